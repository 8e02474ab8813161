"""Verb certify: show by counting that an event is rare, or say what is missing."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli import options, tables
from airflock.cli.progress import counting_parts, progress_line
from airflock.support import PICTURES, SCENARIOS

ScenarioArgument = Annotated[
    str, typer.Argument(metavar="PRESET|FILE", help="A preset or a scenario file; with --check a certificate.")
]
Limits = Annotated[
    list[str] | None,
    typer.Option(
        "--limit", "-l", metavar="LIMIT", show_default=False,
        help="'r_min<1 at 1e-3/h' (per flock hour), '.../drone-h', 'clearance<0 at 1%' (of flights: a contact), "
        "'phi_vel>=3 in 99%'; without a rate: bound it. Repeatable; all hold together.",
    ),
]  # fmt: skip
Budget = Annotated[str, typer.Option(metavar="TIME", help="Time to spend, such as 90s, 10min or 2h.")]
Flights = Annotated[
    int | None,
    typer.Option(help="Fly this many flights and look once, however long it takes.", show_default="from the limit"),
]
Out = Annotated[
    Path | None,
    typer.Option(
        "--out", "-o", metavar="FILE.toml", help="Certificate to write; its flights are kept beside it in FILE_flights."
    ),
]
Tolerance = Annotated[
    bool, typer.Option("--tolerance", help="Also find how far delay, noise, lag and so on may change.")
]
ToleranceOf = Annotated[
    list[str] | None,
    typer.Option("--tolerance-of", metavar="KEY", help="Only for this key, such as radio.delay; repeatable."),
]
Split = Annotated[
    bool,
    typer.Option("--split", help="Also estimate r_min limits by splitting; this ranks flights but proves nothing."),
]
Map = Annotated[
    list[str] | None,
    typer.Option(
        "--map", metavar="KEY=VALUES", help="Give it twice: also bounds over a grid, such as radio.delay=0.5:1.5:5."
    ),
]
Uncertain = Annotated[
    bool, typer.Option("--uncertain", help="Draw each flight's numbers from the intervals in the file.")
]
Check = Annotated[
    bool, typer.Option("--check", help="Check a certificate: fly one flight in a hundred again and compare the bits.")
]
Plot = Annotated[Path | None, typer.Option(metavar="FILE.png", help="Draw bounds, distances and tolerances.")]
Timeout = Annotated[
    float | None, typer.Option(help="Longest time for one flight on a worker, s.", show_default="no limit")
]
Device = Annotated[str, typer.Option(help="cpu, or python (not compiled, for debugging).")]


def certify(
    ctx: typer.Context,
    scenario: ScenarioArgument,
    limit: Limits = None,
    confidence: Annotated[float, typer.Option(help="Confidence that all limits hold together.")] = 0.95,
    budget: Budget = "10min",
    flights: Flights = None,
    out: Out = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue with the flights beside --out.")] = False,
    tolerance: Tolerance = False,
    tolerance_of: ToleranceOf = None,
    split: Split = False,
    over: Map = None,
    uncertain: Uncertain = False,
    check: Check = False,
    plot: Plot = None,
    scheduler: options.Scheduler = None,
    timeout: Timeout = None,
    changes: options.Set = None,
    law: options.Law = None,
    trust: options.Trust = False,
    agents: options.Agents = None,
    duration: options.Duration = None,
    threads: options.Threads = None,
    precision: options.Precision = 32,
    device: Device = "cpu",
    as_json: options.Json = False,
) -> None:
    """Show that an event is rare: exact bounds, seeds fixed in advance, every interim look accounted for.

    Exit status 0: every limit is shown to hold (or the check passes); 1: not; 2: bad input.

    Example: airflock certify vasarhelyi_2018/real_6ms --limit "r_min<1 at 0.1/h" --budget 10min --out certificate.toml
    """
    asked = options.collect_option_errors(ctx)
    if check:
        asked.raise_errors()
        others = {
            "--limit": limit, "--flights": flights, "--out": out, "--resume": resume, "--tolerance": tolerance,
            "--tolerance-of": tolerance_of, "--split": split, "--map": over, "--uncertain": uncertain, "--plot": plot,
            "--scheduler": scheduler, "--set": changes, "--law": law, "--agents": agents, "--duration": duration,
        }  # fmt: skip
        left_out = ", ".join(name for name, value in others.items() if value)
        options.raise_errors(
            [f"--check: flies again what the certificate holds; leave out {left_out}"] if left_out else []
        )
        _check(scenario, threads, trust, as_json)
        return
    from airflock.certificates import (
        campaign_from_request,
        check_confidence,
        check_flight_count,
        check_flight_options,
        check_map_axes,
        check_split,
        check_workers,
        tolerance_keys,
    )
    from airflock.cli.sweep import parse_axis

    asked.read(options.check_writable, (out, SCENARIOS), (plot, PICTURES), reads=[scenario])
    seconds = asked.read(options.parse_seconds, budget)
    loaded = options.collect_scenario(
        asked, scenario, options.collect_settings(asked, changes, agents, duration), law, trust=trust
    )
    asked.read(check_confidence, confidence)
    asked.read(check_flight_count, flights)
    asked.read(check_flight_options, precision, device)
    how: dict[str, Any] = {"uncertain": uncertain, "precision": precision, "device": device}
    campaign = asked.read(campaign_from_request, loaded, limit or [], confidence, flights, **how)
    also: dict[str, Any] = {"split": split, "axes": {}}
    also["keys"] = asked.read(tolerance_keys, loaded, tolerance_of or tolerance)
    if split:
        asked.read(check_split, campaign)
    if over:
        axes = asked.collect_each(partial(parse_axis, option="--map"), over)
        also["axes"] = asked.read(check_map_axes, loaded, asked.read(dict, axes))
    asked.read(check_workers, timeout, scheduler, device)
    if resume and out is None:
        asked.note("--resume: name the certificate whose flights are to be continued with --out")
    asked.raise_errors()
    tables.print_notes(campaign.scenario.notes)
    if scheduler is None:
        options.compile_before_bar(campaign.flown, precision, device)
    flying = {"scheduler": scheduler, "threads": threads, "timeout": timeout}
    _end(_flown(campaign, seconds, out, resume, flying, also, quiet=as_json), out, plot, as_json)


def _flown(
    campaign: Any, seconds: float, out: Path | None, resume: bool, flying: dict[str, Any], extras: dict[str, Any], *,
    quiet: bool,
) -> Any:  # fmt: skip
    """Fly a campaign, in the folder beside `out` or one that is gone afterwards; its certificate.

    flying : scheduler, threads and timeout; also: what is asked for besides counting
    """
    from airflock.certificates import (
        CAMPAIGN_KIND,
        campaign_executor,
        flight_folder,
        run_campaign,
        with_planned_flights,
    )
    from airflock.runs import open_folder

    with flight_folder(None if out is None else out.parent / f"{out.stem}_flights") as folder:
        executor = campaign_executor(campaign, **flying)
        try:
            campaign = with_planned_flights(campaign, executor, seconds, folder, resume)
            open_folder(folder, campaign, resume=resume, kind=CAMPAIGN_KIND)
            with counting_progress(quiet) as (watch, note):
                return run_campaign(
                    campaign, folder, executor, seconds, watch, **extras, threads=flying["threads"], notify=note,
                    is_stored=out is not None,
                )  # fmt: skip
        finally:
            executor.close()


def _end(result: Any, out: Path | None, plot: Path | None, as_json: bool) -> None:
    """Write, print, and leave with status 1 where something is not shown."""
    if out is not None:
        result.save(out)
        tables.print_message(f"saved {out}")
    if plot is not None:
        from airflock.view import plot_certificate, save_figure

        save_figure(plot_certificate(result), plot)
        tables.print_message(f"saved {plot}")
    if as_json:
        tables.print_json({**result.document(), "seconds": result.seconds})
    else:
        from airflock.cli.certificate import print_certificate

        print_certificate(result)
    if not result.shown:
        raise typer.Exit(1)


@contextmanager
def counting_progress(quiet: bool) -> Iterator[tuple[Callable[[Any], None], Callable[[str], None]]]:
    """Progress of counting: flights up to the coming look, events so far, flights per second; then what else begins."""
    with progress_line(quiet) as told:

        def watch(p: Any) -> None:
            events = ", ".join(str(count) for count in p.events)
            told.update(f"counting, {events} events, {p.rate:.1f} flights/s", p.done, p.total)

        yield watch, told.update


def _check(path: str, threads: int | None, trust: bool, as_json: bool) -> None:
    """Check a certificate; status 1 where it does not hold."""
    from airflock.certificates import check_certificate

    with counting_parts(f"{path}: flights again", quiet=as_json) as done:
        result = check_certificate(path, threads=threads, trust=trust, on_done=done)
    if as_json:
        tables.print_json({"same": result.same, **vars(result)})
    else:
        tables.print_notes(result.notes)
        for fault in result.faults:
            tables.print_message(f"airflock: {path}: {fault}")
        said = "same bits, bounds computed again" if result.same else "does not hold"
        typer.echo(f"{path}: {result.flown} of {result.total:,} flights flown again: {said}")
    if not result.same:
        raise typer.Exit(1)
