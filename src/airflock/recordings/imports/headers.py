"""Headers of tables: which quantity a column holds, and in which unit."""

import re
from typing import NamedTuple

from airflock.recordings.imports.track import (
    COMMAND_TARGETS,
    GEODETIC_TARGETS,
    POSITION_TARGETS,
    VELOCITY_TARGETS,
    ImportOptions,
)
from airflock.support import RecordingError

LENGTH_UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1000.0, "ft": 0.3048, "in": 0.0254}
TIME_UNITS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}
SPEED_UNITS = {"m/s": 1.0, "mps": 1.0, "cm/s": 0.01, "cmps": 0.01, "mm/s": 1e-3, "km/h": 1 / 3.6, "kmh": 1 / 3.6,
          "kn": 1852.0 / 3600.0, "kt": 1852.0 / 3600.0, "ft/s": 0.3048}  # fmt: skip
OTHER_COMMAND_UNITS = ("1", "m/s^2")  # units of commands that are headings or accelerations
ANGLES = {"deg": 1.0, "°": 1.0, "degrees": 1.0}
PIXEL_UNITS = ("px", "pixel", "pixels")
UNIT_HINT = (
    "write --unit px --scale METRES_PER_PIXEL, or --unit mm, cm or m"  # where nothing tells the unit of a length
)

_EAST, _NORTH, _UP = ("x", "e", "east"), ("y", "n", "north"), ("z", "u", "up")
ALIASES: dict[str, tuple[str, ...]] = {
    "t": ("t", "time", "timestamp", "seconds"),
    "frame": ("frame", "frames", "frame_idx", "frame_index", "frame_number"),
    "id": ("id", "individual", "agent", "drone", "track", "track_id", "trackid", "animal", "tag", "identity", "name",
           "individual_local_identifier", "tag_local_identifier", "fish", "bird", "ant", "subject", "uav", "vehicle",
           "individual_id", "agent_id", "drone_id", "animal_id", "fish_id", "bird_id", "object_id", "vehicle_id"),
    "lat": ("lat", "latitude", "location_lat"),
    "lon": ("lon", "lng", "long", "longitude", "location_long", "location_lon"),
    "alt": ("alt", "altitude", "height", "amsl", "height_above_msl", "height_above_ellipsoid", "relative_alt", "agl"),
    "utc": ("utc", "utc_time", "unix", "unix_time", "gps_time"),
    "air": ("air", "in_air", "flying", "armed"),
}  # fmt: skip
for _axis, (_place, _speed, _wish, _words) in enumerate(
    zip(POSITION_TARGETS, VELOCITY_TARGETS, COMMAND_TARGETS, (_EAST, _NORTH, _UP), strict=True)
):
    ALIASES[_place] = (*_words, *(f"{p}_{w}" for p in ("pos", "position", "p") for w in _words))
    ALIASES[_speed] = tuple(f"{p}{w}" for p in ("v", "v_", "vel_", "velocity_", "speed_") for w in _words)
    wishes = ("c", "c_", "cmd_", "cmd_v", "command_", "command_v", "target_v", "target_vel_", "set_v", "sp_v", "tv")
    ALIASES[_wish] = tuple(f"{p}{w}" for p in wishes for w in _words)
EAST_HEADERS = frozenset(alias for alias in (*ALIASES["x"], "pe") if alias.split("_")[-1] in ("e", "east", "pe"))
ALIASES |= {"x": (*ALIASES["x"], "pe"), "y": (*ALIASES["y"], "pn")}  # of ArduPilot's XKF1, beside PD, VN, VE, VD
DOWN = {"down": "z", "pos_d": "z", "pos_down": "z", "position_down": "z", "vd": "vz", "vel_d": "vz", "vel_down": "vz",
        "pd": "z", "cmd_d": "cz", "cmd_vd": "cz", "cmd_down": "cz"}  # fmt: skip
DATUMS = {"height_above_msl": "amsl", "amsl": "amsl", "height_above_ellipsoid": "ellipsoid", "relative_alt": "home",
          "agl": "ground"}  # fmt: skip
_TARGET = {alias: target for target, known in ALIASES.items() for alias in known}
_SUFFIXES = sorted({*LENGTH_UNITS, *TIME_UNITS, *SPEED_UNITS, *ANGLES, *PIXEL_UNITS}, key=len, reverse=True)


class HeaderMeaning(NamedTuple):
    """What a header says: target, its unit (empty: not said), sign (-1 for down), and the level of a height."""

    target: str
    unit: str
    sign: float
    datum: str


def split_header(header: str) -> tuple[str, str]:
    """Name and unit of a header: `x [mm]`, `x(mm)`, `x_mm`; an empty unit if it has none."""
    text = header.strip()
    found = re.fullmatch(r"(.+?)\s*[\[(]([^\])]*)[\])]", text)
    if found:
        return _plain(found[1]), found[2].strip().lower()
    plain = _plain(text)
    if plain == "timeus":  # as ArduPilot writes it
        return "time", "us"
    if plain not in _TARGET:
        for unit in _SUFFIXES:
            if plain.endswith(f"_{unit}") and len(plain) > len(unit) + 1:
                return plain[: -len(unit) - 1], unit
    return plain, ""


def is_unit(text: str) -> bool:
    """Whether a text is nothing but a unit, also in brackets."""
    plain = text.strip().strip("[]()").strip().lower()
    return plain in {*LENGTH_UNITS, *TIME_UNITS, *SPEED_UNITS, *ANGLES, *PIXEL_UNITS}


def _plain(text: str) -> str:
    return re.sub(r"[\s.\-:]+", "_", text.strip().lower())


def header_meaning(header: str) -> HeaderMeaning | None:
    """What a column holds, or None if its name tells nothing."""
    name, unit = split_header(header)
    if name in DOWN:
        return HeaderMeaning(DOWN[name], unit, -1.0, "")
    target = _TARGET.get(name)
    return None if target is None else HeaderMeaning(target, unit, 1.0, DATUMS.get(name, ""))


def column_factor(target: str, unit: str, where: str, options: ImportOptions) -> float:
    """Number that turns a column into SI; raises RecordingError for a unit of something else.

    unit : of the header; if empty, that of the options
    """
    kind = {"t": TIME_UNITS, "utc": TIME_UNITS, "lat": ANGLES, "lon": ANGLES, "alt": LENGTH_UNITS}.get(target)
    if kind is None:
        kind = (
            LENGTH_UNITS
            if target in POSITION_TARGETS
            else SPEED_UNITS
            if target in (*VELOCITY_TARGETS, *COMMAND_TARGETS)
            else {}
        )
    if not kind or target in GEODETIC_TARGETS[:2]:
        return 1.0
    if not unit and target in ("t", "utc"):
        unit = options.time_unit if options.time_unit != "frames" else ""
    if not unit and target in POSITION_TARGETS:
        unit = options.unit
    if not unit and target in (*VELOCITY_TARGETS, *COMMAND_TARGETS) and options.unit not in ("", *PIXEL_UNITS):
        return LENGTH_UNITS[options.unit]
    if unit in PIXEL_UNITS and target in POSITION_TARGETS:
        if options.scale is None:
            raise RecordingError(f"{where}: {target} is in pixels; say how many metres one is: --scale 0.0005")
        return options.scale
    if unit and unit not in kind:
        raise RecordingError(f"{where}: {unit}: unknown unit of {target}; known: {', '.join(kind)}")
    return kind[unit] if unit else 1.0


def unit_in_metres(unit: str, where: str, subject: str, options: ImportOptions) -> float:
    """Metres in one unit of what has no header; raises RecordingError where neither it nor the options tell the unit.

    unit : that the file tells, if any; where, what : file and variable, for the message
    """
    if options.unit or unit in LENGTH_UNITS or unit in PIXEL_UNITS:
        return column_factor("x", options.unit or unit, where, options)
    raise RecordingError(f"{where}: {subject} has no unit; {UNIT_HINT}")
