"""Colours of agents: one value of every agent at one moment, the colours that stand for it, and the key that
explains them.
"""

import html
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from airflock.core import Quantity, declarations
from airflock.scenarios import LETTERS, Scenario

# viridis of matplotlib (van der Walt and Smith 2015, CC0), nine of its colours, without the yellow
# end
RAMP_STOPS = np.array(
    [[68, 1, 84], [72, 40, 120], [62, 74, 137], [49, 104, 142], [38, 130, 142], [31, 158, 137], [53, 183, 121],
     [109, 205, 89], [180, 222, 44]], float,
)  # fmt: skip
# round the compass: blue north, orange south, with the lightness of a cyclic map
WHEEL_STOPS = np.array(
    [[213, 94, 0], [230, 159, 0], [86, 180, 233], [0, 114, 178], [120, 94, 240], [204, 121, 167]], float
)
COLLISION_COLOUR = (213, 0, 50)
SELECTED_COLOUR = (255, 140, 0)
AXIS_COLOUR = "#555555"
BLUE, RED, GREEN = (0, 114, 178), (213, 94, 0), (0, 158, 115)
ORANGE, PURPLE, SKY = (230, 159, 0), (204, 121, 167), (86, 180, 233)  # Okabe and Ito 2008
CATEGORY_COLOURS = (BLUE, GREEN, PURPLE, SKY, (120, 94, 240), RED, ORANGE)  # of names, in this order
TERM_COLOURS = (GREEN, SKY, PURPLE, BLUE, (120, 94, 240), (120, 120, 120))
LINE_STYLES = {
    "links": ((170, 180, 195), 1.0),
    "heard": (ORANGE, 2.0),
    "ghosts": (PURPLE, 3.0),
    "measured": (BLUE, 3.0),
    "command": (RED, 4.0),
    "terms": (GREEN, 3.0),
    "rays": ((150, 150, 150), 1.0),
    "wake": (SKY, 1.5),
}  # kinds of lines about agents: colour, width in pixels


def ramp_colours(share: NDArray[Any]) -> NDArray[np.uint8]:
    """Return the colours (n, 3) of values from 0 to 1."""
    return _interpolated(RAMP_STOPS, np.clip(share, 0.0, 1.0) * (len(RAMP_STOPS) - 1))


def wheel_colours(share: NDArray[Any]) -> NDArray[np.uint8]:
    """Return the colours (n, 3) of fractions of a full turn."""
    closed = np.vstack([WHEEL_STOPS, WHEEL_STOPS[:1]])
    return _interpolated(closed, np.mod(share, 1.0) * len(WHEEL_STOPS))


def _interpolated(table: NDArray[Any], position: NDArray[Any]) -> NDArray[np.uint8]:
    first = np.minimum(position.astype(int), len(table) - 2)
    part = (position - first)[:, None]
    return np.asarray(np.round(table[first] * (1.0 - part) + table[first + 1] * part), np.uint8)


FIRST_LINKS = 9  # nearest agents that are linked first: in a dense flock they join nearly everybody


def cluster_labels(position: NDArray[Any], distance: float, period: NDArray[Any] | None = None) -> NDArray[np.intp]:
    """Return the smallest agent number in the cluster of each agent, or -1 for a lone agent: (agent,).

    position : (agent, axis), m; distance : m, links are shorter; box : sides of a periodic world, m
    """
    points = np.asarray(position, float)
    count = len(points)
    if count < 2 or not distance > 0.0:
        return np.full(count, -1, np.intp)
    tree = cKDTree(points if period is None else np.mod(points + 0.5 * period, period), boxsize=period)
    # A few nearest links join almost the whole flock at the cost of one query; all pairs within the
    # distance would grow with the square of a dense flock.
    apart, other = tree.query(tree.data, k=min(FIRST_LINKS, count), distance_upper_bound=distance)
    near = np.isfinite(apart) & (np.arange(count)[:, None] != other)
    label = _component_labels(np.nonzero(near)[0], other[near], count)
    rest = np.flatnonzero(label != np.bincount(label).argmax())
    if len(rest):  # whatever joins two clusters has an end outside the largest
        # cKDTree includes pairs at exactly this distance; the metric of clusters excludes them.
        far = np.nextafter(distance, 0.0)
        links = cKDTree(tree.data[rest], boxsize=period).sparse_distance_matrix(tree, far, output_type="coo_matrix")
        first = np.concatenate([np.nonzero(near)[0], rest[links.row]])
        label = _component_labels(first, np.concatenate([other[near], links.col]), count)
    least = np.full(label.max() + 1, count, np.intp)
    # Labels are renamed to the smallest agent number, so that a cluster keeps its colour from frame
    # to frame.
    np.minimum.at(least, label, np.arange(count))
    return np.where(np.bincount(label)[label] > 1, least[label], -1)


def _component_labels(first: NDArray[Any], second: NDArray[Any], count: int) -> NDArray[np.intp]:
    """Return the labels (agent,) of the components that links between agents join."""
    links = coo_array((np.ones(len(first), np.int8), (first, second)), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], np.intp)


def cluster_distance(scenario: Any) -> float:
    """Return the distance within which two agents belong to one cluster, m; nan where no rule of the scenario
    gives one.
    """
    return float(scenario.resolved_metrics().r_cluster or math.nan)


NUMBERS, HEADING, CATEGORIES, IDENTITIES = "scale", "turn", "names", "marks"
MOTION_COLOURINGS = ("speed", "heading", "height")  # from the motion alone
GOLDEN_TURN = 0.6180339887  # of a turn between two marks: neighbouring numbers look unlike
NO_VALUE_COLOUR = (150, 150, 150)  # of -1: none of the names, alone
COLOURING_NOTES = {"agent": "each agent has a colour of its own", "cluster": "a colour for each cluster"}


class AgentColours(NamedTuple):
    """One value of every agent.

    name   : what it is
    kind   : scale, from `low` to `high` in `unit`; turn, shares of a full turn; names, numbers of
             `names`; marks, whole numbers without an order. Names and marks: -1 for none
    values : (agent,)
    note   : text beside the key
    """

    name: str
    kind: str
    values: NDArray[Any]
    low: float = 0.0
    high: float = 1.0
    unit: str = ""
    names: tuple[str, ...] = ()
    note: str = ""

    @property
    def colours(self) -> NDArray[np.uint8]:
        """Return the colours (agent, 3); grey where there is no value."""
        values = np.asarray(self.values, float)
        # Only numbers and headings may be negative; elsewhere -1 stands for no value.
        known = np.isfinite(values) & ((values >= 0.0) | (self.kind in (NUMBERS, HEADING)))
        whole = np.where(known, values, 0.0)
        if self.kind == NUMBERS:
            tones = ramp_colours((whole - self.low) / max(self.high - self.low, 1e-9))
        elif self.kind == CATEGORIES:
            tones = category_colours(max(len(self.names), 1))[whole.astype(int)]  # of no names all have none
        else:
            tones = wheel_colours(whole if self.kind == HEADING else whole * GOLDEN_TURN)
        tones[~known] = NO_VALUE_COLOUR
        return tones

    @property
    def key(self) -> str:
        """Return the key to the colours, as HTML."""
        if self.kind == IDENTITIES:
            words = COLOURING_NOTES.get(self.name, self.name)
            return _small_print_html(", ".join(part for part in (words, self.note) if part))
        if self.kind == CATEGORIES:
            chips = [
                _colour_chip_html(tone, name)
                for tone, name in zip(category_colours(len(self.names)), self.names, strict=True)
            ]
            return _small_print_html(
                " ".join(
                    [f"{html.escape(self.name)}:", *chips, _colour_chip_html(NO_VALUE_COLOUR, self.note or "none")]
                )
            )
        if self.kind == HEADING:
            sample, left, right = wheel_colours(np.linspace(0.0, 1.0, 25)), "east", "north, west, south, east"
        else:
            sample = ramp_colours(np.linspace(0.0, 1.0, 17))
            left, right = f"{self.low:.3g}", f"{self.high:.3g} {self.unit}".strip()
        bands = ", ".join(map(_hex_colour, sample.tolist()))
        return (
            f'<div style="padding:0 0.75em"><div style="height:0.7em;border-radius:3px;'
            f'background:linear-gradient(to right, {bands})"></div><div '
            'style="display:flex;justify-content:space-between;font-size:0.75em">'
            f"<span>{left}</span><span>{html.escape(self.name)}</span><span>{html.escape(right)}</span></div></div>"
        )


def motion_colours(
    name: str, position: NDArray[Any], velocity: NDArray[Any], max_speed: float, height_range: tuple[float, float]
) -> AgentColours:
    """Colour by speed (0 to `top` m/s), heading, or height (between two, m): (agent, 3), m and m/s."""
    if name == "heading":
        return AgentColours(name, HEADING, np.arctan2(velocity[:, 1], velocity[:, 0]) / (2.0 * np.pi))
    if name == "height":
        return AgentColours(name, NUMBERS, position[:, 2], *height_range, "m")
    return AgentColours("speed", NUMBERS, np.sqrt((velocity**2).sum(1)), 0.0, max_speed, "m/s")


def number_colours(name: str, values: NDArray[Any], unit: str = "") -> AgentColours:
    """Colour by a number, on a scale over all its values."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    return AgentColours(name, NUMBERS, values, low, high, unit)


def individual_colours(count: int) -> AgentColours:
    """Give each agent its own colour."""
    return AgentColours("agent", IDENTITIES, np.arange(count))


def group_colours(groups: Sequence[Any], count: int) -> AgentColours:
    """Colour `count` agents by their group of a scenario."""
    values = np.full(count, -1)
    for number, group in enumerate(groups):
        values[list(group.agents)] = number
    return AgentColours("group", CATEGORIES, values, names=tuple(group.name for group in groups))


def fault_colours(
    faults: Sequence[Mapping[str, Any]], time: float, count: int, kinds: Sequence[str] = ()
) -> AgentColours:
    """Colour `count` agents by the fault that is active at a time, s; of several, by the one that began last.

    faults : kind, agent, begin and end, s (None: never); kinds : names in the order of the key, if
             they are known
    """
    names = tuple(kinds) or tuple(dict.fromkeys(str(fault["kind"]) for fault in faults))
    values = np.full(count, -1)
    for fault in sorted(faults, key=lambda fault: float(fault["begin"])):
        over = fault["end"] is not None and time >= float(fault["end"])
        if float(fault["begin"]) <= time and not over and 0 <= int(fault["agent"]) < count:
            values[int(fault["agent"])] = names.index(str(fault["kind"]))
    return AgentColours("fault", CATEGORIES, values, names=names, note="sound")


def varied_number_units(scenario: Scenario) -> dict[str, str]:
    """Return the units of the numbers of law and body that differ among agents, such as model.v_flock."""
    units = {}
    records = {"model": scenario.parameters, "body": scenario.body.numbers, "sensors": scenario.sensors.numbers}
    for section, record in records.items():
        for name, declared, _ in declarations(record):
            if (LETTERS[section], name) in scenario.varied and isinstance(declared, Quantity):
                units[f"{section}.{name}"] = "" if declared.unit == "1" else declared.unit
    return units


def varied_colours(scenario: Scenario, key: str, seed: int) -> AgentColours:
    """Colour by a number that differs among agents, such as model.v_flock, drawn with a seed."""
    section, _, name = key.partition(".")
    return number_colours(
        key, np.array(scenario.agent_values(LETTERS[section], name, seed)), varied_number_units(scenario)[key]
    )


def cluster_colours(least: NDArray[Any]) -> AgentColours:
    """Colour by the clusters that `cluster_labels` returns."""
    known, sizes = np.unique(least[least >= 0], return_counts=True)
    most = f", the largest of {sizes.max()}" if len(known) else ""
    return AgentColours("cluster", IDENTITIES, least, note=f"{len(known)} of two and more{most}, grey: alone")


def category_colours(count: int) -> NDArray[np.uint8]:
    """Return colours (count, 3) for names: first those that colour-blind readers can separate, then others."""
    own = np.array(CATEGORY_COLOURS, np.uint8)[:count]
    return np.vstack([own, wheel_colours(np.arange(len(own), count) * GOLDEN_TURN)]).astype(np.uint8)


def _small_print_html(text: str) -> str:
    return f"<div style='padding:0 0.75em'><small>{text}</small></div>"


def _colour_chip_html(tone: Any, name: str) -> str:
    return (
        f"<span style='white-space:nowrap'><span style='color:{_hex_colour(tone)}'>●</span> {html.escape(name)}</span>"
    )


def _hex_colour(tone: Any) -> str:
    red, green, blue = (int(part) for part in tone)
    return f"#{red:02x}{green:02x}{blue:02x}"
