"""Plot of a formation's wash from above, and of each bird's induced drag."""

import math
from types import FunctionType, SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

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
from airflock.support import RecordingError
from airflock.view import style
from airflock.view.flight_paths import paths_in_window, scenario_or_none, short_name, title_details

Array = NDArray[Any]
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
