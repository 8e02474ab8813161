"""Headers of tables: which quantity a column holds, and in which unit."""

import re
from typing import NamedTuple

from airflock.recordings.imports.track import COMMAND, GEODETIC, POSITION, VELOCITY, Options
from airflock.support.errors import RecordingError

LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1000.0, "ft": 0.3048, "in": 0.0254}
TIMES = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}
SPEEDS = {"m/s": 1.0, "mps": 1.0, "cm/s": 0.01, "cmps": 0.01, "mm/s": 1e-3, "km/h": 1 / 3.6, "kmh": 1 / 3.6,
          "kn": 1852.0 / 3600.0, "kt": 1852.0 / 3600.0, "ft/s": 0.3048}  # fmt: skip
NO_SPEEDS = ("1", "m/s^2")  # units of commands that are headings or accelerations
ANGLES = {"deg": 1.0, "°": 1.0, "degrees": 1.0}
PIXELS = ("px", "pixel", "pixels")
GIVE = "write --unit px --scale METRES_PER_PIXEL, or --unit mm, cm or m"  # where nothing tells the unit of a length

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
    zip(POSITION, VELOCITY, COMMAND, (_EAST, _NORTH, _UP), strict=True)
):
    ALIASES[_place] = (*_words, *(f"{p}_{w}" for p in ("pos", "position", "p") for w in _words))
    ALIASES[_speed] = tuple(f"{p}{w}" for p in ("v", "v_", "vel_", "velocity_", "speed_") for w in _words)
    wishes = ("c", "c_", "cmd_", "cmd_v", "command_", "command_v", "target_v", "target_vel_", "set_v", "sp_v", "tv")
    ALIASES[_wish] = tuple(f"{p}{w}" for p in wishes for w in _words)
EASTWARDS = frozenset(alias for alias in (*ALIASES["x"], "pe") if alias.split("_")[-1] in ("e", "east", "pe"))
ALIASES |= {"x": (*ALIASES["x"], "pe"), "y": (*ALIASES["y"], "pn")}  # of ArduPilot's XKF1, beside PD, VN, VE, VD
DOWN = {"down": "z", "pos_d": "z", "pos_down": "z", "position_down": "z", "vd": "vz", "vel_d": "vz", "vel_down": "vz",
        "pd": "z", "cmd_d": "cz", "cmd_vd": "cz", "cmd_down": "cz"}  # fmt: skip
DATUMS = {"height_above_msl": "amsl", "amsl": "amsl", "height_above_ellipsoid": "ellipsoid", "relative_alt": "home",
          "agl": "ground"}  # fmt: skip
_TARGET = {alias: target for target, known in ALIASES.items() for alias in known}
_SUFFIXES = sorted({*LENGTHS, *TIMES, *SPEEDS, *ANGLES, *PIXELS}, key=len, reverse=True)


class Meaning(NamedTuple):
    """What a header says: target, its unit (empty: not said), sign (-1 for down), and the level of a height."""

    target: str
    unit: str
    sign: float
    datum: str


def split(header: str) -> tuple[str, str]:
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
    return plain in {*LENGTHS, *TIMES, *SPEEDS, *ANGLES, *PIXELS}


def _plain(text: str) -> str:
    return re.sub(r"[\s.\-:]+", "_", text.strip().lower())


def meaning(header: str) -> Meaning | None:
    """What a column holds, or None if its name tells nothing."""
    name, unit = split(header)
    if name in DOWN:
        return Meaning(DOWN[name], unit, -1.0, "")
    target = _TARGET.get(name)
    return None if target is None else Meaning(target, unit, 1.0, DATUMS.get(name, ""))


def factor(target: str, unit: str, where: str, options: Options) -> float:
    """Number that turns a column into SI; raises RecordingError for a unit of something else.

    unit : of the header; if empty, that of the options
    """
    kind = {"t": TIMES, "utc": TIMES, "lat": ANGLES, "lon": ANGLES, "alt": LENGTHS}.get(target)
    if kind is None:
        kind = LENGTHS if target in POSITION else SPEEDS if target in (*VELOCITY, *COMMAND) else {}
    if not kind or target in GEODETIC[:2]:
        return 1.0
    if not unit and target in ("t", "utc"):
        unit = options.time_unit if options.time_unit != "frames" else ""
    if not unit and target in POSITION:
        unit = options.unit
    if not unit and target in (*VELOCITY, *COMMAND) and options.unit not in ("", *PIXELS):
        return LENGTHS[options.unit]
    if unit in PIXELS and target in POSITION:
        if options.scale is None:
            raise RecordingError(f"{where}: {target} is in pixels; say how many metres one is: --scale 0.0005")
        return options.scale
    if unit and unit not in kind:
        raise RecordingError(f"{where}: {unit}: unknown unit of {target}; known: {', '.join(kind)}")
    return kind[unit] if unit else 1.0


def length(unit: str, where: str, what: str, options: Options) -> float:
    """Metres in one unit of what has no header; raises RecordingError where neither it nor the options tell the unit.

    unit : that the file tells, if any; where, what : file and variable, for the message
    """
    if options.unit or unit in LENGTHS or unit in PIXELS:
        return factor("x", options.unit or unit, where, options)
    raise RecordingError(f"{where}: {what} has no unit; {GIVE}")
