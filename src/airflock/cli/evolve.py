"""Verb evolve: repeat or begin an optimisation."""

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli import options, tables
from airflock.cli.progress import search_progress
from airflock.support import INVALID, value_or_default


def evolve(
    ctx: typer.Context,
    scenario: Annotated[str, typer.Argument(metavar="PRESET|FILE", help="A preset, a scenario file, or a study file.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the study.", show_default=False)],
    algorithm: Annotated[str | None, typer.Option(help="cmaes, ga or nsga2.", show_default="cmaes")] = None,
    population: Annotated[int | None, typer.Option(help="Candidates per generation.", show_default="100")] = None,
    generations: Annotated[int | None, typer.Option(help="Generations per run.", show_default="150")] = None,
    seeds: Annotated[int | None, typer.Option(help="Flights per candidate.", show_default="1")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of everything random in the study.", show_default="0")] = None,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            "--limit",
            "-l",
            metavar="LIMIT",
            show_default=False,
            help="A limit that candidates must keep before fitness counts, such as 'r_min<3 at 0.01/h', as in certify; "
            "--seeds is then 2 by default. Repeatable.",
        ),
    ] = None,
    restarts: Annotated[int | None, typer.Option(help="Further independent runs.", show_default="0")] = None,
    flights: Annotated[
        str | None,
        typer.Option(
            help="whole, or growing: flights start at an eighth of the duration and grow to all of it.",
            show_default="whole",
        ),
    ] = None,
    racing: Annotated[
        bool,
        typer.Option(
            "--racing", help="With several --seeds: stop flying a candidate once it cannot reach the better half."
        ),
    ] = False,
    start: Annotated[
        str | None,
        typer.Option(
            help="Where CMA-ES starts: middle (of all ranges), or scenario (its own values).", show_default="middle"
        ),
    ] = None,
    averages: Annotated[
        int | None,
        typer.Option(help="Number of averages of the last means that also join the final.", show_default="0"),
    ] = None,
    fast: Annotated[
        bool,
        typer.Option(
            "--fast",
            help="Use a third of the flights: 24 candidates, each with one flight at first and nine at the end.",
        ),
    ] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue the study in the folder; other options may be left out.")
    ] = False,
    scheduler: options.Scheduler = None,
    timeout: Annotated[
        float | None, typer.Option(help="Longest time for one flight on a worker, s.", show_default="no limit")
    ] = None,
    sensitivity: Annotated[
        str,
        typer.Option(metavar="METHOD", help="Also find which parameters matter: sobol or morris.", show_default=False),
    ] = "",
    device: Annotated[str, typer.Option(metavar="D", help="Device for the flights: cpu, cuda or auto.")] = "cpu",
    changes: options.Set = None,
    trust: options.Trust = False,
    agents: options.Agents = None,
    duration: options.Duration = None,
    threads: options.Threads = None,
    as_json: options.Json = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress.")] = False,
) -> None:
    """Evolve a flock's parameters; the folder then holds the optimum, all evaluations, tables and pictures.

    Exit status 1 if no candidate flies; then there is no best.toml.

    Example: airflock evolve vasarhelyi_2018/6ms --out study --generations 20
    """
    from airflock.runs import check_timeout, open_folder
    from airflock.search import (
        check_sensitivity_method,
        check_study_device,
        evolve_request,
        resolve_device,
        run_study,
        study_executor,
    )

    asked = options.collect_option_errors(ctx)
    given = {
        "algorithm": algorithm,
        "population": population,
        "generations": generations,
        "seeds": seeds,
        "seed": seed,
        "restarts": restarts,
        "flights": flights,
        **({"racing": "optimistic", "random_numbers": "generation"} if racing else {}),
        "start": start,
        "averages": averages,
    }
    found = asked.read(
        evolve_request,
        scenario,
        value_or_default(options.collect_settings(asked, changes, agents, duration), {}),
        search_keys={key: value for key, value in given.items() if value is not None and value is not INVALID},
        limit=limit or (),
        trust=trust,
        fast=fast,
        folder=out if resume else None,
    )
    asked.read(check_sensitivity_method, sensitivity)
    asked.read(check_timeout, timeout)
    asked.read(check_study_device, device, scheduler)
    asked.raise_errors()
    study, taken = found
    study = resolve_device(study, device)
    open_folder(out, study, resume=resume)
    tables.print_notes(
        [*(note for each in study.scenarios for note in each.notes), *study.notes, *([taken] if taken else [])]
    )
    begin = time.perf_counter()
    executor = study_executor(study, scheduler, threads, timeout)
    with search_progress(study, quiet or as_json) as (watch, note):
        result = run_study(study, out, executor, watch, note, sensitivity=sensitivity)
    if as_json:
        tables.print_json({**result.document(), "folder": str(out), "seconds": time.perf_counter() - begin})
    elif not quiet:
        _print(result)
    if result.dead_reason:
        tables.print_message(f"airflock: {result.scenario.name}: {result.dead_reason}")
        raise typer.Exit(1)


def _print(result: Any) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from airflock.search import limit_report_line

    title = f"{result.scenario.name}: {result.fitness:.4f} ± {result.sd:.2g} on {result.seeds} fresh seeds"
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
    table.add_column("parameter", style="bold")
    table.add_column("best", justify="right")
    table.add_column("working range", justify="right")
    for key, value in result.parameters.items():
        low, high = result.ranges.get(key, (None, None))
        table.add_row(key, f"{value:.4g}", "" if low is None else f"{low:.3g} … {high:.3g}")
    console = Console()
    console.print(table)
    console.print(
        f"95 % interval {result.low:.4f} … {result.high:.4f}; luckiest of the search {result.largest:.4f}; "
        f"{result.above} of {result.candidate_count} candidates reach the mean; {result.failed} failed",
        highlight=False,
    )
    for entry in result.limits:
        console.print(limit_report_line(entry), highlight=False, markup=False, soft_wrap=True)
    for name, (mean, low, high) in result.scenarios.items():
        console.print(f"in {name}: {mean:.4f} ({low:.4f} … {high:.4f})", highlight=False, markup=False)
    if result.dead_reason:
        return
    console.print(f"fly it: airflock run {result.folder / 'best.toml'}", highlight=False, markup=False, soft_wrap=True)
