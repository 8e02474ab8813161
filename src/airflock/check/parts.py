"""The standing lists of bodies, sensors, radios, topologies, faults and order parameters, a table of truths a kind."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

import numpy as np

from airflock.check.truths import (
    MIRROR,
    Array,
    Report,
    Trials,
    TruthTable,
    UnitScale,
    numbers_text,
    parameters_with_values,
    rescaled,
    rescaled_scenario,
    rotation_about_vertical,
    standing_list,
    unit_factor,
)
from airflock.core import (
    COMMANDS,
    COMPONENTS,
    FAR,
    FAULT_RULES,
    RULES as RADIO_RULES,
    TINY,
    VOCABULARY,
    Kind,
    MetricSet,
    Quantity,
    State,
    add_errors,
    call_measure,
    call_rule,
    declarations,
)
from airflock.engine import measure_frames
from airflock.parts import BODIES, FAULTS, RADIOS, SENSORS, SETS, TOPOLOGIES
from airflock.parts.aero import Parameters as Wing
from airflock.parts.topologies import Parameters as TopologyParameters
from airflock.scenarios import CallerParts, Part, Scenario, build_scenario, check_seed, part_from_caller
from airflock.support import ScenarioError

T = TypeVar("T")
AXES = "xyz"
Arguments = Mapping[str, Any]
Case = tuple[str, Arguments]  # kind of a rule, and its arguments by name
# Units of what rules return, by their kind; others return plain numbers.
STATE_UNITS = ("m",) * 3 + ("m/s",) * 3
ANSWERS = {
    **dict.fromkeys(("sense", "tell", "see"), STATE_UNITS), **dict.fromkeys(("late", "clock", "leaves"), ("s",)),
    **dict.fromkeys(("move", "overrule", "motion"), ("m/s",) * 3), "carry": ("m",) * 3, "radio": ("m",) * 2,
}  # fmt: skip
UNIT = re.compile(r", (m/s|m|s)(?=[,;]|$)")  # in the text of an argument in the vocabulary
SHIFT = {"x": 1234.0, "y": -567.0, "z": 89.0}  # m


def find_part(kind: Kind[T], source: Any) -> T:
    """Return the part that a caller gives or names; raise a ScenarioError that lists the errors if there are any."""
    part, errors = part_from_caller(kind, source)
    if part is None or errors:
        raise ScenarioError(errors or [f"{kind.noun} {source!r} has no rule to check"])
    return part


def part_to_check(kind: Kind[T], source: Any, values: Any, seed: int) -> tuple[T, Any, np.random.Generator]:
    """Return a part with the numbers that a caller gives, and the random numbers of its cases."""
    part: Any = find_part(kind, source)
    section = kind.section or "fault"
    numbers = parameters_with_values(part.Parameters or TopologyParameters, values, section)
    return part, numbers, np.random.default_rng(check_seed(seed))


def rules_of(part: Any, kinds: Any) -> dict[str, Any]:
    """Return those rules of these kinds that a part has."""
    return {kind: rule for kind in kinds if (rule := getattr(part, kind, None)) is not None}


def named(name: str, vector: Any) -> dict[str, float]:
    """Return the arguments by which a rule is handed a vector."""
    return {f"{name}{axis}": float(component) for axis, component in zip(AXES, vector, strict=False)}


def in_other_units(case: Case, units: UnitScale, command: str) -> Case:
    """Return a case in other units; the vocabulary says the unit of each argument. command : unit of a command"""
    scaled = dict(case[1])
    for name, text in VOCABULARY[case[0]].items():
        unit = UNIT.search(text)
        if hasattr(scaled.get(name), "__dataclass_fields__"):
            scaled[name] = rescaled(scaled[name], units)
        elif name in scaled and (unit or "COMMAND" in text):
            scaled[name] *= unit_factor(unit[1] if unit else command, units)
    return case[0], scaled


def shifted(case: Case) -> Case:
    """Return a case in which all positions are shifted."""
    kind, given = case
    places = {f"{at}{axis}": by for at in ("", "at_") for axis, by in SHIFT.items()}
    return kind, {name: value + places.get(name, 0.0) if name in places else value for name, value in given.items()}


def rule_trials(
    part: Any, rules: Mapping[str, Any], letter: str, numbers: Any, cases: Sequence[Case], seed: int,
    answer: Callable[[Any, Case], Array] | None = None, *, command: str = "m/s", **how: Any,
) -> Trials:  # fmt: skip
    """Return trials of single rules on cases; `how` are further fields of the trials.

    answer : of a case, if it is not what its rule returns; command : unit of a command
    """

    def returned(numbers: Any, case: Case) -> Array:
        made = call_rule(rules[case[0]], case[0], {**case[1], letter: numbers}, part.name)
        return np.atleast_1d(np.array(made, float))

    def scale(units: UnitScale, case: Case) -> tuple[Case, Array]:
        by = [unit_factor(unit, units) for unit in ANSWERS.get(case[0], ("1",))]
        return in_other_units(case, units, command), np.array(by)

    givens = [given for _, given in cases[: 5 * len(rules) : max(len(rules), 1)]]
    return Trials(part, rules, letter, numbers, answer or returned, cases, seed, scale, givens, **how)


MOTIONS = 40  # random motions that each truth is tried on
REMEMBERED = 5  # steps after which a body that remembers is looked at
WING = Wing()
VECTORS = "vmcgw"  # what `move` may ask for


@standing_list(BODIES)
def check_body(body: Any, parameters: Mapping[str, Any] | None = None, *, seed: int = 0) -> Report:
    """Run the standing list of truths on a body and return a report with one line a truth.

    A motion that is turned or seen in a mirror turns or mirrors its result; at rest the result is
    finite; a halved time step halves the error; in other units it is the same motion; the rule
    stays in single precision. A body that rightly breaks one of them says which and why: VIOLATES =
    {"mirror": "a propeller turns one way"}.

    Examples
    --------
    >>> import airflock
    >>> airflock.check_body("multirotor").broken
    ()
    """
    part, b, rng = part_to_check(BODIES, body, parameters, seed)
    speed = float(min(getattr(b, "speed", getattr(b, "speed_max", 5.0)), 5.0))
    memory = part.Memory() if part.Memory is not None else None

    def draw() -> Case:
        vectors = {name: (1.0 if name == "g" else speed) * rng.normal(size=3) for name in VECTORS}
        if part.accepts == "heading":
            vectors["c"] /= np.linalg.norm(vectors["c"])
        given: dict[str, Any] = {"dt": 0.02, "memory": memory, "wing": WING}
        return "move", given | {key: value for name in VECTORS for key, value in named(name, vectors[name]).items()}

    def fly(b: Any, motion: Case, steps: int = 1 if memory is None else REMEMBERED) -> Array:
        """Velocity (m/s) after some steps, from the Memory at the start."""
        given = {**motion[1], "b": b}
        for _ in range(steps):
            moved = call_rule(part.move, "move", given, part.name)
            given |= named("v", moved) | named("m", moved) | ({} if memory is None else {"memory": moved[3]})
        return np.array(moved[:3])

    def turned(by: Array) -> str:
        def change(motion: Case) -> Case:
            vectors = {name: by @ [motion[1][f"{name}{axis}"] for axis in AXES] for name in VECTORS}
            return "move", {**motion[1], **{k: v for name in VECTORS for k, v in named(name, vectors[name]).items()}}

        return trials.same(change, lambda velocity: by @ velocity)

    def rest() -> str:
        still = {f"{name}{axis}": 0.0 for name in VECTORS for axis in AXES}
        after = fly(b, ("move", {**trials.cases[0][1], **still}))
        return "" if np.isfinite(after).all() else f"the velocity is {after}"

    def time_step() -> str:
        for number, (_, motion) in enumerate(trials.cases[:10]):  # without noise, over a tenth of a second
            quiet = motion | named("g", np.zeros(3)) | named("m", [motion[f"v{axis}"] for axis in AXES])
            ends = [fly(b, ("move", quiet | {"dt": 0.1 / steps}), steps) for steps in (2, 4, 8, 16)]
            off = [float(np.abs(x - y).max()) for x, y in zip(ends, ends[1:], strict=False)]
            if off[-1] > max(0.6 * off[0], 1e-9):
                return f"motion {number}: velocities change by {off[0]:.2g}, then {off[1]:.2g}, {off[2]:.2g} m/s"
        return ""

    cases = [draw() for _ in range(MOTIONS)]
    trials = rule_trials(
        part, {"move": part.move}, "b", b, cases, seed, fly, command=COMMANDS[part.accepts], floor=1e-3
    )  # fmt: skip
    truths: TruthTable = {
        "rotation": ("a motion turned about the vertical turns", lambda: turned(rotation_about_vertical(1.1))),
        "mirror": ("a motion seen in a mirror is mirrored", lambda: turned(MIRROR)),
        "rest": ("at rest, without a command, the velocity is finite", rest),
        "time step": ("halving dt shrinks the error", time_step),
    }
    return trials.report("body", truths)


TRACKS, MEASUREMENTS = 8, 60  # random tracks that each truth is tried on, and how often each is measured
LONG = 3000  # measurements after which an error is still bounded


class Track(NamedTuple):
    """True positions (m) and velocities (m/s), (measurement, component), a period (s) apart; number: for its draws."""

    states: Array
    period: float
    number: int


@standing_list(SENSORS)
def check_sensor(sensor: Any, parameters: Mapping[str, Any] | None = None, *, seed: int = 0) -> Report:
    """Run the standing list of truths on a sensor and return a report with one line a truth.

    A track that is shifted is measured shifted; errors stay bounded; where `exact` says so there is
    no error; in other units it is the same measurement; the rule stays in single precision. A
    sensor that rightly breaks one of them says which and why: VIOLATES = {"place": "a beacon stands
    in the origin"}.

    Examples
    --------
    >>> import airflock
    >>> airflock.check_sensor("gnss").broken
    ()
    """
    part, s, rng = part_to_check(SENSORS, sensor, parameters, seed)
    period = s.period or 0.2
    start = part.Memory() if part.Memory is not None else None

    def draw(number: int) -> Track:
        velocity = np.cumsum(rng.normal(size=(MEASUREMENTS, 3)), axis=0)  # of random accelerations
        places = 50.0 * rng.normal(size=3) + period * np.cumsum(velocity, axis=0)
        return Track(np.hstack([places, velocity]), period, number)

    def draws(number: int, measurement: int) -> dict[str, float]:
        rng = np.random.default_rng((seed + number, measurement))
        normal, uniform = rng.normal(size=12).tolist(), rng.uniform(size=4).tolist()
        return {f"g{c}": g for c, g in enumerate(normal)} | {f"u{c}": u for c, u in enumerate(uniform)}

    def measure(s: Any, track: Track) -> Array:
        made = np.empty_like(track.states)
        memory, off = start, State(*(0.0,) * 6)
        for k, state in enumerate(track.states):
            drawn, period = draws(track.number, k), track.period
            if part.error is not None:
                off = add_errors(part, s, off, [drawn[f"g{axis}"] for axis in range(3)], period)
                made[k] = state + np.array(off)
            else:
                made[k], memory = call_measure(part, s, state.tolist(), memory, k * period, period, drawn)
        return made

    def scale(units: UnitScale, track: Track) -> tuple[Track, Array]:
        by = state_scale(units)
        return Track(track.states * by, track.period * units.second, track.number), by

    def bounded() -> str:
        made = measure(s, Track(np.zeros((LONG, 6)), period, 0))
        if np.isfinite(made).all() and np.abs(made).max() < 1e20:
            return ""
        return f"seed {seed}: an agent at rest measures {np.nanmax(np.abs(made)):.3g} within {LONG} measurements"

    def exact() -> str:
        """With every number at zero that may be: if `exact` holds, what is measured is the true state."""
        usual = {name: d for name, d, _ in declarations(part.Parameters) if isinstance(d, Quantity)}
        zero = part.Parameters(**{n: 0.0 for n, d in usual.items() if d.low <= 0.0 <= d.high and n != "period"})
        track = trials.cases[0]
        return trials.first_mismatch([(measure(zero, track), track.states)]) if part.is_exact(zero) else ""

    rules, tracks = rules_of(part, ("measure", "error")), [draw(k) for k in range(TRACKS)]
    usual: dict[str, Any] = {"dx": 0.3, "dv": 0.1, "g": 0.4, "memory": start, "period": period}
    usual |= dict(zip(COMPONENTS, (1.0, 2.0, 3.0, 0.5, 0.25, 0.125), strict=True))
    givens = [{**usual, **draws(k, k), "time": k * period} for k in range(5)]
    trials = Trials(part, rules, "s", s, measure, tracks, seed, scale, givens)
    shift = np.array([*SHIFT.values(), 0.0, 0.0, 0.0])
    truths: TruthTable = {
        "place": (
            "shifting the track shifts the measurements",
            lambda: trials.same(lambda track: track._replace(states=track.states + shift), lambda made: made + shift),
        ),
        "bounded": ("errors stay finite", bounded),
        "exact": ("where `exact` holds, it measures the true state", exact),
    }
    return trials.report("sensor", truths)


def state_scale(units: UnitScale) -> Array:
    """Return the factors by which a position (m) and a velocity (m/s) grow."""
    return np.array([unit_factor(unit, units) for unit in STATE_UNITS])


PAIRS = 60  # random pairs that each truth is tried on


@standing_list(RADIOS)
def check_radio(radio: Any, parameters: Mapping[str, Any] | None = None, *, seed: int = 0) -> Report:
    """Run the standing list of truths on a radio and return a report with one line a truth.

    Chances lie between 0 and 1 and delays are not negative; a packet of age 0 is believed as it is;
    what is shifted is carried on shifted; in other units it is the same radio; rules stay in single
    precision. A radio that rightly breaks one of them says which and why: VIOLATES = {"place": "a
    mast stands in the origin"}.

    Examples
    --------
    >>> import airflock
    >>> airflock.check_radio("bursts").broken
    ()
    """
    part, k, rng = part_to_check(RADIOS, radio, parameters, seed)
    rules = rules_of(part, RADIO_RULES)
    names = sorted({name for kind in RADIO_RULES for name in VOCABULARY[kind]})
    packet = part.Packet() if part.Packet is not None else None

    def draw(number: int) -> dict[str, Any]:
        given: dict[str, Any] = {name: float(rng.uniform() if name[0] == "u" else rng.normal()) for name in names}
        offset, place = 30.0 * rng.normal(size=3), 50.0 * rng.normal(size=3)
        given |= {**named("d", offset), **named("", place), "distance": math.hypot(*offset)}
        given |= {"clear": float(number % 2), "talkers": float(rng.integers(1, 50)), "step": float(number)}
        given |= {"period": 0.2, "fast": int(rng.integers(0, 4)), "slow": number % 3}
        return given | {"age": float(rng.uniform(0.0, 5.0)), "since": float(rng.uniform(0.1, 5.0)), "packet": packet}

    def answer(k: Any, case: Case) -> Array:
        made = call_rule(rules[case[0]], case[0], {**case[1], "k": k}, part.name)
        # What `receive` keeps has units of its own.
        return np.atleast_1d(np.array(made[0] if case[0] == "receive" and packet is not None else made, float))

    def chances() -> str:
        for kind, given in trials.cases:
            if kind in ("see", "carry"):
                continue
            value = answer(k, (kind, given))[0]
            most = math.inf if kind == "late" else 1.0 + 1e-9
            if not -1e-9 <= value <= most or (kind in ("receive", "lasts") and value not in (0.0, 1.0)):
                return f"seed {seed}: {kind} gives {value:.6g} over {given['distance']:.4g} m"
        return ""

    def fresh() -> str:
        given = [{**given, "age": 0.0} for _, given in carried]
        return trials.first_mismatch((answer(k, ("carry", g)), np.array([g[a] for a in AXES])) for g in given)

    cases = [(kind, given) for given in map(draw, range(PAIRS)) for kind in rules]
    trials = rule_trials(part, rules, "k", k, cases, seed, answer, separate=True)
    carried = [case for case in cases if case[0] == "carry"]
    shift = np.array(list(SHIFT.values()))
    truths: TruthTable = {
        "chances": ("chances lie between 0 and 1, delays are not negative", chances),
        "fresh": ("a packet of age 0 is believed as it is", fresh),
        "place": (
            "shifting the sender shifts where it is believed to be",
            lambda: trials.same(shifted, lambda there: there + shift, carried),
        ),
    }
    return trials.report("radio", truths)


FLOCKS = 40  # random flocks that each truth is tried on
UNHEARD = 0.2  # share of the others that an agent does not hear


class Neighbours(NamedTuple):
    """The others of one agent: offsets (other, axis) m, whether each is heard and hidden, fading of each signal."""

    offsets: Array
    heard: Any
    hidden: Array
    fade: Array

    def subset(self, order: Any) -> "Neighbours":
        """Return some of them, or all in another order."""
        return Neighbours(*(column[order] for column in self))


@standing_list(TOPOLOGIES)
def check_topology(topology: Any, parameters: Mapping[str, Any] | None = None, *, seed: int = 0) -> Report:
    """Run the standing list of truths on a topology and return a report with one line a truth.

    Everybody is met or not, and nobody who is not heard; the order of the others does not matter;
    turned about the vertical it is the same; in other units it is the same; where it says that it
    is NEAR, nobody farther matters. A topology that rightly breaks one of them says which and why:
    VIOLATES = {"turned": "whoever is east is met"}.

    Examples
    --------
    >>> import airflock
    >>> airflock.check_topology("nearest", {"k": 3}).broken
    ()
    """
    part, t, rng = part_to_check(TOPOLOGIES, topology, parameters, seed)

    def draw(number: int) -> Neighbours:
        """Others at random places or on a lattice, some of them not heard."""
        count = int(rng.integers(1, 25))
        offsets = 20.0 * rng.normal(size=(count, 3))
        if number % 4 == 3:
            offsets = np.round(offsets / 10.0) * 10.0 + 1e-3 * rng.normal(size=(count, 3))
        if part.flat or number % 2:
            offsets[:, 2] = 0.0
        hidden = (rng.random(count) < 0.3).astype(float)
        return Neighbours(offsets, rng.random(count) >= UNHEARD, hidden, rng.normal(size=count))

    def met(t: Any, others: Neighbours) -> Array:
        """Return the row that the rule fills; 2.0 where it fills nothing."""
        count, squares = len(others.offsets), (others.offsets**2).sum(axis=1) + TINY
        row = [2.0] * count
        given = {f"d{a}": column for a, column in zip(AXES, others.offsets.T.tolist(), strict=True)}
        given |= {"n": count, "met": row, "t": t, "heap": [FAR] * count, "weak": [FAR] * count}
        given |= {"r2": np.where(others.heard, squares, FAR).tolist(), "hidden": others.hidden.tolist()}
        call_rule(part.meet, "meet", {**given, "fade": others.fade.tolist()}, part.name)
        return np.array(row)

    def heard() -> str:
        for number, others in enumerate(trials.cases):
            row = met(t, others)
            wrong = row[~np.isin(row, (0.0, 1.0))]
            if len(wrong):
                return f"flock {number} of seed {seed}: met holds {wrong[0]:g}"
            if (row[~others.heard] > 0.5).any():
                return f"flock {number} of seed {seed}: an agent is met that is not heard"
        return ""

    def compare(choose: Any) -> str:
        """Return where a subset of the others, in some order, is met otherwise than among all."""
        pairs = ((met(t, o.subset(c)), met(t, o)[c]) for o, c in ((o, choose(o)) for o in trials.cases))
        return trials.first_mismatch(pairs)

    def inner(others: Neighbours) -> Any:
        far = np.linalg.norm(others.offsets, axis=1)
        return far <= np.median(far)

    turn = rotation_about_vertical(0.7 + rng.uniform(0.0, 5.0))
    trials = Trials(
        part, {"meet": part.meet}, "t", t, met, [draw(number) for number in range(FLOCKS)], seed,
        lambda units, others: (others._replace(offsets=others.offsets * units.metre), np.array(1.0)),
    )  # fmt: skip
    truths: TruthTable = {
        "heard": ("each agent is met or not, and none that is not heard", heard),
        "order": (
            "the order of the others does not matter",
            lambda: compare(lambda others: rng.permutation(len(others.offsets))),
        ),
        "turned": (
            "turned about the vertical it is the same",
            lambda: trials.same(lambda others: others._replace(offsets=others.offsets @ turn.T)),
        ),
        "near": ("where it says NEAR, nobody farther matters", lambda: compare(inner) if part.near else ""),
    }
    return trials.report("topology", truths)


CASES = 40  # random states that each truth is tried on


@standing_list(FAULTS)
def check_fault(fault: Any, parameters: Mapping[str, Any] | None = None, *, seed: int = 0) -> Report:
    """Run the standing list of truths on a kind of fault and return a report with one line a truth.

    Each rule returns as many finite numbers as its stage needs; what is shifted is believed
    shifted; in other units it is the same fault; rules stay in single precision. A fault that
    rightly breaks one of them says which and why: VIOLATES = {"place": "a jammer stands in the
    origin"}.

    Examples
    --------
    >>> import airflock
    >>> airflock.check_fault("motor").broken
    ()
    """
    part, f, rng = part_to_check(FAULTS, fault, parameters, seed)
    names = sorted({name for kind in part.rules for name in VOCABULARY[kind]} - {"f"})

    def draw() -> dict[str, Any]:
        given = {name: float(rng.normal(0.0, 5.0)) for name in names}
        return given | {"since": float(rng.uniform(0.0, 100.0)), "reach": float(rng.uniform(1.0, 100.0)), "dt": 0.02}

    def answer(f: Any, case: Case) -> Array:
        made = np.atleast_1d(np.array(call_rule(part.rules[case[0]], case[0], {**case[1], "f": f}, part.name), float))
        return np.maximum(made, 0.0) if case[0] == "radio" else made  # a negative range means none at all

    def finite() -> str:
        for kind, given in trials.cases:
            made, count = answer(f, (kind, given)), FAULT_RULES[kind][0]
            if len(made) != count or not np.isfinite(made).all():
                return f"seed {seed}: {kind} gives ({numbers_text(made)}) instead of {count} finite numbers"
        return ""

    givens = [draw() for _ in range(CASES)]
    cases = [(kind, given) for given in givens for kind in part.rules]
    moved = np.array([*SHIFT.values(), 0.0, 0.0, 0.0])
    placed = [case for case in cases if case[0] in ("sense", "tell")]
    trials = rule_trials(part, part.rules, "f", f, cases, seed, answer, separate=True)
    truths: TruthTable = {
        "answers": ("each rule returns the numbers that its stage needs", finite),
        "place": (
            "shifting the flight shifts what is believed",
            lambda: trials.same(shifted, lambda state: state + moved, placed),
        ),
    }
    return trials.report("fault", truths)


AGENTS, INSTANTS, TRIED = 6, 5, 8
CLOSE_IN_OTHER_UNITS = 1e-6  # guards such as TINY, and angles near zero, where a cosine is insensitive
METRIC_RULES = ("pair", "linked", "agent", "member", "cluster", "sample", "survey")


class FlockTrack(NamedTuple):
    """Positions (m) and velocities (m/s), (instant, agent, component), a period (s) apart, in a scenario."""

    states: Array
    period: float
    scenario: Scenario


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
    metrics: MetricSet = find_part(SETS, part)
    of_metrics = {key: why for metric in metrics.metrics for key, why in metric.violates.items()}
    metrics = replace(metrics, violates=of_metrics | dict(metrics.violates))
    scenario = _measured_scenario(metrics, dimensions)
    rng = np.random.default_rng(check_seed(seed))
    flat = np.array([1.0, 1.0, float(dimensions == 3)])
    q = scenario.resolved_metrics()
    units = {name: unit for m in scenario.order_parameters for name, (unit, _) in m.reports.items()}
    units |= {name: unit for name, (unit, _) in metrics.reports.items()}

    def draw() -> FlockTrack:
        places = rng.uniform(-12.0, 12.0, (1, AGENTS, 3)) + np.cumsum(rng.normal(0, 2, (INSTANTS, AGENTS, 3)), axis=0)
        speeds = np.array([3.0, 1.0, 0.0]) + rng.normal(0.0, 2.0, (INSTANTS, AGENTS, 3))
        return FlockTrack(np.concatenate([places * flat, speeds * flat], axis=2), 0.2, scenario)

    def measure(q: Any, flock: FlockTrack) -> dict[str, float]:
        """Return the order parameters of some instants, by the stages of a driver, uncompiled."""
        flown, dims, states = replace(flock.scenario, metrics=Part(metrics, q)), dimensions, flock.states
        frames = np.concatenate([states[:, :, :dims], states[:, :, 3 : 3 + dims]], axis=2).transpose(0, 2, 1)
        values, _ = measure_frames(flown, frames, flock.period, device="python")
        return metrics.judged(values, states.shape[1], flock.period * len(states), flown.resolved_metrics())

    def scale(to: UnitScale, flock: FlockTrack) -> tuple[FlockTrack, Array]:
        known = [units.get(name, "").split(" or ")[-1 if dimensions == 3 else 0] for name in names]
        other = FlockTrack(flock.states * state_scale(to), flock.period * to.second, rescaled_scenario(scenario, to))
        return other, np.array([unit_factor(unit, to) for unit in known])

    def reports() -> str:
        missing = [name for name in names if name not in units]
        return f"REPORTS tells nothing of {', '.join(missing)}" if missing else ""

    def finite(agents: Any) -> str:
        few = cases[0]._replace(states=cases[0].states[:, agents])
        return ", ".join(f"{name} = {v}" for name, v in measure(q, few).items() if math.isinf(v))

    cases = [draw() for _ in range(TRIED)]
    names = tuple(measure(q, cases[0]))
    rules = {
        f"{metric.name}.{kind}": rule
        for metric in scenario.order_parameters
        for kind, rule in rules_of(metric, METRIC_RULES).items()
    }
    trials = Trials(
        metrics, rules, "q", q, lambda q, case: np.array([measure(q, case)[name] for name in names]), cases, seed,
        scale, floor=1e-3, close=CLOSE_IN_OTHER_UNITS, separate=True,
    )  # fmt: skip
    turn = rotation_about_vertical(rng.uniform(0.5, 2.5))
    order = rng.permutation(AGENTS)
    shift = np.array([37.0, -19.0, 8.0 * (dimensions == 3), 0.0, 0.0, 0.0])

    def same(change: Any) -> Any:
        return lambda: trials.same(lambda flock: flock._replace(states=change(flock.states)))

    def turned(by: Array) -> Any:
        return same(lambda states: np.concatenate([states[:, :, :3] @ by.T, states[:, :, 3:] @ by.T], axis=2))

    truths: TruthTable = {
        "reports": ("every value has a unit and a meaning", reports),
        "rotation": ("turning the flock about the vertical does not change the values", turned(turn)),
        "translation": ("shifting the flock does not change the values", same(lambda states: states + shift)),
        "mirror": ("mirroring the flock does not change the values", turned(MIRROR)),
        "renumbering": ("renumbering the agents does not change the values", same(lambda states: states[:, order])),
        "lone agent": ("a single agent gives finite values", lambda: finite([0])),
        "two agents": ("two agents at one place give finite values", lambda: finite([0, 0])),
        "units": ("in other units of length and time each value scales by its unit", trials.units),
    }
    return trials.report("metrics", truths)


def _measured_scenario(metrics: MetricSet, dimensions: int) -> Scenario:
    """Return a scenario without an arena, whose numbers are of the size of the flocks."""
    keys = {
        "agents": AGENTS, "world.dimensions": str(dimensions), "world.arena": "none", "start.kind": "ball",
        "start.radius": 100.0, "metrics.max_e": 200.0, "metrics.r_coll": 8.0, "metrics.r_cluster": 12.0,
        "metrics.r_comm": 15.0, "metrics.r_b": 6.0, "metrics.t_settle": 0.0, "wing.segments": "5",
        "wing.tolerance": 1e-14,
    }  # fmt: skip
    document = {"model": {"kind": "vasarhelyi_2018"}}
    return build_scenario(document, f"check of {metrics.name}", keys, caller_parts=CallerParts(metrics=metrics))
