"""Measures of a page: the scenario's order parameters in the window since the last change, and how near agents are."""

import math
from collections import deque
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from airflock.engine.flight import Flight
from airflock.metrics.registry import reports

KEPT = 600  # points of a chart
MOST_LINKS = 4000


class Instant(NamedTuple):
    """One moment of a flock: s, m/s, m."""

    time: float
    mean_speed: float
    slowest: float
    fastest: float
    nearest: float


class Pairs:
    """Near pairs of a flock; of a periodic world with the nearest image where its box is given.

    period : side of the box along each axis, m; None in an open world
    """

    def __init__(self, position: NDArray[Any], period: tuple[float, float, float] | None = None):
        self.position = np.asarray(position, float)
        self.period = None
        if period is not None:
            box = np.array([side if side > 0.0 else 1e9 for side in period])
            self.period = box
            self._tree = cKDTree(np.mod(self.position + 0.5 * box, box), boxsize=box)
        else:
            self._tree = cKDTree(self.position)

    def nearest(self) -> float:
        """Smallest distance of two agents, m; nan of one agent."""
        if len(self.position) < 2:
            return math.nan
        far, _ = self._tree.query(self._tree.data, k=2)
        return float(far[:, 1].min())

    def within(self, distance: float) -> NDArray[np.intp]:
        """Pairs (pair, 2) nearer than a distance, m."""
        return np.asarray(self._tree.query_pairs(distance, output_type="ndarray"), np.intp)

    def neighbours(self, count: int = 3) -> NDArray[Any]:
        """Segments (segment, 2, 3) from each agent to its nearest others; none through a periodic face."""
        count = min(count, len(self.position) - 1, max(1, MOST_LINKS // max(len(self.position), 1)))
        if count < 1:
            return np.zeros((0, 2, 3))
        _, other = self._tree.query(self._tree.data, k=count + 1)
        ends = self.position[other[:, 1:]].reshape(-1, 3)
        found = np.stack([np.repeat(self.position, count, axis=0), ends], 1)
        return found if self.period is None else unwrapped(found, self.period)


def unwrapped(segments: NDArray[Any], period: NDArray[Any]) -> NDArray[Any]:
    """Segments without those that cross a periodic face."""
    long = (np.abs(segments[:, 1] - segments[:, 0]) > 0.5 * period).any(axis=1)
    return np.asarray(segments[~long])


def period_of(scenario: Any) -> tuple[float, float, float] | None:
    """Sides of a periodic world, m; None of any other."""
    world = scenario.world
    if world.edges != "periodic":
        return None
    return (world.side, world.side, world.height if scenario.dimensions == 3 else 0.0)


class Measures:
    """What the charts show: instants, and the course of one order parameter of the present window."""

    def __init__(self) -> None:
        self.instants: deque[Instant] = deque(maxlen=KEPT)
        self.course: deque[tuple[float, float]] = deque(maxlen=KEPT)
        self.name = ""

    def clear(self) -> None:
        """Forget everything: another flight, or an earlier moment of this one."""
        self.instants.clear()
        self.course.clear()

    def note(self, flight: Flight, velocity: NDArray[Any], pairs: Pairs) -> dict[str, Any]:
        """Add the present moment; returns the scores of the present window."""
        speed = np.sqrt((velocity**2).sum(1))
        self.instants.append(
            Instant(flight.time, float(speed.mean()), float(speed.min()), float(speed.max()), pairs.nearest())
        )
        scores = flight.scores()
        value = scores.get(self.name)
        if isinstance(value, (int, float)) and math.isfinite(value):
            self.course.append((flight.time, float(value)))
        return scores


def chosen_score(names: Mapping[str, Any], published: Mapping[str, Any]) -> str:
    """The order parameter shown first: one that the paper reports, if there is any."""
    for name in ("phi_corr", "fitness", "f_corr", "polarisation"):
        if name in names and (name in published or not published):
            return name
    return next((name for name in names if name in published), next(iter(names), ""))


def score_table(flight: Flight, scores: Mapping[str, Any]) -> str:
    """Order parameters of this window, of the window before, and of the paper, as HTML."""
    about, published = reports(flight.scenario.measures), flight.scenario.published
    before = flight.windows[-1].scores if flight.windows else {}
    heads = ["", "now", *(["before"] if before else []), *(["paper"] if published else [])]
    rows = ["<tr>" + "".join(f"<th style='text-align:right'>{head}</th>" for head in heads) + "</tr>"]
    for name, value in scores.items():
        if not isinstance(value, (int, float)):
            continue
        unit, meaning = about.get(name, ("", ""))
        cells = [_number(value), *([_number(before.get(name))] if before else [])]
        if published:
            mean, spread = published.get(name, (None, None))
            cells.append(_number(mean) + (f" ± {spread:.2g}" if spread is not None else ""))
        title = f"{name} ({unit})" if unit else name
        body = "".join(f"<td style='text-align:right;padding-left:0.8em'>{cell}</td>" for cell in cells)
        rows.append(f"<tr title='{meaning}'><td>{title}</td>{body}</tr>")
    begin = flight.windows[-1].end if flight.windows else 0.0
    table = f"<table style='font-size:0.8em;font-variant-numeric:tabular-nums'>{''.join(rows)}</table>"
    return f"<div style='padding:0 0.75em'><small>since t = {begin:.3g} s</small>{table}</div>"


def _number(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, (int, float)) and math.isfinite(value) else "–"
