"""Resumed: the study that a folder holds, asked for again without all that it was first asked for with."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from airflock.runs import STUDY_FILE, read_toml_file, to_toml_values
from airflock.scenarios import value_of
from airflock.search.study import Study

OWN = ("layout", "airflock")  # of the version that made the folder: nothing that can be asked for


def resume_study(
    folder: Path,
    study: Study,
    settings: Mapping[str, Any],
    search: Mapping[str, Any],
    limit: Sequence[str],
    make_request: Callable[[dict[str, Any], dict[str, Any], list[str]], Study],
) -> tuple[Study, str]:
    """The study as its folder holds it, and a note of what was taken from there; what is asked for anew stays so.

    study : as it would be without the folder; settings, search, limit : what is asked for now
    ask   : the study for other settings, keys of the search, and limits
    """
    if not (folder / STUDY_FILE).is_file():
        return study, ""
    held, now = read_toml_file(folder / STUDY_FILE), to_toml_values(study.document())
    if any(held.get(key) != now[key] for key in OWN):
        return study, ""  # `open_folder` says so
    named = {key.rpartition(".")[2] for key in settings}
    flown = {
        key: value
        for key, value in _changed(held.get("scenario", {}), now["scenario"])
        if key not in settings and key.rpartition(".")[2] not in named
    }
    keys = {key: value for key, value in held.get("search", {}).items() if key not in search}
    searched = {f"search.{key}": value for key, value in keys.items() if now["search"].get(key) != value}
    limits = list(limit) or list(held.get("limits", []))
    held_to = {"limit": limits} if limits != list(limit) and limits != now.get("limits", []) else {}
    taken = flown | searched | held_to
    if not taken:
        return study, ""
    told = ", ".join(f"{key} = {value_of(value)}" for key, value in taken.items())
    said = f"goes on with what {folder} holds: {told}"
    return make_request({**settings, **flown}, {**keys, **search}, limits if held_to or limit else []), said


def _changed(held: Mapping[str, Any], now: Mapping[str, Any], at: str = "") -> list[tuple[str, Any]]:
    """Keys of a scenario that have another value in the folder, with that value."""
    found: list[tuple[str, Any]] = []
    for key, value in held.items():
        other = now.get(key)
        if isinstance(value, Mapping) and isinstance(other, Mapping) and "value" not in value:
            found += _changed(value, other, f"{at}{key}.")
        elif value_of(value) != value_of(other):
            found.append((f"{at}{key}", value))
    return found
