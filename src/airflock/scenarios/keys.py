"""Every key that a scenario file may hold, from the declarations of its parameters, and as a JSON schema for editors.

Keys that no record declares (names, lists and tables that are read as a whole) stand at the end, in
`UNDECLARED_KEYS`.
"""

import re
from collections.abc import Mapping
from difflib import get_close_matches
from functools import cache
from typing import Any, NamedTuple

from airflock.core import (
    Choice,
    Declaration,
    Kind,
    PacketParameters,
    Points,
    Quantity,
    Text,
    declarations,
    format_with_unit,
    number_names,
)
from airflock.parts import BODIES, FAULTS as KINDS, RADIOS, SENSORS, SETS, TOPOLOGIES
from airflock.scenarios import formats
from airflock.scenarios.fault_entries import FaultTiming
from airflock.scenarios.groups import LETTERS
from airflock.scenarios.named_code import MODELS
from airflock.scenarios.part_kinds import PART_KINDS
from airflock.scenarios.schema import LONG_FORM, unit_names
from airflock.scenarios.sections import SECTIONS, Flight
from airflock.support import ScenarioError, to_identifier

TOP = "top"  # the keys before the first section
FAMILIES = {"model": MODELS, "body": BODIES, "sensors": SENSORS, "faults": KINDS}  # sections with records by kind
OF_ALL = number_names(PacketParameters)  # keys of every radio: the section [radio] lists them
SHARING = {kind.section: kind for kind in (RADIOS, TOPOLOGIES, SETS)}  # whose members share the numbers of a section


class Key(NamedTuple):
    """One key of a scenario file.

    name    : as it is written after --set, for instance "radio.delay"; keys of an entry of
              [[faults]] or [[groups]]
        follow the name of the list
    of      : the model, body, sensor, radio or kind of fault that the key belongs to; "" where it
              is always there
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
    apart: tuple[Kind[Any], ...] = (MODELS, BODIES, SENSORS)  # each member has a section of its own
    for kind in apart:
        for name, member in kind.items():
            result[name] = _section(f'{kind.section}.kind = "{name}"', kind.section, member.Parameters, name)
    for name, record in SECTIONS.items():
        if name not in FAMILIES:
            result[name] = _section(f"[{name}]", name, record)
    # Keys that all members share are listed once, under their section.
    for family, sharing in SHARING.items():
        common = OF_ALL if sharing is RADIOS else number_names(SECTIONS[family])
        for name, record in sharing.records.items():
            if record is not SECTIONS[family]:
                own = _section(f'{family}.kind = "{name}"', family, record, name)
                result[name] = own._replace(keys=tuple(k for k in own.keys if _last(k) not in (*common, "kind")))
    groups = "Agents with their own numbers for the law, the body or the sensor."
    result["groups"] = Section("[[groups]]", groups, tuple(_whole("groups")))
    shared = _section("[[faults]]", "faults", FaultTiming)
    result["faults"] = shared
    for name, fault in KINDS.items():
        about = fault.doc.strip().split("\n\n")[0].partition(": ")[2] or fault.doc
        found = _section(f'[[faults]] kind = "{name}"', "faults", fault.Parameters, name)
        result[name] = found._replace(about=" ".join(f"{about[:1].upper()}{about[1:]}".split()))
    return result


def keys(section: str | None = None) -> list[Key]:
    """List every key of a scenario file: its meaning, unit, range, default and source.

    Parameters
    ----------
    section : str (SECTION|KIND|KEY), optional
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
    if section in RADIOS and section in known:  # behind what all radios have
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
        if name == "kind" and before in SHARING:
            kind, options = "choice", (*SHARING[before], OWN)
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

DRAFT = "http://json-schema.org/draft-07/schema#"  # Taplo, VS Code and validators read it
NUMBER = r"^\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*"  # before a unit, in text
OWN_FILE = {"type": "string", "pattern": r"\.py$"}
TYPES: Mapping[str, dict[str, Any]] = {
    "text": {"type": "string"},
    "list": {"type": ["array", "number", "string"]},
    "table": {"type": "object"},
}


def json_schema() -> dict[str, Any]:
    """Return a JSON schema of scenario files: what each key alone may hold, by its declaration.

    What takes several keys, another file or code is left to `load`.

    Examples
    --------
    >>> from airflock.scenarios import keys
    >>> keys.json_schema()["properties"]["agents"]["default"]
    100.0
    """
    records: dict[str, dict[str, type]] = {}
    every: tuple[Kind[Any], ...] = (MODELS, KINDS, *PART_KINDS)
    for each in every:
        own = {name: getattr(one, "Parameters", None) for name, one in each.items()}
        records[each.section or "faults"] = {name: one or SECTIONS[each.section] for name, one in own.items()}
    kinds: dict[str, dict[str, list[str]]] = {name: {} for name in records}  # kinds of one record share a table
    tables: dict[str, dict[str, Any]] = {}
    for section, of in records.items():
        for record in dict.fromkeys(of.values()):
            names = [name for name, one in of.items() if one is record]
            kinds[section][f"{section}.{names[0]}"] = names
            tables[f"{section}.{names[0]}"] = _values(section, record)
    for name in kinds["faults"]:
        tables[name] |= _values("faults", FaultTiming) | _undeclared("faults")
    top = _values("", Flight) | _undeclared("") | {"format": {"enum": [formats.FORMAT]}}
    top |= {name: _closed(_values(name, record)) for name, record in SECTIONS.items() if name not in kinds}
    top |= {name: _section_by_kind(name, of, tables) for name, of in kinds.items()}
    of_group = {name: _section_by_kind(name, kinds[name], tables, spread=True) for name in LETTERS}
    group = _closed(_undeclared("groups") | of_group)
    top |= {name: {"type": "array", "items": items} for name, items in (("faults", top["faults"]), ("groups", group))}
    definitions = {name: _closed(values) for name, values in tables.items()}
    for unit in sorted({key.unit for key in keys() if key.kind == "number"}):
        units = sorted(unit_names(unit))
        pattern = rf"{NUMBER}({'|'.join(map(re.escape, units))})\s*$"
        definitions[f"text.{to_identifier(unit)}"] = {"type": "string", "pattern": pattern if units else "^$"}
        definitions[f"table.{to_identifier(unit)}"] = _long({"type": "number"}, {"enum": units}, "unit")
    return {"$schema": DRAFT, "title": "Airflock scenario", **_closed(top), "definitions": definitions}


def _closed(properties: Mapping[str, Any], *needed: str) -> dict[str, Any]:
    return {"type": "object", "properties": properties, "additionalProperties": False, "required": list(needed)}


def _undeclared(section: str) -> dict[str, Any]:
    """Return the schemas of keys of a section that no record declares; kinds and tables of groups are made apart."""
    known = UNDECLARED_KEYS[section].items()
    return {name: {"description": key.meaning, **TYPES[key.kind]} for name, key in known if key.kind in TYPES}


def _values(section: str, record: type) -> dict[str, Any]:
    """Return the schema of each key of a record, and of its vectors."""
    declared = [how for _, how, _ in declarations(record)]
    values = {_last(key): _value(key, how) for key, how in zip(_declared(section, "", record), declared, strict=True)}
    for name, size in getattr(record, "VECTORS", {}).items():
        first = values[f"{name}_0"]
        many = {"type": "array", "minItems": size, "maxItems": size, "items": {"anyOf": first["anyOf"][:2]}}
        values[name] = {"description": first["description"], "anyOf": [many, _long(many, {})]}
    return values


def _value(key: Key, declared: Declaration) -> dict[str, Any]:
    """Return the schema of one value: plain, as text with its unit, or as a table with value, unit and source."""
    about: dict[str, Any] = {"description": f"{key.meaning} [{key.allowed}]{f' ({key.source})' if key.source else ''}"}
    about |= {"default": key.default} if key.default not in (None, (), "") else {}
    plain: dict[str, Any] = {"type": "string"}
    unit = {"enum": sorted({"", key.unit})}
    if isinstance(declared, Quantity):
        plain = {"type": "number", "minimum": key.low, "maximum": key.high}
        plain |= {"multipleOf": 1} if declared.whole else {}
        with_unit = [{"$ref": f"#/definitions/{form}.{to_identifier(key.unit)}"} for form in ("text", "table")]
        return about | {"anyOf": [plain, with_unit[0], _long(plain, unit), with_unit[1]]}
    if isinstance(declared, Choice):
        plain = {"enum": [*key.options, *(int(option) for option in key.options if option.isdecimal())]}
    elif isinstance(declared, Points):
        plain = {"type": "array", "items": {"type": "number"}, "maxItems": declared.axes}
        plain |= {"minItems": declared.axes} if declared.depth > 1 else {}
        for _ in range(declared.depth - 1):
            plain = {"type": "array", "items": plain}
        unit = {"enum": sorted({"", key.unit, *unit_names(key.unit)})}
    return about | {"anyOf": [plain, _long(plain, unit)]}


def _long(value: Any, unit: Any, *needed: str) -> dict[str, Any]:
    """Return the schema of a value in a table with its unit and source."""
    return _closed({**dict.fromkeys(sorted(LONG_FORM), {}), "value": value, "unit": unit}, "value", *needed)


def _section_by_kind(
    section: str, kinds: Mapping[str, list[str]], tables: Mapping[str, dict[str, Any]], *, spread: bool = False
) -> dict[str, Any]:
    """Return the schema of a section whose keys depend on its kind; a kind of one's own may have any.

    kinds  : name of a table → the kinds that have its keys; tables : the keys of each
    spread : True if numbers may have a spread, as in a group
    """
    about: dict[str, Any] = {}
    may: dict[str, list[Any]] = {}
    for table in kinds:
        tables[table]["kind"] = {}  # judged by the section
        for key, value in tables[table].items():
            about.setdefault(key, {part: text for part, text in value.items() if part != "anyOf"})
            may.setdefault(key, []).append({"$ref": f"#/definitions/{table}/properties/{key}"})
    spreads = [{"type": "object", "required": ["spread"]}] if spread else []
    every = _closed({key: {"anyOf": [*of, *spreads]} for key, of in may.items()})
    kind: dict[str, Any] = {"anyOf": [{"enum": sorted(name for names in kinds.values() for name in names)}, OWN_FILE]}
    meaning = UNDECLARED_KEYS[""].get(f"{section}.kind") or UNDECLARED_KEYS["faults"]["kind"]
    about["kind"] = {"description": meaning.meaning} | about["kind"] | {"anyOf": [*kind["anyOf"], _long(kind, {})]}
    # Editors complete from these, and judge by kind what a key may hold: two laws may share the name of a number.
    schema = {"type": "object", "properties": about}
    if spread:
        return schema | {"if": {"properties": {"kind": OWN_FILE}, "required": ["kind"]}, "else": every}
    # A file that extends another may leave its kind out, and means any of them.
    conditions: list[Any] = [{"if": {"not": {"required": ["kind"]}}, "then": every}]
    for table, names in kinds.items():
        named = {"kind": {"anyOf": [{"enum": names}, _long({"enum": names}, {})]}}
        then = {"$ref": f"#/definitions/{table}"}
        conditions.append({"if": {"properties": named, "required": ["kind"]}, "then": then})
    return schema | {"allOf": conditions}
