"""Measures of a page: order parameters in the window since the last change, near pairs, and tables of scores."""

import html
import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from airflock.core import Quantity, declarations, format_with_unit
from airflock.engine import Flight
from airflock.parts.metrics import reported_values
from airflock.scenarios import Scenario

MAX_CHART_POINTS = 600  # points of a chart
MAX_LINKS = 2500
HISTOGRAM_BINS = 40  # of a histogram


class FlockInstant(NamedTuple):
    """Measures of a flock at one instant: s, m/s, m."""

    time: float
    mean_speed: float
    slowest: float
    fastest: float
    nearest: float


class AgentPairs:
    """Near pairs of a flock; of a periodic world with the nearest image where its box is given.

    period : side of the box along each axis, m; None in an open world
    """

    def __init__(self, position: NDArray[Any], period: tuple[float, float, float] | None = None):
        self.position = np.asarray(position, float)
        self.period = None
        if period is not None:
            # cKDTree has no open axis beside periodic ones; a side of 1e9 m acts as one.
            box = np.array([side if side > 0.0 else 1e9 for side in period])
            self.period = box
            self._tree = cKDTree(np.mod(self.position + 0.5 * box, box), boxsize=box)
        else:
            self._tree = cKDTree(self.position)

    def apart(self) -> NDArray[np.float64]:
        """Return the distance of each agent to its nearest neighbour, m; empty for one agent."""
        if len(self.position) < 2:
            return np.zeros(0)
        return np.asarray(self._tree.query(self._tree.data, k=2)[0][:, 1])

    def nearest(self) -> float:
        """Return the smallest distance of two agents, m; nan for one agent."""
        return float(self.apart().min()) if len(self.position) > 1 else math.nan

    def within(self, distance: float) -> NDArray[np.intp]:
        """Return pairs (pair, 2) nearer than a distance, m."""
        return np.asarray(self._tree.query_pairs(distance, output_type="ndarray"), np.intp)

    def nearest_pairs_within(self, distance: float) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Return pairs (pair, 2) nearer than a distance, and their distances, m; none through a periodic face.

        Of more than can be drawn the nearest.
        """
        size = len(self.position)
        far = distance
        if size * size > 2 * MAX_LINKS:  # a denser flock than can be drawn: as far as so many neighbours reach
            count = min(size - 1, max(1, 2 * MAX_LINKS // size))
            # The 90 % quantile of the distance to the n-th neighbour bounds the pairs before they
            # are listed: all pairs of 1,000 agents within radio range would be half a million.
            far = min(distance, float(np.quantile(self._tree.query(self._tree.data, k=count + 1)[0][:, -1], 0.9)))
        pairs = self.within(far)
        length = np.linalg.norm(self.position[pairs[:, 1]] - self.position[pairs[:, 0]], axis=1)
        # Stable: among equal lengths the drawn lines do not flicker from frame to frame.
        order = np.argsort(length, kind="stable")[:MAX_LINKS]
        order = order[length[order] <= distance]  # others lie beyond a periodic face
        return pairs[order], length[order]

    def neighbours(self, count: int = 3) -> NDArray[Any]:
        """Return segments (segment, 2, 3) from each agent to its nearest others; none through a periodic face."""
        count = min(count, len(self.position) - 1, max(1, MAX_LINKS // max(len(self.position), 1)))
        if count < 1:
            return np.zeros((0, 2, 3))
        _, other = self._tree.query(self._tree.data, k=count + 1)
        ends = self.position[other[:, 1:]].reshape(-1, 3)
        found = np.stack([np.repeat(self.position, count, axis=0), ends], 1)
        return found if self.period is None else without_periodic_crossings(found, self.period)


def without_periodic_crossings(segments: NDArray[Any], period: NDArray[Any]) -> NDArray[Any]:
    """Drop the segments that cross a periodic face."""
    # The nearest image is at most half a period away; a longer line leads the wrong way round.
    long = (np.abs(segments[:, 1] - segments[:, 0]) > 0.5 * period).any(axis=1)
    return np.asarray(segments[~long])


def world_period(scenario: Any) -> tuple[float, float, float] | None:
    """Return the sides of a periodic world, m; None for any other."""
    world = scenario.world
    if world.edges != "periodic":
        return None
    return (world.side, world.side, world.height if scenario.dimensions == 3 else 0.0)


class PaneChartData:
    """Data of the charts of one pane: instants, the course of one order parameter of the present window, and how
    often which speed and which distance to the nearest neighbour was seen in it.

    max_speed, max_distance : ends of the histograms, m/s and m; name : of the order parameter
    """

    def __init__(self, max_speed: float = 1.0, max_distance: float = 1.0, name: str = "") -> None:
        self.instants: deque[FlockInstant] = deque(maxlen=MAX_CHART_POINTS)
        self.score_course: deque[tuple[float, float]] = deque(maxlen=MAX_CHART_POINTS)
        self.name = name
        self.speed_histogram, self.distance_histogram = Histogram(max_speed), Histogram(max_distance)
        self._window = -1

    def clear(self) -> None:
        """Clear everything: another flight, or an earlier moment of this one."""
        self.instants.clear()
        self.fresh()

    def fresh(self) -> None:
        """Begin a new window."""
        self.score_course.clear()
        self.speed_histogram.clear()
        self.distance_histogram.clear()

    def note(self, flight: Flight, velocity: NDArray[Any], pairs: AgentPairs) -> dict[str, Any]:
        """Add the present moment, once; returns the scores of the present window."""
        if len(flight.windows) != self._window:
            self._window = len(flight.windows)
            self.fresh()
        scores = flight.scores()
        # A paused page calls again with the same moment; counting it twice would bend the
        # histograms.
        if self.instants and self.instants[-1].time == flight.time:
            return scores
        speed, apart = np.sqrt((velocity**2).sum(1)), pairs.apart()
        nearest = float(apart.min()) if len(apart) else math.nan
        self.instants.append(
            FlockInstant(flight.time, float(speed.mean()), float(speed.min()), float(speed.max()), nearest)
        )
        self.speed_histogram.add(speed)
        self.distance_histogram.add(apart)
        value = scores.get(self.name)
        if isinstance(value, (int, float)) and math.isfinite(value):
            self.score_course.append((flight.time, float(value)))
        return scores


class Histogram:
    """Shares of values from 0 to `top`; larger values count in the last bin."""

    def __init__(self, max_value: float):
        self.edges = np.linspace(0.0, max_value, HISTOGRAM_BINS + 1)
        self.counts = np.zeros(HISTOGRAM_BINS)

    def clear(self) -> None:
        """Remove all values."""
        self.counts[:] = 0.0

    def add(self, values: NDArray[Any]) -> None:
        """Count values."""
        width = self.edges[1]
        self.counts += np.bincount(
            np.clip((values / width).astype(int), 0, HISTOGRAM_BINS - 1), minlength=HISTOGRAM_BINS
        )

    @property
    def steps(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the outline of the bars: values and shares."""
        share = self.counts / max(self.counts.sum(), 1.0)
        return np.repeat(self.edges, 2)[1:-1], np.repeat(share, 2)


def default_score(names: Mapping[str, Any], published: Mapping[str, Any]) -> str:
    """Return the order parameter shown first: one that the paper reports, if there is any."""
    for name in ("phi_corr", "fitness", "f_corr", "polarisation"):
        if name in names and (name in published or not published):
            return name
    return next((name for name in names if name in published), next(iter(names), ""))


COLUMN_STYLE = "text-align:right;padding-left:0.8em"


def score_table_html(flights: Sequence[Flight], scores: Sequence[Mapping[str, Any]]) -> str:
    """Return order parameters of this window, the window before and the paper, as HTML; of two flights side by
    side.
    """
    flight, two = flights[0], len(flights) > 1
    about, published = reported_values(flight.scenario.metrics.rule), {} if two else flight.scenario.published
    before = flight.windows[-1].scores if flight.windows and not two else {}
    heads = ["A", "B", "B − A"] if two else ["now", *(["before"] if before else []), *(["paper"] if published else [])]
    rows = [_header_row(["", *heads])]
    for name, value in scores[0].items():
        if not isinstance(value, (int, float)):
            continue
        unit, meaning = about.get(name, ("", ""))
        cells = [_number_text(value)]
        if two:
            other = scores[1].get(name)
            gap = other - value if isinstance(other, (int, float)) else None
            cells += [_number_text(other), _number_text(gap)]
        if before:
            cells.append(_number_text(before.get(name)))
        if published:
            mean, spread = published.get(name, (None, None))
            cells.append(_number_text(mean) + (f" ± {spread:.2g}" if spread is not None else ""))
        rows.append(_table_row(f"{name} ({unit})" if unit else name, cells, meaning))
    since = " and ".join(f"{flight.windows[-1].end if flight.windows else 0.0:.3g} s" for flight in flights)
    return _table_html(rows, f"since t = {since}")


def difference_table_html(a: Scenario, b: Scenario) -> str:
    """Return the differences of two scenarios, as HTML."""
    found = scenario_differences(a, b)
    if not found:
        return _table_html([], "no difference, only chance that has grown")
    units = _key_units(b) | _key_units(a)
    rows = [
        _table_row(format_with_unit(key, units.get(key, "")), [_value_text(one), _value_text(other)])
        for key, one, other in found
    ]
    return _table_html(
        [_header_row(["", "A", "B"]), *rows], f"{len(found)} parameter{'s' if len(found) > 1 else ''} with other values"
    )


def scenario_differences(a: Scenario, b: Scenario) -> list[tuple[str, Any, Any]]:
    """Return the keys whose values differ, with both values; None where a scenario has no such key."""
    found: list[tuple[str, Any, Any]] = []
    if a.model.name != b.model.name:
        found.append(("model.kind", a.model.name, b.model.name))
    for section, mine in a.records.items():
        theirs = b.records[section]
        names = dict.fromkeys([*mine.__dataclass_fields__, *theirs.__dataclass_fields__])
        for name in names:
            one, other = getattr(mine, name, None), getattr(theirs, name, None)
            if one != other and (section, name) != ("", "duration"):
                found.append((f"{section}.{name}".strip("."), one, other))
    return found


def _key_units(scenario: Scenario) -> dict[str, str]:
    """Return the unit, in brackets, of each key that has one."""
    return {
        f"{section}.{name}".strip("."): f"({declared.unit})"
        for section, record in scenario.records.items()
        for name, declared, _ in declarations(record)
        if isinstance(declared, Quantity) and declared.unit not in ("", "1")
    }


def _header_row(titles: Sequence[str]) -> str:
    return "<tr>" + "".join(f"<th style='{COLUMN_STYLE}'>{title}</th>" for title in titles) + "</tr>"


def _table_row(title: str, cells: Sequence[str], meaning: str = "") -> str:
    body = "".join(f"<td style='{COLUMN_STYLE}'>{html.escape(cell)}</td>" for cell in cells)
    return f"<tr title='{html.escape(meaning, quote=True)}'><td>{html.escape(title)}</td>{body}</tr>"


def _table_html(rows: Sequence[str], caption: str) -> str:
    table = f"<table style='font-size:0.8em;font-variant-numeric:tabular-nums'>{''.join(rows)}</table>"
    return f"<div style='padding:0 0.75em'><small>{caption}</small>{table}</div>"


def _value_text(value: Any) -> str:
    if isinstance(value, (int, float)):
        return _number_text(value)
    return "–" if value is None else str(value) if isinstance(value, str) else f"{len(value)} given"


def _number_text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, (int, float)) and math.isfinite(value) else "–"
