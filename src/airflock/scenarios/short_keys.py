"""Settings by a key's last word: `delay` stands for `radio.delay` where only one section has a delay."""

import re
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any

from airflock.core import Quantity, declarations

# keys that only files have: what to do instead
IN_FILES = {
    "extends": "only a file has it; name the preset or file that it extends in place of this one",
    "format": "only a file has it; leave it out",
}


def keys_by_last_word(records: Mapping[str, type]) -> dict[str, list[str]]:
    """Return last word → whole keys of all sections that have it.

    A key of `metrics` that is taken from the scenario by default (such as metrics.v_flock) gives
    way to a key of the model with the same name.
    """
    keys: dict[str, list[str]] = {}
    for section, record in records.items():
        for name, declared, _ in declarations(record):
            # `delay` alone was the radio's before bodies had one, and stays it.
            if section and (section, name) != ("body", "delay"):
                # Optional numbers of metrics default to the scenario's own; without this rule
                # `v_flock` would be ambiguous in every law that has it.
                derived = section == "metrics" and isinstance(declared, Quantity) and declared.optional
                if not (derived and name in keys):
                    keys.setdefault(name, []).append(f"{section}.{name}")
        for name in getattr(record, "VECTORS", {}):
            keys.setdefault(name, []).append(f"{section}.{name}")
    return keys


def expand_short_keys(
    settings: Mapping[str, Any], records: Mapping[str, type], top: tuple[str, ...]
) -> tuple[dict[str, Any], list[str], list[str]]:
    """Expand settings to whole keys; return them with notes, and errors for ambiguous and unknown keys.

    settings : keys that are neither whole ("radio.delay") nor at the top of a file ("agents")
    records  : section → record of its parameters, "model" first
    """
    known = keys_by_last_word(records)
    result: dict[str, Any] = {}
    notes, errors = [], []
    for key, value in settings.items():
        where = known.get(key, [])
        if len(where) == 1:
            result[where[0]] = value
            notes.append(f"{key} is read as {where[0]}")
        elif where:
            meant = (f"{name} ({_meaning(name, records)})" for name in where)
            errors.append(f"{key} is several keys; write {' or '.join(meant)}")
        elif key in IN_FILES:
            errors.append(f"{key}: {IN_FILES[key]}")
        else:
            near = get_close_matches(key, (*top, *known), n=1, cutoff=0.5)
            full = known.get(near[0], near) if near else []
            errors.append(f"{key}: unknown key; {f'did you mean {full[0]}?' if near else 'known: ' + ', '.join(top)}")
    return result, notes, errors


def _meaning(key: str, records: Mapping[str, type]) -> str:
    """Return the meaning of a whole key, up to the first comma or semicolon."""
    section, _, last = key.partition(".")
    declared = next(found for name, found, _ in declarations(records[section]) if name in (last, f"{last}_0"))
    return re.split(r"[;,(]", declared.meaning)[0].strip()
