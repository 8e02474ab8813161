"""Shades: one value of every agent at one moment, the colours that stand for it, and the key that says so."""

import html
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.core import Quantity, declarations
from airflock.scenarios import LETTERS, Scenario
from airflock.view.stage import colours

NUMBERS, HEADING, CATEGORIES, IDENTITIES = "scale", "turn", "names", "marks"
MOTION_COLOURINGS = ("speed", "heading", "height")  # what the motion alone tells
GOLDEN_TURN = 0.6180339887  # of a turn between two marks: neighbouring numbers look unlike
NO_VALUE_COLOUR = (150, 150, 150)  # of -1: none of the names, alone
COLOURING_NOTES = {"agent": "each agent has a colour of its own", "cluster": "a colour for each cluster"}


class AgentColours(NamedTuple):
    """One value of every agent.

    name   : what it is
    kind   : scale, from `low` to `high` in `unit`; turn, shares of a full turn; names, numbers of `names`;
             marks, whole numbers that only tell agents apart. Names and marks: -1 for none
    values : (agent,)
    told   : what the key says beside it
    """

    name: str
    kind: str
    values: NDArray[Any]
    low: float = 0.0
    high: float = 1.0
    unit: str = ""
    names: tuple[str, ...] = ()
    told: str = ""

    @property
    def colours(self) -> NDArray[np.uint8]:
        """Colours (agent, 3); grey where there is no value."""
        values = np.asarray(self.values, float)
        known = np.isfinite(values) & ((values >= 0.0) | (self.kind in (NUMBERS, HEADING)))
        whole = np.where(known, values, 0.0)
        if self.kind == NUMBERS:
            tones = colours.ramp_colours((whole - self.low) / max(self.high - self.low, 1e-9))
        elif self.kind == CATEGORIES:
            tones = category_colours(len(self.names))[whole.astype(int)]
        else:
            tones = colours.wheel_colours(whole if self.kind == HEADING else whole * GOLDEN_TURN)
        tones[~known] = NO_VALUE_COLOUR
        return tones

    @property
    def key(self) -> str:
        """The key to the colours, as HTML."""
        if self.kind == IDENTITIES:
            words = COLOURING_NOTES.get(self.name, self.name)
            return _small_print_html(", ".join(part for part in (words, self.told) if part))
        if self.kind == CATEGORIES:
            chips = [
                _colour_chip_html(tone, name)
                for tone, name in zip(category_colours(len(self.names)), self.names, strict=True)
            ]
            return _small_print_html(
                " ".join(
                    [f"{html.escape(self.name)}:", *chips, _colour_chip_html(NO_VALUE_COLOUR, self.told or "none")]
                )
            )
        if self.kind == HEADING:
            sample, left, right = colours.wheel_colours(np.linspace(0.0, 1.0, 25)), "east", "north, west, south, east"
        else:
            sample = colours.ramp_colours(np.linspace(0.0, 1.0, 17))
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
    """Speed (0 to `top` m/s), heading, or height (between two, m) of agents: (agent, 3), m and m/s."""
    if name == "heading":
        return AgentColours(name, HEADING, np.arctan2(velocity[:, 1], velocity[:, 0]) / (2.0 * np.pi))
    if name == "height":
        return AgentColours(name, NUMBERS, position[:, 2], *height_range, "m")
    return AgentColours("speed", NUMBERS, np.sqrt((velocity**2).sum(1)), 0.0, max_speed, "m/s")


def number_colours(name: str, values: NDArray[Any], unit: str = "") -> AgentColours:
    """Any number of agents, on a scale over all values at hand."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    return AgentColours(name, NUMBERS, values, low, high, unit)


def individual_colours(count: int) -> AgentColours:
    """A colour for each agent."""
    return AgentColours("agent", IDENTITIES, np.arange(count))


def group_colours(groups: Sequence[Any], count: int) -> AgentColours:
    """To which group of a scenario each of `count` agents belongs."""
    values = np.full(count, -1)
    for number, group in enumerate(groups):
        values[list(group.agents)] = number
    return AgentColours("group", CATEGORIES, values, names=tuple(group.name for group in groups))


def fault_colours(
    faults: Sequence[Mapping[str, Any]], time: float, count: int, kinds: Sequence[str] = ()
) -> AgentColours:
    """Which kind of fault is at work in each of `count` agents at a time, s; of several, that which began last.

    faults : kind, agent, begin and end, s (None: never); kinds : names in the order of the key, if they are known
    """
    names = tuple(kinds) or tuple(dict.fromkeys(str(fault["kind"]) for fault in faults))
    values = np.full(count, -1)
    for fault in sorted(faults, key=lambda fault: float(fault["begin"])):
        over = fault["end"] is not None and time >= float(fault["end"])
        if float(fault["begin"]) <= time and not over and 0 <= int(fault["agent"]) < count:
            values[int(fault["agent"])] = names.index(str(fault["kind"]))
    return AgentColours("fault", CATEGORIES, values, names=names, told="sound")


def varied_number_units(scenario: Scenario) -> dict[str, str]:
    """Numbers of law and body that differ among agents, such as model.v_flock, with their units."""
    found = {}
    records = {"model": scenario.parameters, "body": scenario.body, "sensors": scenario.sensors}
    for section, record in records.items():
        for name, declared, _ in declarations(record):
            if (LETTERS[section], name) in scenario.varied and isinstance(declared, Quantity):
                found[f"{section}.{name}"] = "" if declared.unit == "1" else declared.unit
    return found


def varied_colours(scenario: Scenario, key: str, seed: int) -> AgentColours:
    """A number that differs among agents, such as model.v_flock, as it is drawn with a seed."""
    section, _, name = key.partition(".")
    return number_colours(
        key, np.array(scenario.agent_values(LETTERS[section], name, seed)), varied_number_units(scenario)[key]
    )


def cluster_colours(least: NDArray[Any]) -> AgentColours:
    """Clusters as `view.stage.clusters` names them."""
    known, sizes = np.unique(least[least >= 0], return_counts=True)
    most = f", the largest of {sizes.max()}" if len(known) else ""
    return AgentColours("cluster", IDENTITIES, least, told=f"{len(known)} of two and more{most}, grey: alone")


def category_colours(count: int) -> NDArray[np.uint8]:
    """Colours (count, 3) of names: those that colour-blind readers tell apart, then others."""
    own = np.array(colours.CATEGORY_COLOURS, np.uint8)[:count]
    return np.vstack([own, colours.wheel_colours(np.arange(len(own), count) * GOLDEN_TURN)]).astype(np.uint8)


def _small_print_html(text: str) -> str:
    return f"<div style='padding:0 0.75em'><small>{text}</small></div>"


def _colour_chip_html(tone: Any, name: str) -> str:
    return (
        f"<span style='white-space:nowrap'><span style='color:{_hex_colour(tone)}'>●</span> {html.escape(name)}</span>"
    )


def _hex_colour(tone: Any) -> str:
    red, green, blue = (int(part) for part in tone)
    return f"#{red:02x}{green:02x}{blue:02x}"
