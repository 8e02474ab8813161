"""Local frame: latitudes and longitudes become metres, and tracks of several frames lie about one origin."""

import numpy as np

from airflock.recordings.imports import geodesy
from airflock.recordings.imports.expressions import quote_column
from airflock.recordings.imports.track import (
    COMMAND_TARGETS,
    GEODETIC_TARGETS,
    POSITION_TARGETS,
    VELOCITY_TARGETS,
    ImportedTrack,
    ImportReport,
)

DEGREES = {"lat": 90.0, "lon": 360.0}  # the largest that there are


def to_local_frame(
    tracks: list[ImportedTrack], origin: tuple[float, float, float] | None, findings: ImportReport
) -> None:
    """Rule 3: latitude and longitude to local metres, and all frames about one origin."""
    geodetic = [t for t in tracks if "x" not in t.columns]
    placed = [t for t in tracks if "x" in t.columns and t.origin is not None]
    free = [t for t in tracks if "x" in t.columns and t.origin is None]
    if free and (geodetic or placed):
        findings.fault(
            f"{free[0].source}: has no origin, while {(geodetic or placed)[0].source} has one; import them separately"
        )
        return
    if origin is None and placed:
        origin = placed[0].origin
    wrong: set[str] = set()
    for track in geodetic:
        fault = _degrees_fault(track)
        if fault and track.source not in wrong:
            wrong.add(track.source)
            findings.fault(fault)
        elif not fault and len(track.columns["lat"]):
            if origin is None:
                origin = _first_fix(track)
                findings.notes.append(f"origin of the local frame: {origin[0]:.7f}, {origin[1]:.7f}, {origin[2]:.2f} m")
            _project(track, origin)
    for track in placed:
        assert origin is not None
        _move(track, origin)


def _degrees_fault(track: ImportedTrack) -> str:
    """The first row that is no latitude and longitude, and what to write; empty if all are."""
    lat, lon = track.columns["lat"], track.columns["lon"]
    beyond = {name: np.abs(track.columns[name]) > most for name, most in DEGREES.items()}
    bad = np.flatnonzero(beyond["lat"] | beyond["lon"])
    if not bad.size:
        return ""
    names = [name for name in DEGREES if beyond[name].any()]
    ways = " ".join(f'--map "{name}:={quote_column(track.label(name))}*1e-7"' for name in names)
    return (
        f"{track.source}: column {', '.join(map(track.label, names))}, row {track.rows[bad[0]]}: {lat[bad[0]]:g}, "
        f"{lon[bad[0]]:g} is no latitude and longitude; if it is in 1e-7 degrees, write {ways}"
    )


def _first_fix(track: ImportedTrack) -> tuple[float, float, float]:
    """Latitude, longitude (degrees) and height (m) of a track's first row; 0 m where no height is logged."""
    height = track.columns["alt"][0] if "alt" in track.columns else 0.0
    return float(track.columns["lat"][0]), float(track.columns["lon"][0]), float(height)


def _project(track: ImportedTrack, origin: tuple[float, float, float]) -> None:
    """Put local metres about an origin in the place of a track's latitude, longitude and height."""
    lat, lon = track.columns["lat"], track.columns["lon"]
    local = geodesy.to_enu(lat, lon, track.columns.get("alt", np.zeros(len(lat))), origin)
    axes = 3 if "alt" in track.columns else 2
    track.columns = {k: v for k, v in track.columns.items() if k not in GEODETIC_TARGETS}
    track.columns |= {axis: local[:, c] for c, axis in enumerate(POSITION_TARGETS[:axes])}
    track.user_labels |= {"x": track.label("lon"), "y": track.label("lat"), "z": track.label("alt")}
    track.origin = origin


def _move(track: ImportedTrack, origin: tuple[float, float, float]) -> None:
    """Carry a track in local metres over to the frame about another origin."""
    assert track.origin is not None
    if track.origin == origin:
        return
    for names, change in (
        (POSITION_TARGETS, geodesy.points_to_origin),
        (VELOCITY_TARGETS, geodesy.vectors_to_origin),
        (COMMAND_TARGETS, geodesy.vectors_to_origin),
    ):
        if track.has(names):
            moved = change(track.stack(names, 3), track.origin, origin)
            track.columns |= {name: moved[:, c] for c, name in enumerate(names) if name in track.columns}
    track.origin = origin
