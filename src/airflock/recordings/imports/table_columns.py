"""Columns of tables: meanings and units of headers, fields of PX4, expressions of the user, and the layout of all."""

import ast
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.recordings.imports.track import (
    COMMAND_TARGETS,
    GEODETIC_TARGETS,
    POSITION_TARGETS,
    TARGETS,
    VELOCITY_TARGETS,
    ImportOptions,
    RowFlag,
)
from airflock.support import RecordingError, collect_errors, suggest

LENGTH_UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "um": 1e-6, "km": 1000.0, "ft": 0.3048, "in": 0.0254}
TIME_UNITS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0,
         "cs": 0.01}  # fmt: skip
SPEED_UNITS = {"m/s": 1.0, "mps": 1.0, "cm/s": 0.01, "cmps": 0.01, "mm/s": 1e-3, "km/h": 1 / 3.6, "kmh": 1 / 3.6,
          "kn": 1852.0 / 3600.0, "kt": 1852.0 / 3600.0, "ft/s": 0.3048, "mph": 0.44704}  # fmt: skip
OTHER_COMMAND_UNITS = ("1", "m/s^2")  # units of commands that are headings or accelerations
ANGLES = {"deg": 1.0, "°": 1.0, "degrees": 1.0}
PIXEL_UNITS = ("px", "pixel", "pixels")
FRAME_UNITS = ("frame", "frames")
SPELLINGS = (  # of units, after the unit itself
    "m metre metres meter meters", "cm centimetre centimetres centimeter centimeters",
    "mm millimetre millimetres millimeter millimeters", "km kilometre kilometres kilometer kilometers",
    "um micron microns µm μm micrometer micrometers micrometre micrometres", "ft foot feet", "in inch inches",
    "s second seconds secs", "cs centisec centisecond centiseconds csec", "min minute minutes mins", "h hour hours hr",
    "ms msec msecs millis millisec millisecond milliseconds", "us usec μs micros microsec microsecond microseconds",
    "ns nsec nanosec nanosecond nanoseconds", "m/s m/sec m_s ms-1 m.s-1 meters/s metres/s", "cm/s cm/sec cm_s",
    "mm/s mm/sec", "ft/s ft/sec", "km/h kph kmph km/hr km_h", "kt kts knot knots", "mph mi/h",
)  # fmt: skip
UNIT_WORDS = {word: line.split()[0] for line in SPELLINGS for word in line.split()[1:]}
UNIT_HINT = "write --unit px --scale METRES_PER_PIXEL, or --unit mm, cm or m"  # for a length without a unit

_EAST, _NORTH, _UP = ("x", "e", "east", "easting"), ("y", "n", "north", "northing"), ("z", "u", "up")
ALIASES: dict[str, tuple[str, ...]] = {
    "t": ("t", "time", "timestamp", "seconds", "datetime", "date_time", "time_boot"),
    "frame": ("frame", "frames", "frame_idx", "frame_index", "frame_number"),
    "id": ("id", "individual", "agent", "drone", "track", "track_id", "trackid", "animal", "tag", "identity", "name",
           "individual_local_identifier", "tag_local_identifier", "fish", "bird", "ant", "subject", "uav", "vehicle",
           "individual_id", "agent_id", "drone_id", "animal_id", "fish_id", "bird_id", "object_id", "vehicle_id",
           "particle"),
    "lat": ("lat", "latitude", "location_lat", "gps_lat", "gps_latitude"),
    "lon": ("lon", "lng", "long", "longitude", "location_long", "location_lon", "gps_lon", "gps_lng", "gps_long",
            "gps_longitude"),
    "alt": ("alt", "altitude", "gps_alt", "gps_altitude", "height", "relative_alt", "agl",
            "amsl", "height_above_msl", "height_above_ellipsoid"),
    "utc": ("utc", "utc_time", "unix", "unix_time", "gps_time", "time_utc", "timestamp_utc",
            "utc_timestamp", "unix_timestamp", "epoch"),
    "air": ("air", "in_air", "flying", "armed"),
}  # fmt: skip
# Words of single programs: EthoVision, TrackMate, TRex, NetLogo and the client of the Crazyflie. They count only
# where no column has a plain word for the same quantity.
PROGRAM_WORDS: dict[str, str] = {
    "trial_time": "t", "recording_time": "t", "position_t": "t", "[step]": "frame", "ticks": "frame", "who": "id",
    **{f"{axis}{end}": axis for axis in "xy" for end in ("_center", "_wcentroid", "cor")},
    **{f"stateestimate_{name}": name for name in (*POSITION_TARGETS, *VELOCITY_TARGETS)},
    **{f"kalman_state{name}": name for name in POSITION_TARGETS},
}  # fmt: skip
DATE_WORDS = ("date", "utc_date", "gps_date", "local_date", "datum")  # of a column of days beside one of times
for _axis, (_place, _speed, _wish, _words) in enumerate(
    zip(POSITION_TARGETS, VELOCITY_TARGETS, COMMAND_TARGETS, (_EAST, _NORTH, _UP), strict=True)
):
    ALIASES[_place] = (*_words, *(f"{p}_{w}" for p in ("pos", "position", "p") for w in _words))
    ALIASES[_speed] = tuple(f"{p}{w}" for p in ("v", "v_", "vel_", "velocity_", "speed_") for w in _words)
    wishes = ("c", "c_", "cmd_", "cmd_v", "command_", "command_v", "target_v", "target_vel_", "set_v", "sp_v", "tv")
    ALIASES[_wish] = tuple(f"{p}{w}" for p in wishes for w in _words)
EAST_HEADERS = frozenset(
    alias for alias in (*ALIASES["x"], "pe") if alias.split("_")[-1] in ("e", "east", "easting", "pe")
)
ALIASES |= {"x": (*ALIASES["x"], "pe"), "y": (*ALIASES["y"], "pn")}  # of ArduPilot's XKF1, beside PD, VN, VE, VD
DOWN = {"down": "z", "pos_d": "z", "pos_down": "z", "position_down": "z", "vd": "vz", "vel_d": "vz", "vel_down": "vz",
        "pd": "z", "cmd_d": "cz", "cmd_vd": "cz", "cmd_down": "cz"}  # fmt: skip
DATUMS = {"height_above_msl": "amsl", "amsl": "amsl", "height_above_ellipsoid": "ellipsoid", "relative_alt": "home",
          "agl": "ground"}  # fmt: skip
_TARGET = {**PROGRAM_WORDS, **{alias: target for target, known in ALIASES.items() for alias in known}}
ALL_UNITS = {*LENGTH_UNITS, *TIME_UNITS, *SPEED_UNITS, *ANGLES, *PIXEL_UNITS, *UNIT_WORDS}
_SUFFIXES = sorted(ALL_UNITS, key=len, reverse=True)


class HeaderMeaning(NamedTuple):
    """Meaning of a header: target, its unit (empty: unknown), sign (-1 for down), and the level of a height."""

    target: str
    unit: str
    sign: float
    datum: str


def split_header(header: str) -> tuple[str, str]:
    """Name and unit of a header: `x [mm]`, `x(mm)`, `x_mm`; an empty unit if it has none."""
    text = header.strip()
    found = re.fullmatch(r"(.+?)\s*[\[(]([^\])]*)[\])]", text)
    if found:
        unit = found[2].strip().lower()
        return _plain(found[1]), UNIT_WORDS.get(unit, unit)
    plain = _plain(text)
    if plain == "timeus":  # as ArduPilot writes it
        return "time", "us"
    # Known names first: a name that ends like a unit, such as pos_m, may be a column of its own.
    if plain not in _TARGET:
        for unit in _SUFFIXES:
            if plain.endswith(f"_{unit}") and len(plain) > len(unit) + 1:
                return plain[: -len(unit) - 1], UNIT_WORDS.get(unit, unit)
    return plain, ""


def is_unit(text: str) -> bool:
    """Return True if a text is nothing but a unit, also in brackets."""
    return text.strip().strip("[]()").strip().lower() in {*ALL_UNITS, *FRAME_UNITS}


def _plain(text: str) -> str:
    return re.sub(r"[\s.\-:#]+", "_", text.strip().lower())


def header_meaning(header: str) -> HeaderMeaning | None:
    """Return the quantity in a column, or None for an unknown name."""
    name, unit = split_header(header)
    if name in DOWN:
        return HeaderMeaning(DOWN[name], unit, -1.0, "")
    target = _TARGET.get(name)
    return None if target is None else HeaderMeaning(target, unit, 1.0, DATUMS.get(name, ""))


def column_factor(target: str, unit: str, where: str, options: ImportOptions) -> float:
    """Return the factor that converts a column to SI; raise RecordingError for a unit of something else.

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
    # An option is of use where the header has no unit, or the same one.
    option = "time_unit" if target in ("t", "utc") else "unit" if target in (*POSITION_TARGETS, "alt") else ""
    if option and unit in ("", getattr(options, option)) and getattr(options, option) != "frames":
        unit = options.use(option)
    # A length unit on the command line means the same unit per second for velocities.
    if not unit and target in (*VELOCITY_TARGETS, *COMMAND_TARGETS) and options.unit not in ("", *PIXEL_UNITS):
        return LENGTH_UNITS[options.use("unit")]
    if unit in PIXEL_UNITS and target in POSITION_TARGETS:
        if options.scale is None:
            raise RecordingError(f"{where}: {target} is in pixels; say how many metres one is: --scale 0.0005")
        return float(options.use("scale"))
    if unit in FRAME_UNITS and target == "t":
        return frame_length(where, options)
    if unit and unit not in kind:
        raise RecordingError(f"{where}: {unit}: unknown unit of {target}; known: {', '.join(kind)}")
    return kind[unit] if unit else 1.0


def frame_length(where: str, options: ImportOptions) -> float:
    """Return the time between two frames, s; raise RecordingError if nobody has given their rate."""
    if options.fps is None:
        raise RecordingError(f"{where} counts frames; say how many a second: --fps 25")
    options.used.update({"time_unit"} if options.time_unit == "frames" else ())
    return 1.0 / float(options.use("fps"))


def unit_in_metres(unit: str, where: str, subject: str, options: ImportOptions) -> float:
    """Return the metres in one unit of an array without a header; raise RecordingError if nothing names the unit.

    unit : that of the file, if any; where, what : file and variable, for the message
    """
    unit = UNIT_WORDS.get(unit, unit)
    if options.use("unit") or unit in LENGTH_UNITS or unit in PIXEL_UNITS:
        return column_factor("x", options.unit or unit, where, options)
    raise RecordingError(f"{where}: {subject} has no unit; {UNIT_HINT}")


# Tables with the fields of PX4: x is north, z is down and times are microseconds, although no
# header says so.
FIELDS = {"timestamp", *POSITION_TARGETS, *VELOCITY_TARGETS}
# fields of vehicle_local_position that no other table has; source: PX4,
# msg/VehicleLocalPosition.msg
MARKS = {"ref_timestamp", "xy_valid", "z_valid", "v_xy_valid", "xy_reset_counter", "vxy_reset_counter", "z_deriv"}
CRAZYFLIE = ("stateestimate_x", "kalman_statex")  # fields of its logs, whose times are milliseconds
ORIGIN = ("ref_lat", "ref_lon", "ref_alt")
VALID = ("xy_valid", "v_xy_valid")

# Columns that say which rows count, by their plain names. Sources: MAVLink, GPS_FIX_TYPE (2: a fix in the plane); NMEA
# 0183, GGA (quality 1: a fix) and RMC (status A or V); ROS, NavSatStatus (0: a fix); Movebank, attribute dictionary.
FIX, QUALITY = RowFlag("without a fix of satellites", 2.0), RowFlag("without a fix of satellites")
OUTLIER, RECEIVER, USED = RowFlag("marked as outliers or missing", 0.0, -1.0), RowFlag("receiver"), RowFlag("used")
LIKELY = RowFlag("less likely than 0.6", 0.6)  # our choice, also that of DeepLabCut's and movement's examples
ESTIMATED = RowFlag("that the estimator calls invalid")
ROW_FLAGS: dict[str, RowFlag] = {
    **dict.fromkeys(("fix_type", "gps_fix_type", "gps_fix_type_raw", "fix", "gps_fix"), FIX),
    **dict.fromkeys(("fix_quality", "gps_quality", "gga_quality", "rmc_status"), QUALITY),
    "status_status": QUALITY._replace(least=0.0),
    **dict.fromkeys(("visible", "valid", "is_valid"), RowFlag("not visible or not valid")),
    **dict.fromkeys(("outlier", "is_outlier", "missing", "import_marked_outlier"), OUTLIER),
    **dict.fromkeys(("manually_marked_outlier", "algorithm_marked_outlier"), OUTLIER),
    **dict.fromkeys(("likelihood", "confidence", "probability", "score"), LIKELY),
    **dict.fromkeys(("receiver", "receiver_id", "gps_instance", "gps_id", "ekf_core", "core", "multi_id"), RECEIVER),
}
# Names that mean this only beside latitudes (GPS of any kind), or in a log of ArduPilot (GPS: I, Status, U; XKF1: C).
OF_SATELLITES = {"instance": RECEIVER, "status": QUALITY, "quality": QUALITY}
OF_ARDUPILOT = {"i": RECEIVER, "c": RECEIVER, "status": FIX, "u": USED}


def px4_options(where: str, columns: Sequence[str], options: ImportOptions) -> tuple[ImportOptions, list[str]]:
    """Return options for a table of these columns, and notes: axes and times of PX4 where its fields are there.

    Raises RecordingError where they may be those of PX4 and nobody has said which axes they are.
    """
    names = {split_header(column)[0]: split_header(column)[1] for column in columns}
    if not options.time_unit and names.get("timestamp") == "" and any(name in CRAZYFLIE for name in names):
        note = f"{where}: column timestamp: fields of the Crazyflie: times in ms; if not, write --time-unit us"
        return replace(options, time_unit="ms"), [note]
    if not set(names) >= FIELDS or set(options.map) & {*POSITION_TARGETS, *VELOCITY_TARGETS}:
        return options, []
    micro = "us" in (options.time_unit, names["timestamp"]) or "timestamp" in options.map.get("t", "")
    if is_px4_log(columns):
        unit = options.time_unit or ("" if names["timestamp"] else "us")
        found = replace(options, axes=options.axes or "ned", time_unit=unit, unit=options.unit or "m")
        meaning = "x is north, y east, z down (otherwise --axes enu), times in us, lengths in m"
        return found, [f"{where}: fields of PX4's vehicle_local_position: {meaning}"] if not options.axes else []
    if micro and not options.axes:
        raise RecordingError(
            f"{where}: timestamp in us, x, y, z, vx, vy, vz are fields of PX4, whose x is north and z down: "
            "write --axes ned, or --axes enu if x is east"
        )
    return options, []


def is_px4_log(columns: Sequence[str]) -> bool:
    """Return True if a table of these columns can only be PX4's vehicle_local_position."""
    names = {split_header(column)[0] for column in columns}
    return names >= FIELDS and bool(names & MARKS)


def row_flags(columns: Sequence[str], layout: "ColumnLayout", px4: bool) -> dict[str, RowFlag]:
    """Return the columns that say which rows count, with their meanings; none that is read as something else."""
    plain = {column: split_header(column)[0] for column in columns if column not in layout.used}
    known = ROW_FLAGS | (dict.fromkeys(VALID, ESTIMATED) if px4 else {})
    known |= OF_SATELLITES if "lat" in layout.expressions else {}
    known |= OF_ARDUPILOT if any(_plain(column) == "timeus" for column in columns) else {}
    return {column: known[name] for column, name in plain.items() if name in known}


def invalid_note(where: str, name: str, valid: Any, row_numbers: Any) -> str:
    """Return the note on rows that the estimator calls invalid."""
    bad = row_numbers[~valid]
    return f"{where}: {name}: {len(bad)} rows that the estimator calls invalid left out, first row {bad[0]}"


def px4_origin(local: Mapping[str, Any]) -> tuple[float, float, float] | None:
    """Return latitude, longitude (degrees) and height (m) of x = y = z = 0, once the estimator knows them."""
    if not all(name in local for name in ORIGIN):
        return None
    place = np.stack([np.asarray(local[f"ref_{name}"], float) for name in ("lat", "lon", "alt")], axis=1)
    known = place[np.isfinite(place).all(axis=1) & (place[:, :2] != 0.0).any(axis=1)]
    return None if not len(known) else (float(known[-1, 0]), float(known[-1, 1]), float(known[-1, 2]))


# A list of allowed ast nodes, walked by us: eval with a cleaned namespace still reaches the
# interpreter by attributes.
LONGEST = 300  # characters; nothing that a column needs is longer
OPERATIONS = {ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide}
ALLOWED = "column names, numbers, + - * / and parentheses; a name with blanks stands in quotes"


def parse_expression(text: str, target: str) -> ast.expr:
    """Parse an expression; raise RecordingError for anything but arithmetic of columns."""
    if len(text) > LONGEST:
        raise RecordingError(f"--map {target}:=...: has {len(text)} characters, more than {LONGEST}")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        raise RecordingError(f"--map {target}:={text}: cannot be read; it may hold {ALLOWED}") from error
    for node in ast.walk(tree):
        number = isinstance(node, ast.Constant) and type(node.value) in (int, float, str)
        sign = isinstance(node, (ast.UnaryOp, ast.USub, ast.UAdd))
        word = isinstance(node, (ast.Name, ast.Load, ast.BinOp, *OPERATIONS))
        if not (number or sign or word):
            raise RecordingError(f"--map {target}:={text}: {type(node).__name__} is not allowed; it may hold {ALLOWED}")
    return tree


def column_names(tree: ast.expr) -> list[str]:
    """Return the columns that an expression uses."""
    found = [node.id for node in ast.walk(tree) if isinstance(node, ast.Name)]
    return found + [n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str)]


def single_column(tree: ast.expr) -> str:
    """Return the column of an expression that is nothing but one column; else empty."""
    return column_names(tree)[0] if isinstance(tree, ast.Name) or _text(tree) else ""


def _text(tree: ast.expr) -> bool:
    return isinstance(tree, ast.Constant) and isinstance(tree.value, str)


def check_columns(tree: ast.expr, columns: Any, where: str, target: str) -> None:
    """Raise a RecordingError if an expression asks for a column that is not there."""
    for name in column_names(tree):
        if name not in columns:
            shown = ", ".join(str(c) for c in list(columns)[:12])
            hint = suggest(name, map(str, columns), f"it has {shown}", cutoff=0.4)
            raise RecordingError(f"{where}: --map {target}: no column {name}; {hint}")


def evaluate(tree: ast.expr, columns: Mapping[str, NDArray[np.float64]]) -> Any:
    """Evaluate an expression with arrays in the place of names."""
    if isinstance(tree, ast.BinOp):
        with np.errstate(divide="ignore", invalid="ignore"):
            return OPERATIONS[type(tree.op)](evaluate(tree.left, columns), evaluate(tree.right, columns))
    if isinstance(tree, ast.UnaryOp):
        inner = evaluate(tree.operand, columns)
        return -inner if isinstance(tree.op, ast.USub) else inner
    if isinstance(tree, ast.Name):
        return columns[tree.id]
    assert isinstance(tree, ast.Constant)
    return columns[tree.value] if isinstance(tree.value, str) else float(tree.value)  # type: ignore[arg-type]


def quote_column(column: str) -> str:
    """Return a column, or an expression in parentheses, as it is written in an expression of --map."""
    return column if column.isidentifier() or column.startswith("(") else f"'{column}'"


def quote_names(text: str, columns: Sequence[str]) -> str:
    """Put quotes round columns whose names have hyphens, dots or blanks; a text that is one column is that column."""
    if text.strip() in columns:
        return repr(text.strip())
    # Longest first, so that a name that begins another one does not cut it; what stands in quotes stays.
    odd = sorted((name for name in columns if name and not name.isidentifier()), key=len, reverse=True)
    names = "|".join(map(re.escape, odd)) or "(?!)"
    return re.sub(
        rf"""('[^']*'|"[^"]*")|(?<![\w.])({names})(?![\w.])""",
        lambda match: match[1] or repr(match[2]),
        text,
    )


MAX_COLUMNS = 2000
OF_A_TRACKER = ("probability", "likelihood", "score", "confidence", "wcentroid")


@dataclass
class ColumnLayout:
    """Layout of a table: target → expression and factor; the column of names; notes for the user."""

    where: str
    expressions: dict[str, Any] = field(default_factory=dict)
    factors: dict[str, float] = field(default_factory=dict)
    user_labels: dict[str, str] = field(default_factory=dict)
    id: str = ""  # a column, or "" where the whole file is one individual
    datum: str = ""
    ground: bool = False  # whether its axes are known to point east and north
    date: str = ""  # a column of days beside times of day
    clocks: list[str] = field(default_factory=list)  # columns of times of day without a date
    unitless: list[str] = field(default_factory=list)  # targets whose unit nobody has named
    notes: list[str] = field(default_factory=list)
    fixed_units: bool = False  # of PX4's fields
    ids: list[str] = field(default_factory=list)  # all columns of names, if none is mapped
    flags: dict[str, RowFlag] = field(default_factory=dict)  # columns that say which rows count

    @property
    def used(self) -> list[str]:
        """Return the columns that are needed."""
        found = [name for tree in self.expressions.values() for name in column_names(tree)]
        return list(dict.fromkeys(found + [name for name in (self.id, self.date, *self.flags) if name]))

    @property
    def times(self) -> list[str]:
        """Return the columns of times that are read alone, so that they may be texts."""
        return [single_column(self.expressions[target]) for target in ("t", "utc") if target in self.expressions]

    def values(self, table: Mapping[str, NDArray[np.float64]], count: int) -> dict[str, NDArray[np.float64]]:
        """Return the targets in SI units."""
        return {
            target: np.broadcast_to(self.factors[target] * evaluate(tree, table), count).astype(float)
            for target, tree in self.expressions.items()
        }


def column_layout(where: str, columns: Sequence[str], options: ImportOptions) -> ColumnLayout:
    """Find the layout of a table with these columns; raise RecordingError with all errors."""
    if len(columns) > MAX_COLUMNS:
        raise RecordingError(
            f"{where}: {len(columns)} columns are more than {MAX_COLUMNS}; "
            "give a long table with the columns id, t, x, y"
        )
    twice = [name for i, name in enumerate(columns) if name in columns[:i]]
    if twice:
        raise RecordingError(f"{where}: column {twice[0]} appears twice; rename one of them")
    errors: list[str] = []
    options, notes = px4_options(where, columns, options)
    found = ColumnLayout(where, notes=notes)
    other = [column for column in columns if _commands_no_velocity(column)]
    with collect_errors(errors):
        _mapped(found, columns, options)
    with collect_errors(errors):
        _recognised(found, [column for column in columns if column not in other], options)
    if other:
        found.notes.append(f"{where}: {', '.join(other)}: no commanded velocity: left out")
    # Missing targets are only reported if all columns could be read: they may be the unreadable
    # ones.
    whole = not errors
    _frames(found, options, errors)
    if whole:
        _complete(found, columns, errors)
        _note_unread(found, columns, options)
    dates = [column for column in columns if split_header(column)[0] in DATE_WORDS and column not in found.times]
    found.date = dates[0] if dates else ""
    if errors:
        raise RecordingError("\n".join(errors))
    found.ground = bool(options.axes) or split_header(found.user_labels.get("x", ""))[0] in EAST_HEADERS
    _ned(found, options)
    px4 = found.fixed_units = options.axes == "ned" and is_px4_log(columns)
    for name in ORIGIN if px4 and set(columns) >= set(ORIGIN) else ():
        found.expressions[name], found.factors[name] = parse_expression(repr(name), name), 1.0
        found.user_labels[name] = name
    found.flags = row_flags(columns, found, px4)
    return found


def _commands_no_velocity(column: str) -> bool:
    """Return True if a column is a commanded heading or acceleration."""
    meaning = header_meaning(column)
    return meaning is not None and meaning.target in COMMAND_TARGETS and meaning.unit in OTHER_COMMAND_UNITS


def _mapped(found: ColumnLayout, columns: Sequence[str], options: ImportOptions) -> None:
    errors = []
    for target, text in options.map.items():
        try:
            if target not in TARGETS:
                hint = suggest(target, TARGETS, f"known: {', '.join(TARGETS)}", cutoff=0.6)
                raise RecordingError(f"--map {target}:={text}: no target {target}; {hint}")
            if target == "id" and text.strip() == "file":
                options.used.add("map id")
                continue
            options.used.add(f"map {target}")
            tree = parse_expression(quote_names(text, columns), target)
            check_columns(tree, columns, found.where, target)
            if target == "id":
                found.id = single_column(tree)
                if not found.id:
                    raise RecordingError(f"--map id:={text}: give one column, or file")
                continue
            one = single_column(tree)
            meaning = header_meaning(one) if one else None
            unit = split_header(one)[1] if one else ""
            # A label in parentheses can stand in further expressions, as messages write them.
            found.expressions[target], found.user_labels[target] = tree, one or f"({text.strip()})"
            if target == "t" and meaning is not None and meaning.target == "frame" and not options.time_unit:
                found.factors[target] = frame_length(f"{found.where}: column {one}", options)
                continue
            found.factors[target] = column_factor(target, unit, found.where, options) if one else 1.0
            found.unitless += [target] if one and _unitless(target, unit, options) else []
            if target == "alt" and meaning is not None:
                found.datum = meaning.datum
        except RecordingError as error:
            errors.append(str(error))
    if errors:
        raise RecordingError("\n".join(errors))


def _recognised(found: ColumnLayout, columns: Sequence[str], options: ImportOptions) -> None:
    errors, unsaid = [], []
    # A column that --map reads alone has the meaning that the map gives it, and no second one.
    mapped = {names[0] for tree in found.expressions.values() if len(names := column_names(tree)) == 1}
    placed = {"lat", "lon"} <= set(options.map)
    for column in sorted(columns, key=lambda column: split_header(column)[0] in PROGRAM_WORDS):
        meaning = header_meaning(column)
        if meaning is None or meaning.target in found.expressions or column in mapped:
            continue
        if placed and meaning.target in POSITION_TARGETS:
            continue
        if meaning.target == "id":
            if "id" not in options.map:
                found.ids.append(column)
                found.id = found.id or column
            continue
        if meaning.target in options.map:
            continue
        try:
            scale = column_factor(meaning.target, meaning.unit, f"{found.where}: column {column}", options)
        except RecordingError as error:
            errors.append(str(error))
            continue
        found.expressions[meaning.target] = parse_expression(repr(column), meaning.target)
        found.factors[meaning.target] = meaning.sign * scale
        found.user_labels[meaning.target] = column
        found.datum = meaning.datum or found.datum
        found.unitless += [meaning.target] if _unitless(meaning.target, meaning.unit, options) else []
        if meaning.target in POSITION_TARGETS and not meaning.unit and not options.unit:
            unsaid.append(column)
    if {"lat", "lon", "alt", "z"} <= set(found.expressions) and "z" not in options.map and "x" not in found.expressions:
        unsaid = [
            column for column in unsaid if column != found.user_labels["z"]
        ]  # such as U, used, of ArduPilot's GPS
        _drop(found, "z")
    if errors:
        raise RecordingError("\n".join(errors))
    # Lengths without a unit are metres in logs of robots, but pixels in files of trackers and
    # cameras: there they are refused.
    if unsaid:
        hints = [f"{c} comes from a tracker" for c in columns if split_header(c)[0].split("_")[-1] in OF_A_TRACKER]
        if "t" not in found.expressions and "frame" in found.expressions:
            hints.append(f"{found.user_labels['frame']} comes from a camera")
        if hints:
            raise RecordingError(f"{found.where}: column {unsaid[0]} has no unit, and {hints[0]}; {UNIT_HINT}")
        found.notes.append(
            f"{found.where}: {', '.join(unsaid)} without a unit: taken as m; if not, write for instance --unit mm"
        )


def _unitless(target: str, unit: str, options: ImportOptions) -> bool:
    """Return True if neither the header nor an option names the unit of a time or a position."""
    named = options.time_unit if target in ("t", "utc") else options.unit
    return target in ("t", "utc", *POSITION_TARGETS) and not unit and not named


def _frames(found: ColumnLayout, options: ImportOptions, errors: list[str]) -> None:
    """Use frame numbers as time where there is no other time."""
    counted = options.time_unit == "frames" and "t" in found.expressions
    if "t" not in found.expressions and "frame" in found.expressions:
        _copy(found, "frame", "t")
        counted = True
    if counted:
        with collect_errors(errors):
            found.factors["t"] = frame_length(f"{found.where}: column {found.user_labels['t']}", options)
        found.unitless = [target for target in found.unitless if target != "t"]
    _drop(found, "frame")


def _complete(found: ColumnLayout, columns: Sequence[str], errors: list[str]) -> None:
    shown = ", ".join(list(columns)[:12]) + (", ..." if len(columns) > 12 else "")
    if "t" not in found.expressions and "utc" not in found.expressions:
        errors.append(f"{found.where}: no column of times among {shown}; write for instance --map t:=COLUMN")
    local = all(name in found.expressions for name in POSITION_TARGETS[:2])
    geodetic = all(name in found.expressions for name in ("lat", "lon"))
    if not (local or geodetic):
        errors.append(f"{found.where}: no position among {shown}; write for instance --map x:=COLUMN --map y:=COLUMN")
    for part in (VELOCITY_TARGETS, COMMAND_TARGETS):
        if sum(name in found.expressions for name in part[:2]) == 1:
            there = next(name for name in part[:2] if name in found.expressions)
            lacks = next(name for name in part[:2] if name not in found.expressions)
            errors.append(
                f"{found.where}: has {there} ({found.user_labels[there]}) but no {lacks}; --map {lacks}:=COLUMN"
            )


def _note_unread(found: ColumnLayout, columns: Sequence[str], options: ImportOptions) -> None:
    """Note places that are there but not read: a depth, and latitudes beside x and y."""
    depth = next((column for column in columns if split_header(column)[0] == "depth"), "")
    if depth and not {"z", "alt"} & set(found.expressions):
        way = f'--map "z:=-{quote_column(depth)}"'
        found.notes.append(f"{found.where}: column {depth} is left out; for a height, write {way}")
    if {"lat", "lon", "x", "y"} <= set(found.expressions) and "x" not in options.map:
        x, y, lat, lon = (found.user_labels[name] for name in ("x", "y", "lat", "lon"))
        found.notes.append(
            f"{found.where}: {x}, {y} are read as positions; also there: {lat}, {lon}; for these write "
            f'--map "lat:={quote_column(lat)}" --map "lon:={quote_column(lon)}"'
        )


def _ned(found: ColumnLayout, options: ImportOptions) -> None:
    """Swap north and east and turn z over, if the user declares that x is north."""
    if options.axes != "ned":
        return
    # Swapped by way of an empty name, for positions, velocities and commands.
    for first, second, third in (POSITION_TARGETS, VELOCITY_TARGETS, COMMAND_TARGETS):
        if {first, second, third} & set(found.expressions):
            options.used.add("axes")
        if first in found.expressions and second in found.expressions:
            _copy(found, first, "")
            _copy(found, second, first)
            _copy(found, "", second)
        if third in found.factors:
            found.factors[third] = -found.factors[third]
    _drop(found, "")


def _copy(found: ColumnLayout, source: str, target: str) -> None:
    found.expressions[target], found.factors[target] = found.expressions[source], found.factors[source]
    found.user_labels[target] = found.user_labels[source]


def _drop(found: ColumnLayout, target: str) -> None:
    for table in (found.expressions, found.factors, found.user_labels):
        table.pop(target, None)
