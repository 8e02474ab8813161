"""Verb harden: from an optimum to parameters that may be flown."""

from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli import options, tables
from airflock.cli.progress import counting_parts
from airflock.support import SCENARIOS, ScenarioError, invalid_if, value_or_default

NUMBER_WIDTH = 6  # columns that a number takes: a narrow terminal must not cut it off


def harden(
    ctx: typer.Context,
    scenario: Annotated[
        str, typer.Argument(metavar="FILE|PRESET|DIR", help="An optimum: a scenario, or a study's folder.")
    ],
    out: Annotated[Path, typer.Option(metavar="FILE.toml", help="The hardened scenario.", show_default=False)],
    seeds: Annotated[int, typer.Option(min=2, help="Flights per step.")] = 100,
    first_seed: options.FirstSeed = 0,
    cost: Annotated[float, typer.Option(min=0.0, help="Fitness that the recipe may give up.")] = 0.05,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            "--limit",
            "-l",
            metavar="LIMIT",
            show_default=False,
            help="A limit that no step may break, such as 'r_min<3 at 0.01/h', as in certify; repeatable.",
        ),
    ] = None,
    changes: options.Set = None,
    trust: options.Trust = False,
    duration: options.Duration = None,
    threads: options.Threads = None,
    as_json: options.Json = False,
) -> None:
    """Make an optimum safer: try the steps of Table S4, and keep those that help, cost little and break nothing.

    A step towards a limit that is not kept yet may cost more. With a study of several scenarios, a step must keep what
    held in each; further files end in _2 and so on. Exit status 1 if no step was kept.

    Example: airflock harden study --out flyable.toml
    """
    from airflock.runs import write_toml_file
    from airflock.search import MAX_ROUNDS, harden, hardened_document, hardening_request

    asked = options.collect_option_errors(ctx)
    settings = asked.read(options.parse_settings, changes, None, duration)
    optima = invalid_if(settings, asked.read(_optima, scenario, value_or_default(settings, {}), trust))
    places = asked.read(_output_files, out, len(value_or_default(optima, [])), scenario)
    asked.read(hardening_request, optima, value_or_default(cost, 0.0), limit or ())
    numbers = asked.read(options.seeds_from, first_seed, seeds)
    asked.raise_errors()
    tables.print_notes(note for each in optima for note in each.notes)
    with counting_parts(f"{scenario}: flights", MAX_ROUNDS * seeds * len(optima), quiet=as_json) as done:
        steps = harden(optima, numbers, cost=cost, limit=limit or (), threads=threads, done=done)
    for each, place in zip(optima, places, strict=True):
        write_toml_file(place, hardened_document(each, steps[-1]), "Hardened; see airflock harden --help.")
    if as_json:
        rows = [step.as_dict() for step in steps]
        tables.print_json({"scenario": optima[0].name, "seeds": seeds, "out": str(out), "steps": rows})
    else:
        _print(optima[0].name, steps, seeds)
        tables.print_message(f"saved {', '.join(map(str, places))}")
    if not steps[-1].kept:
        raise typer.Exit(1)


def _output_files(out: Path, optima: int, where: str) -> list[Path]:
    """Files to write, one for each optimum."""
    places = [out, *(out.with_stem(f"{out.stem}_{i}") for i in range(2, optima + 1))]
    options.check_writable(*((place, SCENARIOS) for place in places), reads=[where])
    return places


def _optima(source: str, settings: dict[str, Any], trust: bool) -> list[Any]:
    """The optimum, or that of each scenario of a study's folder."""
    from airflock.scenarios import load
    from airflock.search import BEST_FILE, further_best_files

    folder = Path(source)
    if folder.is_dir() and not (folder / BEST_FILE).is_file():
        raise ScenarioError([f"{source}: holds no {BEST_FILE}: its search is not over, or nothing flies in it"])
    files = [folder / BEST_FILE, *further_best_files(folder)] if folder.is_dir() else [source]
    return [load(path, settings, trust=trust) for path in files]


def _print(name: str, steps: list[Any], seeds: int) -> None:
    """A table of what each step flies like, and below it a line for each: what it costs and gains, and its verdict."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"{name}: {seeds} paired flights a step", box=box.SIMPLE_HEAD, title_justify="left")
    table.add_column("step")
    for column in ("fitness", "r_min, m", "n_coll", "f_wall", "contacts", "clearance, m"):
        table.add_column(column, justify="right", min_width=NUMBER_WIDTH)
    for step in steps:
        walls = f"{step.parts['f_wall']:.3g}" if "f_wall" in step.parts else ""
        contacts = f"{100.0 * step.contacts:.0f} %" if step.contacts == step.contacts else ""
        room = f"{step.clearance:.3g}" if step.clearance == step.clearance else ""
        table.add_row(
            step.name, f"{step.fitness:.4f}", f"{step.r_min:.3g}", f"{step.n_coll:.3g}", walls, contacts, room
        )
    console = Console()
    console.print(table)
    for step in steps[1:]:
        (cost, least, most), (gain, low, high) = step.cost, step.gain
        told = f"cost {cost:.3g} ({least:.3g} to {most:.3g}), gain {gain:.3g} m ({low:.3g} to {high:.3g}), 95 %"
        console.print(f"{step.name}: {step.verdict}; {told}", highlight=False, markup=False, soft_wrap=True)
