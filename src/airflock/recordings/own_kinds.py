"""Bodies, sensors, radios, topologies and metrics of the user's own: a recording names them, but does not hold them."""

from collections.abc import Mapping
from typing import Any

from airflock.scenarios.families import FAMILIES
from airflock.support.errors import RecordingError


def own_kinds(document: Mapping[str, Any]) -> dict[str, str]:
    """Section → name of what the user's own was there, of the scenario that a recording was flown with."""
    found = {}
    for family in FAMILIES:
        table = document.get(family.section)
        kind = str(table.get("kind") or "") if isinstance(table, Mapping) else ""
        if kind and kind not in family.known:
            found[family.section] = kind
    return found


def missing_kinds(document: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, str]:
    """Those of them for which settings give no file."""
    return {s: kind for s, kind in own_kinds(document).items() if not str(settings.get(f"{s}.kind")).endswith(".py")}


def with_files(document: Mapping[str, Any], settings: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The document with the files that settings give for such kinds, whose numbers stay; and all other settings."""
    found, rest = dict(document), dict(settings)
    for section in own_kinds(document).keys() - missing_kinds(document, settings).keys():
        found[section] = {**found[section], "kind": rest.pop(f"{section}.kind")}
    return found, rest


def refuse_without_files(document: Mapping[str, Any], settings: Mapping[str, Any]) -> None:
    """Raise RecordingError, one line with the remedy, where a recording cannot be flown again by what is at hand."""
    missing = missing_kinds(document, settings)
    if missing:
        what = " and ".join(f"{section}.kind = {kind!r}" for section, kind in missing.items())
        options = " ".join(f"--set {section}.kind={kind}.py" for section, kind in missing.items())
        given = ", ".join(f'"{section}.kind": "{kind}.py"' for section, kind in missing.items())
        raise RecordingError(
            f"recording: was flown with {what}, which {'is' if len(missing) == 1 else 'are'} not in the file; give "
            f"{'its file' if len(missing) == 1 else 'their files'} with {options} --trust "
            f"(in Python: settings={{{given}}}, trust=True)"
        )
    other = [key for key in settings if key not in {f"{section}.kind" for section in own_kinds(document)}]
    if other:
        raise RecordingError(f"recording: {other[0]}: it can only be flown again as it was, so no key can change")
