"""Schedule: the order of a step, which every driver reads.

A step of a flight is a row of events. Each has stages, which run one after another, and is due at
every step or at every so-manieth. `stages.flight` is the same as a function; kernels and cells take
their stages from here.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from airflock.engine.passes.grid import sorts_by_cells
from airflock.engine.plan import Plan
from airflock.engine.text.rewrite import law_suffix


@dataclass(frozen=True)
class StepEvent:
    """Stages of a step that are due together.

    stages : in their order
    every  : integer of a world: steps from one time to the next; empty: at each step
    """

    stages: tuple[str, ...]
    every: str = ""


ORDER: Mapping[str, StepEvent] = {
    "send": StepEvent(("snapshot",), "decide_every"),  # ahead of the decision by the delay
    "world": StepEvent(("aim_", "glide_", "appear_")),
    "decide": StepEvent(
        ("perceive", "tune", "neighbours", "rearrange", "boundaries", "flock", "decide", "stop", "overrule", "observe"),
        "decide_every",
    ),
    "watch": StepEvent(("measure_collision",), "collide_every"),
    "sample": StepEvent(("measure_sample",), "sample_every"),
    "queue": StepEvent(("queue",), "decide_every"),  # a command joins those that wait
    "obey": StepEvent(("obey",), "decide_every"),  # behind the decision by the body's dead time
    "move": StepEvent(("move",)),
}
STAGES_PER_LAW = ("neighbours", "boundaries", "decide", "observe")  # one for every law of the flock
AT_ONCE = ("perceive", "tune", "rearrange", "flock")  # for all agents: not where one after another decides and moves
NEEDED: Mapping[str, Callable[[Plan], bool]] = {
    "snapshot": lambda plan: plan.late,
    "aim_": lambda plan: plan.goals,
    "glide_": lambda plan: plan.own,
    "appear_": lambda plan: plan.scene,
    "tune": lambda plan: bool(plan.suffers("radio", "clock")),
    "neighbours": lambda plan: plan.model.neighbour is not None,
    "rearrange": sorts_by_cells,
    "boundaries": lambda plan: plan.model.boundary is not None,
    "flock": lambda plan: plan.model.flock is not None,
    "stop": lambda plan: plan.stops_for_lost,
    "queue": lambda plan: plan.lags,
    "obey": lambda plan: plan.lags,
    "overrule": lambda plan: bool(plan.suffers("overrule")),
    "observe": lambda plan: plan.observes,
    "measure_collision": lambda plan: any(metric.clock == "collision" for metric in plan.metrics),
    "measure_sample": lambda plan: any(metric.clock == "sample" for metric in plan.metrics),
}


def stages_of_events(plan: Plan) -> dict[str, tuple[str, ...]]:
    """Stages of each event that a plan has, in the order of a step."""
    return {
        name: tuple(each for stage in event.stages for each in _of_laws(stage, plan)) for name, event in ORDER.items()
    }


def _of_laws(stage: str, plan: Plan) -> list[str]:
    """Names of a stage in a plan that has it; of one that asks a law, for each law that has such a rule."""
    plans = plan.every if stage in STAGES_PER_LAW else (plan,)
    return [f"{stage}{law_suffix(own.law)}" for own in plans if stage not in NEEDED or NEEDED[stage](own)]


def sequential_stages(plan: Plan) -> tuple[str, ...]:
    """Return the stages that each agent runs in turn in a sequential step."""
    events = stages_of_events(plan)
    return tuple(stage for stage in (*events["decide"], *events["move"]) if stage not in AT_ONCE)
