"""Answers of a law's own rules to one neighbour or one wall, against distance, by calling the rules themselves.

One neighbour is put straight ahead (east) of an agent at rest. The push away from it is the radial component of what
`neighbour` returns; the response to a velocity difference is its component along that difference, here sideways, so
that the two do not mix.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.core import Model, argument_names
from airflock.support import RuleError
from airflock.view.stage.arrows import vector_fields

Array = NDArray[Any]
MAX_DIFFERENCE = 1e3  # m/s; a larger allowed difference is drawn as none


class RuleResponse(NamedTuple):
    """Answer of a pair rule along one axis: to each vector among its sums."""

    name: str
    values: Array


def pair_sums(model: Model, p: Any, r: float, dv: float = 0.0) -> Any:
    """What `neighbour` returns for a neighbour r (m) ahead of an agent at rest that moves sideways at dv (m/s)."""
    side = 1.0 if dv > 0.0 else 0.0
    given = {
        "dx": r, "dy": 0.0, "dz": 0.0, "r": r, "r2": r * r, "dvx": 0.0, "dvy": dv, "dvz": 0.0, "dv": dv,
        "vx": 0.0, "vy": 0.0, "vz": 0.0, "hx": 0.0, "hy": 0.0, "hz": 0.0,
        "nhx": 0.0, "nhy": side, "nhz": 0.0, "age": 0.0, "lower": 0.0, "kin": 1.0, "group": -1.0, "p": p,
    }  # fmt: skip
    if model.neighbour is None:
        raise RuleError(f"model {model.name} has no rule neighbour")
    names = argument_names(model.neighbour, "neighbour", model.name)
    if "dv" in names and dv == 0.0:
        given["dv"] = 1e-6  # as a driver guards it: the length of nothing divides safely
    return model.neighbour(*(given[name] for name in names))


def repulsion_curve(model: Model, p: Any, r: Array) -> list[RuleResponse]:
    """Push away from a neighbour at rest at distances r (m), positive outwards; one Response per vector."""
    sums = [pair_sums(model, p, float(d)) for d in r]
    return [
        RuleResponse(name, np.array([-getattr(s, x) for s in sums], dtype=float))
        for name, (x, _) in vector_fields(model.Sums).items()
    ]


def alignment_curve(model: Model, p: Any, r: Array, dv: float) -> list[RuleResponse]:
    """Response along a velocity difference dv (m/s) at distances r (m), beyond what a neighbour at rest causes."""
    rest = [pair_sums(model, p, float(d)) for d in r]
    moved = [pair_sums(model, p, float(d), dv) for d in r]
    return [
        RuleResponse(
            name, np.array([getattr(b, y) - getattr(a, y) for a, b in zip(rest, moved, strict=True)], dtype=float)
        )
        for name, (_, y) in vector_fields(model.Sums).items()
    ]


def allowed_difference_curve(model: Model, p: Any, r: Array) -> Array:
    """Largest velocity difference (m/s) at distances r (m) that causes no alignment; nan where none does.

    Found by halving an interval, from the rule alone: any difference above it must cause some.
    """
    return np.array([_largest_allowed_difference(model, p, float(d)) for d in r])


def _largest_allowed_difference(model: Model, p: Any, r: float) -> float:
    fields = [y for _, y in vector_fields(model.Sums).values()]
    rest = pair_sums(model, p, r)

    def aligns(dv: float) -> bool:
        moved = pair_sums(model, p, r, dv)
        return any(abs(getattr(moved, y) - getattr(rest, y)) > 1e-12 * dv for y in fields)

    low, high = 0.0, MAX_DIFFERENCE
    if not aligns(high):
        return float("nan")
    if aligns(1e-6):
        return 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if aligns(middle) else (middle, high)
    return high


def wall_curve(model: Model, p: Any, distance: Array, v: float) -> list[RuleResponse]:
    """What one wall adds to the command of an agent that flies straight at it at v (m/s), positive inwards."""
    if model.boundary is None:
        raise RuleError(f"model {model.name} has no rule boundary")
    names = argument_names(model.boundary, "boundary", model.name)
    given = {"nx": 1.0, "ny": 0.0, "nz": 0.0, "vx": -v, "vy": 0.0, "vz": 0.0, "p": p}
    answers = [model.boundary(*({**given, "distance": float(d)}[name] for name in names)) for d in distance]
    return [
        RuleResponse(name, np.array([getattr(a, x) for a in answers], dtype=float))
        for name, (x, _) in vector_fields(model.Walls).items()
    ]
