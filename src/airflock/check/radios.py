"""The standing list for a radio: chances, fresh data as they are, the same everywhere, units, single precision."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from airflock.check.truths import (
    UNIT_SCALES,
    Report,
    TruthTable,
    UnitScale,
    parameters_with_values,
    require_part,
    rescaled,
    run_in_single_precision,
    run_truths,
)
from airflock.core import RULES, VOCABULARY, Radio, argument_names, call_rule, choices, law
from airflock.scenarios import RADIO_KIND, check_seed

TRIES = 60  # random pairs that each truth is tried on
CLOSE = 1e-9
SHIFT = {"x": 1234.0, "y": -567.0, "z": 89.0}  # m
LENGTHS, TIMES = ("distance", "dx", "dy", "dz", "ex", "ey", "ez", "x", "y", "z"), ("age", "since", "period")
SPEEDS = ("vx", "vy", "vz", "evx", "evy", "evz")


def check_radio(radio: Any, parameters: Mapping[str, Any] | None = None, *, seed: int = 0) -> Report:
    """Run the standing list of truths on a radio and return a report with one line a truth.

    Chances lie between 0 and 1 and delays are not negative; a packet of age 0 is believed as it is;
    what is shifted is carried on shifted; in other units it is the same radio; rules stay in single
    precision. A radio that rightly breaks one of them says which and why: VIOLATES = {"place": "a
    mast stands in the origin"}.

    Parameters
    ----------
    radio : Radio, module, class, mapping or str
        A radio: a Radio, a namespace such as globals(), a name of ours, or a file that ends in .py.
    parameters : mapping, optional
        Values that differ from the defaults, by name.
    seed : int
        Of the random pairs; it stands in every mismatch.

    Returns
    -------
    Report
        Printed, one line a truth; `broken` are the names of those that do not hold, declared or not.

    Raises
    ------
    CheckError
        If a truth does not hold that the radio does not declare.
    RuleError, ScenarioError, ParameterError
        If what is checked cannot be read, or a value is none of its numbers.

    Examples
    --------
    >>> import airflock
    >>> airflock.check_radio("bursts").broken
    ()
    """
    found = require_part(RADIO_KIND.from_caller(radio))
    k = parameters_with_values(found.Parameters, parameters, "radio")
    pairs = list(_pairs(found, seed))
    rules = [rule for kind in RULES if (rule := getattr(found, kind)) is not None]
    truths: TruthTable = {
        "rule": ("every rule can be compiled", lambda: "".join(sum(map(law.rule_errors, rules), [])[:1])),
        "chances": ("chances lie between 0 and 1, delays are not negative", lambda: _chances(found, k, pairs, seed)),
        "fresh": ("a packet of age 0 is believed as it is", lambda: _fresh(found, k, pairs, seed)),
        "place": ("shifting the sender shifts where it is believed to be", lambda: _place(found, k, pairs, seed)),
        "units": ("in other units of length and time it is the same", lambda: _units(found, k, pairs, seed)),
        "single precision": ("rules do not turn float32 into doubles", lambda: _single(found, k, pairs)),
    }
    return run_truths(f"radio {found.name}", truths, found.violates)


def _pairs(found: Radio, seed: int) -> Iterator[dict[str, Any]]:
    """Draw arguments of rules for random pairs of agents."""
    rng = np.random.default_rng(check_seed(seed))
    names = {name for kind in RULES for name in VOCABULARY[kind]}
    for number in range(TRIES):
        offset = 30.0 * rng.normal(size=3)
        given: dict[str, Any] = {name: float(rng.normal()) for name in sorted(names)}
        given |= {name: float(rng.uniform()) for name in sorted(names) if name[0] == "u"}
        given |= dict(zip(("dx", "dy", "dz"), offset.tolist(), strict=True))
        given |= dict(zip(("x", "y", "z"), (50.0 * rng.normal(size=3)).tolist(), strict=True))
        given |= {"distance": math.hypot(*offset), "clear": float(number % 2), "talkers": float(rng.integers(1, 50))}
        given |= {"step": float(number), "period": 0.2, "fast": int(rng.integers(0, 4)), "slow": number % 3}
        given |= {
            "age": float(rng.uniform(0.0, 5.0)),
            "since": float(rng.uniform(0.1, 5.0)),
            "packet": found.Packet() if found.Packet is not None else None,
        }
        yield given


def _asked(found: Radio, kind: str, given: Mapping[str, Any], k: Any) -> tuple[float, ...]:
    """Numbers that a rule answers."""
    made = call_rule(getattr(found, kind), kind, {**given, "k": k}, found.name)
    if kind == "receive" and found.Packet is not None:
        return (float(made[0]), *map(float, made[1]))
    return tuple(map(float, made)) if isinstance(made, tuple) else (float(made),)


def _kinds(found: Radio, *kinds: str) -> list[str]:
    return [kind for kind in kinds if getattr(found, kind) is not None]


def _chances(found: Radio, k: Any, pairs: list[dict[str, Any]], seed: int) -> str:
    for number, given in enumerate(pairs):
        for kind in _kinds(found, "missed", "missed_few", "receive", "late", "lasts"):
            value = _asked(found, kind, given, k)[0]
            most = math.inf if kind == "late" else 1.0 + CLOSE
            if not -CLOSE <= value <= most or (kind in ("receive", "lasts") and value not in (0.0, 1.0)):
                return f"pair {number} of seed {seed}: {kind} gives {value:.6g} over {given['distance']:.4g} m"
    return ""


def _fresh(found: Radio, k: Any, pairs: list[dict[str, Any]], seed: int) -> str:
    if found.carry is None:
        return ""
    for number, given in enumerate(pairs):
        x, y, z = _asked(found, "carry", {**given, "age": 0.0}, k)
        off = math.dist((x, y, z), (given["x"], given["y"], given["z"]))
        if off > CLOSE:
            return f"pair {number} of seed {seed}: a packet of age 0 is believed {off:.3g} m off"
    return ""


def _place(found: Radio, k: Any, pairs: list[dict[str, Any]], seed: int) -> str:
    if found.carry is None:
        return ""
    for number, given in enumerate(pairs):
        here = _asked(found, "carry", given, k)
        there = _asked(found, "carry", given | {name: given[name] + by for name, by in SHIFT.items()}, k)
        moved = [a + by for a, by in zip(here, SHIFT.values(), strict=True)]
        if math.dist(moved, there) > CLOSE * 1e3:
            return f"pair {number} of seed {seed}: shifted, it is believed {math.dist(moved, there):.3g} m elsewhere"
    return ""


def _units(found: Radio, k: Any, pairs: list[dict[str, Any]], seed: int) -> str:
    for units in UNIT_SCALES:
        other = rescaled(k, units)
        for number, given in enumerate(pairs):
            for kind in _kinds(found, *RULES):
                sizes = {"late": [units.second], "carry": [units.metre] * 3, "see": _of_state(units)}.get(kind, [1.0])
                one, two = _asked(found, kind, given, k), _asked(found, kind, _scaled(given, units), other)
                both = [(a, b / size) for a, b, size in zip(one, two, sizes, strict=False)]
                off = [(a, b) for a, b in both if abs(b - a) > CLOSE * max(abs(a), 1.0)]
                if off:
                    told = f"pair {number} of seed {seed}: {kind} is {off[0][1]:.6g} instead of {off[0][0]:.6g}"
                    return f"{told}: a unit is declared wrongly, or the rule contains a number that has a unit"
    return ""


def _of_state(units: UnitScale) -> list[float]:
    """Return the units of a position and a velocity."""
    return [units.metre] * 3 + [units.metre / units.second] * 3


def _scaled(given: Mapping[str, Any], units: UnitScale) -> dict[str, Any]:
    """Convert the arguments of a pair to other units."""
    sizes = dict.fromkeys(LENGTHS, units.metre) | dict.fromkeys(TIMES, units.second)
    sizes |= dict.fromkeys(SPEEDS, units.metre / units.second)
    return {name: value * sizes[name] if name in sizes else value for name, value in given.items()}


def _single(found: Radio, k: Any, pairs: list[dict[str, Any]]) -> str:
    for kind in _kinds(found, *RULES):
        rule = getattr(found, kind)
        for given in pairs[:5]:
            run_in_single_precision(rule, {"k": choices(k)}, {**given, "k": k}, argument_names(rule, kind, found.name))
    return ""
