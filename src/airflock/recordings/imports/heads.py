"""How a text table begins: its encoding, what stands above it, what separates its columns, their names."""

import re
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from airflock.recordings.imports.columns import MAX_COLUMNS, column_layout
from airflock.recordings.imports.track import ImportOptions
from airflock.support import RecordingError

DELIMITERS = (",", ";", "\t", "|")
BLANKS = r"\s+"  # where nothing else separates columns, as NumPy writes tables
MOST = 1 << 20  # bytes that are looked at
REMARK = "#"  # begins a line above a table
SEPARATOR = re.compile(r'"?sep=.?"?', re.IGNORECASE)  # such a line, which spreadsheets write and read


class TableHead(NamedTuple):
    """The beginning of a text table.

    above  : number of lines above it; first : number of its first row of data, as an editor counts
    hidden : whether the names stand in the last line above it, as NumPy writes them
    """

    encoding: str
    delimiter: str
    names: list[str]
    above: int
    hidden: bool

    @property
    def first(self) -> int:
        """Number of the first row of data, as an editor counts."""
        return self.above + (1 if self.hidden else 2)


def read_head(path: Path, options: ImportOptions) -> TableHead:
    """How a text table begins; raises RecordingError for what is none, and where columns have no names."""
    encoding, lines = _lines(path)
    above = next((i for i, line in enumerate(lines) if line.strip() and not _remark(line)), len(lines))
    if above == len(lines):
        raise RecordingError(f"{path}: has no rows")
    body = [line for line in islice(lines, above + 1, above + 20) if line.strip()]
    given = {"tab": "\t", "\\t": "\t"}.get(options.delimiter, options.delimiter)
    delimiter = given or _delimiter(lines[above], body)
    names = _cells(lines[above], delimiter)
    if len(names) > MAX_COLUMNS:
        column_layout(str(path), names, options)
    hidden = False
    if all(_numeric(name) for name in names):
        over = _cells(lines[above - 1].strip().lstrip(REMARK), delimiter) if above else []
        if len(over) != len(names) or any(_numeric(name) for name in over):
            raise RecordingError(f"{path}: the first row holds numbers; add a row of names, for instance t,id,x,y")
        body, names, hidden = [lines[above], *body], over, True
    _decimals(path, body, len(names), delimiter, options, above + (1 if hidden else 2))
    return TableHead(encoding, delimiter, names, above, hidden)


def _lines(path: Path) -> tuple[str, list[str]]:
    """Encoding and first lines of a text."""
    with path.open("rb") as file:
        start = file.read(MOST)
    if not start.strip():
        raise RecordingError(f"{path}: is empty")
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        encoding = "utf-16"
    elif b"\0" in start:
        raise RecordingError(f"{path}: is not text; known formats: .csv, .parquet, .ulg, .bin, .tlog, .nc, .h5, .npy")
    else:
        encoding = "utf-8-sig"
    try:
        return encoding, start.decode(encoding, errors="strict" if len(start) < MOST else "ignore").splitlines()
    except UnicodeDecodeError as fault:
        raise RecordingError(f"{path}: is not written in UTF-8 (byte {fault.start}); save it as UTF-8") from fault


def _remark(line: str) -> bool:
    return line.lstrip().startswith(REMARK) or SEPARATOR.fullmatch(line.strip()) is not None


def _delimiter(first: str, body: list[str]) -> str:
    """What separates columns: the sign that the first line has most of, or blanks where it has none of them."""
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
    if options.decimal != ".":
        return
    for number, line in enumerate(body, at):
        cells = line.split() if delimiter == BLANKS else line.split(delimiter)
        comma = [cell.strip() for cell in cells if re.fullmatch(r'\s*"?[-+]?\d+,\d+"?\s*', cell)]
        if delimiter != "," and comma:
            raise RecordingError(f"{path}: row {number}: {comma[0]} has a decimal comma; write --decimal ,")
        if delimiter == "," and '"' not in line and len(cells) > count:
            raise RecordingError(
                f"{path}: row {number} has {len(cells)} cells, the header {count}; if the numbers have decimal commas, "
                "save the table with ; between its columns and write --decimal ,"
            )
