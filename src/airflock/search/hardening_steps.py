"""Steps of hardening: what is changed after Table S4, and what a step costs and gains on the same seeds."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.runs import declared_numbers, with_parameters
from airflock.scenarios import Scenario, rebuilt
from airflock.search.study_result import mean_interval
from airflock.support import ScenarioError

ScoreColumns = Mapping[str, NDArray[np.float64]]  # score → its values (seed,)

S4 = "Table S4"


@dataclass(frozen=True)
class HardeningStep:
    """One change of the recipe: factors on keys, and why.

    braking_lead : time of flight (s) by which r0_shill grows, so that agents brake earlier at walls and obstacles
    """

    name: str
    factors: Mapping[str, float]
    reason: str
    braking_lead: float = 0.0


# ratios of Table S4 to Table S1, columns 4, 6, 8 m/s: p_rep 2.3, 1.4, 1.7; C_frict 10, 10, 8;
# v_shill 0.74, 0.71, 0.61; r0_shill from 0.3, 0.5, 0.1 m to 0, 5, 30 m
TABLE_S4_STEPS = (
    HardeningStep("p_rep up", {"model.p_rep": 1.5}, f"{S4}: gain increased to prevent collisions"),
    HardeningStep("c_frict up", {"model.c_frict": 3.0}, f"{S4}: increased substantially to minimise oscillations"),
    HardeningStep("c_frict up again", {"model.c_frict": 3.0}, f"{S4}: 8 to 10 times in all, here in two steps"),
    HardeningStep(
        "v_shill down, r0_shill up", {"model.v_shill": 0.7}, f"{S4}: a higher r0_shill makes up for it", 0.5
    ),  # 0.5 s: 2 to 4 m; the paper's table has 0, 5 and 30 m
)
# where agents leave the arena or enter obstacles
WALL_STEPS = tuple(
    HardeningStep(name, {}, "our choice: earlier braking, nothing else", 0.5) for name in ("r0_shill up", "and again")
)


@dataclass(frozen=True)
class StepResult:
    """Parameters of one step and what they cost and gain against the optimum, over paired seeds.

    fitness, r_min, n_coll : mean over seeds; r_min (m) is the smallest distance of two agents in a flight
    cost, gain : fitness lost and smallest distance won (m) against the first step: mean, and 95 % interval
    parts    : mean of each partial fitness
    contacts : share of flights in which somebody left the arena or entered an obstacle; nan where nobody looked
    clearance : mean over seeds of the smallest distance to walls and obstacles, m; nan where nobody looked
    kept     : whether the step stays; verdict: why, or why not
    """

    name: str
    reason: str
    parameters: Mapping[str, float]
    fitness: float
    r_min: float
    n_coll: float
    cost: tuple[float, float, float]
    gain: tuple[float, float, float]
    parts: Mapping[str, float] = field(default_factory=dict)
    contacts: float = math.nan
    clearance: float = math.nan
    kept: bool = True
    verdict: str = ""

    def as_dict(self) -> dict[str, Any]:
        """The step as plain values."""
        return {
            "name": self.name,
            "reason": self.reason,
            "parameters": dict(self.parameters),
            "fitness": self.fitness,
            "r_min": self.r_min,
            "n_coll": self.n_coll,
            "cost": list(self.cost),
            "gain": list(self.gain),
            "parts": dict(self.parts),
            "contacts": self.contacts,
            "clearance": self.clearance,
            "kept": self.kept,
            "verdict": self.verdict,
        }


def recipe_parameters(
    scenario: Scenario, steps: Sequence[HardeningStep] = TABLE_S4_STEPS
) -> list[tuple[HardeningStep, dict[str, float]]]:
    """Return the parameters after each step, the optimum first; values stay inside their declared ranges."""
    known = declared_numbers(scenario)
    keys = {key for step in (*steps, *TABLE_S4_STEPS) for key in step.factors} | {"model.r0_shill"}
    missing = sorted(key for key in keys if key not in known)
    if missing:
        raise ScenarioError(
            [
                f"{scenario.name}: no recipe for model {scenario.model.name}: {key} is not a number of it"
                for key in missing
            ]
        )
    now = {key: float(known[key][1] or 0.0) for key in sorted(keys)}
    found = [(HardeningStep("optimum", {}, "where hardening begins"), dict(now))]
    for step in steps:
        now = parameters_after_step(scenario, now, step)
        found.append((step, now))
    return found


def parameters_after_step(
    scenario: Scenario, parameters: Mapping[str, float], step: HardeningStep, step_share: float = 1.0
) -> dict[str, float]:
    """Return the parameters after a step or a part of it; values stay inside their declared ranges."""
    known, found = declared_numbers(scenario), dict(parameters)
    for key, factor in step.factors.items():
        found[key] = _inside(found[key] * factor**step_share, known[key][0])
    if step.braking_lead:
        far = step_share * step.braking_lead * (scenario.resolved_metrics().v_flock or 0.0)
        found["model.r0_shill"] = _inside(found["model.r0_shill"] + far, known["model.r0_shill"][0])
    return found


def _inside(value: float, how: Any) -> float:
    return min(max(value, float(how.low)), float(how.high))


def fly_parameters(
    scenario: Scenario,
    parameters: Sequence[Mapping[str, float]],
    seeds: Sequence[int],
    threads: int | None,
    on_done: Callable[[], None] | None,
) -> list[dict[str, NDArray[np.float64]]]:
    """Return scores (seed,) of each set of parameters on the same seeds."""
    from airflock.engine import score_flights

    varied = [with_parameters(scenario, each) for each in parameters]
    rows = score_flights(
        [s for s in varied for _ in seeds], [s for _ in varied for s in seeds], threads=threads, on_done=on_done
    )
    if "fitness" not in rows[0] or "r_min" not in rows[0]:
        raise ScenarioError(
            [f"{scenario.name}: metrics.kind = '{scenario.metrics.rule.name}' has no fitness and no r_min"]
        )
    names = [name for name, value in rows[0].items() if isinstance(value, (int, float))]
    table = {name: np.array([row[name] for row in rows], float).reshape(len(parameters), -1) for name in names}
    return [{name: values[i] for name, values in table.items()} for i in range(len(parameters))]


def compare_with_optimum(
    before: ScoreColumns,
    after: ScoreColumns,
    step: HardeningStep,
    parameters: Mapping[str, float],
) -> StepResult:
    """Compare a step with the optimum on the same seeds."""
    mean, _, low, high = mean_interval((before["fitness"] - after["fitness"]).tolist())
    won, _, least, most = mean_interval((after["r_min"] - before["r_min"]).tolist())
    parts = {name: float(values.mean()) for name, values in after.items() if name.startswith("f_")}
    contacts = float((after["phi_wall"] > 0.0).mean()) if "phi_wall" in after else math.nan
    room = float(after["clearance"].mean()) if "clearance" in after else math.nan
    fitness, near, hits = (float(after[name].mean()) for name in ("fitness", "r_min", "n_coll"))
    cost, gain = (mean, low, high), (won, least, most)
    return StepResult(step.name, step.reason, parameters, fitness, near, hits, cost, gain, parts, contacts, room)


def table_rows(table: ScoreColumns) -> list[dict[str, float]]:
    """Return the scores of each flight as a row."""
    names = list(table)
    return [dict(zip(names, row, strict=True)) for row in np.array([table[name] for name in names]).T.tolist()]


def join_rounds(rounds: Sequence[Sequence[ScoreColumns]]) -> list[ScoreColumns]:
    """Join the flights of all rounds to one table for each scenario."""
    return [
        {name: np.concatenate([t[name] for t in tables]) for name in tables[0]} for tables in zip(*rounds, strict=True)
    ]


def join_scenarios(tables: Sequence[ScoreColumns]) -> ScoreColumns:
    """Join the flights of all scenarios to one table of the scores that all of them have."""
    if len(tables) == 1:
        return tables[0]
    names = [name for name in tables[0] if all(name in table for table in tables)]
    return {name: np.concatenate([table[name] for table in tables]) for name in names}


CARRIED = "neighbours carried forward"
STOPS = "stop near a lost neighbour"


def measures(scenarios: Sequence[Scenario]) -> list[tuple[HardeningStep, list[Scenario], str]]:
    """Return measures that could change a flight in any scenario: step, changed scenarios, and what to set."""
    # Reported, never applied: whether the drones have such a program is not for a search to decide.
    found = []
    for name, reason, settings in (
        (CARRIED, "Vásárhelyi et al. 2018, Drone setup: positions are carried forward by velocities", _carried),
        (STOPS, "our choice: a neighbour that is not heard may still be near", _stops),
    ):
        changes = [settings(scenario) for scenario in scenarios]
        if not any(changes):
            continue
        try:
            flown = [rebuilt(s, change) if change else s for s, change in zip(scenarios, changes, strict=True)]
        except ScenarioError:  # the law has no such form, or the flock is too large for it
            continue
        first = next(change for change in changes if change)
        found.append(
            (HardeningStep(name, {}, reason), flown, " ".join(f"--set {key}={value}" for key, value in first.items()))
        )
    return found


def _carried(scenario: Scenario) -> dict[str, Any]:
    """Return settings by which each packet is carried forward until the next one; no further packet is lost."""
    if scenario.radio.rule.name != "constant" or scenario.radio.delay <= 0.0:
        return {}
    rate = max(10.0, 1.0 / max(scenario.sensors.period, scenario.flight.dt))
    far = min(max(scenario.radio.range, 1.0), 1e6)
    whole = {"radio.received_near": 1.0, "radio.received_far": 1.0, "radio.near": 0.5 * far, "radio.far": far}
    return {"radio.kind": "links", **whole, "radio.fast_rate": rate}


def _stops(scenario: Scenario) -> dict[str, Any]:
    """Return settings by which an agent stops near a lost neighbour, if packets may be lost."""
    deaf = any(entry.fault.radio is not None for entry in scenario.faults)
    lost = deaf or scenario.radio.rule.name not in ("constant", "vision") or scenario.radio.loss > 0.0
    return {"silence.rule": "stop"} if lost and scenario.silence.rule == "fly_on" else {}
