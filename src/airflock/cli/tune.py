"""Verb tune: from a scenario of one's own to a set that is evolved, hardened and certified."""

from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli import options, tables
from airflock.cli.progress import progress_line
from airflock.support import ScenarioError, value_or_default


def tune(
    ctx: typer.Context,
    scenario: Annotated[
        list[str],
        typer.Argument(metavar="FILE|PRESET|LOGS", help="Your drones, field and speed; or logs, with --like."),
    ],
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for all results.", show_default=False)
    ],
    budget: Annotated[str, typer.Option(metavar="TIME", help="Time to spend, such as 20min or 2h.")] = "20min",
    limit: Annotated[
        list[str] | None,
        typer.Option(
            "--limit",
            "-l",
            metavar="LIMIT",
            help="As in certify; repeatable. Search, hardening and certificate all use it.",
            show_default="collisions and contacts with walls at 0.01/h each",
        ),
    ] = None,
    confidence: Annotated[
        float | None, typer.Option(help="Confidence of the certificate.", show_default="0.95")
    ] = None,
    like: Annotated[
        str | None,
        typer.Option(
            metavar="PRESET|FILE", help="For logs: the scenario with their law, field and speed.", show_default=False
        ),
    ] = None,
    heard: Annotated[
        Path | None, typer.Option(metavar="FILE.csv", help="For logs: their packets, as in identify.")
    ] = None,
    warm: Annotated[
        bool, typer.Option("--warm", help="Start the search at the scaled numbers, not in the middle of all ranges.")
    ] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue the work in the folder; --limit may be left out.")
    ] = False,
    changes: options.Set = None,
    trust: options.Trust = False,
    agents: options.Agents = None,
    duration: options.Duration = None,
    threads: options.Threads = None,
    as_json: options.Json = False,
) -> None:
    """Start, evolve, harden, certify, report: tuned.toml to fly, certificate.toml, and report.html to sign.

    Numbers of the law that the file leaves out are scaled to its speed. Exit status 1 if a limit is not shown.

    From logs, the numbers of the drones are identified first. For more options, run airflock identify and tune the
    file that it writes.

    Example: airflock tune mine.toml --budget 20min --out tuned
    """
    from airflock.certificates import check_confidence
    from airflock.search import load_plan, make_request, tune

    asked = options.collect_option_errors(ctx)
    seconds = asked.read(options.parse_seconds, budget)
    settings = options.collect_settings(asked, changes, agents, duration)
    base = options.collect_scenario(asked, asked.read(_start_scenario, scenario, like, heard), settings, trust=trust)
    start = asked.read(_tuned_scenario, base, like)
    plan = asked.read(load_plan, out, start, resume) if like is None else None  # with logs, of what they will tell
    if confidence is not None:
        asked.read(check_confidence, confidence)
    asked.read(make_request, start, limit or (), confidence, value_or_default(plan, None))
    asked.raise_errors()
    tables.print_notes(start.notes)
    options.compile_before_bar(base, 32, "cpu")
    what: Any = base if like is None else scenario
    how: dict[str, Any] = {"confidence": confidence, "warm": warm, "resume": resume, "threads": threads, "trust": trust}
    if like is not None:
        how |= {"like": base, "heard": heard}
    shown: list[str] = []
    with progress_line(as_json) as told:

        def watch(p: Any) -> None:
            told.update(p.stage + (f", {p.told}" if p.told else ""), p.done, p.total)

        def note(text: str) -> None:
            shown.append(text)
            told.say(text)

        tuning = tune(what, out, budget=seconds, limit=limit or (), watch=watch, note=note, **how)
    if as_json:
        tables.print_json(tuning.document())
    else:
        _print(tuning, shown)
    if not tuning.shown:
        raise typer.Exit(1)


def _start_scenario(scenario: list[str], like: str | None, heard: Path | None) -> str:
    """The scenario that names law, field and speed: the one that is tuned or, with logs, what they are like."""
    if like is not None:
        return like
    if len(scenario) > 1 or heard is not None:
        raise ScenarioError([f"{', '.join(scenario)}: give one scenario to tune; with logs, give --like PRESET"])
    if Path(scenario[0]).suffix != ".toml" and Path(scenario[0]).is_file():
        raise ScenarioError([f"{scenario[0]}: is not a scenario file (.toml); with logs, give --like PRESET"])
    return scenario[0]


def _tuned_scenario(base: Any, like: str | None) -> Any:
    """The scenario from which tuning starts; with logs it is not known yet, but takes the same limits."""
    from airflock.search import prepare_start

    return base if like is not None else prepare_start(base)[0]


def _print(tuning: Any, shown: list[str]) -> None:
    """What was found, and those notes that were not told while it was sought."""
    from rich.console import Console

    from airflock.search import limit_report_line

    console = Console()

    def line(text: str) -> None:
        console.print(text, highlight=False, markup=False, soft_wrap=True)

    for note in tuning.notes:
        if note not in shown:
            line(f"start: {note}")
    r = tuning.result
    line(f"evolved: fitness {r.fitness:.4f} ({r.low:.4f} to {r.high:.4f}) on {r.seeds} fresh seeds")
    for entry in r.limits:
        line(f"evolved: {limit_report_line(entry)}")
    line(f"hardened: {tuning.steps[-1].verdict}" if tuning.steps else f"not hardened: {tuning.why}")
    for text in tuning.certificate.statements:
        line(text)
    line(f"saved {tuning.folder}: tuned.toml, certificate.toml, report.html, figures.pdf")
