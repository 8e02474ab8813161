"""The standing list for a sensor: the same everywhere, bounded, the truth where it says so, units, single precision."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
from airflock.core import (
    COMPONENTS,
    Quantity,
    Sensor,
    State,
    add_errors,
    argument_names,
    call_measure,
    choices,
    declarations,
    law,
)
from airflock.scenarios import SENSOR_KIND, check_seed

TRACKS, MEASUREMENTS = 8, 60  # random tracks that each truth is tried on, and how often each is measured
LONG = 3000  # measurements after which an error is still bounded
CLOSE = 1e-9
Track = NDArray[np.float64]  # (measurement, component) true position (m) and velocity (m/s)


def check_sensor(sensor: Any, parameters: Mapping[str, Any] | None = None, *, seed: int = 0) -> Report:
    """Run the standing list of truths on a sensor and return a report with one line a truth.

    A track that is shifted is measured shifted; errors stay bounded; where `exact` says so there is
    no error; in other units it is the same measurement; the rule stays in single precision. A
    sensor that rightly breaks one of them says which and why: VIOLATES = {"place": "a beacon stands
    in the origin"}.

    Parameters
    ----------
    sensor : Sensor, module, class, mapping or str
        A sensor: a Sensor, a namespace such as globals(), a name of ours, or a file that ends in .py.
    parameters : mapping, optional
        Values that differ from the defaults, by name.
    seed : int
        Of the random tracks; it stands in every mismatch.

    Returns
    -------
    Report
        Printed, one line a truth; `broken` are the names of those that do not hold, declared or not.

    Raises
    ------
    CheckError
        If a truth does not hold that the sensor does not declare.
    RuleError, ScenarioError, ParameterError
        If what is checked cannot be read, or a value is none of its numbers.

    Examples
    --------
    >>> import airflock
    >>> airflock.check_sensor("gnss").broken
    ()
    """
    found = require_part(SENSOR_KIND.from_caller(sensor))
    s = parameters_with_values(found.Parameters, parameters, "sensors")
    period = s.period or 0.2
    rng = np.random.default_rng(check_seed(seed))
    tracks = [_track(rng, period) for _ in range(TRACKS)]
    rule = found.measure or found.error
    assert rule is not None
    truths: TruthTable = {
        "rule": ("the rule can be compiled", lambda: "".join(law.rule_errors(rule)[:1])),
        "place": ("shifting the track shifts the measurements", lambda: _place(found, s, tracks, period, seed)),
        "bounded": ("errors stay finite", lambda: _bounded(found, s, period, seed)),
        "exact": ("where `exact` holds, it measures the true state", lambda: _exact(found, tracks, period, seed)),
        "units": ("in other units of length and time it is the same", lambda: _units(found, s, tracks, period)),
        "single precision": ("the rule does not turn float32 into doubles", lambda: _single(found, s, period)),
    }
    return run_truths(f"sensor {found.name}", truths, found.violates)


def _track(rng: np.random.Generator, period: float) -> Track:
    """A track of random accelerations."""
    velocity = np.cumsum(rng.normal(size=(MEASUREMENTS, 3)), axis=0)
    return np.hstack([50.0 * rng.normal(size=3) + period * np.cumsum(velocity, axis=0), velocity])


def _draws(seed: int, number: int) -> dict[str, float]:
    """Normal and uniform numbers of one measurement."""
    rng = np.random.default_rng((seed, number))
    normal, uniform = rng.normal(size=12).tolist(), rng.uniform(size=4).tolist()
    return {f"g{c}": g for c, g in enumerate(normal)} | {f"u{c}": u for c, u in enumerate(uniform)}


def _believed(found: Sensor, s: Any, track: Track, period: float, seed: int) -> Track:
    """Return the states that a sensor makes of a track, relative to its first state."""
    made = np.empty_like(track)
    memory, off = (found.Memory() if found.Memory is not None else None), State(*(0.0,) * 6)
    for number, state in enumerate(track):
        draws = _draws(seed, number)
        if found.error is not None:
            off = add_errors(found, s, off, [draws[f"g{axis}"] for axis in range(3)], period)
            made[number] = state + np.array(off)
        else:
            true = [float(component) for component in state]
            made[number], memory = call_measure(found, s, true, memory, number * period, period, draws)
    return made


def _apart(a: Track, b: Track, number: int, seed: int) -> str:
    off = np.abs(a - b)
    if off.max() <= CLOSE * max(float(np.abs(b).max()), 1.0):
        return ""
    when, which = np.unravel_index(int(off.argmax()), off.shape)
    one, other = a[when, which], b[when, which]
    told = f"track {number} of seed {seed}, measurement {when}"
    return f"{told}: {COMPONENTS[which]} is {one:.6g} instead of {other:.6g}"


def _place(found: Sensor, s: Any, tracks: list[Track], period: float, seed: int) -> str:
    shift = np.array([1234.0, -567.0, 89.0, 0.0, 0.0, 0.0])
    errors = (
        _apart(_believed(found, s, t + shift, period, seed), _believed(found, s, t, period, seed) + shift, k, seed)
        for k, t in enumerate(tracks)
    )
    return next(filter(None, errors), "")


def _bounded(found: Sensor, s: Any, period: float, seed: int) -> str:
    made = _believed(found, s, np.zeros((LONG, 6)), period, seed)
    if np.isfinite(made).all() and np.abs(made).max() < 1e20:
        return ""
    return f"seed {seed}: an agent at rest measures {np.nanmax(np.abs(made)):.3g} within {LONG} measurements"


def _exact(found: Sensor, tracks: list[Track], period: float, seed: int) -> str:
    """With every number at zero that may be: if `exact` holds, what is measured is the true state."""
    usual = {name: d for name, d, _ in declarations(found.Parameters) if isinstance(d, Quantity)}
    s = found.Parameters(**{name: 0.0 for name, d in usual.items() if d.low <= 0.0 <= d.high and name != "period"})
    if not found.is_exact(s):
        return ""
    return _apart(_believed(found, s, tracks[0], period, seed), tracks[0], 0, seed)


def _units(found: Sensor, s: Any, tracks: list[Track], period: float) -> str:
    for units in UNIT_SCALES:
        scale, other = _scale(units), rescaled(s, units)
        for number, track in enumerate(tracks):
            scaled = _believed(found, other, track * scale, period * units.second, number)
            mismatch = _apart(scaled / scale, _believed(found, s, track, period, number), number, number)
            if mismatch:
                return f"{mismatch}: a unit is declared wrongly, or the rule contains a number that has a unit"
    return ""


def _scale(units: UnitScale) -> Track:
    return np.array([units.metre] * 3 + [units.metre / units.second] * 3)


def _single(found: Sensor, s: Any, period: float) -> str:
    rule, kind = (found.measure, "measure") if found.error is None else (found.error, "error")
    assert rule is not None
    memory = found.Memory() if found.Memory is not None else None
    for number in range(5):
        draws = _draws(number, number)
        given: dict[str, Any] = {**dict(zip(COMPONENTS, (1.0, 2.0, 3.0, 0.5, 0.25, 0.125), strict=True)), **draws}
        given |= {"memory": memory, "time": number * period, "period": period, "s": s}
        given |= {"dx": 0.3, "dv": 0.1, "g": draws["g0"]}
        run_in_single_precision(rule, {"s": choices(s)}, given, argument_names(rule, kind, found.name))
    return ""
