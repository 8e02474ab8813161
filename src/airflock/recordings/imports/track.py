"""Tracks between a reader and the checks: one individual in SI units, options, and the report of errors."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.support import RecordingError

POSITION_TARGETS, VELOCITY_TARGETS, COMMAND_TARGETS = ("x", "y", "z"), ("vx", "vy", "vz"), ("cx", "cy", "cz")
COMPONENTS = {"position": POSITION_TARGETS, "velocity": VELOCITY_TARGETS, "command": COMMAND_TARGETS}
GEODETIC_TARGETS = ("lat", "lon", "alt")
OTHER_TARGETS = ("utc", "air", "id", "receiver", "frame")
TARGETS = ("t", *POSITION_TARGETS, *VELOCITY_TARGETS, *COMMAND_TARGETS, *GEODETIC_TARGETS, *OTHER_TARGETS)
ACCEPTABLE_ERRORS = {
    "absent": "keep individuals that are there for less than a fifth of the time",
    "axes": "keep axes, signs and units although velocities contradict them",
    "down": "keep z below 0",
    "duplicates": "keep the first of rows with one time",
    "height": "keep heights above different levels",
    "jumps": "split a track where its position jumps",
    "rows": "keep rows that a column of the file rejects: no fix, not visible, unlikely",
    "time": "keep a time whose unit looks wrong",
}


def ignore_progress(_: float) -> None:
    """Take no notice of progress."""


@dataclass(frozen=True, kw_only=True)
class ImportOptions:
    """Options of the user for files that do not contain this themselves, as in `load_tracks`.

    used : names of those that a reader made use of; those of no use are refused
    """

    map: Mapping[str, str] = field(default_factory=dict)
    unit: str = ""
    scale: float | None = None
    time_unit: str = ""
    fps: float | None = None
    keypoint: str = ""
    axes: str = ""
    decimal: str = "."
    delimiter: str = ""
    done: Callable[[float], None] = ignore_progress
    used: set[str] = field(default_factory=set)

    def use(self, name: str) -> Any:
        """Return an option, and note that it was of use."""
        self.used.add(name)
        return getattr(self, name)


class RowFlag(NamedTuple):
    """Meaning of a column that says which rows count: those of `least` or more, also where `sign` times it is meant.

    words : of rows that do not count; `receiver` and `used` name receivers or filters of one drone,
            of which one counts
    numbers : of receivers that have names, by name
    """

    words: str
    least: float = 1.0
    sign: float = 1.0
    numbers: dict[str, int] = {}  # noqa: RUF012


@dataclass
class ImportedTrack:
    """One individual. Arrays have one entry per row of the file. Readers keep rows without a time or a place (nan);
    `track_checks.drop_incomplete_rows` reports and removes them.

    name, source : the individual and its file, for messages
    time    : (row,) s, of the clock that `clock` names
    columns : target → (row,) m, m/s, degrees; position, velocity and command as far as the file has
              them
    rows    : (row,) number of the row in the file, for messages
    labels  : target → the column or topic that it was read from
    clock   : "utc", "boot" (since this device was switched on), "own" (of this file) or "shared"
              (by all in the file)
    utc     : (k, 2) own time and UTC, s, where the file has both
    datum   : what heights are above: "", "amsl", "ellipsoid" or "home"
    origin  : latitude, longitude (degrees) and height (m) of x = y = z = 0, if known
    fixed_units : whether its units are those of an autopilot, which nobody chooses
    unnamed : targets whose unit nobody has named
    ground  : whether its axes are known to point east and north
    air     : (row,) whether it was in the air; None if the file does not tell
    breaks  : rows at which the estimator was reset, so that positions before and after do not
              belong together
    flags   : column → what it says of rows, and its (row,) values;
              `track_checks.drop_rejected_rows` takes them
    """

    name: str
    source: str
    time: NDArray[np.float64]
    columns: dict[str, NDArray[np.float64]]
    rows: NDArray[np.int64]
    user_labels: dict[str, str] = field(default_factory=dict)
    clock: str = "shared"
    utc: NDArray[np.float64] | None = None
    datum: str = ""
    origin: tuple[float, float, float] | None = None
    fixed_units: bool = False
    ground: bool = False
    unnamed: frozenset[str] = frozenset()
    in_air: NDArray[np.bool_] | None = None
    breaks: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    flags: dict[str, tuple["RowFlag", NDArray[np.float64]]] = field(default_factory=dict)

    def has(self, names: tuple[str, ...]) -> bool:
        """Return True if the first two of three components are there."""
        return all(name in self.columns for name in names[:2])

    def stack(self, names: tuple[str, ...], dimensions: int) -> NDArray[np.float64]:
        """Stack components side by side, (row, dimensions); 0 for a missing height."""
        empty = np.zeros(len(self.time))
        return np.stack([self.columns.get(name, empty) for name in names[:dimensions]], axis=1)

    def label(self, target: str) -> str:
        """Return the user's own word for a target."""
        return self.user_labels.get(target, target)

    def keep(self, chosen: NDArray[Any]) -> None:
        """Keep only the chosen rows (a mask or an order)."""
        # Breaks are row numbers: after rows are dropped each break belongs to the next kept row.
        last = np.arange(len(self.time))[chosen]
        place = np.searchsorted(last, self.breaks) if last.size and (np.diff(last) > 0).all() else self.breaks
        self.breaks = np.unique(place[place < len(last)]).astype(np.int64)
        self.time, self.rows = self.time[chosen], self.rows[chosen]
        self.columns = {name: values[chosen] for name, values in self.columns.items()}
        self.in_air = None if self.in_air is None else self.in_air[chosen]


# Checks see tracks and know no format; errors that may be intended have a kind that `--accept`
# names. There is no "all".
@dataclass
class ImportReport:
    """Errors and notes of an import, collected to be reported together."""

    accepted_kinds: frozenset[str] = frozenset()
    errors: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    since: float = 0.0  # s to which a window of time is added: that of the first row, where times count since 1970

    def add_error(self, line: str, kind: str = "") -> bool:
        """Add an error; one of a kind that the user accepts becomes a note. Return True if it was accepted."""
        if kind in self.accepted_kinds:
            self.notes.append(f"accepted ({kind}): {line}")
            return True
        kept = "the first of each" if kind == "duplicates" else "it so"
        way = f"; or keep {kept}: --accept {kind}" if kind else ""
        self.errors.append(line + way)
        return False

    def raise_errors(self) -> None:
        """Raise a RecordingError with all errors, if there are any."""
        if self.errors:
            raise RecordingError("\n".join(dict.fromkeys(self.errors)))
