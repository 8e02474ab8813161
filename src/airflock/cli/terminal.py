"""Output of the commands: tables for a terminal, JSON for machines, and progress."""

import json
import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from threading import Lock
from typing import Any

import typer

from airflock import view
from airflock.support import format_cell, result_group, result_table


def column_statistics(rows: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return mean, standard deviation and median of each column; of a column of lists, those of each place.

    A value that is nan (a time of what never happened) is left out; where all are, the statistics are nan.
    """
    summary: dict[str, dict[str, Any]] = {"mean": {}, "std": {}, "median": {}}
    for key, first in rows[0].items():
        if isinstance(first, (list, tuple)):
            places = [_moments([row[key][c] for row in rows]) for c in range(len(first))]
            moments: Any = [list(column) for column in zip(*places, strict=True)] or [[], [], []]
        else:
            moments = _moments([row[key] for row in rows])
        for name, value in zip(summary, moments, strict=True):
            summary[name][key] = value
    return summary


def _moments(numbers: Sequence[Any]) -> tuple[float, float, float]:
    values = sorted(v for v in map(float, numbers) if not math.isnan(v))
    n = len(values)
    if not n:
        return math.nan, math.nan, math.nan
    mean = math.fsum(values) / n
    spread = math.sqrt(math.fsum((v - mean) ** 2 for v in values) / (n - 1)) if n > 1 else 0.0
    return mean, spread, 0.5 * (values[(n - 1) // 2] + values[n // 2])


def print_score_table(
    title: str,
    rows: Sequence[Mapping[str, Any]],
    published: Mapping[str, tuple[float, float | None]],
    units_and_meanings: Mapping[str, tuple[str, str]],
) -> None:
    """Print order parameters beside what a paper reports; about: unit and meaning by name.

    What no flight has (a clearance where nothing stands) is named in one line below instead of a number.
    """
    summary, several = column_statistics(rows), len(rows) > 1
    heads = f"*order parameter; >{'mean ± sd; >median' if several else 'value'}{'; >+published' * bool(published)}"
    lines, untold = [], []
    for key, value in summary["mean"].items():
        if _is_unmeasured(key, value) and key not in published:
            untold.append(key)
            continue
        missing = "never" if key.startswith("time_to_") else "nan"  # only an event can never happen
        mean, spread = format_cell(value, missing), summary["std"][key]
        single = not several or isinstance(spread, list) or spread != spread
        cells = [key, mean if single else f"{mean} ± {spread:.2g}"]
        cells += [format_cell(summary["median"][key], missing)] if several else []
        if published:
            figure, deviation = published.get(key, (None, None))
            spread = "" if deviation is None else f" ± {deviation:.2g}"
            cells += ["" if figure is None else f"{format_cell(figure)}{spread}"]
        lines.append((*cells, *units_and_meanings.get(key, ("", ""))))
    print_result(result_table(title, f"{heads}; unit; ~meaning", lines))
    if untold:
        from rich.text import Text

        words = f"not shown, because there is nothing to measure: {', '.join(untold)}"
        print_result(result_group(Text(words, style="dim", no_wrap=True, overflow="ignore")))


def _is_unmeasured(key: str, mean: Any) -> bool:
    """Return True if no flight has such a number; an event that never happened is printed as `never`."""
    values = mean if isinstance(mean, (list, tuple)) else [mean]
    return not key.startswith("time_to_") and bool(values) and all(math.isnan(value) for value in values)


def print_json(value: Any) -> None:
    """Print JSON on one line; numbers that are no JSON (never expected) become null."""
    sys.stdout.write(json.dumps(to_json_value(value), ensure_ascii=False) + "\n")


def print_result(result: Any, as_json: bool = False, **more: Any) -> None:
    """Print what a verb returned: as it prints itself, or one JSON object of its `document()` or its plain values.

    more : further values of the JSON object. Exit with status 1 for a limit or claim that is not `shown` to hold.
    """
    if as_json:
        document = result.document() if hasattr(result, "document") else result
        print_json({**document, **more} if more else document)
    else:
        from rich.console import Console

        Console().print(result, crop=False)
    if not getattr(result, "shown", True):
        raise typer.Exit(1)


def save_picture(figure: Any, path: Any) -> None:
    """Write a figure and print where it is."""
    view.save_figure(figure, path)
    print_message(f"saved {path}")


def to_json_value(value: Any) -> Any:
    """Return plain Python values with finite numbers."""
    if isinstance(value, Mapping):
        return {str(key): to_json_value(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_json_value(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value.item() if hasattr(value, "item") else value


def print_notes(notes: Iterable[str]) -> None:
    """Print notes on unexpected or doubtful settings, once each; before anything is flown or written."""
    for text in dict.fromkeys(notes):
        print_message(f"note: {text}")


def print_message(text: str) -> None:
    """Print a line for a person, on the error stream so that it never mixes with output."""
    sys.stderr.write(f"{text}\n")


FIRST_LINE_AFTER, LINE_INTERVAL = 10.0, 30.0  # s: before the first line of a log, and at least between two
INTERVAL_SHARE = 0.1  # of the time so far that passes at least between two lines: a day gives some seventy


class ProgressLine:
    """Progress of the work, updated as it changes; this one prints nothing."""

    def update(self, text: str, done: float = 0.0, total: float | None = None) -> None:
        """Show the work under way, the amount done, and the total (None: unknown)."""

    def say(self, text: str) -> None:
        """Print a line that stays."""


@contextmanager
def progress_line(quiet: bool = False) -> Iterator[ProgressLine]:
    """Return the progress for standard error: none if quiet, a bar on a terminal, or lines for a log."""
    if quiet:
        yield ProgressLine()
    elif sys.stderr.isatty():
        with _progress_bar() as bar:
            yield bar
    else:
        yield LogProgress()


class LogProgress(ProgressLine):
    """Plain lines for a file or the log of a cluster, each with amount done, rate, and time left."""

    def __init__(self, clock: Callable[[], float] = time.monotonic):
        self._clock, self._lock = clock, Lock()
        self._began = clock()
        self._next_line_at = self._began + FIRST_LINE_AFTER
        self._time_left = TimeLeft(clock)

    def update(self, text: str, done: float = 0.0, total: float | None = None) -> None:
        """Print a line if the last one is long enough ago."""
        with self._lock:
            self._time_left.update(done, total)
            now = self._clock()
            if now < self._next_line_at:
                return
            # The interval grows with the run, so that a log of days stays short.
            self._next_line_at = now + max(LINE_INTERVAL, INTERVAL_SHARE * (now - self._began))
            amount = f": {done:,.0f}" if done else ""
            amount = f": {done:,.0f} of {total:,.0f} ({done / total:.0%})" if total else amount
            left = self._time_left.left
            ends = "" if left is None else f", {format_duration(left)} left"
            self.say(f"{text}{amount}{ends}")

    def say(self, text: str) -> None:
        """Print a line that stays."""
        print_message(text)


class TimeLeft:
    """Rate of the work: `left` is the remaining time (s), None while unknown.

    What was done before it was first looked at, by a run that was cut off, took no time. Less done than before
    means that other work begins.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic):
        self._clock = clock
        self._first, self._last, self._since = 0.0, math.inf, clock()
        self.left: float | None = None

    def update(self, done: float, total: float | None) -> None:
        """Take the amount done, and the total."""
        now = self._clock()
        # Less than before: other work has begun, and its rate is not that of the last.
        if done < self._last:
            self._first, self._since = done, now
        self._last = done
        gained = done - self._first
        self.left = None if not total or gained <= 0.0 else (total - done) * (now - self._since) / gained


def format_duration(seconds: float) -> str:
    """Format a time: 40 s, 12 min, 3.5 h."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"


@contextmanager
def _progress_bar() -> Iterator[ProgressLine]:
    """Return a moving line: the work under way, a bar, its share, and the time left."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    shape = (
        TextColumn("{task.description}", markup=False), BarColumn(bar_width=20), TaskProgressColumn(),
        TextColumn("{task.fields[left]}"), TimeElapsedColumn(),
    )  # fmt: skip
    pace = TimeLeft()
    with Progress(*shape, console=Console(stderr=True), transient=True, refresh_per_second=4) as drawn:
        task: Any = None

        class Bar(ProgressLine):
            def update(self, text: str, done: float = 0.0, total: float | None = None) -> None:
                nonlocal task
                pace.update(done, total)
                left = "" if pace.left is None else f"{format_duration(pace.left)} left"
                if task is None:
                    task = drawn.add_task(text, total=total, left=left)
                drawn.update(task, description=text, completed=done, total=total, left=left)

            def say(self, text: str) -> None:
                drawn.console.print(text, highlight=False, markup=False, soft_wrap=True)

        yield Bar()


@contextmanager
def counting_parts(label: str, total: int | None = None, quiet: bool = False) -> Iterator[Callable[[], None]]:
    """Show the progress of so many equal parts (None: unknown); yields a function to call after each."""
    with progress_line(quiet) as line:
        lock, done = Lock(), 0

        def one() -> None:
            nonlocal done
            with lock:
                done += 1
                line.update(label, done, total)

        line.update(label, 0, total)
        yield one


@contextmanager
def run_progress(quiet: bool) -> Iterator[Callable[[Any], None]]:
    """Show the progress of a run; yields what takes its `airflock.runs.RunProgress`."""
    with progress_line(quiet) as line:
        yield lambda p: line.update(progress_text(p), p.done, p.total)


def progress_text(p: Any) -> str:
    """Return stage and words of a progress."""
    return ", ".join(filter(None, (p.stage, p.text)))
