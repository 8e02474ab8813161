"""Rules that see all agents at once: a model's `flock` and a metric's `survey`, with the scratch that they work in."""

from collections.abc import Callable
from functools import lru_cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.core import Metric, argument_names, component_names, vector_sizes
from airflock.engine.passes.build import Builder
from airflock.engine.plan import Plan
from airflock.engine.text.probe import scratch_shapes


class FlockRule(NamedTuple):
    """A rule of the whole flock: its owner (the model or a metric), the rule, Shared, workspace and parameters."""

    name: str
    kind: str
    rule: Callable[..., None]
    Shared: Any
    workspace: Callable[..., Any]
    letter: str


def flock_rules(plan: Plan) -> list[FlockRule]:
    """All rules of the whole flock in a plan, in the order of their scratch."""
    model = plan.model
    first = []
    if model.flock is not None and model.workspace is not None:
        first = [FlockRule("model", "flock", model.flock, model.Shared, model.workspace, "p")]
    return first + survey_rules(plan)


def survey_rules(plan: Plan) -> list[FlockRule]:
    """Those of them that measure."""
    return [
        FlockRule(metric.name, "survey", metric.survey, metric.Shared, metric.workspace, "q")
        for metric in plan.metrics
        if metric.survey is not None and metric.workspace is not None
    ]


def add_flock(build: Builder) -> None:
    """Function flock: the model's rule, once per decision, on the true states."""
    owner = flock_rules(build.plan)[0]
    records = "p wing aero" if "aero" in argument_names(owner.rule, owner.kind, owner.name) else "p wing"
    build.function("flock(n, row, work, scratch)", build.records(records), _call(build, owner), "return 0")


def survey_lines(build: Builder, metric: Metric) -> list[str]:
    """Lines that run a metric's rule; `scratch` is at hand."""
    (owner,) = (owner for owner in survey_rules(build.plan) if owner.name == metric.name)
    return [*build.records("q wing"), *_call(build, owner), "return 0"]


def _call(build: Builder, owner: FlockRule) -> list[str]:
    plan = build.plan
    number = [each.name for each in flock_rules(plan)].index(owner.name)
    work = build.source.name(_record(owner, plan))
    fields = _record(owner, plan)._fields
    given = {"work": f"scratch_{owner.name}", "shared": f"shared_{owner.name}"}
    flown = plan.motion
    used = argument_names(owner.rule, owner.kind, owner.name)
    lines = build.bind_rows([name for name in flown if name in used])
    for name in ("x", "y", "z", "vx", "vy", "vz"):
        if name not in flown and name in used:
            lines += [f"{name} = work[{build.row('level_')}]"]
    parts = [f"scratch[{number}][{c}]" for c in range(len(fields))]
    lines += [f"scratch_{owner.name} = {work}({', '.join(parts)})"]
    columns = [f"work[{build.row(f'shared_{owner.name}_{name}')}]" for name in owner.Shared._fields]
    lines += [f"shared_{owner.name} = {build.source.name(owner.Shared)}({', '.join(columns)})"]
    # Rules with scratch are functions of their own: 160 s of compiling became 40. On a GPU
    # triangular solves and sweeps feed on themselves, so one thread of the block runs the rule as
    # it stands, between two barriers; a GPU then solves for thousands of flocks side by side.
    build.source.solver(owner.rule)
    return [*lines, *build.once([build.call(owner.rule, owner.kind, given, owner.name)])]


def _record(owner: FlockRule, plan: Plan) -> Any:
    """NamedTuple class of the scratch: what `workspace` returns, whatever its shapes."""
    return type(scratch_shapes(owner.workspace, 1, _parameters(plan, owner, None)))


def _parameters(plan: Plan, owner: FlockRule, row: NDArray[Any] | None) -> dict[str, Any]:
    """Parameters of an owner, of the wing and of drag descent as plain records by name, from a row of numbers."""
    found = {}
    for letter in (owner.letter, "wing", "aero"):
        names = plan.records[letter]
        values = [0.0] * len(names) if row is None else row[plan.spans[letter]].tolist()
        numbers = dict(zip(names, values, strict=True))
        whole = {
            key: tuple(numbers[part] for part in component_names(key, n)) for key, n in vector_sizes(names).items()
        }
        found[letter] = SimpleNamespace(**{**numbers, **plan.constants.get(letter, {}), **whole})
    return found


NamedScratch = tuple[tuple[tuple[str, tuple[int, int], bool], ...], ...]


def scratch_arrays(plan: Plan, row: NDArray[Any], agents: int) -> NamedScratch:
    """Scratch of every rule of the whole flock: a name, rows and columns, and whether nothing in it outlasts a call."""
    return _scratch(plan, row.dtype, row.tobytes(), agents) if flock_rules(plan) else ()


@lru_cache(maxsize=64)
def _scratch(plan: Plan, real: Any, numbers: bytes, agents: int) -> NamedScratch:
    made = []
    # Kept by plan and numbers: laying it out again for each flight took 0.13 ms. Large arrays that
    # are rarely used cost nothing until their pages of zeros are touched.
    sizes_of = scratch_sizes(plan, np.frombuffer(numbers, real), agents)
    for owner, sizes in zip(flock_rules(plan), sizes_of, strict=True):
        record = _record(owner, plan)
        within = getattr(record, "WITHIN", ())
        fields = zip(record._fields, sizes, strict=True)
        made.append(tuple((f"{owner.name}.{name}", size, name in within) for name, size in fields))
    return tuple(made)


def scratch_sizes(plan: Plan, row: NDArray[Any] | None, agents: int) -> list[list[tuple[int, int]]]:
    """Rows and columns of the scratch arrays of every rule of the whole flock; without a row of numbers, with zeros."""
    return [list(scratch_shapes(owner.workspace, agents, _parameters(plan, owner, row))) for owner in flock_rules(plan)]
