"""Rebuild the scenario that a recording was flown with, with the user's own laws and kinds of parts."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from airflock.core import Model, Own, PacketParameters, Parameters, argument_names, declarations, number_names
from airflock.parts import SETS
from airflock.parts.aero import descent
from airflock.parts.metrics import POWER_SETTINGS
from airflock.recordings.attributes import check_format, metrics_settings, scenario_document, uses_user_law
from airflock.recordings.dataset import recording_frames
from airflock.scenarios import PART_KINDS, SECTIONS, CallerParts, Scenario, build_scenario, formats, settings_dict
from airflock.support import RecordingError, as_error


class _Nothing(Parameters):
    """A law without a parameter."""


def _on(own: Own) -> tuple[float, float, float]:
    """Keep the velocity."""
    return own.vx, own.vy, own.vz


# Stands where the law of a recording is not known: it is measured, not flown.
UNKNOWN = Model(name="unknown", Parameters=_Nothing, command="velocity", decide=_on)


def power_settings(recording: xr.Dataset, settings: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return settings that measure the power which a recording's geometry saves; `changed` has priority.

    A law that solves for the wings of the flock flies in a frame that moves with the air; elsewhere
    forward is the flock's mean heading.
    """
    law = scenario_of_recording(recording).model
    on_wings = law.flock is not None and law.flock is not descent.flock and "wing" in argument_names(law.flock, "flock")
    frame = {} if on_wings else {"wing.frame": "ground"}
    return {**POWER_SETTINGS, **frame, **(settings or {})}


def scenario_of_recording(
    recording: xr.Dataset, settings: Mapping[str, Any] | None = None, *, trust: bool = False
) -> Scenario:
    """Rebuild the scenario of a recording; for a flight log, build one that only defines the metrics.

    A law, a body or a metric set of the user's own is not in the file: the law is unknown then, and
    the others are the usual ones, unless settings give a file ({"metrics.kind": "mine.py"}), which
    runs with `trust`. A log brings no arena: it is open unless settings name one, and v_flock is
    its mean speed.
    """
    check_format(recording)
    document = scenario_document(recording)
    settings = settings_dict(settings, str(recording.attrs.get("airflock_name", "recording")))
    if document is not None:
        with as_error(str(recording.attrs.get("airflock_name", "recording")), RecordingError):
            return _flown(document, settings, recording, trust)
    # A log has no scenario: one agent with the recorded speed carries the metrics.
    frames, period, _ = recording_frames(recording)
    dims = frames.shape[1] // 2
    speed = float(np.nanmean(np.linalg.norm(frames[:, dims:], axis=1)))
    # Nothing flies: periods only say how often frames are measured. Where frames are farther apart than a flight's
    # may be (fixes of animals are hours apart), each one is.
    document = {
        "agents": 1,
        "dt": min(period, 10.0),
        "sensors": {"period": min(period, 60.0)},
        "start": {"separation": 0.0},
        "metrics": {
            "v_flock": min(max(speed, 0.01), 1000.0),
            "r_cluster": 80.0,
            "r_comm": 80.0,
            "period": min(period, 600.0),
        },
        "world": {"dimensions": str(dims), "arena": "none"},
    }
    parts = CallerParts(law=UNKNOWN)
    return build_scenario(formats.numbered(document), "recording", settings, caller_parts=parts, trust=trust)


def _flown(document: dict[str, Any], given: Mapping[str, Any], recording: xr.Dataset, trust: bool) -> Scenario:
    """Rebuild the scenario of a simulated recording, with stand-ins for the user's own code that is not at hand."""
    name = str(recording.attrs.get("airflock_name", "recording"))
    missing = missing_user_parts(document, given)
    document, settings = with_user_files(document, given)
    if "metrics" in missing:
        document = {**document, "metrics": _usual_metrics(document["metrics"])}
    # A missing part is replaced by the usual one: recordings are measured here, not flown, so its
    # physics does not matter.
    if "body" in missing:
        document = {**{key: value for key, value in document.items() if key != "groups"}, "body": {}}
    if "sensors" in missing:
        document = {**document, "sensors": {k: v for k, v in document["sensors"].items() if k == "period"}}
    if "radio" in missing:
        common = {key: value for key, value in document["radio"].items() if key in number_names(PacketParameters)}
        document = {**document, "radio": common}
    if "topology" in missing:
        document = {key: value for key, value in document.items() if key != "topology"}
    if not uses_user_law(recording):
        return build_scenario(document, name, settings, trust=trust)
    measured = metrics_settings(recording)
    kept = measured if str(measured.get("kind", "")) in ("", *SETS) else _usual_metrics(measured)
    kept = document["metrics"] if str(given.get("metrics.kind")).endswith(".py") and "metrics" in document else kept
    stand_in = {**document, "model": {}, "body": {}, "metrics": {k: v for k, v in kept.items() if v is not None}}
    stand_in = {key: value for key, value in stand_in.items() if key not in ("groups", "faults")}
    if isinstance(document.get("groups"), list):  # members are known even if their law is not
        stand_in["groups"] = [
            {key: group[key] for key in ("name", "agents") if key in group} if isinstance(group, Mapping) else group
            for group in document["groups"]
        ]
    # Numbers of the unknown law cannot be checked, and no metric reads them.
    others = {key: value for key, value in settings.items() if not key.startswith("model.")}
    return build_scenario(stand_in, name, others, caller_parts=CallerParts(law=UNKNOWN), trust=trust)


def _usual_metrics(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys of a section [metrics] that every set has."""
    known = {key for key, _, _ in declarations(SECTIONS["metrics"])} - {"kind"}
    return {key: value for key, value in table.items() if key in known}


# A recording names the user's own kinds of parts, but never contains their code.
def user_parts(document: Mapping[str, Any]) -> dict[str, str]:
    """Return section → name of each kind of part that was the user's own in the recorded scenario."""
    found = {}
    for family in PART_KINDS:
        table = document.get(family.section)
        kind = str(table.get("kind") or "") if isinstance(table, Mapping) else ""
        if kind and kind not in family:
            found[family.section] = kind
    return found


def missing_user_parts(document: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, str]:
    """Return those of the user's own kinds of parts for which the settings name no file."""
    return {s: kind for s, kind in user_parts(document).items() if not str(settings.get(f"{s}.kind")).endswith(".py")}


def with_user_files(document: Mapping[str, Any], settings: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the document with the files that settings name for the user's own kinds, and the other settings."""
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
