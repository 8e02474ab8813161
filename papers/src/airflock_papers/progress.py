"""Word of how far flights are: a bar for each title on a terminal, else, and in a log, a line every ten seconds."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

Progress = Callable[[str, int, int], None]  # title, flights done, flights in all
EVERY = 10.0  # s between two lines


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """Progress on the error stream."""
    if not sys.stderr.isatty():
        yield _lines(lambda line: print(line, file=sys.stderr, flush=True))
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress as Bars, TextColumn, TimeRemainingColumn

    with Bars(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
    ) as bars:
        tasks: dict[str, Any] = {}

        def tell(title: str, done: int, total: int) -> None:
            if title not in tasks:
                tasks[title] = bars.add_task(title, total=total)
            bars.update(tasks[title], completed=done)

        yield tell


def teller(log: Path, say: Callable[[str], None], what: str) -> Progress:
    """Progress of `what` as lines, to the log and to the caller."""

    def both(line: str) -> None:
        line = f"{what}: {line}"
        with log.open("a", encoding="utf-8") as file:
            file.write(f"{time.strftime('%Y-%m-%d %H:%M:%S')} {line}\n")
        say(line)

    return _lines(both, first=0.0)


def _lines(say: Callable[[str], None], first: float = EVERY) -> Progress:
    """Progress as lines, at most one every ten seconds; first: s until the first may come."""
    due = time.monotonic() + first

    def tell(title: str, done: int, total: int) -> None:
        nonlocal due
        if time.monotonic() < due:
            return
        due = time.monotonic() + EVERY
        say(f"{title}, {done:,} of {total:,}")

    return tell
