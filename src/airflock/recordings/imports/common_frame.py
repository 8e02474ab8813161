"""Put tracks into one local frame (east, north, up) and on one clock."""

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.recordings.imports.table_columns import quote_column, split_header
from airflock.recordings.imports.track import (
    COMMAND_TARGETS,
    GEODETIC_TARGETS,
    POSITION_TARGETS,
    VELOCITY_TARGETS,
    ImportedTrack,
    ImportReport,
)

# Geodesy: exact, by earth-centred coordinates (WGS84), since a flat earth is 8 cm off at 1 km in
# height.
SEMI_MAJOR = 6378137.0  # m, WGS84 (NIMA TR8350.2)
FLATTENING = 1.0 / 298.257223563
ECCENTRICITY2 = FLATTENING * (2.0 - FLATTENING)


def to_ecef(lat: Any, lon: Any, height: Any) -> NDArray[np.float64]:
    """Convert latitude, longitude (degrees) and height (m) to earth-centred, earth-fixed coordinates (..., 3), m."""
    phi, lam, h = np.radians(lat), np.radians(lon), np.asarray(height, float)
    normal = SEMI_MAJOR / np.sqrt(1.0 - ECCENTRICITY2 * np.sin(phi) ** 2)
    across = (normal + h) * np.cos(phi)
    up = (normal * (1.0 - ECCENTRICITY2) + h) * np.sin(phi)
    return np.stack(np.broadcast_arrays(across * np.cos(lam), across * np.sin(lam), up), axis=-1)


def enu_axes(lat: Any, lon: Any) -> NDArray[np.float64]:
    """Return unit vectors east, north and up (3, 3, ...) at places, as rows, in earth-centred coordinates."""
    phi, lam = np.radians(lat), np.radians(lon)
    east = [-np.sin(lam), np.cos(lam), lam - lam]
    north = [-np.sin(phi) * np.cos(lam), -np.sin(phi) * np.sin(lam), np.cos(phi)]
    return np.array([east, north, np.cross(np.array(east), np.array(north), axis=0)])


def to_enu(lat: Any, lon: Any, height: Any, origin: tuple[float, float, float]) -> NDArray[np.float64]:
    """Convert to east, north, up (..., 3), m, about an origin of latitude, longitude (degrees) and height (m)."""
    offset: NDArray[np.float64] = (to_ecef(lat, lon, height) - to_ecef(*origin)) @ enu_axes(*origin[:2]).T
    return offset


def points_to_origin(
    local: NDArray[np.float64], from_origin: tuple[float, float, float], to_origin: tuple[float, float, float]
) -> NDArray[np.float64]:
    """Convert points (row, 3), m, from the frame about one origin to the frame about another."""
    centred = local @ enu_axes(*from_origin[:2]) + (to_ecef(*from_origin) - to_ecef(*to_origin))
    return centred @ enu_axes(*to_origin[:2]).T


def vectors_to_origin(
    vectors: NDArray[np.float64], from_origin: tuple[float, float, float], to_origin: tuple[float, float, float]
) -> NDArray[np.float64]:
    """Rotate vectors (row, 3), such as velocities, from the axes at one origin to those at another."""
    rotated: NDArray[np.float64] = vectors @ enu_axes(*from_origin[:2]) @ enu_axes(*to_origin[:2]).T
    return rotated


DEGREES = {"lat": 90.0, "lon": 360.0}  # the largest that there are
FAR = 5e4  # m from the origin; beyond, the curvature of the earth is told


def to_local_frame(
    tracks: list[ImportedTrack], origin: tuple[float, float, float] | None, findings: ImportReport
) -> None:
    """Rule 3: convert latitude and longitude to local metres, and all frames to one origin."""
    geodetic = [t for t in tracks if "x" not in t.columns]
    placed = [t for t in tracks if "x" in t.columns and t.origin is not None]
    free = [t for t in tracks if "x" in t.columns and t.origin is None]
    if free and (geodetic or placed):
        findings.add_error(
            f"{free[0].source}: has no origin, while {(geodetic or placed)[0].source} has one; import them separately"
        )
        return
    if origin is None and placed:
        origin = placed[0].origin
    wrong: set[str] = set()
    flat = [track for track in geodetic if "alt" not in track.columns]
    for track in geodetic:
        error = _degrees_error(track)
        if error and track.source not in wrong:
            wrong.add(track.source)
            findings.add_error(error)
        elif not error and len(track.columns["lat"]):
            if origin is None:
                origin = _first_fix(track)
                findings.notes.append(f"origin of the local frame: {origin[0]:.7f}, {origin[1]:.7f}, {origin[2]:.2f} m")
            _project(track, origin)
    far = [track for track in geodetic if "x" in track.columns and _is_far(track)]
    if far:
        # In the plane of the origin distances shrink: by 3e-5 at 50 km, to nothing at a quarter of the earth's girth.
        findings.notes.append(
            f"{far[0].source}: column {far[0].label('y')}, {far[0].label('x')}, row {far[0].rows[0]} on: {far[0].name} "
            f"goes farther than {FAR / 1e3:g} km from the origin: z drops with the curvature of the earth, so that "
            "distances and speeds are those on the ellipsoid; it is no height"
        )
    for track in flat if not far else ():
        track.columns.pop("z", None)
    for track in placed:
        assert origin is not None
        _move(track, origin)


def _degrees_error(track: ImportedTrack) -> str:
    """Return the error of the first row that is no latitude and longitude; empty if all are."""
    lat, lon = track.columns["lat"], track.columns["lon"]
    beyond = {name: np.abs(track.columns[name]) > most for name, most in DEGREES.items()}
    bad = np.flatnonzero(beyond["lat"] | beyond["lon"])
    if not bad.size:
        return ""
    names = [name for name in DEGREES if beyond[name].any()]
    own = {name: quote_column(track.label(name)) for name in track.columns}
    ways = " ".join(f'--map "{name}:={own[name]}*1e-7"' for name in names)
    most = max(abs(lat[bad[0]]), abs(lon[bad[0]]))
    if most <= DEGREES["lon"]:
        remedy = f'if they are exchanged, write --map "lat:={own["lon"]}" --map "lon:={own["lat"]}"'
    elif most <= 100.0 * DEGREES["lon"]:  # ddmm.mmm of NMEA 0183: an expression cannot part it
        remedy = "if it is degrees and minutes, ddmm.mmm, write degrees (dd + mm.mmm / 60) into the file"
    else:
        # Who sends 1e-7 degrees sends millimetres; source: MAVLink, GLOBAL_POSITION_INT.
        ways += f' --map "alt:={own["alt"]}*1e-3"' if not split_header(track.label("alt"))[1] and "alt" in own else ""
        remedy = f"if it is in 1e-7 degrees, write {ways}"
    return (
        f"{track.source}: column {', '.join(map(track.label, names))}, row {track.rows[bad[0]]}: {lat[bad[0]]:g}, "
        f"{lon[bad[0]]:g} is no latitude and longitude; {remedy}"
    )


def _first_fix(track: ImportedTrack) -> tuple[float, float, float]:
    """Return latitude, longitude (degrees) and height (m) of a track's first row; 0 m where no height is logged."""
    height = track.columns["alt"][0] if "alt" in track.columns else 0.0
    return float(track.columns["lat"][0]), float(track.columns["lon"][0]), float(height)


def _project(track: ImportedTrack, origin: tuple[float, float, float]) -> None:
    """Put local metres about an origin in the place of a track's latitude, longitude and height."""
    lat, lon = track.columns["lat"], track.columns["lon"]
    local = to_enu(lat, lon, track.columns.get("alt", np.zeros(len(lat))), origin)
    track.columns = {k: v for k, v in track.columns.items() if k not in GEODETIC_TARGETS}
    track.columns |= {axis: local[:, c] for c, axis in enumerate(POSITION_TARGETS)}
    track.user_labels |= {"x": track.label("lon"), "y": track.label("lat"), "z": track.label("alt")}
    track.origin = origin
    if not _is_far(track):
        return
    for names in (VELOCITY_TARGETS, COMMAND_TARGETS):  # east and north of the place are not those of the origin
        if track.has(names):
            axes = np.moveaxis(enu_axes(lat, lon), -1, 0)
            turned = np.einsum("ri,rij->rj", track.stack(names, 3), axes) @ enu_axes(*origin[:2]).T
            track.columns |= {name: turned[:, c] for c, name in enumerate(names)}


def _is_far(track: ImportedTrack) -> bool:
    return bool(np.hypot(track.columns["x"], track.columns["y"]).max(initial=0.0) > FAR)


def _move(track: ImportedTrack, origin: tuple[float, float, float]) -> None:
    """Move a track in local metres to the frame about another origin."""
    assert track.origin is not None
    if track.origin == origin:
        return
    for names in (POSITION_TARGETS, VELOCITY_TARGETS, COMMAND_TARGETS):
        if track.has(names):
            change = points_to_origin if names is POSITION_TARGETS else vectors_to_origin
            moved = change(track.stack(names, 3), track.origin, origin)
            track.columns |= {name: moved[:, c] for c, name in enumerate(names) if name in track.columns}
    track.origin = origin


SAME_CLOCK = 0.1  # s; a packet of a receiver is late by as much, a metre of a drone at 10 m/s


# Clocks of several devices come to one time by GNSS time, or are refused: a second between two
# drones is metres of distance.
def align_clocks(tracks: list[ImportedTrack], same_clock: bool, findings: ImportReport) -> bool:
    """Put all times on one clock, in place; returns whether quantities between individuals mean something.

    same : the user says that the clocks agree
    """
    if len(tracks) == 1 or same_clock:
        return True
    sources = sorted({track.source for track in tracks})
    for source in sources:
        _part_clocks([track for track in tracks if track.source == source], findings)
    own = [track for track in tracks if track.clock in ("boot", "own")]
    lacking = [track for track in own if track.utc is None]
    if lacking and (len(sources) > 1 or len(lacking) < len(own)):
        names = ", ".join(sorted({track.source for track in lacking})[:3])
        findings.add_error(
            f"{names}: {lacking[0].name}{' ...' if len(lacking) > 1 else ''}: nothing says that the clocks of "
            f"{len(tracks)} individuals agree, and distances between them need that; write --same-clock if they do, or "
            "--map utc:=COLUMN"
        )
        return False
    if len(lacking) == len(own):
        return True  # all of one file, whose clock is theirs
    worst, name = max((to_utc(track), f"{track.source}: {track.name}") for track in own if track.utc is not None)
    if worst > 1.0:
        findings.add_error(
            f"{name}: its clock is up to {worst:.3g} s off a straight line through GNSS times; leave out the rows "
            "without a fix"
        )
    findings.notes.append(f"clocks aligned by GNSS time, largest residual {1e3 * worst:.1f} ms")
    return True


def _part_clocks(tracks: list[ImportedTrack], findings: ImportReport) -> None:
    """Find individuals of one table whose times run on clocks of their own, as a column of UTC beside them shows."""
    where = f"{tracks[0].source}: column {tracks[0].label('t')}"
    shared = [track for track in tracks if track.clock == "shared"]
    ahead = [np.quantile(np.diff(track.utc), (0.05, 0.95)) for track in shared if track.utc is not None]
    # UTC may be written to the second: clocks differ where these readings do not overlap.
    apart = max(low for low, _ in ahead) - min(high for _, high in ahead) if ahead else 0.0
    if apart > SAME_CLOCK:
        findings.notes.append(
            f"{where}: each individual has a clock of its own, up to {apart:.4g} s apart by column "
            f"{tracks[0].label('utc')}"
        )
        for track in shared:
            track.clock = "own"
    spans = sorted((float(track.time[0]), float(track.time[-1])) for track in shared if len(track.time))
    if not ahead and len(spans) > 1 and all(one[1] < other[0] for one, other in itertools.pairwise(spans)):
        findings.notes.append(
            f"{where}: no two individuals are there at a time, so that nothing between them can be measured; if it "
            "counts since each was switched on, write --map utc:=COLUMN"
        )


def to_utc(track: ImportedTrack) -> float:
    """Replace own time by UTC, by a straight line through the pairs; returns the largest residual, s."""
    assert track.utc is not None
    track.time, residual = on_other_clock(track.time, *track.utc.T)
    track.clock = "utc"
    return residual


def on_other_clock(
    times: NDArray[np.float64], own: NDArray[np.float64], other: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Return times on another clock, by a straight line through readings of both; and the largest residual, s."""
    centre = own.mean()
    offset = other - own
    ahead = offset - offset.mean()
    spread = float(((own - centre) ** 2).sum())
    # a drift only shows over minutes: quartz drifts by 1e-5, a packet of the receiver is late
    # by 0.1 s
    drift = float((ahead * (own - centre)).sum() / spread) if own.max() - own.min() > 60.0 else 0.0
    residual = ahead - drift * (own - centre)
    return times + offset.mean() + drift * (times - centre), float(np.abs(residual).max())
