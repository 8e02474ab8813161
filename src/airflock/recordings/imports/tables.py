"""Tables: CSV and Parquet files and pandas DataFrames, one individual or many, long or one column per individual."""

import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from airflock.errors import RecordingError
from airflock.memory import give_back_memory
from airflock.recordings.imports import headers, px4
from airflock.recordings.imports.absent import PLACES
from airflock.recordings.imports.columns import MOST_COLUMNS, Layout, layout
from airflock.recordings.imports.track import GEODETIC, POSITION, Findings, Options, Track

CHUNK = 250_000  # rows that are read at a time, so that an hour of thirty drones fits
DELIMITERS = (",", ";", "\t", "|")


def read_csv(path: Path, options: Options, findings: Findings) -> list[Track]:
    """Tracks of a text table; raises RecordingError that names column and row."""
    head, delimiter, names = _sniff(path, options)
    size = path.stat().st_size
    text = {"sep": delimiter, "decimal": options.decimal, "encoding": head, "skipinitialspace": True}

    def parts(columns: list[str] | None) -> Iterator[tuple[int, pd.DataFrame]]:
        at = 2  # the row after the header, as an editor counts
        with path.open("rb") as file:
            wanted = None if columns is None else lambda c: c.strip() in columns
            try:
                for part in pd.read_csv(file, usecols=wanted, chunksize=CHUNK, low_memory=False, **text):
                    part.columns = [str(c).strip() for c in part.columns]
                    yield at, part
                    at += len(part)
                    options.done(file.tell() / max(size, 1))
            except (pd.errors.ParserError, UnicodeDecodeError) as fault:
                raise RecordingError(f"{path}: {str(fault).splitlines()[0]}") from fault

    return from_parts(str(path), path.stem, names, parts, options, findings)


def read_parquet(path: Path, options: Options, findings: Findings) -> list[Track]:
    """Tracks of a Parquet table."""
    try:
        import pyarrow
        import pyarrow.parquet as parquet
    except ImportError as fault:
        raise RecordingError(f"{path}: needs pyarrow: pip install 'airflock[logs]'") from fault
    try:
        file = parquet.ParquetFile(path, pre_buffer=False, buffer_size=1 << 20)
    except (OSError, ValueError) as fault:
        raise RecordingError(f"{path}: is not a Parquet table: {str(fault).splitlines()[0]}") from fault
    total = max(file.metadata.num_rows, 1)

    def parts(columns: list[str] | None) -> Iterator[tuple[int, pd.DataFrame]]:
        at = 1
        # Arrow decodes a column in each of its threads, and keeps what it has freed: a third of an hour's memory
        for batch in file.iter_batches(batch_size=CHUNK // 4, columns=columns, use_threads=False):
            yield at, batch.to_pandas()
            at += batch.num_rows
            pyarrow.default_memory_pool().release_unused()
            options.done(min(1.0, at / total))

    return from_parts(str(path), path.stem, list(file.schema_arrow.names), parts, options, findings)


def table_of(columns: Mapping[str, Any]) -> pd.DataFrame:
    """Columns by name as a table, one value for all rows where a column is no list; raises RecordingError."""
    lists = {str(k): list(v) for k, v in columns.items() if np.iterable(v) and not isinstance(v, str)}
    if len({len(column) for column in lists.values()}) != 1:
        told = ", ".join(f"{name} has {len(column)}" for name, column in lists.items()) or "there are none"
        raise RecordingError(f"columns of a table must be lists of equal length: {told}")
    return pd.DataFrame({str(name): lists.get(str(name), value) for name, value in columns.items()})


def read_frame(table: pd.DataFrame, options: Options, findings: Findings) -> list[Track]:
    """Tracks of a pandas DataFrame; its index is a column too, where it has a name."""
    flat = table.reset_index() if any(name is not None for name in table.index.names) else table
    flat = flat.set_axis([str(c) for c in flat.columns], axis=1)
    return from_parts("DataFrame", "individual", list(flat.columns), lambda _: iter([(0, flat)]), options, findings)


def _sniff(path: Path, options: Options) -> tuple[str, str, list[str]]:
    """Encoding, delimiter and names of the columns of a text table."""
    with path.open("rb") as file:
        start = file.read(1 << 20)
    if not start.strip():
        raise RecordingError(f"{path}: is empty")
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        encoding = "utf-16"
    elif b"\0" in start:
        raise RecordingError(f"{path}: is not text; known formats: .csv, .parquet, .ulg, .bin, .tlog, .nc, .h5, .npy")
    else:
        encoding = "utf-8-sig"
    try:
        lines = start.decode(encoding, errors="strict" if len(start) < 1 << 20 else "ignore").splitlines()
    except UnicodeDecodeError as fault:
        raise RecordingError(f"{path}: is not written in UTF-8 (byte {fault.start}); save it as UTF-8") from fault
    first = lines[0]
    delimiter = options.delimiter or max(DELIMITERS, key=lambda d: (first.count(d), d == ","))
    delimiter = {"tab": "\t", "\\t": "\t"}.get(delimiter, delimiter)
    names = [name.strip().strip('"').strip() for name in first.split(delimiter)]
    if len(names) > MOST_COLUMNS:
        layout(str(path), names, options)
    if all(_numeric(name) for name in names):
        raise RecordingError(f"{path}: the first row holds numbers; add a row of names, for instance t,id,x,y")
    body = [line for line in islice(lines, 1, 20) if line.strip()]
    _decimals(path, body, len(names), delimiter, options)
    return encoding, delimiter, names


def _numeric(text: str) -> bool:
    return bool(re.fullmatch(r"[-+]?[\d.,]+([eE][-+]?\d+)?", text))


def _decimals(path: Path, body: list[str], count: int, delimiter: str, options: Options) -> None:
    """Refuse decimal commas that nobody has announced."""
    if options.decimal != ".":
        return
    for number, line in enumerate(body, 2):
        cells = line.split(delimiter)
        comma = [cell.strip() for cell in cells if re.fullmatch(r'\s*"?[-+]?\d+,\d+"?\s*', cell)]
        if delimiter != "," and comma:
            raise RecordingError(f"{path}: row {number}: {comma[0]} has a decimal comma; write --decimal ,")
        if delimiter == "," and '"' not in line and len(cells) > count:
            raise RecordingError(
                f"{path}: row {number} has {len(cells)} cells, the header {count}; if the numbers have decimal commas, "
                "save the table with ; between its columns and write --decimal ,"
            )


def from_parts(
    where: str, stem: str, names: list[str], parts: Any, options: Options, findings: Findings
) -> list[Track]:
    """Tracks of a table that comes in parts, by the layout of its columns."""
    wide = _wide(names) if not any(target in options.map for target in (*POSITION, *GEODETIC)) else {}
    how = layout(where, _first_of(names, wide) if wide else names, options)
    findings.notes += how.notes
    gathered: dict[str, list[Any]] = {}
    nameless: list[Any] = [np.empty(0, int)]
    columns = None if wide else how.used
    for at, part in parts(columns):
        rows = np.arange(at, at + len(part))
        for name, piece in _pieces(part, wide, how, stem):
            numbers = {column: _numbers(piece[column], where, column, at) for column in how.used if column != how.id}
            values = how.values(numbers, len(piece))
            placed = np.all([np.isfinite(values[c]) for c in PLACES if c in values], axis=0)
            timed = np.isfinite(values["t" if "t" in values else "utc"])
            if how.id:
                nameless.append(rows[placed & timed & piece[how.id].isna().to_numpy()])
                for own, chosen in _by_name(piece[how.id]):
                    gathered.setdefault(own, []).append(_taken(values, rows, chosen))
            else:
                gathered.setdefault(name, []).append(_taken(values, rows, None))
    if not gathered:
        raise RecordingError(f"{where}: has no rows")
    lost = np.unique(np.concatenate(nameless))
    if len(lost):
        findings.notes.append(f"{where}: {len(lost)} rows without an id left out, first row {lost[0]}")
    tracks = []
    for name in list(gathered):
        tracks.append(_track(name, where, gathered.pop(name), how, findings))
    give_back_memory()
    return tracks


def _wide(names: list[str]) -> dict[str, dict[str, str]]:
    """Individual → component → column, of a table such as time, x1, y1, x2, y2; empty if it is none."""
    found: dict[str, dict[str, str]] = {}
    if any(headers.split(name)[0] in headers.ALIASES["x"] for name in names):
        return found
    for name in names:
        parts = re.fullmatch(r"([xyz])_?(\d+)", headers.split(name)[0])
        if parts:
            found.setdefault(parts[2], {})[parts[1]] = name
    return found if found and all({"x", "y"} <= set(parts) for parts in found.values()) else {}


def _first_of(names: list[str], wide: dict[str, dict[str, str]]) -> list[str]:
    """Columns of the first individual of a wide table, under the names of a long one."""
    taken = {column for parts in wide.values() for column in parts.values()}
    first = next(iter(wide.values()))
    unit = {part: headers.split(column)[1] for part, column in first.items()}
    return [n for n in names if n not in taken] + [f"{part} [{unit[part]}]" if unit[part] else part for part in first]


def _pieces(
    part: pd.DataFrame, wide: dict[str, dict[str, str]], how: Layout, stem: str
) -> Iterable[tuple[str, pd.DataFrame]]:
    if not wide:
        return [(stem, part)]
    taken = [column for parts in wide.values() for column in parts.values()]
    rest = part.drop(columns=taken)
    told = {how.labels[axis]: axis for axis in POSITION if axis in how.labels}
    return (
        (number, rest.assign(**{label: part[parts[axis]] for label, axis in told.items() if axis in parts}))
        for number, parts in wide.items()
    )


def _numbers(column: Any, where: str, name: str, at: int) -> Any:
    """A column as float64; dates become seconds since 1970, durations seconds; texts of neither are faults."""
    if pd.api.types.is_numeric_dtype(column):
        return column.to_numpy(float, na_value=np.nan)
    if pd.api.types.is_datetime64_any_dtype(column):
        return _since_1970(column)
    if pd.api.types.is_timedelta64_dtype(column):
        return column.dt.total_seconds().to_numpy(float)
    found = pd.to_numeric(column, errors="coerce")
    given = column.notna() & (column.astype(str).str.strip() != "")
    bad = np.flatnonzero((found.isna() & given).to_numpy())
    if not bad.size:
        return found.to_numpy(float, na_value=np.nan)
    told = headers.meaning(name)
    if told is not None and told.target in ("t", "utc"):
        when = pd.to_datetime(column, errors="coerce", utc=True, format="ISO8601")
        bad = np.flatnonzero((when.isna() & given).to_numpy())
        if not bad.size:
            return _since_1970(when)
    text = str(column.iloc[bad[0]])
    if re.fullmatch(r"\s*[-+]?\d+,\d+\s*", text):
        raise RecordingError(
            f"{where}: column {name}, row {at + bad[0]}: {text} has a decimal comma; write --decimal ,"
        )
    raise RecordingError(
        f"{where}: column {name}, row {at + bad[0]}: {text!r} is not a number; leave missing cells empty"
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


def _taken(values: dict[str, Any], rows: Any, chosen: Any) -> tuple[dict[str, Any], Any]:
    every = slice(None) if chosen is None else chosen
    return {target: array[every] for target, array in values.items()}, rows[every]


def _track(name: str, where: str, pieces: list[Any], how: Layout, findings: Findings) -> Track:
    columns = {target: np.concatenate([p[0][target] for p in pieces]) for target in pieces[0][0]}
    rows = np.concatenate([p[1] for p in pieces])
    origin, valid = px4.taken_out(columns)
    if valid is not None and not valid.all():
        findings.notes.append(px4.invalid_note(where, name, valid, rows))
        columns, rows = {target: values[valid] for target, values in columns.items()}, rows[valid]
    utc = columns.pop("utc", None)
    time = columns.pop("t") if "t" in columns else utc
    assert time is not None
    of_day = bool((time[np.isfinite(time)][:1] > 1e9).any())  # seconds since 1970
    clock = "utc" if of_day or (utc is not None and utc is time) else ("shared" if how.id else "own")
    pair = None
    if utc is not None and utc is not time and np.isfinite(utc + time).any():
        pair = np.stack([time, utc], axis=1)[np.isfinite(utc + time)]
    air = columns.pop("air") > 0.5 if "air" in columns else None
    found = Track(name, where, time, columns, rows, dict(how.labels), clock, pair, how.datum)
    found.origin, found.datum = (origin, found.datum or "amsl") if origin is not None else (None, found.datum)
    found.air = air
    return found
