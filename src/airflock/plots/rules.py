"""A model's own rules drawn against distance, by calling the rules themselves (Vásárhelyi et al. 2018, Fig. 6).

One neighbour is put straight ahead (east) of an agent at rest. The push away from it is the radial component of what
`neighbour` returns; the response to a velocity difference is its component along that difference, here sideways, so
that the two do not mix.
"""

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from airflock.core.contract import Model
from airflock.core.vocabulary import asks
from airflock.errors import RuleError
from airflock.plots import style
from airflock.plots.save import positive
from airflock.plots.scene import name_of
from airflock.scenarios.scenario import Scenario
from airflock.stage.arrows import vectors

Array = NDArray[Any]
POINTS = 400
FASTEST = 1e3  # m/s; a larger allowed difference is drawn as none
SHARES = (0.5, 1.0, 2.0)  # of the velocity difference, in the panel of alignment
UNITS = {"velocity": "m/s", "acceleration": "m/s²", "heading": "1"}


class Response(NamedTuple):
    """Answer of a pair rule along one axis: to each vector among its sums."""

    name: str
    values: Array


def rules(
    scenario: Scenario, *, difference: float | None = None, speed: float | None = None, farthest: float | None = None
) -> Figure:
    """Repulsion, largest allowed velocity difference, alignment, and walls where the model has them.

    difference : velocity difference of the pair, m/s; by default the model's preferred speed
    speed      : at which an agent flies towards a wall, m/s; by default the same
    farthest   : largest distance drawn, m; by default a quarter beyond the interaction range
    """
    model, p = scenario.model, scenario.parameters
    if model.neighbour is None and model.boundary is None:
        raise RuleError(f"model {model.name} has neither neighbour nor boundary; there is no rule of distance to draw")
    preferred = model.preferred_speed(p) if model.preferred_speed else 1.0
    dv = float(preferred if difference is None else difference)
    v = float(preferred if speed is None else speed)
    reach = float(farthest if farthest is not None else _farthest(scenario))
    positive(difference=dv, speed=v, farthest=reach)
    r = np.linspace(reach / POINTS, reach, POINTS)
    count = 2 * (model.neighbour is not None) + (model.boundary is not None)
    figure = style.Picture(3.4 * count + 0.4, 3.1)
    figure.set_layout_engine("constrained")
    panels = list(np.atleast_1d(figure.subplots(1, count)))
    unit = UNITS[model.command]
    if model.neighbour is not None:
        _pair_panel(panels.pop(0), model, p, r, dv, unit)
        _alignment_panel(panels.pop(0), model, p, r, dv, unit)
    if model.boundary is not None:
        _wall_panel(panels[0], model, p, r, v, unit)
    style.overall(figure, name_of(scenario), f"rules of {model.name} against distance")
    return figure


def _farthest(scenario: Scenario) -> float:
    known = scenario.model.interaction_range or scenario.model.reach
    span = float(known(scenario.parameters)) if known else scenario.radio.range
    return 1.25 * (span if span < 1e4 else min(scenario.radio.range, 100.0))


def pair_sums(model: Model, p: Any, r: float, dv: float = 0.0) -> Any:
    """What `neighbour` returns for a neighbour r (m) ahead of an agent at rest that moves sideways at dv (m/s)."""
    side = 1.0 if dv > 0.0 else 0.0
    given = {
        "dx": r, "dy": 0.0, "dz": 0.0, "r": r, "r2": r * r, "dvx": 0.0, "dvy": dv, "dvz": 0.0, "dv": dv,
        "vx": 0.0, "vy": 0.0, "vz": 0.0, "hx": 0.0, "hy": 0.0, "hz": 0.0,
        "nhx": 0.0, "nhy": side, "nhz": 0.0, "age": 0.0, "lower": 0.0, "p": p,
    }  # fmt: skip
    if model.neighbour is None:
        raise RuleError(f"model {model.name} has no rule neighbour")
    names = asks(model.neighbour, "neighbour", model.name)
    if "dv" in names and dv == 0.0:
        given["dv"] = 1e-6  # as a driver guards it: the length of nothing divides safely
    return model.neighbour(*(given[name] for name in names))


def repulsion(model: Model, p: Any, r: Array) -> list[Response]:
    """Push away from a neighbour at rest at distances r (m), positive outwards; one Response per vector."""
    sums = [pair_sums(model, p, float(d)) for d in r]
    return [
        Response(name, np.array([-getattr(s, x) for s in sums], dtype=float))
        for name, (x, _) in vectors(model.Sums).items()
    ]


def alignment(model: Model, p: Any, r: Array, dv: float) -> list[Response]:
    """Response along a velocity difference dv (m/s) at distances r (m), beyond what a neighbour at rest causes."""
    rest = [pair_sums(model, p, float(d)) for d in r]
    moved = [pair_sums(model, p, float(d), dv) for d in r]
    return [
        Response(name, np.array([getattr(b, y) - getattr(a, y) for a, b in zip(rest, moved, strict=True)], dtype=float))
        for name, (_, y) in vectors(model.Sums).items()
    ]


def allowed_difference(model: Model, p: Any, r: Array) -> Array:
    """Largest velocity difference (m/s) at distances r (m) that causes no alignment; nan where none does.

    Found by halving an interval, from the rule alone: any difference above it must cause some.
    """
    return np.array([_allowed(model, p, float(d)) for d in r])


def _allowed(model: Model, p: Any, r: float) -> float:
    fields = [y for _, y in vectors(model.Sums).values()]
    rest = pair_sums(model, p, r)

    def aligns(dv: float) -> bool:
        moved = pair_sums(model, p, r, dv)
        return any(abs(getattr(moved, y) - getattr(rest, y)) > 1e-12 * dv for y in fields)

    low, high = 0.0, FASTEST
    if not aligns(high):
        return float("nan")
    if aligns(1e-6):
        return 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if aligns(middle) else (middle, high)
    return high


def wall_response(model: Model, p: Any, distance: Array, v: float) -> list[Response]:
    """What one wall adds to the command of an agent that flies straight at it at v (m/s), positive inwards."""
    if model.boundary is None:
        raise RuleError(f"model {model.name} has no rule boundary")
    names = asks(model.boundary, "boundary", model.name)
    given = {"nx": 1.0, "ny": 0.0, "nz": 0.0, "vx": -v, "vy": 0.0, "vz": 0.0, "p": p}
    answers = [model.boundary(*({**given, "distance": float(d)}[name] for name in names)) for d in distance]
    return [
        Response(name, np.array([getattr(a, x) for a in answers], dtype=float))
        for name, (x, _) in vectors(model.Walls).items()
    ]


def _pair_panel(axes: Axes, model: Model, p: Any, r: Array, dv: float, unit: str) -> None:
    """Fig. 6 itself: repulsion, largest allowed difference, and the difference at hand."""
    pushes = repulsion(model, p, r)
    allowed = allowed_difference(model, p, r)
    shared = unit == "m/s"  # one axis serves both
    for line, push in zip((style.BLUE, style.SKY, style.PURPLE), pushes, strict=False):
        axes.plot(r, push.values, color=line, linewidth=1.8, label=_named("repulsion", push.name))
    other = axes if shared else style.second_axis(axes, "velocity difference (m/s)", style.GREEN)
    other.plot(r, allowed, color=style.GREEN, linewidth=1.8, label="largest allowed\nvelocity difference")
    other.axhline(dv, color=style.RED, linewidth=1.2, linestyle=(0, (5, 3)), label="actual difference")
    beyond = np.nan_to_num(allowed, nan=FASTEST) < dv
    other.fill_between(r, allowed, dv, where=beyond.tolist(), color=style.RED, alpha=0.08, linewidth=0.0)
    style.dress(axes, "distance (m)", f"speed ({unit})" if shared else f"repulsion ({unit})")
    lines = axes.get_legend_handles_labels()[0] + ([] if shared else other.get_legend_handles_labels()[0])
    highest = max([2.0 * dv] + ([float(push.values.max()) for push in pushes] if shared else []))
    other.set_ylim(min(0.0, axes.get_ylim()[0] if shared else 0.0), 1.25 * highest)
    axes.set_xlim(0.0, float(r[-1]))
    style.letter(axes, "A  one neighbour")
    style.legend(axes, lines)


def _alignment_panel(axes: Axes, model: Model, p: Any, r: Array, dv: float, unit: str) -> None:
    for share, color in zip(SHARES, (style.ORANGE, style.RED, style.PURPLE), strict=True):
        for number, term in enumerate(alignment(model, p, r, share * dv)):
            dashes = ("-", "--", ":")[number % 3]
            label = _named(f"$\\Delta v$ = {share * dv:.3g} m/s", term.name)
            axes.plot(r, term.values, color=color, linewidth=1.8, linestyle=dashes, label=label)
    style.dress(axes, "distance (m)", f"alignment term ({unit})")
    axes.set_xlim(0.0, float(r[-1]))
    low, high = axes.get_ylim()
    axes.set_ylim(min(0.0, low), 1.4 * high)  # room for the legend
    style.letter(axes, "B  alignment")
    style.legend(axes)


def _wall_panel(axes: Axes, model: Model, p: Any, r: Array, v: float, unit: str) -> None:
    reach = float(r[-1])
    distance = np.linspace(-0.1 * reach, reach, POINTS)
    colors = (style.ORANGE, style.RED, style.PURPLE)
    for share, color in zip(SHARES, colors, strict=True):
        for number, term in enumerate(wall_response(model, p, distance, share * v)):
            dashes = ("-", "--", ":")[number % 3]
            label = _named(f"{share * v:.3g} m/s towards it", term.name)
            axes.plot(distance, term.values, color=color, linewidth=1.8, linestyle=dashes, label=label)
    axes.axvspan(float(distance[0]), 0.0, color=style.PALE, alpha=0.6, linewidth=0.0)
    style.dress(axes, "distance to the wall (m)", f"wall term ({unit})")
    axes.set_xlim(float(distance[0]), reach)
    style.letter(axes, "C  one wall")
    style.legend(axes)


def _named(what: str, name: str) -> str:
    return f"{what}, {name}" if name else what
