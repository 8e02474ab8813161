"""Plots of a law's own parts: its rules against distance, and the wash of its wings.

Rules are drawn against distance (Vásárhelyi et al. 2018, Fig. 6), named as the law names them. A
law whose neighbours act through several terms (TERMS, or several vectors among its Sums) gets a
panel for each.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from types import FunctionType, SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from airflock.core import COMMANDS, Model, argument_names
from airflock.parts.aero import (
    filaments,
    forward,
    induced_drag,
    pitch,
    place_wings,
    segments_of,
    shapes,
    solo_drag,
    solve,
)
from airflock.scenarios import Scenario
from airflock.support import RecordingError, RuleError
from airflock.view import style
from airflock.view.flight_paths import paths_in_window, scenario_or_none, short_name, title_details
from airflock.view.law_vectors import term_name_and_unit, vector_fields
from airflock.view.style import check_positive

Array = NDArray[Any]
MAX_DIFFERENCE = 1e3  # m/s; a larger allowed difference is drawn as none


class RuleResponse(NamedTuple):
    """Response of a pair rule along one axis, for each vector among its sums."""

    name: str
    values: Array


def pair_sums(model: Model, p: Any, r: float, dv: float = 0.0) -> Any:
    """Return the sums of `neighbour` for a neighbour r (m) ahead of an agent at rest that moves sideways at dv
    (m/s).
    """
    side = 1.0 if dv > 0.0 else 0.0
    arguments = {
        "dx": r, "dy": 0.0, "dz": 0.0, "r": r, "r2": r * r, "dvx": 0.0, "dvy": dv, "dvz": 0.0, "dv": dv,
        "vx": 0.0, "vy": 0.0, "vz": 0.0, "hx": 0.0, "hy": 0.0, "hz": 0.0,
        "nhx": 0.0, "nhy": side, "nhz": 0.0, "age": 0.0, "lower": 0.0, "kin": 1.0, "group": -1.0, "p": p,
    }  # fmt: skip
    if model.neighbour is None:
        raise RuleError(f"model {model.name} has no rule neighbour")
    names = argument_names(model.neighbour, "neighbour", model.name)
    if "dv" in names and dv == 0.0:
        arguments["dv"] = 1e-6  # as a driver guards it: the length of nothing divides safely
    return model.neighbour(*(arguments[name] for name in names))


def _responses(sums: Any, axis: int, answers: Sequence[Any], sign: float = 1.0) -> list[RuleResponse]:
    """Return component `axis` of each vector among the fields of a record, of all answers, times a sign."""
    return [
        RuleResponse(name, sign * np.array([getattr(answer, fields[axis]) for answer in answers], float))
        for name, fields in vector_fields(sums).items()
    ]


def repulsion_curve(model: Model, p: Any, r: Array) -> list[RuleResponse]:
    """Return the push away from a resting neighbour at distances r (m), positive outwards; one response per
    vector.
    """
    return _responses(model.Sums, 0, [pair_sums(model, p, float(d)) for d in r], -1.0)


def alignment_curve(model: Model, p: Any, r: Array, dv: float) -> list[RuleResponse]:
    """Return the response to a velocity difference dv (m/s) at distances r (m), beyond that to a resting
    neighbour.
    """
    moved, rest = (
        _responses(model.Sums, 1, [pair_sums(model, p, float(d), difference) for d in r]) for difference in (dv, 0.0)
    )
    return [one._replace(values=one.values - other.values) for one, other in zip(moved, rest, strict=True)]


def allowed_difference_curve(model: Model, p: Any, r: Array) -> Array:
    """Return the largest velocity difference (m/s) at distances r (m) that causes no alignment, or nan.

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
    # Any difference aligns: the curve is zero, not a rounding error of the search.
    if aligns(1e-6):
        return 0.0
    # 60 halvings narrow the interval to the rounding of a double.
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if aligns(middle) else (middle, high)
    return high


def wall_curve(model: Model, p: Any, distance: Array, v: float) -> list[RuleResponse]:
    """Return what one wall adds to the command of an agent that flies straight at it at v (m/s), positive inwards."""
    if model.boundary is None:
        raise RuleError(f"model {model.name} has no rule boundary")
    names = argument_names(model.boundary, "boundary", model.name)
    arguments = {"nx": 1.0, "ny": 0.0, "nz": 0.0, "vx": -v, "vy": 0.0, "vz": 0.0, "p": p}
    answers = [model.boundary(*({**arguments, "distance": float(d)}[name] for name in names)) for d in distance]
    return _responses(model.Walls, 0, answers)


CURVE_POINTS = 400
DIFFERENCE_SHARES = (0.5, 1.0, 2.0)  # of the velocity difference, in the panel of alignment


def rules(
    scenario: Scenario, *, difference: float | None = None, speed: float | None = None, farthest: float | None = None,
    ax: Axes | None = None,
) -> Figure:  # fmt: skip
    """Plot repulsion, largest allowed velocity difference and alignment, or each term of the law by its own word;
    walls.

    scenario   : whose law is drawn, with its numbers
    difference : velocity difference of the pair, m/s; by default the model's preferred speed
    speed      : at which an agent flies towards a wall, m/s; by default the same
    farthest   : largest distance drawn, m; by default a quarter beyond the interaction range
    ax         : axes of a grid, whose place the panels take, instead of a new figure
    The picture is that of Vásárhelyi et al. 2018, Fig. 6.

    Raises RuleError for a law without a rule of distance, and AirflockError for an `ax` that is
    none of a grid.

    Examples
    --------
    >>> import airflock
    >>> len(airflock.plots.rules(airflock.load("vasarhelyi_2018/4ms")).axes)
    3
    """
    model, p = scenario.model, scenario.parameters
    if model.neighbour is None and model.boundary is None:
        raise RuleError(f"model {model.name} has neither neighbour nor boundary; there is no rule of distance to draw")
    preferred = model.preferred_speed(p) if model.preferred_speed else 1.0
    dv = float(preferred if difference is None else difference)
    v = float(preferred if speed is None else speed)
    reach = float(farthest if farthest is not None else _largest_distance(scenario))
    check_positive(difference=dv, speed=v, farthest=reach)
    r = np.linspace(reach / CURVE_POINTS, reach, CURVE_POINTS)
    unit = COMMANDS[model.command].replace("^2", "²")
    draws: list[tuple[str, Callable[[Axes], None]]] = []
    if model.neighbour is not None and (model.terms or len(vector_fields(model.Sums)) > 1):
        for stem in vector_fields(model.Sums):
            draws.append(
                (term_name_and_unit(model, stem)[0], partial(_term_panel, model=model, p=p, r=r, dv=dv, stem=stem))
            )
    elif model.neighbour is not None:
        draws.append(("one neighbour", partial(_pair_panel, model=model, p=p, r=r, dv=dv, unit=unit)))
        draws.append(("alignment", partial(_alignment_panel, model=model, p=p, r=r, dv=dv, unit=unit)))
    if model.boundary is not None:
        draws.append(("one wall", partial(_wall_panel, model=model, p=p, r=r, v=v, unit=unit)))
    figure, panels = style.figure_and_panels(ax, 1, len(draws), 3.4 * len(draws) + 0.4, 3.1)
    for axes, (title, draw), name in zip(panels[0], draws, "ABCDEFGH", strict=False):
        draw(axes)
        style.set_panel_letter(axes, f"{name}  {title}")
    return style.set_figure_title(figure, short_name(scenario), f"rules of {model.name} against distance")


def _largest_distance(scenario: Scenario) -> float:
    known = scenario.model.interaction_range or scenario.model.reach
    span = float(known(scenario.parameters)) if known else scenario.radio.range
    return 1.25 * (span if span < 1e4 else min(scenario.radio.range, 100.0))


def _term_panel(axes: Axes, *, model: Model, p: Any, r: Array, dv: float, stem: str) -> None:
    """Draw one term of a law: the part of a resting neighbour and the part of its motion, up to the law's reach."""
    word, unit = term_name_and_unit(model, stem)
    assert model.neighbour is not None
    by_velocity = bool({"dvx", "dvy", "dv"} & set(argument_names(model.neighbour, "neighbour", model.name)))
    inside = r < float(model.reach(p)) if model.reach else np.full(len(r), True)
    place = list(vector_fields(model.Sums)).index(stem)
    away = np.where(inside, repulsion_curve(model, p, r)[place].values, 0.0)
    if away.any():
        towards = away.max() <= 0.0
        label = "towards it" if towards else "away from it"
        axes.plot(r, -away if towards else away, color=style.BLUE, linewidth=1.8, label=label)
    for share, color in zip(
        DIFFERENCE_SHARES if by_velocity else (1.0,), (style.ORANGE, style.RED, style.PURPLE), strict=False
    ):
        along = np.where(inside, alignment_curve(model, p, r, share * dv)[place].values, 0.0)
        if along.any():
            label = f"$\\Delta v$ = {share * dv:.3g} m/s" if by_velocity else "along its heading"
            axes.plot(r, along, color=color, linewidth=1.8, label=label)
    axes.axhline(0.0, color=style.GREY, linewidth=0.6, zorder=0)
    style.style_axes(axes, "distance (m)", f"{word} ({unit})" if unit else word)
    axes.set_xlim(0.0, float(r[-1]))
    style.add_legend(axes)


def _pair_panel(axes: Axes, *, model: Model, p: Any, r: Array, dv: float, unit: str) -> None:
    """Draw Fig. 6 itself: repulsion, largest allowed difference, and the difference at hand."""
    pushes = repulsion_curve(model, p, r)
    allowed = allowed_difference_curve(model, p, r)
    shared = unit == "m/s"  # one axis serves both
    for line, push in zip((style.BLUE, style.SKY, style.PURPLE), pushes, strict=False):
        axes.plot(r, push.values, color=line, linewidth=1.8, label=_curve_label("repulsion", push.name))
    other = axes if shared else style.add_right_axis(axes, "velocity difference (m/s)", style.GREEN)
    other.plot(r, allowed, color=style.GREEN, linewidth=1.8, label="largest allowed\nvelocity difference")
    other.axhline(dv, color=style.RED, linewidth=1.2, linestyle=(0, (5, 3)), label="actual difference")
    beyond = np.nan_to_num(allowed, nan=MAX_DIFFERENCE) < dv
    other.fill_between(r, allowed, dv, where=beyond.tolist(), color=style.RED, alpha=0.08, linewidth=0.0)
    style.style_axes(axes, "distance (m)", f"speed ({unit})" if shared else f"repulsion ({unit})")
    lines = axes.get_legend_handles_labels()[0] + ([] if shared else other.get_legend_handles_labels()[0])
    highest = max([2.0 * dv] + ([float(push.values.max()) for push in pushes] if shared else []))
    other.set_ylim(min(0.0, axes.get_ylim()[0] if shared else 0.0), 1.25 * highest)
    axes.set_xlim(0.0, float(r[-1]))
    style.add_legend(axes, lines)


def _alignment_panel(axes: Axes, *, model: Model, p: Any, r: Array, dv: float, unit: str) -> None:
    _draw_shares(axes, r, dv, partial(alignment_curve, model, p, r), "$\\Delta v$ = {:.3g} m/s")
    style.style_axes(axes, "distance (m)", f"alignment term ({unit})")
    low, high = axes.get_ylim()
    axes.set_ylim(min(0.0, low), 1.4 * high)  # room for the legend
    style.add_legend(axes)


def _wall_panel(axes: Axes, *, model: Model, p: Any, r: Array, v: float, unit: str) -> None:
    reach = float(r[-1])
    distance = np.linspace(-0.1 * reach, reach, CURVE_POINTS)
    _draw_shares(axes, distance, v, partial(wall_curve, model, p, distance), "{:.3g} m/s towards it")
    axes.axvspan(float(distance[0]), 0.0, color=style.PALE_GREY, alpha=0.6, linewidth=0.0)
    style.style_axes(axes, "distance to the wall (m)", f"wall term ({unit})", legend=True)


def _draw_shares(axes: Axes, at: Array, v: float, curve: Callable[[float], list[RuleResponse]], label: str) -> None:
    """Draw what a rule answers at distances (m) to shares of a velocity v, m/s, each vector with dashes of its own."""
    for share, color in zip(DIFFERENCE_SHARES, (style.ORANGE, style.RED, style.PURPLE), strict=True):
        for number, term in enumerate(curve(share * v)):
            dashes = ("-", "--", ":")[number % 3]
            text = _curve_label(label.format(share * v), term.name)
            axes.plot(at, term.values, color=color, linewidth=1.8, linestyle=dashes, label=text)
    axes.set_xlim(float(at[0]) if at[0] < 0.0 else 0.0, float(at[-1]))


def _curve_label(label: str, name: str) -> str:
    return f"{label}, {name}" if name else label


SPANS_BESIDE, SPANS_AHEAD, SPANS_BEHIND = 1.5, 1.0, 5.0  # spans of air shown around the birds
FIELD_POINTS = 260  # of the field along its longer side
MAX_BIRDS = 60  # birds; the lifting line of more takes long without a compiler


class SolvedFormation(NamedTuple):
    """Solution of a flock's lifting line.

    place       : (bird, axis) m: ahead, across (to the left), up
    circulation : (bird, segment) m²/s
    wash        : (bird, segment) downwash of the others, m/s
    drag, solo  : induced drag of each bird, and of a lone one, N
    """

    place: Array
    circulation: Array
    wash: Array
    drag: Array
    solo: float


def solve_formation(scenario: Scenario, position: Array, velocity: Array) -> SolvedFormation:
    """Solve the lifting line of a flock: positions (axis, bird) m and velocities, m/s, by the rules themselves."""
    wing, n = scenario.wing, position.shape[1]
    m = segments_of(wing)
    sizes = shapes(n, m, "none")
    # Plain lists: the rules are scalar Python here, and a picture shows one instant only.
    work = type(sizes)(*(np.zeros(size).tolist() for size in sizes))
    x, y, z = (part.tolist() for part in position.astype(float))
    vx, vy = (part.tolist() for part in velocity[:2].astype(float))
    hx, hy = forward(n, vx, vy, wing)
    place_wings(n, x, y, z, hx, hy, wing, work)
    solve(n, work, wing)
    drag = [induced_drag(i, work, work.circulation, wing) for i in range(n)]
    circulation, wash = (np.array(part)[:, :m] for part in (work.circulation, work.wash))
    return SolvedFormation(np.array(work.place).T, circulation, wash, np.array(drag), float(solo_drag(work, wing)))


def downwash(scenario: Scenario, formation: SolvedFormation, points: Array, without: int = -1) -> Array:
    """Return the downwash, m/s, that all wings (but one) induce at points (point, axis), m, in the formation's
    axes.
    """
    wing = scenario.wing
    m, h, core = segments_of(wing), pitch(wing), wing.core * wing.span
    total = np.zeros(len(points))
    for bird, (place, circulation) in enumerate(zip(formation.place, formation.circulation, strict=True)):
        if bird == without:
            continue
        dx, dy, dz = (points - place).T
        for segment in range(m):
            y = dy - (segment - 0.5 * (m - 1)) * h
            # A horseshoe vortex is the difference of its two trailing legs (Dimock & Selig 2003,
            # Eqs 5 and 6).
            ends = _filament_leg(dx, y + 0.5 * h, dz, core * core) - _filament_leg(dx, y - 0.5 * h, dz, core * core)
            total += circulation[segment] * filaments.SHARE * ends
    return total


def _over_arrays(rule: Any) -> Any:
    """Return a scalar rule of the aero package that works on arrays: its `math` is NumPy's."""
    # The rule has one source: the simulator compiles it, the picture runs it over arrays.
    return FunctionType(rule.__code__, {**rule.__globals__, "math": SimpleNamespace(sqrt=np.sqrt)})


_filament_leg = _over_arrays(filaments.leg)


def wash(recording: xr.Dataset, *, start: float | None = None, ax: Axes | None = None) -> Figure:
    """Plot a formation from above, flying up the picture: up- and downwash in its mean plane, each wing with its
    drag.

    The number beside a wing is its induced drag against a lone bird's: -30 % is saved.
    The lifting line is that of Dimock & Selig 2003; the picture is ours.

    recording : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    start : instant, s; by default the last one; ax : axes to draw into, instead of a new figure
    Raises RecordingError for a recording in a plane, or of more than 60 birds.

    Examples
    --------
    >>> import airflock
    >>> birds = airflock.simulate(airflock.load("dimock_2003/published", {"duration": 1.0}))
    >>> len(airflock.plots.wash(birds).axes) > 0
    True
    """
    scenario, shown = scenario_or_none(recording), paths_in_window(recording)
    if scenario is None or shown.position.shape[1] == 2:
        raise RecordingError("recording: the wash needs a scenario with wings that fly in space")
    if shown.agents > MAX_BIRDS:
        raise RecordingError(f"recording: has {shown.agents} birds; the wash can be drawn for at most {MAX_BIRDS}")
    frame = len(shown.times) - 1 if start is None else int(np.abs(shown.times - start).argmin())
    solved = solve_formation(scenario, shown.position[frame], shown.velocity[frame])
    span = float(scenario.wing.span)
    low, high = solved.place.min(axis=0), solved.place.max(axis=0)
    ahead = float(low[0]) - SPANS_BEHIND * span, float(high[0]) + SPANS_AHEAD * span
    right = -float(high[1]) - SPANS_BESIDE * span, -float(low[1]) + SPANS_BESIDE * span
    tall, wide = ahead[1] - ahead[0], right[1] - right[0]
    rows, columns = (max(2, math.ceil(FIELD_POINTS * side / max(tall, wide))) for side in (tall, wide))
    u, v = np.meshgrid(np.linspace(right[0], right[1], columns), np.linspace(ahead[0], ahead[1], rows))
    points = np.column_stack([v.ravel(), -u.ravel(), np.full(u.size, solved.place[:, 2].mean())])
    field = -downwash(scenario, solved, points).reshape(u.shape)
    most = max(float(np.quantile(np.abs(field), 0.97)), 1e-6)
    figure, axes = style.figure_and_axes(ax, 6.4, float(np.clip(6.0 * tall / wide, 3.0, 8.0)))
    picture = axes.imshow(
        field, extent=(*right, *ahead), origin="lower", cmap="PuOr_r", norm=TwoSlopeNorm(0.0, -most, most),
        interpolation="bilinear", zorder=0,
    )  # fmt: skip
    for place, drag in zip(solved.place, solved.drag, strict=True):
        middle = -place[1]
        axes.plot([middle - 0.5 * span, middle + 0.5 * span], [place[0]] * 2, color=style.INK, linewidth=2.4, zorder=3)
        label = f"{100.0 * (drag / solved.solo - 1.0):+.0f} %"
        axes.annotate(
            label, (middle, place[0]), (0.0, 5.0), textcoords="offset points", ha="center", fontsize=style.SMALL_SIZE,
            color=style.INK, zorder=4, bbox={"facecolor": "white", "alpha": 0.75, "linewidth": 0.0, "pad": 1.0},
        )  # fmt: skip
    style.style_axes(axes, "across (m)", "ahead (m)", grid=False)
    axes.set(xlim=right, ylim=ahead, aspect="equal")
    saving = 1.0 - solved.drag.mean() / solved.solo
    against = f"{100.0 * abs(saving):.0f} % {'below' if saving >= 0.0 else 'above'} that of lone birds"
    instant = f"t = {shown.times[frame]:.4g} s · induced drag {against}"
    style.set_title(axes, short_name(recording), f"{title_details(recording)} · {instant}")
    style.add_colour_bar(figure, picture, axes, "upwash (m/s)", shrink=0.7)
    return figure
