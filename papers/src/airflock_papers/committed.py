"""Tables that are committed beside the papers' texts: what came of flights, read again and written whole."""

import csv
import io
from collections.abc import Callable, Iterable
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from airflock.support import AirflockError, atomic, result_group


class Report(NamedTuple):
    """What a command prints of flown claims: lines, or one JSON document; shown : False where it fails."""

    lines: list[str]
    content: Any
    shown: bool

    def __rich__(self) -> Any:
        return result_group(*self.lines)

    def document(self) -> Any:
        """Return the report as plain values."""
        return self.content


def read(name: str, command: str) -> list[dict[str, str]]:
    """Rows of a committed table, by column; `command` writes it.

    Raises AirflockError if there is none.
    """
    try:
        text = resources.files("airflock_papers").joinpath(name).read_text(encoding="utf-8")
    except OSError as fault:
        raise AirflockError(f"{name}: {fault.strerror}; `{command}` writes it") from fault
    return list(csv.DictReader(io.StringIO(text)))


def write(columns: Iterable[str], rows: Iterable[NamedTuple], path: Path) -> None:
    """Write rows as a table, complete or not at all."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(columns)
    table.writerows(rows)
    atomic.write_file(path, text.getvalue())


def renew(
    description: str,
    name: str,
    columns: Iterable[str],
    fly: Callable[[Path, Callable[[str], None]], Iterable[NamedTuple]],
) -> None:
    """A command that flies what a table tells, and commits it.

    fly : takes the folder where what is done is kept, and what tells a person how far it is; returns the rows
    """
    import argparse
    import sys

    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("folder", type=Path, help="where what is done is kept")
    asked = parser.parse_args()
    rows = fly(asked.folder, lambda line: print(line, file=sys.stderr))
    write(columns, rows, Path(str(resources.files("airflock_papers"))) / name)
