"""Bodies, sensors, radios, topologies and metrics of the user's own: a recording names them, but does not hold them."""

from collections.abc import Mapping
from typing import Any

from airflock.scenarios import PART_KINDS
from airflock.support import RecordingError


def user_parts(document: Mapping[str, Any]) -> dict[str, str]:
    """Section → name of what the user's own was there, of the scenario that a recording was flown with."""
    found = {}
    for family in PART_KINDS:
        table = document.get(family.section)
        kind = str(table.get("kind") or "") if isinstance(table, Mapping) else ""
        if kind and kind not in family.shipped:
            found[family.section] = kind
    return found


def missing_user_parts(document: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, str]:
    """Those of them for which settings give no file."""
    return {s: kind for s, kind in user_parts(document).items() if not str(settings.get(f"{s}.kind")).endswith(".py")}


def with_user_files(document: Mapping[str, Any], settings: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The document with the files that settings give for such kinds, whose numbers stay; and all other settings."""
    found, rest = dict(document), dict(settings)
    for section in user_parts(document).keys() - missing_user_parts(document, settings).keys():
        found[section] = {**found[section], "kind": rest.pop(f"{section}.kind")}
    return found, rest


def require_user_files(document: Mapping[str, Any], settings: Mapping[str, Any]) -> None:
    """Raise RecordingError, one line with the remedy, where a recording cannot be flown again by what is at hand."""
    missing = missing_user_parts(document, settings)
    if missing:
        what = " and ".join(f"{section}.kind = {kind!r}" for section, kind in missing.items())
        options = " ".join(f"--set {section}.kind={kind}.py" for section, kind in missing.items())
        given = ", ".join(f'"{section}.kind": "{kind}.py"' for section, kind in missing.items())
        raise RecordingError(
            f"recording: was flown with {what}, which {'is' if len(missing) == 1 else 'are'} not in the file; give "
            f"{'its file' if len(missing) == 1 else 'their files'} with {options} --trust "
            f"(in Python: settings={{{given}}}, trust=True)"
        )
    other = [key for key in settings if key not in {f"{section}.kind" for section in user_parts(document)}]
    if other:
        raise RecordingError(f"recording: {other[0]}: it can only be flown again as it was, so no key can change")
