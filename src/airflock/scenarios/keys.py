"""Every key that a scenario file may hold, from the declarations of its parameters.

Keys that no record declares (names, lists and tables that are read as a whole) stand at the end, in
`UNDECLARED_KEYS`.
"""

from collections.abc import Mapping
from difflib import get_close_matches
from functools import cache
from typing import Any, NamedTuple

from airflock.core import Choice, PacketParameters, Points, Quantity, Text, declarations, format_with_unit, number_names
from airflock.parts import BODIES, FAULTS as KINDS, RADIOS, SENSORS
from airflock.scenarios.fault_entries import FaultTiming
from airflock.scenarios.named_code import MODELS, find_law
from airflock.scenarios.sections import SECTIONS, Flight
from airflock.support import ScenarioError

TOP = "top"  # the keys before the first section
FAMILIES = {"model": MODELS, "body": BODIES, "sensors": SENSORS, "faults": KINDS}  # sections with records by kind
OF_ALL = number_names(PacketParameters)  # keys of every radio: the section [radio] lists them
OTHER_RADIOS = {name: radio for name, radio in RADIOS.items() if radio.Parameters is not SECTIONS["radio"]}


class Key(NamedTuple):
    """One key of a scenario file.

    name    : as it is written after --set, for instance "radio.delay"; keys of an entry of [[faults]] or [[groups]]
        follow the name of the list
    of      : the model, body, sensor, radio or kind of fault that the key belongs to; "" where it is always there
    kind    : "number", "choice", "points", "text", "list" or "table"
    default : None means "derived from the rest of the scenario", or that there is none
    unit    : SI unit; "1" for a plain number, "" for a key without one
    low, high : allowed range of a number, both ends included; None otherwise
    options : values of a choice
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
        """The default, for a person to read; a dash where it follows from the scenario."""
        if self.default is None or self.default in ((), ""):
            return "–"
        return format_with_unit(f"{self.default:g}", self.unit) if self.kind == "number" else str(self.default)

    @property
    def allowed(self) -> str:
        """The allowed values, for a person to read."""
        if self.kind == "number":
            return format_with_unit(f"{self.low:g} … {self.high:g}", self.unit)
        return " | ".join(self.options) if self.options else self.kind


class Section(NamedTuple):
    """A section of a scenario file, or the keys that one of its kinds adds.

    head  : its first line in a file
    about : one sentence
    keys  : in the order of the declarations
    """

    head: str
    about: str
    keys: tuple[Key, ...]


@cache
def sections() -> Mapping[str, Section]:
    """Return sections by name: the top, each model, body, sensor and radio, other sections, lists, kinds of fault."""
    result = {TOP: _section("at the top", "", Flight)}
    for name in MODELS:
        result[name] = _section(f'model.kind = "{name}"', "model", find_law(name).Parameters, name)
    for family, members in (("body", BODIES), ("sensors", SENSORS)):
        for name, member in members.items():
            result[name] = _section(f'{family}.kind = "{name}"', family, member.Parameters, name)
    for name, record in SECTIONS.items():
        if name not in FAMILIES:
            result[name] = _section(f"[{name}]", name, record)
    # Keys of all radios are listed once, under [radio].
    for name, radio in OTHER_RADIOS.items():
        found = _section(f'radio.kind = "{name}"', "radio", radio.Parameters, name)
        result[name] = found._replace(keys=tuple(key for key in found.keys if _last(key) not in OF_ALL))
    groups = "Agents with their own numbers for the law, the body or the sensor."
    result["groups"] = Section("[[groups]]", groups, tuple(_whole("groups")))
    shared = _section("[[faults]]", "faults", FaultTiming)
    result["faults"] = shared
    for name, kind in KINDS.items():
        about = kind.doc.strip().split("\n\n")[0].partition(": ")[2] or kind.doc
        found = _section(f'[[faults]] kind = "{name}"', "faults", kind.Parameters, name)
        result[name] = found._replace(about=" ".join(f"{about[:1].upper()}{about[1:]}".split()))
    return result


def keys(section: str | None = None) -> list[Key]:
    """List every key of a scenario file: its meaning, unit, range, default and source.

    Parameters
    ----------
    section : str, optional
        A section ("radio"), "model", "body", "sensors" or "faults" for all models, bodies, sensors or kinds of fault,
        one of them or of the radios by its name ("couzin_2002", "gnss", "jitter", "motor"), "top" for the keys before
        the first section, or a key ("radio.delay", "delay"). By default all.

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
    known = sections()
    every = [key for found in known.values() for key in found.keys]
    if section is None:
        return every
    if not isinstance(section, str):
        raise ScenarioError([f"{section!r} is no section or key; give its name, such as 'radio' or 'radio.delay'"])
    if section in KINDS:  # all that an entry of this kind may hold, and keys of the same name
        return [*known[section].keys, *known["faults"].keys, *(key for key in every if _last(key) == section)]
    if section in OTHER_RADIOS:  # behind what all radios have
        return [*(key for key in known["radio"].keys if _last(key) in OF_ALL), *known[section].keys]
    if section in known and section not in FAMILIES:
        return list(known[section].keys)
    found = [key for key in every if section in (key.name, _last(key), key.name.partition(".")[0])]
    if not found:
        # Suggest among whole keys, last words and sections together, as any of the three may be
        # misspelt.
        words = {key.name: key.name for key in every} | {_last(key): key.name for key in every}
        words |= {name: name for name in (*known, *FAMILIES)}
        near = get_close_matches(section, words, n=1, cutoff=0.5)
        hint = f"did you mean {words[near[0]]}?" if near else f"sections: model, body, sensors, {', '.join(known)}"
        raise ScenarioError([f"{section}: unknown section or key; {hint}"])
    return found


def _last(key: Key) -> str:
    return key.name.rpartition(".")[2]


def _section(head: str, before: str, record: type, owner: str = "") -> Section:
    """Make the section of a record; keys that are read as a whole come first."""
    about = " ".join((record.__doc__ or "").strip().split("\n\n")[0].split())
    whole = () if owner else _whole(before)
    return Section(head, about, (*whole, *_declared(before, owner, record)))


def _whole(section: str) -> list[Key]:
    return [
        Key(f"{section}.{name}".lstrip("."), "", key.kind, None, "", None, None, key.options, key.meaning, "")
        for name, key in UNDECLARED_KEYS.get(section, {}).items()
    ]


def _declared(before: str, owner: str, record: type) -> list[Key]:
    """Return the keys of one record."""
    keys_of_record = []
    for name, declared, default in declarations(record):
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
        whole = f"{before}.{name}".lstrip(".")
        keys_of_record.append(Key(whole, owner, kind, default, unit, low, high, options, meaning, source))
    return keys_of_record


OWN = "FILE.py"


class UndeclaredKey(NamedTuple):
    """A key without a declaration: kind ("text", "choice", "list", "table"), meaning, options."""

    kind: str
    meaning: str
    options: tuple[str, ...] = ()


# section → key → what it is; "" stands for the keys at the top of a file
UNDECLARED_KEYS: Mapping[str, Mapping[str, UndeclaredKey]] = {
    "": {
        "title": UndeclaredKey("text", "what the scenario is, for pictures and lists"),
        "extends": UndeclaredKey(
            "text", "a preset or a file to start from; keys that are left out here are taken from it"
        ),
        "published": UndeclaredKey(
            "table",
            "what a paper reports: order parameter → mean, [mean, SD] or { mean, sd }; shown beside ours",
        ),
        "model.kind": UndeclaredKey("choice", "the law that all agents fly by", (*MODELS, OWN)),
        "body.kind": UndeclaredKey("choice", "what turns commands into motion", (*BODIES, OWN)),
        "sensors.kind": UndeclaredKey("choice", "how an agent knows its own state", (*SENSORS, OWN)),
    },
    "faults": {
        "kind": UndeclaredKey("choice", "what happens to an agent", (*KINDS, OWN)),
        "agents": UndeclaredKey("list", "numbers of the agents that the fault may hit; by default all"),
        "group": UndeclaredKey("text", "name of the group that the fault may hit; give this or agents"),
    },
    "groups": {
        "name": UndeclaredKey("text", "name of the group"),
        "agents": UndeclaredKey(
            "list",
            'numbers of its agents, how many, or a share ("20 %"); by default all that are in no other group',
        ),
        "model": UndeclaredKey("table", "kind, choices and numbers of its law; { value, spread } for a tolerance"),
        "body": UndeclaredKey("table", "numbers of its agents' body; { value, spread } for a tolerance"),
        "sensors": UndeclaredKey("table", "numbers of its agents' sensor; { value, spread } for a tolerance"),
    },
}
