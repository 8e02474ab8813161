"""The standing list for a body: symmetries, rest, time step, units, single precision."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.check.truths import (
    MIRROR,
    UNIT_SCALES,
    Report,
    TruthTable,
    parameters_with_values,
    require_part,
    rescaled,
    rotation_about_vertical,
    run_in_single_precision,
    run_truths,
    unit_factor,
)
from airflock.core import COMMANDS, Body, argument_names, call_rule, choices, law
from airflock.parts.aero import Parameters as Wing
from airflock.scenarios import BODY_KIND, check_seed

MOTIONS = 40  # random motions that each truth is tried on
REMEMBERED = 5  # steps after which a body that remembers is looked at
CLOSE = 1e-9
WING = Wing()
VECTORS = {"v": "m/s", "m": "m/s", "c": "", "g": "1", "w": "m/s"}  # what `move` may ask for; c: as ACCEPTS says
Motion = dict[str, NDArray[np.float64]]


def check_body(body: Any, parameters: Mapping[str, Any] | None = None, *, seed: int = 0) -> Report:
    """Run the standing list of truths on a body and return a report with one line a truth.

    A motion that is turned or seen in a mirror turns or mirrors its result; at rest the result is
    finite; a halved time step halves the error; in other units it is the same motion; the rule
    stays in single precision. A body that rightly breaks one of them says which and why: VIOLATES =
    {"mirror": "a propeller turns one way"}.

    Parameters
    ----------
    body : Body, module, class, mapping or str
        A body: a Body, a namespace such as globals(), a name of ours, or a file that ends in .py.
    parameters : mapping, optional
        Values that differ from the defaults, by name.
    seed : int
        Of the random motions; it stands in every mismatch.

    Returns
    -------
    Report
        Printed, one line a truth; `broken` are the names of those that do not hold, declared or not.

    Raises
    ------
    CheckError
        If a truth does not hold that the body does not declare.
    RuleError, ScenarioError, ParameterError
        If what is checked cannot be read, or a value is none of its numbers.

    Examples
    --------
    >>> import airflock
    >>> airflock.check_body("multirotor").broken
    ()
    """
    found = require_part(BODY_KIND.from_caller(body))
    b = parameters_with_values(found.Parameters, parameters, "body")
    speed = float(min(getattr(b, "speed", getattr(b, "speed_max", 5.0)), 5.0))
    rng = np.random.default_rng(check_seed(seed))
    motions = [_motion(found, rng, speed) for _ in range(MOTIONS)]
    turn = rotation_about_vertical(1.1)
    truths: TruthTable = {
        "rule": ("the rule can be compiled", lambda: "".join(law.rule_errors(found.move)[:1])),
        "rotation": ("a motion turned about the vertical turns", lambda: _turns(found, b, motions, turn, seed)),
        "mirror": ("a motion seen in a mirror is mirrored", lambda: _turns(found, b, motions, MIRROR, seed)),
        "rest": ("at rest, without a command, the velocity is finite", lambda: _rest(found, b)),
        "time step": ("halving dt shrinks the error", lambda: _time_step(found, b, motions)),
        "units": ("in other units of length and time it is the same", lambda: _units(found, b, motions, seed)),
        "single precision": ("the rule does not turn float32 into doubles", lambda: _single(found, b, motions)),
    }
    return run_truths(f"body {found.name}", truths, found.violates)


def _motion(found: Body, rng: np.random.Generator, speed: float) -> Motion:
    """Velocities, a command, noise and wind at random."""
    made = {name: rng.normal(size=3) for name in VECTORS}
    for name in ("v", "m", "c", "w"):
        made[name] = speed * made[name]
    if found.accepts == "heading":
        made["c"] = made["c"] / np.linalg.norm(made["c"])
    return made


def _given(b: Any, motion: Motion, dt: float, memory: Any, wing: Any = WING) -> dict[str, Any]:
    """Everything that `move` may ask for, by name."""
    numbers = {f"{k}{a}": float(v[c]) for k, v in motion.items() for c, a in enumerate("xyz")}
    return {**numbers, "dt": dt, "b": b, "memory": memory, "wing": wing}


def _step(
    found: Body, b: Any, motion: Motion, dt: float, memory: Any, wing: Any = WING
) -> tuple[NDArray[np.float64], Any]:
    """Velocity (m/s) and Memory after one step."""
    moved = call_rule(found.move, "move", _given(b, motion, dt, memory, wing), found.name)
    return np.array(moved[:3]), moved[3] if found.Memory is not None else None


def _moved(found: Body, b: Any, motion: Motion, dt: float, wing: Any = WING) -> NDArray[np.float64]:
    """Velocity after one step, m/s; of a body that remembers after several, from its Memory at the start."""
    memory = found.Memory() if found.Memory is not None else None
    for _ in range(1 if memory is None else REMEMBERED):
        velocity, memory = _step(found, b, motion, dt, memory, wing)
        motion = motion | {"v": velocity, "m": velocity}
    return velocity


def _apart(a: NDArray[np.float64], b: NDArray[np.float64], number: int, seed: int) -> str:
    if np.abs(a - b).max() <= CLOSE * max(float(np.abs(b).max()), 1e-3):
        return ""
    one, other = (", ".join(f"{x:.6g}" for x in v) for v in (a, b))
    return f"motion {number} of seed {seed}: the velocity is ({one}) instead of ({other})"


def _turns(found: Body, b: Any, motions: list[Motion], turn: NDArray[np.float64], seed: int) -> str:
    errors = (
        _apart(_moved(found, b, {k: turn @ v for k, v in m.items()}, 0.02), turn @ _moved(found, b, m, 0.02), i, seed)
        for i, m in enumerate(motions)
    )
    return next(filter(None, errors), "")


def _rest(found: Body, b: Any) -> str:
    after = _moved(found, b, {name: np.zeros(3) for name in VECTORS}, 0.02)
    return "" if np.isfinite(after).all() else f"the velocity is {after}"


def _time_step(found: Body, b: Any, motions: list[Motion]) -> str:
    """Without noise: velocities after a tenth of a second differ ever less."""
    for number, motion in enumerate(motions[:10]):
        ends = []
        for steps in (2, 4, 8, 16):
            state = motion | {"g": np.zeros(3), "m": motion["v"]}
            memory = found.Memory() if found.Memory is not None else None
            for _ in range(steps):
                velocity, memory = _step(found, b, state, 0.1 / steps, memory)
                state = state | {"v": velocity, "m": velocity}
            ends.append(state["v"])
        errors = [float(np.abs(x - y).max()) for x, y in zip(ends, ends[1:], strict=False)]
        if errors[-1] > max(0.6 * errors[0], 1e-9):
            return f"motion {number}: velocities change by {errors[0]:.2g}, then {errors[1]:.2g}, {errors[2]:.2g} m/s"
    return ""


def _units(found: Body, b: Any, motions: list[Motion], seed: int) -> str:
    for units in UNIT_SCALES:
        scale = {name: unit_factor(unit or COMMANDS[found.accepts], units) for name, unit in VECTORS.items()}
        other = rescaled(b, units)
        for number, motion in enumerate(motions):
            scaled = {k: scale[k] * v for k, v in motion.items()}
            moved = _moved(found, other, scaled, 0.02 * units.second, rescaled(WING, units))
            mismatch = _apart(moved / scale["v"], _moved(found, b, motion, 0.02), number, seed)
            if mismatch:
                return f"{mismatch}: a unit is declared wrongly, or the rule contains a number that has a unit"
    return ""


def _single(found: Body, b: Any, motions: list[Motion]) -> str:
    for motion in motions[:5]:
        given = _given(b, motion, 0.02, found.Memory() if found.Memory is not None else None)
        run_in_single_precision(found.move, {"b": choices(b)}, given, argument_names(found.move, "move", found.name))
    return ""
