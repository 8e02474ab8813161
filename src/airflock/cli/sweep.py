"""Verb sweep: order parameters over ranges of any keys."""

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli import options, tables
from airflock.cli.progress import counting_parts
from airflock.support import INVALID, PICTURES, TABLES, ErrorCollector, ScenarioError, invalid_if, value_or_default

MAX_GRID_POINTS = 100_000  # of one key, and points of a whole grid


def sweep(
    ctx: typer.Context,
    scenario: options.Where,
    over: Annotated[
        list[str],
        typer.Option(
            "--over",
            metavar="KEY=VALUES",
            help="Values to fly, as a list a,b,c or a range low:high:count; repeat for a grid.",
            show_default=False,
        ),
    ],
    seeds: options.Seeds = 5,
    first_seed: options.FirstSeed = 0,
    changes: options.Set = None,
    law: options.Law = None,
    trust: options.Trust = False,
    agents: options.Agents = None,
    duration: options.Duration = None,
    threads: options.Threads = None,
    precision: options.Precision = 32,
    device: options.Device = "cpu",
    scheduler: options.Scheduler = None,
    as_json: options.Json = False,
    table: Annotated[Path | None, typer.Option(metavar="FILE.csv", help="Write one row per flight.")] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw a heat map (two keys) or a line (one key).")
    ] = None,
    show: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Order parameter to show.", show_default="fitness, quality or polarisation"),
    ] = None,
) -> None:
    """Fly a scenario over a grid of values and tabulate the order parameters.

    Example: airflock sweep vasarhelyi_2018/32ms --over radio.delay=0:2:5 --over radio.range=80,160,320 --plot map.png
    """
    from airflock.recordings import fly_points, grid_points, metric_to_show, scenarios_at

    asked = options.collect_option_errors(ctx)
    asked.read(options.check_writable, (table, TABLES), (plot, PICTURES))
    fixed = options.collect_settings(asked, changes, agents, duration)
    axes = _axes(over, plot, asked)
    points = asked.read(grid_points, axes)
    scenarios = invalid_if(
        fixed, asked.read(scenarios_at, scenario, points, value_or_default(fixed, {}), law, trust=trust)
    )
    name = asked.read(metric_to_show, show, scenarios)
    numbers = asked.read(options.seeds_from, first_seed, seeds)
    asked.read(options.check_flight_options, device, precision, scheduler)
    asked.raise_errors()
    tables.print_notes(merge_similar_notes(dict.fromkeys(note for found in scenarios for note in found.notes)))
    if scheduler is None:
        options.announce_run_time([found for found in scenarios for _ in numbers], threads, device)
        options.compile_before_bar(scenarios[0], precision, device)
    with counting_parts(f"{scenario}: flights", len(points) * seeds, quiet=as_json) as done:
        chosen: dict[str, Any] = {"threads": threads, "precision": precision, "done": done, "device": device}
        tidy = fly_points(points, scenarios, numbers, **chosen, notify=tables.print_message, scheduler=scheduler)
    _keep(tidy, list(axes), name, scenarios[0], table, plot)
    if as_json:
        tables.print_json({"scenario": scenario, "seeds": seeds, "runs": tidy.to_dict("records")})
    else:
        _print(tidy, list(axes), name)


def _axes(over: list[str], plot: Path | None, errors: ErrorCollector) -> dict[str, list[Any]]:
    """Keys that are swept, with the values of each; of those that can be read, the rest being noted."""
    axes = [found for text in over if (found := errors.read(parse_axis, text)) is not INVALID]
    errors.read(check_distinct_keys, [text.partition("=")[0].strip() for text in over], plot)
    return errors.read(_bounded, axes)


def _bounded(axes: list[tuple[str, list[Any]]]) -> dict[str, list[Any]]:
    """Axes of a grid that is not too large."""
    size = math.prod(len(values) for _, values in axes)
    if size > MAX_GRID_POINTS:
        raise ScenarioError([f"--over: a grid of {size} points is more than {MAX_GRID_POINTS}"])
    return dict(axes)


def _keep(tidy: Any, keys: list[str], show: str, scenario: Any, table: Path | None, plot: Path | None) -> None:
    """Write the table and the picture that were asked for."""
    if table is not None:
        from airflock.support import atomic

        atomic.write_file(table, tidy.to_csv(index=False))
        tables.print_message(f"saved {table}")
    if plot is not None:
        from airflock.view import heatmap, save_figure

        save_figure(heatmap(tidy, keys, show, scenario=scenario), plot)
        tables.print_message(f"saved {plot}")


def merge_similar_notes(notes: Iterable[str]) -> Iterator[str]:
    """The first of all notes that differ in numbers alone, and how many are like it."""
    kinds: dict[str, list[str]] = {}
    for note in notes:
        kinds.setdefault(re.sub(r"[-+]?\d[\d.e+-]*", "", note), []).append(note)
    for first, *more in kinds.values():
        yield f"{first} ({len(more)} more like it)" if more else first


def check_distinct_keys(keys: Sequence[str], plot: Path | None) -> None:
    """Refuse a key that is swept twice, and a picture of more keys than it has axes."""
    faults = [f"--over {key}: given {keys.count(key)} times; give all its values in one --over" for key in keys]
    faults = [fault for fault, key in zip(faults, keys, strict=True) if keys.count(key) > 1]
    if plot is not None and len(set(keys)) > 2:
        faults.append(f"--plot {plot}: a picture shows 1 or 2 keys, not {len(set(keys))}; leave it out, or sweep fewer")
    if faults:
        raise ScenarioError(list(dict.fromkeys(faults)))


def parse_axis(text: str, option: str = "--over") -> tuple[str, list[Any]]:
    """Key and values from KEY=a,b,c or KEY=low:high:count, as an option was given."""
    key, equals, values = text.partition("=")
    key = key.strip()
    parts = values.split(":")
    if equals and len(parts) == 3:
        try:
            low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
        except ValueError as fault:
            raise ScenarioError([f"{option} {text}: write low:high:count, for instance radio.delay=0:2:5"]) from fault
        if not 1 <= count <= MAX_GRID_POINTS:
            raise ScenarioError([f"{option} {text}: the count lies outside [1, {MAX_GRID_POINTS}]"])
        step = (high - low) / max(count - 1, 1)
        return key, [low + step * i for i in range(count)]
    if not equals or not values or len(parts) == 2:
        raise ScenarioError([f"{option} {text}: write KEY=a,b,c or KEY=low:high:count"])
    numbers = [options.parse_option_value(part, f"{option} {key}") for part in values.split(",")]
    if any(isinstance(value, (dict, list)) for value in numbers):
        raise ScenarioError([f"{option} {text}: a table or a list cannot be swept; give numbers or choices"])
    return key, numbers


def _print(tidy: Any, keys: list[str], show: str) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    grouped = tidy.groupby(keys, sort=False)[show].agg(["mean", "std", "median", "count"]).reset_index()
    table = Table(title=f"{show} (mean ± sd over seeds)", box=box.SIMPLE_HEAD, title_justify="left")
    for name in (*keys, show, "median", "flights"):
        table.add_column(name, justify="right")
    for row in grouped.to_dict("records"):
        spread = "" if row["count"] < 2 else f" ± {row['std']:.2g}"
        cells = [str(row[key]) if isinstance(row[key], str) else f"{row[key]:g}" for key in keys]
        table.add_row(*cells, f"{row['mean']:.4g}{spread}", f"{row['median']:.4g}", str(row["count"]))
    Console().print(table)
