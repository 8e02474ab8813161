"""Columns of tables: meanings and units of headers, fields of PX4, expressions of the user, and the layout of all."""

import ast
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.recordings.imports.track import (
    COMMAND_TARGETS,
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
DATE_ORDERS = ("dmy", "mdy")  # of --time-unit: order of the numbers of dates that leave it open
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
# Words of units that name a column of times alone; short ones have other meanings, too.
TIME_WORDS = {word for word, unit in UNIT_WORDS.items() if unit in TIME_UNITS and word.endswith("s") and len(word) > 3}
UNIT_HINT = "write --unit px --scale METRES_PER_PIXEL, or --unit mm, cm or m"  # for a length without a unit

_EAST, _NORTH, _UP = ("x", "e", "east", "easting"), ("y", "n", "north", "northing"), ("z", "u", "up")
ALIASES: dict[str, tuple[str, ...]] = {
    "t": ("t", "time", "timestamp", "datetime", "date_time", "time_boot"),
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
    if plain in TIME_WORDS:
        return "time", UNIT_WORDS[plain]
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


UNITS_OF = {
    **dict.fromkeys(("t", "utc"), TIME_UNITS), **dict.fromkeys((*POSITION_TARGETS, "alt"), LENGTH_UNITS),
    **dict.fromkeys((*VELOCITY_TARGETS, *COMMAND_TARGETS), SPEED_UNITS),
}  # fmt: skip


def column_factor(target: str, unit: str, where: str, options: ImportOptions) -> float:
    """Return the factor that converts a column to SI; raise RecordingError for a unit of something else.

    unit : of the header; if empty, that of the options
    """
    kind = UNITS_OF.get(target)
    if kind is None:
        return 1.0
    # An option is of use where the header has no unit, or the same one.
    option = "time_unit" if target in ("t", "utc") else "unit" if target in (*POSITION_TARGETS, "alt") else ""
    if option and unit in ("", getattr(options, option)) and getattr(options, option) not in ("frames", *DATE_ORDERS):
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
    known |= OF_SATELLITES if "lat" in layout.sources else {}
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


class Source(NamedTuple):
    """Where a quantity is read.

    tree  : an expression of columns; factor : of its values to SI
    label : the user's word for it, which can stand in further expressions; bare : whether nobody
            has named its unit
    """

    tree: ast.expr
    factor: float
    label: str
    bare: bool = False


@dataclass
class ColumnLayout:
    """Layout of a table: target → where it is read; the column of names; notes for the user."""

    where: str
    sources: dict[str, Source] = field(default_factory=dict)
    id: str = ""  # a column, or "" where the whole file is one individual
    datum: str = ""
    ground: bool = False  # whether its axes are known to point east and north
    date: str = ""  # a column of days beside times of day
    clock: str = ""  # a column of local times: times of day, or dates without a zone if `dated`
    dated: bool = False
    notes: list[str] = field(default_factory=list)
    fixed_units: bool = False  # of PX4's fields
    ids: list[str] = field(default_factory=list)  # all columns of names, if none is mapped
    flags: dict[str, RowFlag] = field(default_factory=dict)  # columns that say which rows count
    unread: tuple[str, ...] = ()  # all other columns

    @property
    def used(self) -> list[str]:
        """Return the columns that are needed."""
        found = [name for source in self.sources.values() for name in column_names(source.tree)]
        return list(dict.fromkeys(found + [name for name in (self.id, self.date, *self.flags) if name]))

    @property
    def times(self) -> list[str]:
        """Return the columns of times that are read alone, so that they may be texts."""
        return [single_column(self.sources[target].tree) for target in ("t", "utc") if target in self.sources]

    @property
    def labels(self) -> dict[str, str]:
        """Return the user's words of all targets."""
        return {target: source.label for target, source in self.sources.items()}

    def name_units(self, targets: Iterable[str]) -> None:
        """Note that these units are known after all."""
        self.sources |= {name: self.sources[name]._replace(bare=False) for name in targets if name in self.sources}

    def values(self, table: Mapping[str, NDArray[np.float64]], count: int) -> dict[str, NDArray[np.float64]]:
        """Return the targets in SI units."""
        return {
            target: np.broadcast_to(source.factor * evaluate(source.tree, table), count).astype(float)
            for target, source in self.sources.items()
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
    wishes = [column for column in columns if _commands_no_velocity(column)]
    clock = [column for column in columns if _plain(column) in TIME_WORDS]  # hours, minutes, seconds: parts of one time
    other = [*wishes, *(clock if len(clock) > 1 else ())]
    _each(options.map, lambda target: _mapped(found, target, columns, options), errors)
    known = sorted(columns, key=lambda c: split_header(c)[0] in PROGRAM_WORDS or _plain(c) in TIME_WORDS)
    # A column that --map reads alone has the meaning that the map gives it, and no second one.
    mapped = {names[0] for source in found.sources.values() if len(names := column_names(source.tree)) == 1}
    rest = [column for column in known if column not in {*other, *mapped}]
    _each(rest, lambda column: _recognised(found, column, options), errors)
    with collect_errors(errors):
        _note_bare_lengths(found, columns, mapped, options)
    if wishes:
        found.notes.append(f"{where}: {', '.join(wishes)}: no commanded velocity: left out")
    # Missing targets are only reported if all columns could be read: they may be the unreadable
    # ones.
    whole = not errors
    _frames(found, options, errors)
    if whole:
        _complete(found, columns, errors)
        _note_unread(found, columns, options)
    found.date = next((c for c in columns if split_header(c)[0] in DATE_WORDS and c not in found.times), "")
    if errors:
        raise RecordingError("\n".join(errors))
    found.ground = bool(options.axes) or split_header(found.labels.get("x", ""))[0] in EAST_HEADERS
    _ned(found, options)
    px4 = found.fixed_units = options.axes == "ned" and is_px4_log(columns)
    for name in ORIGIN if px4 and set(columns) >= set(ORIGIN) else ():
        found.sources[name] = Source(parse_expression(repr(name), name), 1.0, name)
    found.flags = row_flags(columns, found, px4) | found.flags
    found.unread = tuple(column for column in columns if column not in found.used)
    return found


def _each(names: Iterable[str], read: Callable[[str], None], errors: list[str]) -> None:
    for name in names:
        with collect_errors(errors):
            read(name)


def _commands_no_velocity(column: str) -> bool:
    """Return True if a column is a commanded heading or acceleration."""
    meaning = header_meaning(column)
    return meaning is not None and meaning.target in COMMAND_TARGETS and meaning.unit in OTHER_COMMAND_UNITS


def _mapped(found: ColumnLayout, target: str, columns: Sequence[str], options: ImportOptions) -> None:
    """Read a target as --map says."""
    text = options.map[target]
    if target not in TARGETS:
        hint = suggest(target, TARGETS, f"known: {', '.join(TARGETS)}", cutoff=0.6)
        raise RecordingError(f"--map {target}:={text}: no target {target}; {hint}")
    if target == "id" and text.strip() in ("file", "columns"):  # columns: of a table with some for each individual
        options.used.update({"map id"} if text.strip() == "file" else ())
        return
    options.used.add(f"map {target}")
    tree = parse_expression(quote_names(text, columns), target)
    check_columns(tree, columns, found.where, target)
    one = single_column(tree)
    if target in ("id", "receiver"):
        if not one:
            raise RecordingError(f"--map {target}:={text}: give one column{', or file' * (target == 'id')}")
        found.id = one if target == "id" else found.id
        found.flags |= {one: RECEIVER._replace(numbers={})} if target == "receiver" else {}
        return
    label = one or f"({text.strip()})"
    meaning = header_meaning(one) if one else None
    if target == "t" and meaning is not None and meaning.target == "frame" and not options.time_unit:
        found.sources[target] = Source(tree, frame_length(f"{found.where}: column {one}", options), label)
        return
    unit = split_header(one)[1] if one else ""
    factor = column_factor(target, unit, found.where, options) if one else 1.0
    found.sources[target] = Source(tree, factor, label, bool(one) and _is_bare(target, unit, options))
    if target == "alt" and meaning is not None:
        found.datum = meaning.datum


def _recognised(found: ColumnLayout, column: str, options: ImportOptions) -> None:
    """Read a column as its header says, unless its target is read already."""
    meaning = header_meaning(column)
    if meaning is None or meaning.target in found.sources:
        return
    target, unit = meaning.target, meaning.unit
    if target == "id" and "id" not in options.map:
        found.ids.append(column)
        found.id = found.id or column
    if target in {"id", *options.map} or (target in POSITION_TARGETS and {"lat", "lon"} <= set(options.map)):
        return
    factor = meaning.sign * column_factor(target, unit, f"{found.where}: column {column}", options)
    tree = parse_expression(repr(column), target)
    found.sources[target] = Source(tree, factor, column, _is_bare(target, unit, options))
    found.datum = meaning.datum or found.datum


def _note_bare_lengths(
    found: ColumnLayout, columns: Sequence[str], mapped: Collection[str], options: ImportOptions
) -> None:
    """Note that positions without a unit are taken as metres; raise RecordingError where they come from a camera."""
    if {"lat", "lon", "alt", "z"} <= set(found.sources) and "z" not in options.map and "x" not in found.sources:
        del found.sources["z"]  # such as U, used, of ArduPilot's GPS
    bare = [source.label for target, source in found.sources.items()
            if target in POSITION_TARGETS and source.bare and source.label not in mapped]  # fmt: skip
    if not bare:
        return
    # Lengths without a unit are metres in logs of robots, but pixels in files of trackers and
    # cameras: there they are refused.
    hints = [f"{c} comes from a tracker" for c in columns if split_header(c)[0].split("_")[-1] in OF_A_TRACKER]
    if "t" not in found.sources and "frame" in found.sources:
        hints.append(f"{found.sources['frame'].label} comes from a camera")
    if hints:
        raise RecordingError(f"{found.where}: column {bare[0]} has no unit, and {hints[0]}; {UNIT_HINT}")
    found.notes.append(
        f"{found.where}: {', '.join(bare)} without a unit: taken as m; if not, write for instance --unit mm"
    )


def _is_bare(target: str, unit: str, options: ImportOptions) -> bool:
    """Return True if neither the header nor an option names the unit of a time or a position."""
    named = options.time_unit if target in ("t", "utc") else options.unit
    return target in ("t", "utc", *POSITION_TARGETS) and not unit and not named


def _frames(found: ColumnLayout, options: ImportOptions, errors: list[str]) -> None:
    """Use frame numbers as time where there is no other time."""
    frame = found.sources.pop("frame", None)
    counted = options.time_unit == "frames" and "t" in found.sources
    if "t" not in found.sources and frame is not None:
        found.sources["t"], counted = frame, True
    if counted:
        with collect_errors(errors):
            length = frame_length(f"{found.where}: column {found.sources['t'].label}", options)
            found.sources["t"] = found.sources["t"]._replace(factor=length, bare=False)


def _complete(found: ColumnLayout, columns: Sequence[str], errors: list[str]) -> None:
    """Add an error for each target that is missing."""
    shown = ", ".join(list(columns)[:12]) + (", ..." if len(columns) > 12 else "")
    if not {"t", "utc"} & set(found.sources):
        errors.append(f"{found.where}: no column of times among {shown}; write for instance --map t:=COLUMN")
    if not ({"x", "y"} <= set(found.sources) or {"lat", "lon"} <= set(found.sources)):
        errors.append(f"{found.where}: no position among {shown}; write for instance --map x:=COLUMN --map y:=COLUMN")
    for pair in (VELOCITY_TARGETS[:2], COMMAND_TARGETS[:2]):
        there, lacks = ([name for name in pair if (name in found.sources) is known] for known in (True, False))
        if there and lacks:
            label = found.sources[there[0]].label
            errors.append(f"{found.where}: has {there[0]} ({label}) but no {lacks[0]}; --map {lacks[0]}:=COLUMN")


def _note_unread(found: ColumnLayout, columns: Sequence[str], options: ImportOptions) -> None:
    """Note places that are there but not read: a depth, and latitudes beside x and y."""
    depth = next((column for column in columns if split_header(column)[0] == "depth"), "")
    if depth and not {"z", "alt"} & set(found.sources):
        way = f'--map "z:=-{quote_column(depth)}"'
        found.notes.append(f"{found.where}: column {depth} is left out; for a height, write {way}")
    if {"lat", "lon", "x", "y"} <= set(found.sources) and "x" not in options.map:
        x, y, lat, lon = (found.sources[name].label for name in ("x", "y", "lat", "lon"))
        found.notes.append(
            f"{found.where}: {x}, {y} are read as positions; also there: {lat}, {lon}; for these write "
            f'--map "lat:={quote_column(lat)}" --map "lon:={quote_column(lon)}"'
        )


def _ned(found: ColumnLayout, options: ImportOptions) -> None:
    """Swap north and east and turn z over, if the user declares that x is north."""
    for first, second, third in (POSITION_TARGETS, VELOCITY_TARGETS, COMMAND_TARGETS) if options.axes == "ned" else ():
        if {first, second, third} & set(found.sources):
            options.used.add("axes")
        if {first, second} <= set(found.sources):
            found.sources |= {first: found.sources[second], second: found.sources[first]}
        if third in found.sources:
            found.sources[third] = found.sources[third]._replace(factor=-found.sources[third].factor)
