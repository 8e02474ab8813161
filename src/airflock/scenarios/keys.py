"""Every key that a scenario file may hold, from the declarations of its parameters."""

from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any, NamedTuple

from airflock.body.registry import BODIES
from airflock.core import fault
from airflock.core.parameters import Choice, Points, Quantity, Text, declarations, number_names, with_unit
from airflock.core.radio import Packets
from airflock.errors import ScenarioError
from airflock.radios.registry import RADIOS
from airflock.scenarios import groups
from airflock.scenarios.laws import MODELS, find_model
from airflock.scenarios.sections import SECTIONS, Flight
from airflock.sensors.registry import SENSORS

TOP = "top"  # the keys before the first section
LISTS = {"groups": groups.KEYS, "faults": fault.KEYS}


class Key(NamedTuple):
    """One key of a scenario file.

    name    : as it is written after --set, for instance "radio.delay"
    of      : the model, body, sensor or radio that the key belongs to; "" where it is always there
    kind    : "number", "choice", "points" or "text"
    default : None means "derived from the rest of the scenario"
    unit    : SI unit; "1" for a plain number, "" for what has none
    low, high : allowed range of a number, both ends included; None otherwise
    options : what a choice may be
    """

    name: str
    of: str
    kind: str
    default: Any
    unit: str
    low: float | None
    high: float | None
    options: tuple[str, ...]
    meaning: str
    source: str

    @property
    def standard(self) -> str:
        """The default, for a person to read; a dash where it comes from the rest of the scenario."""
        if self.default is None or self.default in ((), ""):
            return "–"
        return with_unit(f"{self.default:g}", self.unit) if self.kind == "number" else str(self.default)

    @property
    def allowed(self) -> str:
        """What the key may be, for a person to read."""
        if self.kind == "number":
            return with_unit(f"{self.low:g} … {self.high:g}", self.unit)
        return " | ".join(self.options) if self.options else self.kind


def records() -> dict[str, type]:
    """Section → record of its parameters: the top, every model, body, sensor and radio by its name, other sections."""
    result: dict[str, type] = {TOP: Flight}
    result |= {name: find_model(name).Parameters for name in MODELS}
    result |= {name: body.Parameters for name, body in BODIES.items()}
    result |= {name: sensor.Parameters for name, sensor in SENSORS.items()}
    result |= {name: radio.Parameters for name, radio in RADIOS.items() if radio.Parameters is not SECTIONS["radio"]}
    return result | {name: record for name, record in SECTIONS.items() if name not in ("body", "sensors")}


def about(section: str) -> str:
    """First sentence of what a section's record says about itself."""
    text = (records()[section].__doc__ or "").strip().split("\n\n")[0]
    return " ".join(text.split())


def keys(section: str | None = None) -> list[Key]:
    """Every key of a scenario file: what it means, its unit, range, default and source.

    Parameters
    ----------
    section : str, optional
        A section ("radio"), "model", "body" or "sensors" for all models, bodies or sensors, one of them by its name
        ("couzin_2002", "multirotor", "gnss"), "top" for the keys before the first section, or a key ("radio.delay",
        "delay"). By default all.

    Returns
    -------
    list of Key
        In the order of the declarations.

    Raises
    ------
    ScenarioError
        If there is no such section or key; names the nearest one.

    Examples
    --------
    >>> import airflock
    >>> delay, = airflock.keys("radio.delay")
    >>> delay.default, delay.unit, delay.low, delay.high
    (1.0, 's', 0.0, 30.0)
    >>> [key.name for key in airflock.keys("vicsek_1995")]
    ['model.r', 'model.eta']
    """
    known = records()
    every = [key for name, record in known.items() for key in _of(name, record) if not _of_all(key, name)]
    if section is None:
        return every
    if section in known:
        return list(_of(section, known[section]))
    found = [key for key in every if section in (key.name, key.name.rpartition(".")[2], key.name.partition(".")[0])]
    if section in LISTS:
        raise ScenarioError([f"{section}: a list of tables [[{section}]], with the keys {', '.join(LISTS[section])}"])
    if not found:
        words = {key.name: key.name for key in every} | {key.name.rpartition(".")[2]: key.name for key in every}
        words |= {name: name for name in (*known, "model", "body", "sensors")}
        near = get_close_matches(section, words, n=1, cutoff=0.5)
        hint = f"did you mean {words[near[0]]}?" if near else f"sections: model, body, sensors, {', '.join(known)}"
        raise ScenarioError([f"{section}: unknown section or key; {hint}"])
    return found


def _of_all(key: Key, section: str) -> bool:
    """Whether a key of a kind of radio is one that all radios have, which the section tells already."""
    return section in RADIOS and key.name.partition(".")[2] in number_names(Packets)


def _of(section: str, record: type) -> Sequence[Key]:
    """Keys of one record."""
    owners = {**dict.fromkeys(MODELS, "model"), **dict.fromkeys(BODIES, "body"), **dict.fromkeys(SENSORS, "sensors")}
    owners |= dict.fromkeys(RADIOS, "radio")
    before = "" if section == TOP else owners.get(section, section)
    owner = section if section in owners else ""
    found = []
    for name, declared, default in declarations(record):
        whole = f"{before}.{name}".lstrip(".")
        unit, low, high = getattr(declared, "unit", ""), None, None
        options: tuple[str, ...] = ()
        if isinstance(declared, Quantity):
            kind, low, high = "number", declared.low, declared.high
        elif isinstance(declared, Choice):
            kind, options = "choice", declared.options
        else:
            kind = "points" if isinstance(declared, Points) else "text"
            assert isinstance(declared, (Points, Text))
        meaning, source = declared.meaning, declared.source
        found.append(Key(whole, owner, kind, default, unit, low, high, options, meaning, source))
    return found
