"""Verbs evolve, harden, tune and certify: search for parameters, make them safer, and bound their risks."""

import time
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli import options, terminal
from airflock.cli.terminal import counting_parts, progress_line, run_progress
from airflock.support import INVALID, PICTURES, SCENARIOS, ScenarioError, invalid_if, value_or_default


def evolve(
    ctx: typer.Context,
    scenario: Annotated[
        str | None,
        typer.Argument(
            metavar="PRESET|FILE",
            show_default=False,
            help="A preset, a scenario file, or a study file; none to --resume what the folder holds.",
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder of the study.", show_default=False)] = None,
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
    from airflock.runs import check_timeout, open_folder, run_place
    from airflock.search import (
        check_sensitivity_method,
        check_study_device,
        evolve_request,
        resolve_device,
        run_study,
        study_executor,
    )

    errors = options.collect_option_errors(ctx)
    place = errors.read(run_place, out)
    given = {
        "algorithm": algorithm,
        "population": population,
        "generations": generations,
        "seeds": seeds,
        "seed": seed,
        "restarts": restarts,
        "flights": flights,
        "start": start,
        "averages": averages,
    }
    found = errors.read(
        evolve_request,
        scenario,
        value_or_default(options.collect_settings(errors, changes, agents, duration), {}),
        search_keys={key: value for key, value in given.items() if value is not None and value is not INVALID},
        limit=limit or (),
        trust=trust,
        fast=fast,
        folder=place if resume else None,
    )
    errors.read(check_sensitivity_method, sensitivity)
    errors.read(check_timeout, timeout)
    errors.read(check_study_device, device, scheduler)
    errors.raise_errors()
    study, taken = found
    study = resolve_device(study, device)
    mended = open_folder(place, study, resume=resume)
    notes = [*(note for each in study.scenarios for note in each.notes), *study.notes, taken, mended]
    terminal.print_notes([note for note in notes if note])
    begin = time.perf_counter()
    executor = study_executor(study, scheduler, threads, timeout)
    with run_progress(quiet or as_json) as watch:
        result = run_study(study, place, executor, watch, sensitivity=sensitivity)
    if as_json:
        terminal.print_json({**result.document(), "folder": str(out), "seconds": time.perf_counter() - begin})
    elif not quiet:
        _print_optimum(result)
    if result.dead_reason:
        terminal.print_message(f"airflock: {result.scenario.name}: {result.dead_reason}")
        raise typer.Exit(1)


def _print_optimum(result: Any) -> None:
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
    for reason, count in result.reasons.items():
        console.print(f"failed flights: {count}; {reason}", highlight=False, markup=False, soft_wrap=True)
    for entry in result.limits:
        console.print(limit_report_line(entry), highlight=False, markup=False, soft_wrap=True)
    for name, (mean, low, high) in result.scenarios.items():
        console.print(f"in {name}: {mean:.4f} ({low:.4f} … {high:.4f})", highlight=False, markup=False)
    if result.dead_reason:
        return
    console.print(f"fly it: airflock run {result.folder / 'best.toml'}", highlight=False, markup=False, soft_wrap=True)


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

    errors = options.collect_option_errors(ctx)
    settings = errors.read(options.parse_settings, changes, None, duration)
    optima = invalid_if(settings, errors.read(_optima, scenario, value_or_default(settings, {}), trust))
    places = errors.read(_output_files, out, len(value_or_default(optima, [])), scenario)
    errors.read(hardening_request, optima, value_or_default(cost, 0.0), limit or ())
    numbers = errors.read(options.seeds_from, first_seed, seeds)
    errors.raise_errors()
    terminal.print_notes(note for each in optima for note in each.notes)
    with counting_parts(f"{scenario}: flights", MAX_ROUNDS * seeds * len(optima), quiet=as_json) as done:
        steps = harden(optima, numbers, cost=cost, limit=limit or (), threads=threads, done=done)
    for each, place in zip(optima, places, strict=True):
        write_toml_file(place, hardened_document(each, steps[-1]), "Hardened; see airflock harden --help.")
    if as_json:
        rows = [step.as_dict() for step in steps]
        terminal.print_json({"scenario": optima[0].name, "seeds": seeds, "out": str(out), "steps": rows})
    else:
        _print_hardened(optima[0].name, steps, seeds)
        terminal.print_message(f"saved {', '.join(map(str, places))}")
    if not steps[-1].kept:
        raise typer.Exit(1)


def _output_files(out: Path, optima: int, where: str) -> list[Path]:
    """Return the files to write, one for each optimum."""
    places = [out, *(out.with_stem(f"{out.stem}_{i}") for i in range(2, optima + 1))]
    options.check_writable(*((place, SCENARIOS) for place in places), reads=[where])
    return places


def _optima(source: str, settings: dict[str, Any], trust: bool) -> list[Any]:
    """Return the optimum, or that of each scenario of a study's folder."""
    from airflock.scenarios import load
    from airflock.search import BEST_FILE, further_best_files

    folder = Path(source)
    if folder.is_dir() and not (folder / BEST_FILE).is_file():
        raise ScenarioError([f"{source}: holds no {BEST_FILE}: its search is not over, or nothing flies in it"])
    files = [folder / BEST_FILE, *further_best_files(folder)] if folder.is_dir() else [source]
    return [load(path, settings, trust=trust) for path in files]


def _print_hardened(name: str, steps: list[Any], seeds: int) -> None:
    """Print a table of the scores of each step, and below it a line for each: costs, gains, and verdict."""
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
        costs = f"cost {cost:.3g} ({least:.3g} to {most:.3g}), gain {gain:.3g} m ({low:.3g} to {high:.3g}), 95 %"
        console.print(f"{step.name}: {step.verdict}; {costs}", highlight=False, markup=False, soft_wrap=True)


def tune(
    ctx: typer.Context,
    scenario: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="FILE|PRESET|LOGS",
            show_default=False,
            help="Your drones, field and speed; or logs, with --like; none to --resume what the folder holds.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="DIR", help="Folder for all results.", show_default=False)
    ] = None,
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
    from airflock.runs import run_place
    from airflock.search import load_plan, make_request, tune

    errors = options.collect_option_errors(ctx)
    folder = errors.read(run_place, out)
    seconds = errors.read(options.parse_seconds, budget)
    settings = options.collect_settings(errors, changes, agents, duration)
    if confidence is not None:
        errors.read(check_confidence, confidence)
    base: Any = None
    if scenario or not resume:
        place = errors.read(_start_scenario, scenario or [], like, heard)
        base = options.collect_scenario(errors, place, settings, trust=trust)
        start = errors.read(_tuned_scenario, base, like)
        # with logs it depends on their contents
        plan = errors.read(load_plan, folder, start, resume) if like is None else None
        errors.read(make_request, start, limit or (), confidence, value_or_default(plan, None))
        errors.raise_errors()
        terminal.print_notes(start.notes)
        options.compile_before_bar(base, 32, "cpu")
    errors.raise_errors()
    what: Any = base if like is None else scenario
    how: dict[str, Any] = {"confidence": confidence, "warm": warm, "resume": resume, "threads": threads, "trust": trust}
    if like is not None:
        how |= {"like": base or like, "heard": heard}
    shown: list[str] = []
    with progress_line(as_json) as line:

        def watch(p: Any) -> None:
            line.update(terminal.progress_text(p), p.done, p.total)

        def note(text: str) -> None:
            shown.append(text)
            line.say(text)

        tuning = tune(what, folder, budget=seconds, limit=limit or (), watch=watch, note=note, **how)
    if as_json:
        terminal.print_json(tuning.document())
    else:
        _print_campaign(tuning, shown)
    if not tuning.shown:
        raise typer.Exit(1)


def _start_scenario(scenario: list[str], like: str | None, heard: Path | None) -> str:
    """Return the scenario that names law, field and speed: the tuned one or, with logs, that of --like."""
    if like is not None:
        return like
    if len(scenario) != 1 or heard is not None:
        what = ", ".join(scenario) or "tune"
        raise ScenarioError([f"{what}: give one scenario to tune; with logs, give --like PRESET"])
    if Path(scenario[0]).suffix != ".toml" and Path(scenario[0]).is_file():
        raise ScenarioError([f"{scenario[0]}: is not a scenario file (.toml); with logs, give --like PRESET"])
    return scenario[0]


def _tuned_scenario(base: Any, like: str | None) -> Any:
    """Return the scenario from which tuning starts; with logs it is not known yet, but takes the same limits."""
    from airflock.search import prepare_start

    return base if like is not None else prepare_start(base)[0]


def _print_campaign(tuning: Any, shown: list[str]) -> None:
    """Print the result, and the notes that were not printed during the search."""
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


def print_certificate(certificate: Any) -> None:
    """Print everything that a certificate shows, and what it does not show."""
    from rich.console import Console

    console = Console()

    def line(text: str, **how: Any) -> None:
        console.print(text, highlight=False, markup=False, soft_wrap=True, **how)

    _verdicts(console, certificate)
    for text in certificate.statements:
        line(text)
    for i, hazard in certificate.hazards.items():
        if hazard.events:
            early = f"{hazard.early} of {hazard.events} first events in the first half of flights"
            even = f"{100.0 * hazard.expected:.0f} % if even: {hazard.verdict}"
            line(f"{certificate.campaign.limits[i].event}: {early}, {even}")
    _worst(console, certificate)
    _tolerances(console, certificate.tolerance)
    _map(console, certificate.over)
    for text in certificate.splitting.get("statements", ()):
        line(text)
    line(f"Not said: {'; '.join(certificate.disclaimers)}.", style="dim")


def _verdicts(console: Any, certificate: Any) -> None:
    """Print one row a limit."""
    from rich import box
    from rich.table import Table

    from airflock.certificates import upper_bound_in_unit

    campaign = certificate.campaign
    sure = f"{100.0 * campaign.confidence:g} %"
    title = f"{campaign.scenario.name}: {len(certificate.rows):,} flights of {campaign.scenario.flight.duration:g} s"
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
    for name in ("limit", "events", "flights", f"at most ({sure})", "verdict"):
        table.add_column(name, justify="right" if name in ("events", "flights") else "left")
    for verdict in certificate.verdicts:
        said = "shown" if verdict.shown else "refuted" if verdict.is_refuted else "not shown"
        table.add_row(
            verdict.limit.text,
            f"{verdict.events:,}",
            f"{verdict.flights:,}",
            upper_bound_in_unit(campaign, verdict),
            said,
        )
    console.print(table)


def _worst(console: Any, certificate: Any) -> None:
    shown: set[str] = set()
    for entry in certificate.worst:
        if entry["limit"] in shown:
            continue
        shown.add(entry["limit"])
        line = f"worst for {entry['limit']}: {terminal.format_number(entry['value'])}"
        moment = f" before {entry['first']:.0f} s" if "first" in entry else ""
        console.print(f"{line}{moment}; {entry['replay']}", highlight=False, markup=False, soft_wrap=True)


def _tolerances(console: Any, tolerance: Any) -> None:
    if not tolerance:
        return
    from rich import box
    from rich.table import Table

    if "reason" in tolerance:
        console.print(f"tolerance: {tolerance['reason']}", highlight=False, markup=False, soft_wrap=True)
        return
    level, confidence = (100.0 * tolerance[name] for name in ("level", "confidence"))
    title = f"safe: fewer than {level:g} % of flights with an event ({confidence:g} %)"
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
    for name in ("number", "nominal", "safe to", "factor", "not shown at", "flights", ""):
        table.add_column(
            name, justify="left" if name in ("number", "") else "right", no_wrap=name == "number", overflow="fold"
        )
    for axis in tolerance["axis"]:
        bad = terminal.format_number(axis["not_shown"]) if "not_shown" in axis else ""
        factor = f"{axis['factor']:.3g}" if "factor" in axis else ""
        table.add_row(
            axis["key"], terminal.format_number(axis["nominal"]), terminal.format_number(axis["safe"]), factor, bad,
            f"{axis['flights']:,}", axis.get("note", ""),
        )  # fmt: skip
    console.print(table)


def _map(console: Any, bounds: Any) -> None:
    """Print upper bounds in percent of flights, first key downwards, second across."""
    if not bounds:
        return
    from rich import box
    from rich.table import Table

    (down, across), (rows, columns) = bounds["keys"], bounds["axes"]
    title = f"at most so many % of flights with an event; * safe, below {100.0 * bounds['level']:g} %"
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
    table.add_column(f"{down} / {across}", style="bold")
    for value in columns:
        table.add_column(f"{value:g}", justify="right")
    cells = iter(bounds["cell"])
    for value in rows:
        row = [next(cells) for _ in columns]
        texts = [f"{100.0 * cell['high']:.3g}{'*' if cell['verdict'] == 'safe' else ''}" for cell in row]
        table.add_row(f"{value:g}", *texts)
    console.print(table)


ScenarioArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="PRESET|FILE", show_default=False,
        help="A preset or a scenario file; with --check a certificate; none to --resume what lies beside --out.",
    ),
]  # fmt: skip
Limits = Annotated[
    list[str] | None,
    typer.Option(
        "--limit", "-l", metavar="LIMIT", show_default=False,
        help="'r_min<1 at 1e-3/h' (per flock hour), '.../drone-h', 'clearance<0 at 1%' (of flights: a contact), "
        "'phi_vel>=3 in 99%'; without a rate: bound it. Repeatable; all hold together.",
    ),
]  # fmt: skip
Budget = Annotated[
    str | None, typer.Option(metavar="TIME", help="Time to spend, such as 90s, 10min or 2h.", show_default="10min")
]
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
    scenario: ScenarioArgument = None,
    limit: Limits = None,
    confidence: Annotated[float, typer.Option(help="Confidence that all limits hold together.")] = 0.95,
    budget: Budget = None,
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
    errors = options.collect_option_errors(ctx)
    if check:
        errors.raise_errors()
        others = {
            "--limit": limit, "--flights": flights, "--out": out, "--resume": resume, "--tolerance": tolerance,
            "--tolerance-of": tolerance_of, "--split": split, "--map": over, "--uncertain": uncertain, "--plot": plot,
            "--scheduler": scheduler, "--set": changes, "--law": law, "--agents": agents, "--duration": duration,
        }  # fmt: skip
        left_out = ", ".join(name for name, value in others.items() if value)
        options.raise_errors(
            [f"--check: flies again what the certificate holds; leave out {left_out}"] if left_out else []
        )
        _check(scenario or "", threads, trust, as_json)
        return
    from airflock.certificates import (
        campaign_from_request,
        check_confidence,
        check_flight_count,
        check_flight_options,
        check_map_axes,
        check_split,
        check_workers,
        fly_campaign,
        resumed_campaign,
        tolerance_keys,
    )
    from airflock.cli.flight_verbs import parse_axis

    errors.read(options.check_writable, (out, SCENARIOS), (plot, PICTURES), reads=[scenario or ""])
    seconds = None if budget is None else errors.read(options.parse_seconds, budget)
    folder = None if out is None else out.parent / f"{out.stem}_flights"
    settings = options.collect_settings(errors, changes, agents, duration)
    how: dict[str, Any] = {"uncertain": uncertain, "precision": precision, "device": device}
    also: dict[str, Any] = {"split": split, "axes": {}}
    if scenario is None and resume and folder is not None:
        errors.raise_errors()
        campaign, held = resumed_campaign(
            folder, trust=trust, limit=limit, flights=flights, settings=settings, law=law, uncertain=uncertain,
        )  # fmt: skip
        loaded, split = campaign.scenario, split or held["split"]
        also = {"split": split, "axes": held["map"]}
        tolerance_of = tolerance_of or held["tolerance"]
    else:
        loaded = options.collect_scenario(errors, scenario or "", settings, law, trust=trust)
        errors.read(check_confidence, confidence)
        errors.read(check_flight_count, flights)
        errors.read(check_flight_options, precision, device)
        campaign = errors.read(campaign_from_request, loaded, limit or [], confidence, flights, **how)
    also["keys"] = errors.read(tolerance_keys, loaded, tolerance_of or tolerance)
    if split:
        errors.read(check_split, campaign)
    if over:
        axes = errors.collect_each(partial(parse_axis, option="--map"), over)
        also["axes"] = errors.read(check_map_axes, loaded, errors.read(dict, axes))
    errors.read(check_workers, timeout, scheduler, device)
    if resume and out is None:
        errors.note("--resume: name the certificate whose flights are to be continued with --out")
    errors.raise_errors()
    terminal.print_notes(campaign.scenario.notes)
    if scheduler is None and scenario is not None:
        options.compile_before_bar(campaign.flown, precision, device)
    also |= {"scheduler": scheduler, "threads": threads, "timeout": timeout}
    with run_progress(as_json) as watch:
        result = fly_campaign(campaign, folder, seconds, watch, resume=resume, **also)
    _end(result, out, plot, as_json)


def _end(result: Any, out: Path | None, plot: Path | None, as_json: bool) -> None:
    """Write, print, and exit with status 1 where something is not shown."""
    if out is not None:
        result.save(out)
        terminal.print_message(f"saved {out}")
    if plot is not None:
        from airflock.view import plot_certificate, save_figure

        save_figure(plot_certificate(result), plot)
        terminal.print_message(f"saved {plot}")
    if as_json:
        terminal.print_json({**result.document(), "seconds": result.seconds})
    else:
        print_certificate(result)
    if not result.shown:
        raise typer.Exit(1)


def _check(path: str, threads: int | None, trust: bool, as_json: bool) -> None:
    """Check a certificate; exit with status 1 where it does not hold."""
    from airflock.certificates import check_certificate

    with counting_parts(f"{path}: flights again", quiet=as_json) as done:
        result = check_certificate(path, threads=threads, trust=trust, on_done=done)
    if as_json:
        terminal.print_json({"same": result.same, **vars(result)})
    else:
        terminal.print_notes(result.notes)
        for fault in result.faults:
            terminal.print_message(f"airflock: {path}: {fault}")
        said = "same bits, bounds computed again" if result.same else "does not hold"
        typer.echo(f"{path}: {result.flown} of {result.total:,} flights flown again: {said}")
    if not result.same:
        raise typer.Exit(1)
