"""Read tables: CSV and Parquet files and pandas DataFrames, long or with columns for each individual."""

import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice, takewhile, zip_longest
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from airflock.recordings.imports import format_words, reader, table_columns
from airflock.recordings.imports.table_columns import MAX_COLUMNS, ColumnLayout, column_layout
from airflock.recordings.imports.track import (
    GEODETIC_TARGETS,
    POSITION_TARGETS,
    ImportedTrack,
    ImportOptions,
    ImportReport,
    RowFlag,
)
from airflock.recordings.imports.track_checks import PLACE_TARGETS
from airflock.support import RecordingError, trim_heap

SHORT_CLOCK = r"\d+:[0-5]\d"  # hours, minutes; counted so only beside a date
CLOCK = r"\d+:[0-5]\d:[0-5]\d(\.\d+)?"  # hours, minutes, seconds
CHUNK = 250_000  # rows that are read at a time, so that an hour of thirty drones fits
DAY = 86400.0  # s
DATES = ("%Y-%m-%d", "%Y/%m/%d", "%d.%m.%Y", "%Y%m%d", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y")
ZONE = r"(?:Z|[+-]\d\d:?\d\d)$"  # behind a date
FIRST_DATE, LAST_DATE = 6.3e8, 4.2e9  # s since 1970: 1990 and 2103
PoseColumns = dict[str, dict[str, dict[str, str]]]  # individual → keypoint → component → column


@reader("table", suffixes=(".csv", ".tsv", ".txt"))
def read_csv(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """A long table with `id`, one file per individual, or a pair of columns for each: `time, x1, y1, x2, y2, ...`,
    `time, fish1_x, fish1_y, ...`. Columns are separated by commas, semicolons, tabs, bars or
    blanks. Lines above the names are left out, whether or not they begin with `#` (EthoVision,
    NetLogo's BehaviorSpace); a row of units below the names is read (EthoVision, TrackMate).
    """
    head = read_head(path, options)
    findings.notes += [f"{path}: {note}" for note in head.notes]
    size = path.stat().st_size
    text = {"sep": head.delimiter, "decimal": options.decimal, "encoding": head.encoding, "skipinitialspace": True}
    text |= {"header": None, "names": head.names} if head.named else {}
    text |= {"skiprows": head.above, "index_col": False if head.trailing else None}
    # A lone hyphen is a missing number, but it may be a name.
    text["na_values"] = {name: ["-"] for name in head.names if name not in names_of_individuals(head.names, options)}

    def parts(columns: list[str] | None) -> Iterator[tuple[int, pd.DataFrame]]:
        at = head.first  # the row after the header, as an editor counts
        with path.open("rb") as file:
            wanted = None if columns is None else lambda c: c.strip() in columns
            try:
                # In chunks, and only the needed columns: an hour of thirty drones does not fit as
                # text.
                for part in pd.read_csv(file, usecols=wanted, chunksize=CHUNK, low_memory=False, **text):
                    part.columns = [str(c).strip() for c in part.columns]
                    yield at, part
                    at += len(part)
                    options.done(file.tell() / max(size, 1))
            except (pd.errors.ParserError, UnicodeDecodeError) as error:
                raise RecordingError(f"{path}: {str(error).splitlines()[0]}") from error

    return tracks_from_parts(str(path), path.stem, head.names, parts, options, findings, head.pose)


def names_of_individuals(columns: list[str], options: ImportOptions) -> list[str]:
    """Return the columns that may hold names of individuals."""
    meanings = map(table_columns.header_meaning, columns)
    named = [column for column, meaning in zip(columns, meanings, strict=True) if meaning and meaning.target == "id"]
    return [*named, options.map.get("id", "").strip("'\" ")]


@reader("Parquet table", suffixes=(".parquet",), needs="pyarrow")
def read_parquet(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """Columns as of a text; a pandas DataFrame is read in the same way."""
    try:
        import pyarrow
        import pyarrow.parquet as parquet
    except ImportError as error:
        raise RecordingError(f"{path}: needs pyarrow: pip install 'airflock[logs]'") from error
    try:
        file = parquet.ParquetFile(path, pre_buffer=False, buffer_size=1 << 20)
    except (OSError, ValueError) as error:
        raise RecordingError(f"{path}: is not a Parquet table: {str(error).splitlines()[0]}") from error
    total = max(file.metadata.num_rows, 1)

    def parts(columns: list[str] | None) -> Iterator[tuple[int, pd.DataFrame]]:
        at = 1
        # Arrow decodes a column in each of its threads, and keeps what it has freed: a third of an
        # hour's memory
        for batch in file.iter_batches(batch_size=CHUNK // 4, columns=columns, use_threads=False):
            yield at, batch.to_pandas()
            at += batch.num_rows
            pyarrow.default_memory_pool().release_unused()
            options.done(min(1.0, at / total))

    return tracks_from_parts(str(path), path.stem, list(file.schema_arrow.names), parts, options, findings)


def table_from_columns(columns: Mapping[str, Any]) -> pd.DataFrame:
    """Make a table of columns by name; a column that is no list has one value for all rows. Raise RecordingError."""
    lists = {str(k): list(v) for k, v in columns.items() if np.iterable(v) and not isinstance(v, str)}
    if len({len(column) for column in lists.values()}) != 1:
        lengths = ", ".join(f"{name} has {len(column)}" for name, column in lists.items()) or "there are none"
        raise RecordingError(f"columns of a table must be lists of equal length: {lengths}")
    return pd.DataFrame({str(name): lists.get(str(name), value) for name, value in columns.items()})


def read_frame(
    table: pd.DataFrame,
    options: ImportOptions,
    findings: ImportReport,
    where: str = "DataFrame",
    stem: str = "individual",
) -> list[ImportedTrack]:
    """Read the tracks of a pandas DataFrame; a named index is a column, too."""
    flat = table.reset_index() if any(name is not None for name in table.index.names) else table
    flat = flat.set_axis([str(c) for c in flat.columns], axis=1)
    return tracks_from_parts(where, stem, list(flat.columns), lambda _: iter([(0, flat)]), options, findings)


def tracks_from_parts(
    where: str, stem: str, names: list[str], parts: Any, options: ImportOptions, findings: ImportReport,
    pose: PoseColumns | None = None,
) -> list[ImportedTrack]:  # fmt: skip
    """Read the tracks of a table that comes in parts, by the layout of its columns.

    pose : individual → keypoint → component → column, where rows above the table say so
    """
    wide: dict[str, dict[str, str]] = {}
    if pose:
        wide = _of_keypoint(pose, where, options)
    elif not any(target in options.map for target in (*POSITION_TARGETS, *GEODETIC_TARGETS)):
        wide = wide_columns(names, where, stem, options)
    headers = long_names(wide, where)
    grouped = [*wide.values(), *(column_groups(names).values() if wide else ())]
    taken = {column for parts in grouped for column in parts.values()}
    how = column_layout(where, [*(name for name in names if name not in taken), *headers.values()], options)
    findings.notes += how.notes
    _choose_id(where, how, parts, findings)
    if "id" not in options.map:
        _ask_for_receivers(where, how, parts)
    gathered: dict[str, list[Any]] = {}
    nameless: list[Any] = [np.empty(0, int)]
    columns = None if wide else how.used
    # Parts are split by individual at once and joined at the end, so that only numbers stay in
    # memory.
    for at, part in parts(columns):
        rows = np.arange(at, at + len(part))
        for name, piece in split_by_individual(part, wide, headers, stem):
            read = [c for c in how.used if c not in (how.id, how.date, *how.flags)]
            numbers = {c: _numbers(piece, c, how, at, options) for c in read}
            values = how.values(numbers, len(piece)) | {
                f"flag {c}": _flag_values(piece[c], how.flags[c]) for c in how.flags
            }
            whole = np.all([np.isfinite(values[c]) for c in PLACE_TARGETS if c in values], axis=0)
            whole &= np.isfinite(values["t" if "t" in values else "utc"])
            if how.id:
                nameless.append(rows[whole & piece[how.id].isna().to_numpy()])
            for own, chosen in _by_name(piece[how.id]) if how.id else ((name, slice(None)),):
                taken_values = {target: array[chosen] for target, array in values.items()}
                gathered.setdefault(own, []).append((taken_values, rows[chosen]))
    if not gathered:
        unnamed = f"no name in column {how.id}; write --map id:=file" if sum(map(len, nameless)) else "no rows"
        raise RecordingError(f"{where}: has {unnamed}")
    _unit_of_dates(how, gathered, findings)
    lost = np.unique(np.concatenate(nameless))
    if len(lost):
        findings.notes.append(f"{where}: {len(lost)} rows without an id left out, first row {lost[0]}")
    tracks = []
    for name in list(gathered):
        tracks.append(_track(name, where, gathered.pop(name), how, bool(how.id or wide), findings))
    if how.clock:
        late = [_set_back(track, how.dated) for track in tracks]
        what = "1 h: taken as the end of summer time" if how.dated else "more than 12 h: taken as midnight"
        findings.notes += [f"{where}: column {how.clock}, row {row} goes back by {what}" for row in late if row][:1]
    trim_heap()
    return tracks


def _numbers(piece: pd.DataFrame, name: str, how: ColumnLayout, at: int, options: ImportOptions) -> Any:
    """Return a column as float64; raise RecordingError for the first text in it that is no number.

    Dates become seconds since 1970, durations seconds. Times may also be texts: dates, or
    hours:minutes:seconds, to which a date in another column is added.
    """
    column, time = piece[name], name in how.times
    if pd.api.types.is_numeric_dtype(column):
        if time and how.date and name == how.labels.get("t") and piece[how.date].nunique() > 1:
            raise RecordingError(
                f"{how.where}: column {how.date}, row {at} on, holds several dates beside column {name}, whose numbers "
                f"are no times of day; write one column (2026-05-04T10:00:00), or --map t:={name}*1 if it counts on"
            )
        return column.to_numpy(float, na_value=np.nan)
    if pd.api.types.is_datetime64_any_dtype(column):
        found = _since_1970(column)
    elif pd.api.types.is_timedelta64_dtype(column):
        found = column.dt.total_seconds().to_numpy(float)
    else:
        numbers, text, given = pd.to_numeric(column, errors="coerce"), *_texts(column)
        bad = np.flatnonzero((numbers.isna() & given).to_numpy())
        if not bad.size:
            return numbers.to_numpy(float, na_value=np.nan)
        found = _moments(text.where(given), piece, name, how, at, options) if time else None
        if found is None:
            line = f"{how.where}: column {name}, row {at + bad[0]}"
            raise RecordingError(f"{line}: {_no_number(str(column.iloc[bad[0]]), time)}")
    how.name_units(target for target, source in how.sources.items() if source.label == name)
    return found


def _moments(text: Any, piece: pd.DataFrame, name: str, how: ColumnLayout, at: int, options: ImportOptions) -> Any:
    """Return texts of dates or times of day in seconds; None where some are neither."""
    when, days = pd.to_datetime(text, errors="coerce", utc=True, format="ISO8601"), None
    iso = not (when.isna() & text.notna()).any()
    if how.date and not iso:
        days = _days(piece[how.date], how.date, how, at, options)
    elif not iso and text.dropna().str.contains(r"^\d\S*\s").all():  # a date, a blank, and the time of day
        parts = text.str.split(n=1, expand=True)
        days, text = _days(parts[0], name, how, at, options), parts[1]
    if days is not None:
        text = text.where(~text.str.fullmatch(SHORT_CLOCK, na=False), text + ":00")
    if not iso and not text.dropna().str.fullmatch(CLOCK).all():
        return None
    if not (iso and text.dropna().str.contains(ZONE).any()):
        how.clock, how.dated = name, iso or days is not None
    seconds = None if iso else pd.to_timedelta(text).dt.total_seconds().to_numpy(float)
    return _since_1970(when) if seconds is None else seconds + (0.0 if days is None else days)


def _texts(column: Any) -> tuple[Any, Any]:
    """Return a column as texts, and the rows in which something stands."""
    text = column.astype(str).str.strip()
    return text, column.notna() & (text != "")


def _days(column: Any, name: str, how: ColumnLayout, at: int, options: ImportOptions) -> Any:
    """Return the midnights of dates, s since 1970; raise RecordingError for other texts, and ask about 04/05/2026."""
    if pd.api.types.is_datetime64_any_dtype(column):
        return _since_1970(column.dt.normalize())
    text, given = _texts(column)
    read = {form: pd.to_datetime(text.where(given), format=form, errors="coerce") for form in DATES}
    whole = [(form, when) for form, when in read.items() if not (when.isna() & given).any()]
    # A whole column may show which of the numbers is no month; if none does, the user is asked.
    if len(whole) > 1 and options.use("time_unit") in table_columns.DATE_ORDERS:
        whole = [one for one in whole if re.sub("[^dmY]", "", one[0]).lower() == options.time_unit]
    other = [~when.eq(whole[0][1]) & given for _, when in whole[1:]] if whole else [read[DATES[0]].isna() & given]
    bad = np.flatnonzero(np.any(other, axis=0)) if other else np.empty(0, int)
    if bad.size:
        why = "may have the day or the month first; write --time-unit dmy, or --time-unit mdy" if whole else (
            "is no date; write dates as 2026-05-04")  # fmt: skip
        raise RecordingError(f"{how.where}: column {name}, row {at + bad[0]}: {text.iloc[bad[0]]} {why}")
    return _since_1970(whole[0][1])


def _unit_of_dates(how: ColumnLayout, gathered: dict[str, list[Any]], findings: ImportReport) -> None:
    """Convert times without a unit that can only be milli-, micro- or nanoseconds since 1970; note what was assumed."""
    for target in [name for name in ("t", "utc") if name in how.sources and how.sources[name].bare]:
        pieces = [piece[0] for parts in gathered.values() for piece in parts]
        ticks = pieces[0][target][np.isfinite(pieces[0][target])]
        usual, row = float(np.median(ticks)) if len(ticks) else 0.0, next(iter(gathered.values()))[0][1][0]
        fits = [(unit, factor) for unit, factor in (("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9))
                if FIRST_DATE <= usual * factor <= LAST_DATE]  # fmt: skip
        if not fits and usual <= 1e11:
            continue
        line = f"{how.where}: column {how.labels[target]}, row {row}: {usual:.6g} has no unit"
        unit, factor = fits[0] if fits else ("s", 1.0)
        step = factor * float(np.median(np.abs(np.diff(ticks)))) if len(ticks) > 1 else 0.0
        # Hours from row to row are fixes of animals on the earth; in a local frame it is a clock with finer ticks.
        if not fits or (step > 3600.0 and "lat" not in how.sources):
            reason = f"as {unit} since 1970 it is no date of ours, or rows are {step:.3g} s apart"
            raise RecordingError(f"{line}; {reason}; write --time-unit ms, us or ns")
        others = " or ".join(other for other in ("s", "ms", "us", "ns") if other != unit)
        date = np.datetime64(int(usual * factor), "s").item()
        findings.notes.append(f"{line}: taken as {unit} since 1970 ({date:%Y-%m-%d}); if not, --time-unit {others}")
        how.name_units([target])
        for piece in pieces:
            piece[target] *= factor


def _set_back(track: ImportedTrack, dated: bool) -> int:
    """Add the time by which a local clock goes back at midnight, or at the end of summer time if `dated`; s.

    Returns the first such row, or 0.
    """
    steps = np.diff(track.time, prepend=track.time[:1])
    if not dated:
        by, back = DAY, steps < -0.5 * DAY
    else:
        usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
        by, ahead = 3600.0, steps + 3600.0
        back = (steps <= 0.0) & (ahead > 0.0) & (ahead < max(1.5 * usual, min(5.0 * usual, 900.0)))
        # The last Sunday of October (Europe), the first of November (America) or April (Australia); in any other night
        # a row is one that came late. 1 January 1970 was a Thursday.
        days = np.nan_to_num(track.time // DAY).astype("datetime64[D]")
        months = days.astype("datetime64[M]")
        number, of_year = (days - months).astype(int), months.astype(int) % 12
        back &= (days.astype(int) % 7 == 3) & (
            ((of_year == 9) & (number > 23)) | (np.isin(of_year, (3, 10)) & (number < 7))
        )
        back[0] = False
    track.time = track.time + by * np.cumsum(back)
    return int(track.rows[back.argmax()]) if back.any() else 0


def _no_number(text: str, time: bool) -> str:
    """Return the error of a cell that is no number, and its remedy."""
    if re.fullmatch(r"\s*[-+]?\d+,\d+\s*", text):
        return f"{text} has a decimal comma; write --decimal ,"
    if table_columns.is_unit(text):
        return f"{text!r} is a unit; write it into the header, such as x [mm], and remove this row"
    if time and any(letter.isdigit() for letter in text):
        return f"{text!r} is no time; write seconds, hours:minutes:seconds, or dates such as 2026-05-04T10:00:00.5"
    return f"{text!r} is not a number; leave missing cells empty"


# Words of columns that say which rows count: of Movebank and pandas, and of NMEA (A: active, V: void).
FLAG_WORDS = {"true": 1, "t": 1, "yes": 1, "a": 1, "false": 0, "f": 0, "no": 0, "v": 0,
              "none": 0, "no fix": 0, "no_fix": 0, "nofix": 0, "2d": 2, "3d": 3,
              "invalid": 0, "valid": 1, "ok": 1}  # fmt: skip


def _flag_values(column: Any, flag: RowFlag) -> Any:
    """Return a column that says which rows count as float64; nan where it is empty or says nothing that is known."""
    if pd.api.types.is_numeric_dtype(column):
        return column.to_numpy(float, na_value=np.nan)
    if flag.words == "receiver":
        return column.map(
            lambda name: flag.numbers.setdefault(str(name), len(flag.numbers)), na_action="ignore"
        ).to_numpy(float)
    text = column.astype(str).str.strip().str.lower()
    return pd.to_numeric(text, errors="coerce").fillna(text.map(FLAG_WORDS)).to_numpy(float)


DEVICES = re.compile(r"device|receiver|instance|serial|logger|sensor.?id", re.IGNORECASE)
TAGS = ("tag", "tag_local_identifier")  # which several animals wear in turn


def _choose_id(where: str, how: ColumnLayout, parts: Any, findings: ImportReport) -> None:
    """Choose the column of names by its values: none that numbers the rows, and an animal before its tag.

    Only the first rows are looked at: there every name of a row number is another one, and no other
    name is. Raises RecordingError where names number the rows and these may be of several
    individuals.
    """
    clock = table_columns.column_names(how.sources["t" if "t" in how.sources else "utc"].tree)[:1]
    pieces = parts([*how.ids, *clock]) if how.ids and clock else iter(())
    _, part = next(pieces, (0, None))
    if part is None or part[clock[0]].nunique() < 2:  # one instant has a row for each individual
        return
    rows, names = part[how.ids].count(), part[how.ids].nunique()
    numbers = [c for c in how.ids if names[c] == rows[c] > 1]
    # Of a part of a file nobody knows whether a column has one name only.
    single = [c for c in how.ids if names[c] < 2] if len(how.ids) > 1 and next(pieces, None) is None else []
    order = sorted(how.ids, key=lambda c: (c in single, table_columns.split_header(c)[0] in TAGS))
    others = [c for c in order if c not in numbers]
    if others:
        how.id = others[0]
        if len(how.ids) > 1:
            more = ", ".join(f"{c} (row number)" if c in numbers else c for c in how.ids if c != how.id)
            hint = f'; for another write --map "id:={table_columns.quote_column(others[1])}"' if others[1:] else ""
            findings.notes.append(f"{where}: id from {how.id}; also there: {more}{hint}")
        return
    column = part[numbers[0]]
    counted = pd.api.types.is_numeric_dtype(column) and bool(column.dropna().is_monotonic_increasing)
    line = f"{where}: column {numbers[0]} has as many names as rows ({len(part)}): a row number"
    if not counted or part[clock[0]].duplicated().any():
        raise RecordingError(
            f"{line}; write --map id:=COLUMN for the column that names the individuals, or --map id:=file if all rows "
            "are one individual's"
        )
    how.id = ""
    findings.notes.append(f"{line}: all rows taken as one individual's; otherwise write --map id:=COLUMN")


def _ask_for_receivers(where: str, how: ColumnLayout, parts: Any) -> None:
    """Raise RecordingError if a column that is not read may part receivers, or individuals, at the same times."""
    columns, names = [c for c in how.unread if DEVICES.search(c)], [how.id] if how.id else []
    clock = [name for name in how.times if name][:1]
    for column in columns if clock else ():
        _, part = next(parts([column, *clock, *names]), (0, pd.DataFrame(columns=[column, *clock, *names])))
        own = part.dropna(subset=[column, *clock]).groupby([*names, column])[clock[0]]
        spans = own.agg(["min", "max", "size"])
        spans = spans[spans["size"] > 2].sort_values("min")
        for _, each in spans.groupby(level=0) if names else [("", spans)]:
            if (each["min"].iloc[1:].to_numpy() < each["max"].iloc[:-1].to_numpy()).any():
                raise RecordingError(
                    f"{where}: column {column} has {len(each)} names at the same times: write --map receiver:={column} "
                    f"if they are receivers of one drone, or --map id:={column} if they are individuals"
                )


def _since_1970(column: Any) -> Any:
    when = column.dt.tz_convert("UTC").dt.tz_localize(None) if column.dt.tz is not None else column
    seconds = when.to_numpy("datetime64[us]").astype(np.int64) * 1e-6
    return np.where(when.isna(), np.nan, seconds)


def _by_name(column: Any) -> Iterator[tuple[str, Any]]:
    codes, names = pd.factorize(column)
    order = np.argsort(codes, kind="stable")
    edges = np.searchsorted(codes[order], np.arange(len(names) + 1))
    for code, name in enumerate(names):
        text = f"{name:g}" if isinstance(name, float) else str(name)
        yield text, order[edges[code] : edges[code + 1]]


def _track(
    name: str, where: str, parts: list[Any], how: ColumnLayout, shared: bool, findings: ImportReport
) -> ImportedTrack:
    """Join the pieces of one individual; shared: True if others have the same column of times."""
    columns = {target: np.concatenate([p[0][target] for p in parts]) for target in parts[0][0]}
    rows = np.concatenate([p[1] for p in parts])
    flags = {column: (flag, columns.pop(f"flag {column}")) for column, flag in how.flags.items()}
    origin = table_columns.px4_origin(columns)
    columns = {target: values for target, values in columns.items() if target not in table_columns.ORIGIN}
    utc = columns.pop("utc", None)
    time = columns.pop("t") if "t" in columns else utc
    assert time is not None
    # More than 1e9 s: a clock since 1970, and no time since a start, which would be 31 years.
    of_day = bool((time[np.isfinite(time)][:1] > 1e9).any())  # seconds since 1970
    clock = "utc" if of_day or (utc is not None and utc is time) else ("shared" if shared else "own")
    pair = None
    if utc is not None and utc is not time and np.isfinite(utc + time).any():
        pair = np.stack([time, utc], axis=1)[np.isfinite(utc + time)]
    air = columns.pop("air") > 0.5 if "air" in columns else None
    unnamed = frozenset(target for target, source in how.sources.items() if source.bare)
    datum = how.datum or ("" if origin is None else "amsl")
    return ImportedTrack(
        name, where, time, columns, rows, how.labels, clock, pair, datum, origin, how.fixed_units, how.ground, unnamed,
        air, flags=flags,
    )  # fmt: skip


DELIMITERS = (",", ";", "\t", "|")
BLANKS = r"\s+"  # where nothing else separates columns, as NumPy writes tables
MOST = 1 << 20  # bytes that are looked at
MOST_ABOVE = 60  # lines above a table
REMARK = "#"  # begins a line above a table
SEPARATOR = re.compile(r'"?sep=.?"?', re.IGNORECASE)  # such a line, which spreadsheets write and read


class TableHead(NamedTuple):
    """The beginning of a text table.

    above    : number of lines above its names, or above its first row where the names do not stand
               in one line above it
    named    : whether `names` stand in no such line: NumPy writes them in a remark, trackers in
               several lines
    trailing : whether rows end with a delimiter, and the names do not
    pose     : individual → keypoint → component → column, of DeepLabCut
    """

    encoding: str
    delimiter: str
    names: list[str]
    above: int
    named: bool
    trailing: bool
    pose: PoseColumns
    notes: list[str]

    @property
    def first(self) -> int:
        """Return the number of the first row of data, as an editor counts."""
        return self.above + (1 if self.named else 2)


def read_head(path: Path, options: ImportOptions) -> TableHead:
    """Read the beginning of a text table; raise RecordingError for other files, and for columns without names."""
    encoding, lines = _lines(path)
    given = {"tab": "\t", "\\t": "\t"}.get(options.use("delimiter"), options.delimiter)
    above = _line_of_names(lines, given, options)
    if above == len(lines):
        raise RecordingError(f"{path}: has no rows")
    body = [line for line in islice(lines, above + 1, above + 20) if line.strip()]
    delimiter = given or _delimiter(lines[above], body)
    names = [name or f"column {k}" for k, name in enumerate(_cells(lines[above], delimiter), 1)]
    if len(names) > MAX_COLUMNS:
        column_layout(str(path), names, options)
    notes = [f"line{'s' * (above > 1)} above the table left out: {above}"] if above else []
    # Some trackers write the names in a comment above the numbers; they are used if their count
    # fits.
    first, pose = above + 1, PoseColumns()
    if all(_numeric(name) for name in names):
        over = _cells(lines[above - 1].strip().lstrip(REMARK), delimiter) if above else []
        if len(over) != len(names) or any(_numeric(name) for name in over):
            raise RecordingError(f"{path}: the first row holds numbers; add a row of names, for instance t,id,x,y")
        first, names = above, over
    elif names[0].lower() == "scorer":
        first, names, pose = _pose_names(path, lines, above, delimiter)
        body = lines[first : first + 20]
    else:
        count = _rows_of_units(body, delimiter)
        if count:
            units = _cells(body[count - 1], delimiter)
            names = [f"{name} [{unit.strip('()[]')}]" if table_columns.is_unit(unit) else name
                     for name, unit in zip_longest(names, units[: len(names)], fillvalue="")]  # fmt: skip
            notes.append(f"row {above + 1 + count} holds the units of the columns")
            first, body = above + 1 + count, body[count:]
    named = first != above + 1 or bool(pose)
    start = first if named else above
    _decimals(path, body, len(names), delimiter, options, first + 1)
    # Rows that end with a delimiter would otherwise be read as one column to the left.
    cells = [_cells(line, delimiter) for line in body if '"' not in line]
    trailing = bool(cells) and all(len(row) > len(names) and not any(row[len(names) :]) for row in cells)
    return TableHead(encoding, delimiter, names, start, named, trailing, pose, notes)


def _line_of_names(lines: list[str], delimiter: str, options: ImportOptions) -> int:
    """Return the first line that names a time and a position, or whatever --map reads; else the first line of all."""
    first = next((i for i, line in enumerate(lines) if line.strip() and not _remark(line)), len(lines))
    words = re.compile(r"[^\W\d]\w*")
    mapped = {word for text in options.map.values() if text != "file" for word in words.findall(text)}
    for i in range(first, min(first + MOST_ABOVE, len(lines))):
        names = _cells(lines[i], delimiter or _delimiter(lines[i], lines[i + 1 : i + 2]))[: MAX_COLUMNS + 1]
        targets = {meaning.target for meaning in map(table_columns.header_meaning, names) if meaning}
        places = targets & {"x", "lat"} or column_groups(names)
        if (targets & {"t", "utc", "frame"} and places) or (mapped and mapped <= set(words.findall(lines[i]))):
            return i
    counted = re.match(r'"?Number of header lines:"?[;,\t]"?(\d+)', "".join(lines[first : first + 1]))
    # EthoVision says how many lines stand above; the last two of them are names and units.
    return min(int(counted[1]) - 2, len(lines)) if counted else first


def _rows_of_units(body: list[str], delimiter: str) -> int:
    """Return how many rows under the names hold words and, last, units; 0 where there are no units."""
    rows = [_cells(line, delimiter) for line in body[:4]]
    words = list(takewhile(lambda row: not any(re.match(r"[-+.]?\d", cell) for cell in row), rows))
    return len(words) if words and any(map(table_columns.is_unit, words[-1])) else 0


def _pose_names(path: Path, lines: list[str], above: int, delimiter: str) -> tuple[int, list[str], PoseColumns]:
    """Return the first row of a table of DeepLabCut, unique names of its columns, and what they hold."""
    rows = {cells[0].lower(): cells[1:] for line in lines[above : above + 4] if (cells := _cells(line, delimiter))}
    if not {"bodyparts", "coords"} <= set(rows):
        raise RecordingError(
            f"{path}: row {above + 1}: scorer without rows bodyparts and coords below it; save it again"
        )
    individuals = rows.get("individuals", [path.stem] * len(rows["coords"]))
    pose: PoseColumns = {}
    names = ["frame"]
    for individual, keypoint, part in zip(individuals, rows["bodyparts"], rows["coords"], strict=True):
        names.append(f"{individual} {keypoint} {part}")
        pose.setdefault(individual, {}).setdefault(keypoint, {})[part] = names[-1]
    return above + 3 + ("individuals" in rows), names, pose


def _lines(path: Path) -> tuple[str, list[str]]:
    """Return the encoding and the first lines of a text."""
    with path.open("rb") as file:
        start = file.read(MOST)
    if not start.strip():
        raise RecordingError(f"{path}: is empty")
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        encoding = "utf-16"
    elif b"\0" in start:
        raise RecordingError(f"{path}: is not text; known formats: {format_words()}")
    else:
        encoding = "utf-8-sig"
    try:
        return encoding, start.decode(encoding, errors="strict" if len(start) < MOST else "ignore").splitlines()
    except UnicodeDecodeError as error:
        raise RecordingError(f"{path}: is not written in UTF-8 (byte {error.start}); save it as UTF-8") from error


def _remark(line: str) -> bool:
    return line.lstrip().startswith(REMARK) or SEPARATOR.fullmatch(line.strip()) is not None


def _delimiter(first: str, body: list[str]) -> str:
    """Return the delimiter of columns: the most frequent sign of the first line, or blanks."""
    likely = max(DELIMITERS, key=lambda d: (first.count(d), d == ","))
    if likely in first:
        return likely
    words = len(first.split())
    return BLANKS if words > 1 and body and all(len(line.split()) == words for line in body) else likely


def _cells(line: str, delimiter: str) -> list[str]:
    found = line.split() if delimiter == BLANKS else line.split(delimiter)
    return [cell.strip().strip('"').strip() for cell in found]


def _numeric(text: str) -> bool:
    return bool(re.fullmatch(r"[-+]?[\d.,]+([eE][-+]?\d+)?", text))


def _decimals(path: Path, body: list[str], count: int, delimiter: str, options: ImportOptions, at: int) -> None:
    """Refuse decimal commas that nobody has announced; at: number of the first row."""
    if options.use("decimal") != ".":
        cells = [cell.strip(' "') for line in body for cell in _cells(line, delimiter)]
        points = [cell for cell in cells if re.fullmatch(r"[-+]?\d+\.\d+", cell)]
        if points and not any(re.fullmatch(r"[-+]?\d+,\d+", cell) for cell in cells):
            raise RecordingError(f"{path}: row {at}: {points[0]} has a decimal point; leave --decimal , out")
        return
    # A decimal comma beside a comma as delimiter cannot be read: the cells of a row are then too
    # many.
    for number, line in enumerate(body, at):
        cells = line.split() if delimiter == BLANKS else line.split(delimiter)
        comma = [cell.strip() for cell in cells if re.fullmatch(r'\s*"?[-+]?\d+,\d+"?\s*', cell)]
        if delimiter != "," and comma:
            raise RecordingError(f"{path}: row {number}: {comma[0]} has a decimal comma; write --decimal ,")
        if delimiter == "," and '"' not in line and any(cell.strip() for cell in cells[count:]):
            raise RecordingError(
                f"{path}: row {number} has {len(cells)} cells, the header {count}; if the numbers have decimal commas, "
                "save the table with ; between its columns and write --decimal ,"
            )


# Columns for each individual or place, as x1, y1, x2, y2 or fish1_x, fish1_y, fish2_x, fish2_y, head.x, head.y.
AXIS_FIRST = re.compile(r"([xyz])_?(\d+)")
NAME_FIRST = re.compile(r"(.+)_([xyz]|score|likelihood|confidence)")
NUMBERED = re.compile(r"([a-z][a-z_]*?_?)?\d+")  # names of individuals; head_x, tail_x are places on one individual


def column_groups(names: list[str]) -> dict[str, dict[str, str]]:
    """Return name → component → column, of columns for each individual or each place on one body."""
    groups: dict[str, dict[str, str]] = {}
    for header in names:
        plain = table_columns.split_header(header)[0]
        if match := AXIS_FIRST.fullmatch(plain):
            groups.setdefault(match[2], {})[match[1]] = header
        elif (match := NAME_FIRST.fullmatch(plain)) and not _is_speed(header, match[1]):
            own = header.strip()[: len(match[1])]  # as the user writes it
            groups.setdefault(own if own.lower() == match[1] else match[1], {})[match[2]] = header
    return groups


def _is_speed(header: str, name: str) -> bool:
    """Return True for vel_x and v_x_ms, beside individuals that may be called V and C."""
    meaning = table_columns.header_meaning(header)
    return meaning is not None and (len(name) > 1 or meaning.unit in table_columns.SPEED_UNITS)


def wide_columns(names: list[str], where: str, stem: str, options: ImportOptions) -> dict[str, dict[str, str]]:
    """Return individual → component → column, of a table such as time, x1, y1, x2, y2; empty for a long table.

    Raises RecordingError where the names may be those of individuals or of places on one body.
    """
    meanings = map(table_columns.header_meaning, names)
    targets = {meaning.target for meaning in meanings if meaning}
    groups = {} if {"x", "lat"} & targets else column_groups(names)
    whole = {name: parts for name, parts in groups.items() if {"x", "y"} <= set(parts)}
    # One pair such as goal_x and goal_y holds no positions unless somebody says so, or a tracker gives it a score.
    scored = any(len(set(parts) - {*POSITION_TARGETS}) for parts in whole.values())
    for parts in whole.values():
        parts.pop("score", None)  # of SLEAP, which is no likelihood
    if whole and options.map.get("id", "").strip() == "columns":
        options.used.add("map id")
        return whole
    # Beside a column of names, leg1_x and leg2_x are places on one body.
    if "id" not in targets and len(whole) == len(groups) and all(NUMBERED.fullmatch(name.lower()) for name in whole):
        return whole
    if len(whole) < 2 and not scored and set(whole) != {options.keypoint}:
        return {}
    return _of_keypoint({stem: whole}, where, options, "; or if each is an individual, write --map id:=columns")


def choose_keypoint(names: list[str], options: ImportOptions, where: str, other: str = "") -> str:
    """Return the keypoint that the user chose, or the only one; raise RecordingError with those that there are."""
    chosen = options.use("keypoint") or (names[0] if len(names) == 1 else "")
    if chosen not in names:
        shown = ", ".join(names[:8])
        if chosen:
            raise RecordingError(f"{where}: no keypoint {chosen}; it has {shown}")
        way = f"choose one: --keypoint {names[0]}{other}"
        raise RecordingError(f"{where}: has {len(names)} keypoints ({shown}); {way}")
    return chosen


def _of_keypoint(pose: PoseColumns, where: str, options: ImportOptions, other: str = "") -> dict[str, dict[str, str]]:
    """Return individual → component → column of the keypoint that the user chose, or of the only one."""
    keypoints = list(dict.fromkeys(keypoint for parts in pose.values() for keypoint in parts))
    chosen = choose_keypoint(keypoints, options, where, other)
    return {individual: parts[chosen] for individual, parts in pose.items() if chosen in parts}


def long_names(wide: dict[str, dict[str, str]], where: str) -> dict[str, str]:
    """Return component → header of a long table of the same; raise RecordingError where units differ."""
    headers: dict[str, str] = {}
    for parts in wide.values():
        for part, column in parts.items():
            unit = table_columns.split_header(column)[1]
            header = headers.setdefault(part, f"{part} [{unit}]" if unit else part)
            if table_columns.split_header(header)[1] != unit:
                raise RecordingError(
                    f"{where}: column {column}: its unit is not that of others, {header}; write all in one"
                )
    return headers


def split_by_individual(
    table: pd.DataFrame, wide: dict[str, dict[str, str]], headers: dict[str, str], stem: str
) -> Iterable[tuple[str, pd.DataFrame]]:
    """Yield the rows of each individual by the names of a long table; all rows as `stem` if the table is not wide."""
    if not wide:
        return [(stem, table)]
    rest = table.drop(columns=[column for parts in wide.values() for column in parts.values()])
    empty = pd.Series(np.nan, table.index)
    return (
        (name, rest.assign(**{header: table.get(parts.get(part), empty) for part, header in headers.items()}))
        for name, parts in wide.items()
    )
