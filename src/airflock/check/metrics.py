"""The standing list for an order parameter or a metric set: symmetries, one agent, two in one place, units."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.check.truths import (
    MIRROR,
    UNIT_SCALES,
    Report,
    TruthTable,
    UnitScale,
    require_part,
    rescaled,
    rescaled_scenario,
    rotation_about_vertical,
    run_truths,
    unit_factor,
)
from airflock.core import Metric, MetricSet, law
from airflock.engine import measure_frames
from airflock.scenarios import METRIC_SET_KIND, CallerParts, Part, Scenario, build_scenario, check_seed

AGENTS, INSTANTS, FLIGHTS = 6, 5, 8
CLOSE = 1e-9
CLOSE_IN_OTHER_UNITS = 1e-6  # guards such as TINY, and angles near zero, where a cosine is insensitive
RULES = ("pair", "linked", "agent", "member", "cluster", "sample", "survey")
FlockTrack = NDArray[np.float64]  # (instant, agent, component): position (m) and velocity (m/s)


def check_metric(part: Any, *, dimensions: int = 3, seed: int = 0) -> Report:
    """Run the standing list of truths on an order parameter and return a report with one line a truth.

    A flock that is turned, shifted, renumbered or seen in a mirror keeps its order parameters; one
    agent alone and two in one place give numbers (or nan); in other units each value changes as its
    unit in REPORTS says. An order parameter that rightly breaks one of them says which and why:
    VIOLATES = {"mirror": "the sense of rotation"}.

    Parameters
    ----------
    part : Metric, MetricSet, list, namespace or str
        Order parameters: a metric, a set, its name or file (.py), a list of metrics, or a namespace such as globals().
    dimensions : int
        2 or 3.
    seed : int
        Of the random flocks; it stands in every mismatch.

    Returns
    -------
    Report
        Printed, one line a truth; `broken` are the names of those that do not hold, declared or not.

    Raises
    ------
    CheckError
        If a truth does not hold that the order parameter does not declare.
    RuleError, ScenarioError, ParameterError
        If what is checked cannot be read, or a number is none.

    Examples
    --------
    >>> import airflock
    >>> airflock.check_metric("order").broken
    ()
    """
    found = require_part(METRIC_SET_KIND.from_caller(part))
    scenario = _scenario(found, dimensions)
    rng = np.random.default_rng(check_seed(seed))
    flocks = [_flock(rng, dimensions) for _ in range(FLIGHTS)]
    turn = rotation_about_vertical(rng.uniform(0.5, 2.5))
    order = rng.permutation(AGENTS)
    shift = np.array([37.0, -19.0, 8.0 * (dimensions == 3), 0.0, 0.0, 0.0])

    def same(change: Callable[[FlockTrack], FlockTrack]) -> Callable[[], str]:
        return lambda: _same(scenario, flocks, [change(flock) for flock in flocks], seed)

    truths: TruthTable = {
        "rules": ("every rule can be compiled", lambda: _rules(scenario.order_parameters)),
        "reports": ("every value has a unit and a meaning", lambda: _reports(scenario, flocks[0])),
        "rotation": (
            "turning the flock about the vertical does not change the values",
            same(lambda flock: _turned(flock, turn)),
        ),
        "translation": ("shifting the flock does not change the values", same(lambda flock: flock + shift)),
        "mirror": ("mirroring the flock does not change the values", same(lambda flock: _turned(flock, MIRROR))),
        "renumbering": ("renumbering the agents does not change the values", same(lambda flock: flock[:, order])),
        "lone agent": ("a single agent gives finite values", lambda: _numbers(scenario, flocks[0][:, :1])),
        "two agents": ("two agents at one place give finite values", lambda: _numbers(scenario, flocks[0][:, [0, 0]])),
        "units": (
            "in other units of length and time each value scales by its unit",
            lambda: _units(scenario, flocks, seed),
        ),
    }
    violates = {key: why for metric in found.metrics for key, why in metric.violates.items()}
    return run_truths(f"metrics {found.name}", truths, violates | dict(found.violates))


def _scenario(found: MetricSet, dimensions: int) -> Scenario:
    """A scenario without an arena, whose numbers are of the size of the flocks."""
    keys = {
        "agents": AGENTS, "world.dimensions": str(dimensions), "world.arena": "none", "start.kind": "ball",
        "start.radius": 100.0, "metrics.max_e": 200.0, "metrics.r_coll": 8.0, "metrics.r_cluster": 12.0,
        "metrics.r_comm": 15.0, "metrics.r_b": 6.0, "metrics.t_settle": 0.0, "wing.segments": "5",
        "wing.tolerance": 1e-14,
    }  # fmt: skip
    return build_scenario(
        {"model": {"kind": "vasarhelyi_2018"}}, f"check of {found.name}", keys, caller_parts=CallerParts(metrics=found)
    )


def _flock(rng: np.random.Generator, dims: int) -> FlockTrack:
    """Agents some metres apart that move about for a few instants."""
    flat = np.array([1.0, 1.0, float(dims == 3)])
    places = rng.uniform(-12.0, 12.0, (1, AGENTS, 3)) + np.cumsum(rng.normal(0.0, 2.0, (INSTANTS, AGENTS, 3)), axis=0)
    speeds = np.array([3.0, 1.0, 0.0]) + rng.normal(0.0, 2.0, (INSTANTS, AGENTS, 3))
    return np.concatenate([places * flat, speeds * flat], axis=2)


def _turned(flock: FlockTrack, turn: NDArray[np.float64]) -> FlockTrack:
    return np.concatenate([flock[:, :, :3] @ turn.T, flock[:, :, 3:] @ turn.T], axis=2)


def _measured(scenario: Scenario, flock: FlockTrack, q: Any = None, second: float = 1.0) -> dict[str, float]:
    """Order parameters of some instants, 0.2 s apart (or `second` as many), by the stages of a driver, uncompiled."""
    scenario = scenario if q is None else replace(scenario, metrics=Part(scenario.metrics.rule, q))
    period, dims = 0.2 * second, scenario.dimensions
    frames = np.concatenate([flock[:, :, :dims], flock[:, :, 3 : 3 + dims]], axis=2).transpose(0, 2, 1)
    values, _ = measure_frames(scenario, frames, period, device="python")
    return scenario.metrics.rule.judged(values, flock.shape[1], period * len(flock), scenario.resolved_metrics())


def _rules(metrics: Sequence[Metric]) -> str:
    errors = [error for m in metrics for kind in RULES if (rule := getattr(m, kind)) for error in law.rule_errors(rule)]
    return errors[0] if errors else ""


def _reports(scenario: Scenario, flock: FlockTrack) -> str:
    known = _units_of(scenario)
    missing = [name for name in _measured(scenario, flock) if name not in known]
    return f"REPORTS tells nothing of {', '.join(missing)}" if missing else ""


def _units_of(scenario: Scenario) -> dict[str, str]:
    """Name of each value → its unit."""
    units = {name: unit for m in scenario.order_parameters for name, (unit, _) in m.reports.items()}
    units |= {name: unit for name, (unit, _) in scenario.metrics.rule.reports.items()}
    return {name: unit.split(" or ")[-1 if scenario.dimensions == 3 else 0] for name, unit in units.items()}


def _same(scenario: Scenario, flocks: Sequence[FlockTrack], others: Sequence[FlockTrack], seed: int) -> str:
    for number, (flock, other) in enumerate(zip(flocks, others, strict=True)):
        mismatch = _apart(_measured(scenario, other), _measured(scenario, flock))
        if mismatch:
            return f"flock {number} of seed {seed}: {mismatch}"
    return ""


def _apart(values: dict[str, float], expected: dict[str, float], close: float = CLOSE) -> str:
    for name, wanted in expected.items():
        value = values[name]
        if math.isnan(value) and math.isnan(wanted):
            continue
        if not abs(value - wanted) <= close * max(abs(wanted), 1e-3):
            return f"{name} = {value:.9g} instead of {wanted:.9g}"
    return ""


def _numbers(scenario: Scenario, flock: FlockTrack) -> str:
    bad = {name: value for name, value in _measured(scenario, flock).items() if math.isinf(value)}
    return ", ".join(f"{name} = {value}" for name, value in bad.items())


def _units(scenario: Scenario, flocks: Sequence[FlockTrack], seed: int) -> str:
    known = _units_of(scenario)
    for units in UNIT_SCALES:
        other = rescaled_scenario(scenario, units)
        q = rescaled(scenario.resolved_metrics(), units)
        scale = np.repeat([units.metre, units.metre / units.second], 3)
        for number, flock in enumerate(flocks):
            values = _measured(scenario, flock)
            wanted = {name: value * _factor(known, name, units) for name, value in values.items()}
            mismatch = _apart(_measured(other, flock * scale, q, units.second), wanted, CLOSE_IN_OTHER_UNITS)
            if mismatch:
                hidden = "a unit is declared wrongly, or a rule contains a number that has a unit"
                return f"flock {number} of seed {seed}: {mismatch}: {hidden}"
    return ""


def _factor(known: dict[str, str], name: str, units: UnitScale) -> float:
    return unit_factor(known.get(name, ""), units)
