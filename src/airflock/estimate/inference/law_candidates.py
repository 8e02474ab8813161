"""Candidates: laws as scenarios without noise, and the numbers of each that tracks may identify."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.core import Quantity, declarations
from airflock.engine import DriverState, Plan, plan_of
from airflock.estimate.inference.observed_tracks import SpanTracks, TrackScale
from airflock.scenarios import MODELS, CallerParts, Scenario, build_scenario, load, presets
from airflock.support import AirflockError, ScenarioError, expand_path, suggest
from airflock.world import half_sizes

STEP = 0.025  # s; longest motion step
LONG = 1e5  # s; a flight that outlasts any span
DECADES = 100.0  # a number whose unit says nothing of its size is sought this far from its default
RATES = (0.01, 20.0)  # 1/s, of gains
METRIC = "metric"  # neighbours by distance, as the law has them
OFFERED = (METRIC, "nearest", "voronoi")
MOST_NEIGHBOURS = 20
QUIET = {"sensors.kind": "perfect", "wind.gust": 0.0, "radio.loss": 0.0}


@dataclass(frozen=True)
class FitParameter:
    """A number of a law or its body: its column, its range, and the scale on which it is searched.

    key : section and name; column : in a driver's row; unit; low, high : range that is sought; log
          : by its logarithm
    whole : only whole numbers below `high` are sought
    """

    key: str
    column: int
    unit: str
    low: float
    high: float
    log: bool
    default: float
    whole: bool = False

    def value(self, u: float) -> float:
        """Return the number at a place from 0 to 1 in its range."""
        if self.log:
            value = float(self.low * (self.high / self.low) ** u)
            return min(math.floor(value), self.high - 1.0) if self.whole else value
        return float(self.low + (self.high - self.low) * u)

    def place(self, value: float) -> float:
        """Return the place from 0 to 1 of a number in its range."""
        inside = min(max(value + 0.5 * self.whole, self.low), self.high)
        if self.log:
            return math.log(inside / self.low) / math.log(self.high / self.low)
        return (inside - self.low) / (self.high - self.low)

    def slope(self, u: float) -> float:
        """Return the derivative of the number by its place."""
        return float(self.value(u) * math.log(self.high / self.low)) if self.log else self.high - self.low


@dataclass
class LawCandidate:
    """A law that may explain the tracks.

    name     : as requested
    scenario : of its law, without any noise
    plan     : what flies it
    numbers  : what may be fitted; noises : numbers of the law that are noise, which the scenario
               has at 0
    body_noise : column of the body's own noise; -1 if it has none
    """

    name: str
    scenario: Scenario
    plan: Plan
    numbers: tuple[FitParameter, ...]
    noise_parameters: tuple[FitParameter, ...]
    body_noise_column: int = -1

    @property
    def commands_heading(self) -> bool:
        """Return True if the law commands a direction only."""
        return self.scenario.model.command == "heading"

    def state(self, tracks: SpanTracks) -> DriverState:
        """Make the memory of a flight of as many agents as there are individuals."""
        flown = replace(self.scenario, flight=replace(self.scenario.flight, agents=float(tracks.individual_count)))
        start = np.zeros((2 * self.plan.dimensions, tracks.individual_count))
        return DriverState.of(self.plan, flown, start=start)


def make_candidate(base: Scenario, scale: TrackScale, axes: int) -> LawCandidate:
    """Make a candidate of a scenario of its law."""
    name = base.name
    scenario = without_noise(base, scale, axes)
    if scenario.body.delay > 0.0:
        raise ScenarioError([f"{name}: body.delay: a step is predicted from the last states alone; set body.delay = 0"])
    if scenario.model.flock is not None:
        raise ScenarioError([f"{name}: has a rule of the whole flock, which no single individual follows"])
    if scenario.flight.update != "synchronous":
        scenario = replace(scenario, flight=replace(scenario.flight, update="synchronous"))
    if scenario.model.neighbour is None:
        raise ScenarioError([f"{name}: this law does not react to neighbours; nothing social can be inferred"])
    texted = replace(scenario, parameters=_unusual(scenario))
    plan = plan_of(texted, precision=64, metrics=()).built(given_start=True, grid=False)
    found = _numbers(scenario, plan, scale)
    noises = _noises(scenario, plan, found)
    quieter = {n.key.partition(".")[2]: 0.0 for n in noises}
    scenario = replace(scenario, parameters=replace(scenario.parameters, **quieter))
    kept = tuple(n for n in found if n.key not in {m.key for m in noises})
    own = plan.records["b"]
    column = _first(plan, "b") + own.index("noise") if "noise" in own else -1
    return LawCandidate(name, scenario, plan, kept, noises, column)


def law_scenarios(
    models: Iterable[str | Scenario],
    settings: Mapping[str, Any],
    topologies: Iterable[str] = (METRIC,),
    *,
    trust: bool = False,
) -> tuple[list[Scenario], tuple[float, ...]]:
    """Return scenarios of the laws, and half sides (m) of the periodic box common to all; 0 along an open axis.

    models : names of laws, presets, scenario files, files with a law, or Scenarios
    topologies : kinds of neighbourhoods by which each is tried; metric : by distance, as the law
                 itself has it
    Raises ScenarioError with every error.
    """
    errors: list[tuple[str, str]] = []
    found = []
    unknown = [kind for kind in topologies if kind not in OFFERED]
    if unknown:
        raise ScenarioError([f"--topologies {', '.join(unknown)}: choose from {', '.join(OFFERED)}"])
    for what, kind in product(models, topologies):
        try:
            found.append(_by_topology(what, settings, kind, trust))
        except AirflockError as error:
            errors += [(f"{what}: ", line) for line in str(error).splitlines()]
    if errors:  # what is wrong with a setting is so for all laws: it is said once
        bare = Counter(line.removeprefix(name) for name, line in set(errors))
        lines = [line.removeprefix(name) if bare[line.removeprefix(name)] > 1 else line for name, line in errors]
        raise ScenarioError(list(dict.fromkeys(lines)))
    boxes = [half_sizes(each.world) if each.world.edges == "periodic" else (0.0, 0.0, 0.0) for each in found]
    for each, box in zip(found, boxes, strict=True):
        if box != boxes[0]:
            raise ScenarioError(
                [f"{each.name}: its box is not that of {found[0].name}; set one for all: --set world.edges=open"]
            )
    return found, boxes[0]


def _by_topology(what: str | Scenario, settings: Mapping[str, Any], kind: str, trust: bool) -> Scenario:
    """Load the scenario of a law with a kind of neighbourhood, which its name says."""
    if kind == METRIC:
        return _base(what, settings, trust)
    chosen = {**settings, "topology.kind": kind}
    if isinstance(what, Scenario):
        made = build_scenario(what.document, what.name, chosen, caller_parts=CallerParts(what.model, what.body.rule))
    else:
        made = _base(what, chosen, trust)
    return replace(made, name=f"{made.name}, {kind}")


def _base(what: str | Scenario, settings: Mapping[str, Any], trust: bool) -> Scenario:
    """Load the scenario of a law; a scenario has its folder already."""
    if isinstance(what, Scenario):
        return what
    if not isinstance(what, (str, Path)):
        raise ScenarioError([f"{what!r} is not a law; give a name of ours, a preset, a scenario file or a Scenario"])
    if what in MODELS or str(what).endswith(".py"):
        open_air = {"model": {"kind": str(what)}, "world": {"arena": "none"}, "radio": {"delay": 0.0}}
        open_air["start"] = {"kind": "ball", "radius": 1e-3, "separation": 0.0}  # of no consequence; fits any dish
        return build_scenario(open_air, str(what), settings, trust=trust or str(what).endswith(".py"))
    if what not in presets() and not expand_path(what).is_file():
        hint = suggest(what, [*MODELS, *presets()], f"; laws: {', '.join(MODELS)}", lead="; ", cutoff=0.4)
        raise ScenarioError([f"{what}: no such law, preset or file{hint}"])
    return load(what, settings, trust=trust)


def without_noise(scenario: Scenario, scale: TrackScale, axes: int) -> Scenario:
    """Return the scenario without noise, with steps that fit into the frames of the tracks."""
    document = {key: value for key, value in scenario.document.items() if key not in ("published", "metrics")}
    steps = max(1, math.ceil(scale.period / STEP - 1e-9))
    dt = scale.period / steps
    law_alone = "sensors" not in document
    decide = scale.period if law_alone else dt * max(1, round(scenario.sensors.period / dt))
    settings: dict[str, Any] = {
        **QUIET, "agents": 2, "duration": LONG, "dt": dt, "sensors.period": decide, "world.dimensions": str(axes),
        "update": "synchronous", "start.kind": "ball", "start.radius": scale.near, "start.separation": 0.0,
        "goals.kind": "none",
    }  # fmt: skip
    made = build_scenario(
        document, scenario.name, settings, caller_parts=CallerParts(law=scenario.model, body=scenario.body.rule)
    )
    names = {name for name, declared, _ in declarations(made.body.numbers) if isinstance(declared, Quantity)}
    return replace(made, body=made.body.with_numbers(noise=0.0)) if "noise" in names else made


def _unusual(scenario: Scenario) -> Any:
    """Return parameters none of which has its usual value, so that all stay numbers in the driver."""
    moved = {
        name: number * 0.9 if number else 0.1
        for name, number in scenario.model.usual.items()
        if getattr(scenario.parameters, name) == number
    }
    return replace(scenario.parameters, **moved)


def _numbers(scenario: Scenario, plan: Plan, scale: TrackScale) -> tuple[FitParameter, ...]:
    """Return numbers of the law and of its body, with the ranges of the search."""
    found = []
    for letter, section, record in (("p", "model", scenario.parameters), ("b", "body", scenario.body.numbers)):
        names = plan.records[letter]
        first = _first(plan, letter)
        for name, declared, _ in declarations(record):
            if not isinstance(declared, Quantity) or (section == "body" and name in ("delay", "noise", "drag")):
                continue
            default = getattr(record, name)
            if default is None:
                continue
            low, high, log = _range(declared, float(default), scale)
            if high > low:
                key = f"{section}.{name}"
                found.append(
                    FitParameter(key, first + names.index(name), declared.unit, low, high, log, float(default))
                )
    if scenario.topology.numbers.kind == "nearest":
        column = _first(plan, "topology") + plan.records["topology"].index("k")
        k = float(scenario.topology.numbers.k)
        found.append(FitParameter("topology.k", column, "1", 1.0, MOST_NEIGHBOURS + 1.0, True, k, whole=True))
    return tuple(found)


def _first(plan: Plan, letter: str) -> int:
    """Return the column of the first number of a record."""
    letters = [name for name, _ in plan.numbers]
    return sum(len(fields) for _, fields in plan.numbers[: letters.index(letter)])


def _range(declared: Quantity, default: float, scale: TrackScale) -> tuple[float, float, bool]:
    """Return the declared range, cut to observed lengths, speeds and times; and True for a logarithmic scale."""
    by_unit = {
        "m": (0.05 * scale.near, 1.2 * scale.far),
        "m/s": (0.02 * scale.speed, 5.0 * scale.max_speed),  # a law may speak of speeds that nobody flies
        "m/s^2": (0.05 * scale.speed, 20.0 * scale.max_speed),
        "1/s": RATES,
        "s": (0.3 * scale.period, 100.0 * scale.period),
        "rad/s": (0.05, 2.0 * math.pi / scale.period),
    }
    if declared.unit in ("deg", "rad"):
        return declared.low, declared.high, False
    around = (abs(default) / DECADES, abs(default) * DECADES) if default else (1e-3, 10.0)
    low, high = by_unit.get(declared.unit, around)
    low, high = max(low, declared.low), min(high, declared.high)
    return low, high, low > 0.0


def _noises(scenario: Scenario, plan: Plan, numbers: tuple[FitParameter, ...]) -> tuple[FitParameter, ...]:
    """Return the numbers that are the noise of the law: at 0, two worlds command the same."""
    agents = 8  # about as far apart as those that were seen
    flown = replace(scenario, flight=replace(scenario.flight, agents=float(agents)))
    generator = np.random.default_rng(0)
    spread = 2.0 * scenario.start.radius
    start = np.concatenate(
        [
            generator.uniform(-spread, spread, (plan.dimensions, agents)),
            generator.normal(size=(plan.dimensions, agents)),
        ]
    )
    rows = DriverState.of(plan, flown, start=start, device="python").tables.row

    def differ(changed: Mapping[int, float]) -> bool:
        commands: list[NDArray[Any]] = []
        for world in (0, 1):
            state = DriverState.of(plan, flown, world=world, start=start, device="python")
            state.arrays["row"][:] = rows
            for column, value in changed.items():
                state.arrays["row"][column] = value
            state.advance(0, 1, 2)
            commands.append(state.rows([f"c{axis}" for axis in plan.axes]))
        return not np.array_equal(commands[0], commands[1], equal_nan=True)

    if not differ({}):
        return ()
    of_law = [n for n in numbers if n.key.startswith("model.") and (0.0 in (n.low, n.default) or n.unit == "rad")]
    found = tuple(n for n in of_law if not differ({n.column: 0.0}))
    if not found:
        raise ScenarioError([f"{scenario.name}: its law draws noise, and none of its numbers switches that off"])
    return found
