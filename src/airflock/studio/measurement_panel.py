"""Measurement panel: charts of order parameters, speeds and distances, histograms, scores, and comparison of two
flights.
"""

import html
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from airflock.studio import page_measures as measures
from airflock.studio.page_measures import difference_table_html, score_table_html
from airflock.studio.page_panels import PagePanel, small_print_html
from airflock.studio.page_scene import PANE_NAMES

if TYPE_CHECKING:
    from airflock.studio.flight_page import FlightPage

# ---- Charts

BAND_NAMES = ("paper +", "paper −")


class MeasurementPanel(PagePanel):
    """Charts of one pane, or of two in one picture."""

    def __init__(self, page: "FlightPage", tab: Any):
        super().__init__(page)
        self.tab = tab
        self._charts: list[Any] = []
        self._score_names: list[str] = []
        self.scores: list[dict[str, Any]] = []
        self.name = ""  # of the order parameter that is drawn

    def rebuild(self) -> None:
        """Start again, for as many panes as there are."""
        player = self.player
        scores = player.sides[0].flight.scores()
        self._score_names = [name for name, value in scores.items() if isinstance(value, (int, float))]
        if self.name not in self._score_names:
            self.name = measures.default_score(dict.fromkeys(self._score_names), player.sides[0].scenario.published)
        self.sides = []
        for side, flock in zip(player.sides, self.scene.flocks, strict=True):
            far = float(side.scenario.resolved_metrics().r_cluster or 1.0)
            apart = flock.pairs.apart()
            far = min(far, 4.0 * float(np.median(apart))) if len(apart) else far
            self.sides.append(measures.PaneChartData(self.scene.top, max(far, 1e-6)))
            self.sides[-1].name = self.name
        self._make_charts()

    def _make_charts(self) -> None:
        """Make menu, charts and table."""
        panel, player = self.widgets, self.player
        for chart in self._charts:
            chart.remove()
        two, names = len(player.sides) > 1, self._score_names
        banded = self.name in player.sides[0].scenario.published
        tags = [f" {name}" for name in PANE_NAMES] if two else [""]
        with self.tab:
            self.score_menu = panel.add_menu(
                "order parameter", names, self.name, lambda n: player.ask(lambda: self._choose(n))
            )
            self.score_chart = panel.add_chart(
                "since the last change", [*(f"value{t}" for t in tags), *(BAND_NAMES if banded else ())], band=banded
            )
            words = ("mean", "slowest", "fastest")
            self.speed_chart = panel.add_chart(
                "speed (m/s)", [f"{w}{t}" for t in tags for w in (words[:1] if two else words)]
            )
            self.nearest = panel.add_chart("smallest distance (m)", [f"nearest pair{t}" for t in tags])
            self.speed_histogram_chart = panel.add_chart(
                "speeds since the last change", [f"share{t}" for t in tags], across="m/s"
            )
            self.distance_histogram_chart = panel.add_chart(
                "distance to the nearest", [f"share{t}" for t in tags], across="m"
            )
            self.table = panel.text()
        self._charts = [
            self.score_menu,
            self.score_chart,
            self.speed_chart,
            self.nearest,
            self.speed_histogram_chart,
            self.distance_histogram_chart,
            self.table,
        ]

    def _choose(self, name: str) -> None:
        """Draw another order parameter from now on; with a band only where the paper reports its value."""
        self.name = name
        for side in self.sides:
            side.name = name
            side.score_course.clear()
        self._make_charts()

    def clear(self) -> None:
        """Clear the charts: the flight is at another time."""
        for side in self.sides:
            side.clear()

    def refresh(self) -> None:
        """Add the present moment and draw everything."""
        flocks, two = self.scene.flocks, len(self.sides) > 1
        for side in self.sides:
            if side.speed_histogram.edges[-1] < self.scene.top:
                side.speed_histogram = measures.Histogram(self.scene.top)
        flights = [flock.side.flight for flock in flocks]
        self.scores = [
            side.note(flock.side.flight, flock.velocity, flock.pairs)
            for side, flock in zip(self.sides, flocks, strict=True)
        ]
        instants = [np.array(side.instants) for side in self.sides]
        count = min(map(len, instants))
        parts = [part[len(part) - count :] for part in instants]
        columns = (1,) if two else (1, 2, 3)
        time = np.ascontiguousarray(parts[0][:, 0])
        self.speed_chart.data = time, *(np.ascontiguousarray(part[:, c]) for part in parts for c in columns)
        self.nearest.data = time, *(np.ascontiguousarray(part[:, 4]) for part in parts)
        self._draw_course()
        for chart, shares in (
            (self.speed_histogram_chart, [side.speed_histogram.steps for side in self.sides]),
            (self.distance_histogram_chart, [side.distance_histogram.steps for side in self.sides]),
        ):
            chart.data = _joined_outlines(shares)
        self.table.content = score_table_html(flights, self.scores)

    def _draw_course(self) -> None:
        courses = [np.array(side.score_course).reshape(-1, 2) for side in self.sides]
        longest = max(courses, key=len)
        if not len(longest):
            return
        time = longest[:, 0].copy()
        values = [
            np.interp(time, course[:, 0], course[:, 1], left=math.nan) if len(course) else np.full(len(time), math.nan)
            for course in courses
        ]
        published = self.player.sides[0].scenario.published
        edges = []
        if self.name in published:
            mean, spread = published[self.name]
            edges = [np.full(len(time), mean + sign * (spread or 0.0)) for sign in (1.0, -1.0)]
        self.score_chart.data = time, *values, *edges


def _joined_outlines(outlines: list[Any]) -> tuple[Any, ...]:
    """Return outlines of histograms over one axis: values and the share of each at them."""
    if len(outlines) == 1:
        return tuple(outlines[0])
    values = np.union1d(outlines[0][0], outlines[1][0])
    both = np.repeat(values, 2)[1:-1]
    middle = 0.5 * (both[::2] + both[1::2])
    found = []
    for edges, shares in outlines:
        place = np.searchsorted(edges[::2], middle, side="right") - 1
        inside = middle <= edges[-1]
        found.append(np.repeat(np.where(inside, shares[::2][np.clip(place, 0, len(shares) // 2 - 1)], 0.0), 2))
    return both, *found


# ---- Comparison

NO_COMPARISON_TEXT = (
    "“Fork here” starts a second flight beside this one, from now on and with the same noise. The controls then act "
    "on B: they differ only in what you change."
)


class ComparisonPanel(PagePanel):
    """Controls to fork, to choose the active pane, and to read the differences."""

    def __init__(self, page: "FlightPage", tab: Any):
        super().__init__(page)
        self.tab = tab
        self.widgets.row({"Fork here": self.ask(self._fork), "End comparison": self.ask(self._end_comparison)})
        self.text = self.widgets.text()
        self._pane_menu: Any = None

    def _fork(self) -> None:
        collisions, hand = self.scene.collisions, self.player.hand
        self.player.fork()
        collisions.join(hand)
        collisions.fork()
        self.page.rebuild()

    def _end_comparison(self) -> None:
        hand = self.player.hand
        self.player.join()
        self.scene.collisions.join(hand)
        self.page.rebuild()

    def _ask_for_pane(self, name: str) -> None:
        self.player.ask(lambda: self._taken(PANE_NAMES.index(name)))

    def _taken(self, index: int) -> None:
        self.player.hand = min(index, len(self.player.sides) - 1)
        self.page.tuning.rebuild()

    def rebuild(self) -> None:
        """Show a menu of the active pane, if there are two."""
        if self._pane_menu is not None:
            self._pane_menu.remove()
            self._pane_menu = None
        if len(self.player.sides) > 1:
            with self.tab:
                self._pane_menu = self.widgets.add_menu(
                    "controls act on", tuple(PANE_NAMES), PANE_NAMES[self.player.hand], self._ask_for_pane
                )

    def refresh(self) -> None:
        """Show one table of the differences: parameters and order parameters."""
        sides = self.player.sides
        if len(sides) < 2:
            self.text.content = small_print_html(NO_COMPARISON_TEXT)
            return
        first, second = (side.origin for side in sides)
        other = second.beside(first) if second is not first else "forked from A"
        names = [f"<b>A</b> {html.escape(first.where)}", f"<b>B</b> {html.escape(other)}"]
        same = difference_table_html(sides[0].scenario, sides[1].scenario)
        scores = score_table_html([side.flight for side in sides], self.page.measurement.scores)
        self.text.content = small_print_html("<br>".join(names)) + same + scores
