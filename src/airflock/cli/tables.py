"""Tables for a terminal, and JSON for machines."""

import json
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any


def column_statistics(rows: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Mean, standard deviation and median of each column; of a column of lists, those of each place.

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


def format_number(x: Any, missing: str = "never") -> str:
    """A number with four significant digits, `missing` where it is nan (a time's `never`); a list side by side."""
    if isinstance(x, (list, tuple)):
        return ", ".join(f"{v:.3g}" if v == v else missing for v in x)
    return f"{x:.4g}" if x == x else missing


def print_score_table(
    title: str,
    rows: Sequence[Mapping[str, Any]],
    published: Mapping[str, tuple[float, float | None]],
    units_and_meanings: Mapping[str, tuple[str, str]],
) -> None:
    """Print order parameters beside what a paper reports; about: unit and meaning by name.

    What no flight has (a clearance where nothing stands) is named in one line below, not told as a number.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table

    summary = column_statistics(rows)
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
    table.add_column("order parameter", style="bold")
    table.add_column("mean ± sd" if len(rows) > 1 else "value", justify="right")
    if len(rows) > 1:
        table.add_column("median", justify="right")
    if published:
        table.add_column("published", justify="right", style="cyan")
    table.add_column("unit")
    table.add_column("meaning", style="dim")
    untold = [key for key, mean in summary["mean"].items() if _is_unmeasured(key, mean) and key not in published]
    for key in [key for key in summary["mean"] if key not in untold]:
        unit, meaning = units_and_meanings.get(key, ("", ""))
        missing = "never" if key.startswith("time_to_") else "nan"  # only an event can never happen
        mean = format_number(summary["mean"][key], missing)
        spread = summary["std"][key]
        single = len(rows) == 1 or isinstance(spread, list) or spread != spread
        cells = [key, mean if single else f"{mean} ± {spread:.2g}"]
        cells += [format_number(summary["median"][key], missing)] if len(rows) > 1 else []
        if published:
            entry = published.get(key)
            spread = "" if entry is None or entry[1] is None else f" ± {entry[1]:.2g}"
            cells += ["" if entry is None else f"{format_number(entry[0])}{spread}"]
        table.add_row(*cells, unit, meaning)
    Console().print(table)
    if untold:
        Console().print(
            f"not shown, because there is nothing to measure: {', '.join(untold)}", style="dim", soft_wrap=True
        )


def _is_unmeasured(key: str, mean: Any) -> bool:
    """Whether no flight has such a number; an event that never happened is told as `never`."""
    values = mean if isinstance(mean, (list, tuple)) else [mean]
    return not key.startswith("time_to_") and bool(values) and all(math.isnan(value) for value in values)


def print_json(value: Any) -> None:
    """Print JSON on one line; numbers that are no JSON (never expected) become null."""
    sys.stdout.write(json.dumps(to_json_value(value), ensure_ascii=False) + "\n")


def to_json_value(value: Any) -> Any:
    """Plain Python values with finite numbers."""
    if isinstance(value, Mapping):
        return {str(key): to_json_value(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_json_value(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value.item() if hasattr(value, "item") else value


def print_notes(notes: Iterable[str]) -> None:
    """What is read otherwise than it is written or hardly meant, once each; before anything is flown or written."""
    for text in dict.fromkeys(notes):
        print_message(f"note: {text}")


def print_message(text: str) -> None:
    """A line for a person, on the error stream so that it never mixes with output."""
    sys.stderr.write(f"{text}\n")
