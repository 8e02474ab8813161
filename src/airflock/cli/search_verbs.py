"""Verbs evolve, harden, tune, certify and why: search for parameters, make them safer, bound and explain risks."""

import math
import time
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import typer

from airflock import certificates, runs, scenarios, search, view
from airflock.cli import options, terminal
from airflock.cli.command import verb
from airflock.cli.terminal import counting_parts, progress_line, run_progress
from airflock.support import (
    INVALID,
    PICTURES,
    SCENARIOS,
    ErrorCollector,
    ScenarioError,
    invalid_if,
    result_group,
    result_table,
    value_or_default,
)

PANEL = "Search and make safe"


SHARED = "settings trust agents duration threads scheduler limit json"


@verb(PANEL, "airflock.evolve", f"{SHARED} quiet", without="over_scenarios")
def evolve(o: SimpleNamespace, errors: ErrorCollector) -> None:
    """Evolve a flock's parameters; the folder then holds the optimum, all evaluations, tables and pictures.

    Candidates must keep what --limit allows before fitness counts; --seeds is then 2 by default. --fast takes a third
    of the flights: 24 candidates, each with one flight at first and nine at the end. Exit status 1 if no candidate
    flies; then there is no best.toml.

    Example: airflock evolve vasarhelyi_2018/6ms --out study --generations 20
    """
    chosen = {name: getattr(o, name) for name in options.SEARCH_KEYS.split()}
    place = errors.read(runs.run_place, o.out)
    request = errors.read(
        search.evolve_request,
        o.scenario,
        value_or_default(options.collect_settings(errors, o), {}),
        search_keys={key: value for key, value in chosen.items() if value is not None and value is not INVALID},
        limit=o.limit or (),
        trust=o.trust,
        fast=o.fast,
        folder=place if o.resume else None,
    )
    errors.read(search.check_sensitivity_method, o.sensitivity)
    errors.read(runs.check_timeout, o.timeout)
    errors.read(search.check_study_device, o.device, o.scheduler)
    errors.raise_errors()
    study, taken = request
    study = search.resolve_device(study, o.device)
    mended = runs.open_folder(place, study, resume=o.resume)
    notes = [*(note for each in study.scenarios for note in each.notes), *study.notes, taken, mended]
    terminal.print_notes([note for note in notes if note])
    begin = time.perf_counter()
    executor = search.study_executor(study, o.scheduler, o.threads, o.timeout)
    with run_progress(o.quiet or o.json) as watch:
        say = None if o.quiet else terminal.print_message
        result = search.run_study(study, place, executor, watch, sensitivity=o.sensitivity, say=say)
    if o.json or not o.quiet:
        terminal.print_result(result, o.json, folder=str(o.out), seconds=time.perf_counter() - begin)
    if result.dead_reason:
        terminal.print_message(f"airflock: {result.scenario.name}: {result.dead_reason}")
        raise typer.Exit(1)


NUMBER_WIDTH = 6  # columns that a number takes: a narrow terminal must not cut it off


@verb(PANEL, "airflock.harden", "first_seed settings trust duration threads limit out json")
def harden(o: SimpleNamespace, errors: ErrorCollector) -> None:
    """Make an optimum safer: try the steps of Table S4, and keep those that help, cost little and break nothing.

    A step towards a limit that is not kept yet may cost more. With a study of several scenarios, a step must keep what
    held in each; further files end in _2 and so on. Exit status 1 if no step was kept.

    Example: airflock harden study --out flyable.toml
    """
    settings = errors.read(options.parse_settings, o.settings, None, o.duration)
    optima = invalid_if(settings, errors.read(_optima, o.scenario, value_or_default(settings, {}), o.trust))
    places = errors.read(_output_files, o.out, len(value_or_default(optima, [])), o.scenario)
    limits = o.limit or ()
    errors.read(search.hardening_request, optima, value_or_default(o.cost, 0.0), limits)
    numbers = errors.read(options.seeds_from, o.first_seed, o.seeds)
    errors.raise_errors()
    terminal.print_notes(note for each in optima for note in each.notes)
    with counting_parts(f"{o.scenario}: flights", search.MAX_ROUNDS * o.seeds * len(optima), quiet=o.json) as done:
        steps = search.harden(optima, numbers, cost=o.cost, limit=limits, threads=o.threads, done=done, folder=o.folder)
    for each, place in zip(optima, places, strict=True):
        runs.write_toml_file(place, search.hardened_document(each, steps[-1]), "Hardened; see airflock harden --help.")
    if o.json:
        rows = [step.as_dict() for step in steps]
        terminal.print_json({"scenario": optima[0].name, "seeds": o.seeds, "out": str(o.out), "steps": rows})
    else:
        _print_hardened(optima[0].name, steps, o.seeds)
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
    folder = Path(source)
    if folder.is_dir() and not (folder / search.BEST_FILE).is_file():
        raise ScenarioError([f"{source}: holds no {search.BEST_FILE}: its search is not over, or nothing flies in it"])
    files = [folder / search.BEST_FILE, *search.further_best_files(folder)] if folder.is_dir() else [source]
    return [scenarios.load(path, settings, trust=trust) for path in files]


def _print_hardened(name: str, steps: list[Any], seeds: int) -> None:
    """Print a table of the scores of each step, and below it a line for each: costs, gains, and verdict."""
    rows = [
        (
            step.name, f"{step.fitness:.4f}", f"{step.r_min:.3g}", f"{step.n_coll:.3g}",
            f"{step.parts['f_wall']:.3g}" if "f_wall" in step.parts else "",
            f"{100.0 * step.contacts:.0f} %" if step.contacts == step.contacts else "",
            f"{step.clearance:.3g}" if step.clearance == step.clearance else "",
        )
        for step in steps
    ]  # fmt: skip
    heads = "step; >fitness; >r_min, m; >n_coll; >f_wall; >contacts; >clearance, m"
    lines = []
    for step in steps[1:]:
        (cost, least, most), (gain, low, high) = step.cost, step.gain
        costs = f"cost {cost:.3g} ({least:.3g} to {most:.3g}), gain {gain:.3g} m ({low:.3g} to {high:.3g}), 95 %"
        lines.append(f"{step.name}: {step.verdict}; {costs}")
    table = result_table(f"{name}: {seeds} paired flights a step", heads, rows, min_width=NUMBER_WIDTH)
    terminal.print_result(result_group(table, *lines))


@verb(PANEL, "airflock.tune", "settings trust agents duration threads limit json")
def tune(o: SimpleNamespace, errors: ErrorCollector) -> None:
    """Start, evolve, harden, certify, report: tuned.toml to fly, certificate.toml, and report.html to sign.

    Numbers of the law that the file leaves out are scaled to its speed. Without --limit, collisions and contacts with
    walls are to be rarer than 0.01 per hour each. Exit status 1 if a limit is not shown.

    From logs, the numbers of the drones are identified first. For more options, run airflock identify and tune the
    file that it writes.

    Example: airflock tune mine.toml --budget 20min --out tuned
    """
    folder = errors.read(runs.run_place, o.out)
    seconds = errors.read(options.parse_seconds, o.budget)
    settings = options.collect_settings(errors, o)
    if o.confidence is not None:
        errors.read(certificates.check_confidence, o.confidence)
    limits, base = o.limit or (), None
    if o.scenario or not o.resume:
        place = errors.read(_start_scenario, o.scenario or [], o.like, o.heard)
        base = options.collect_scenario(errors, place, settings, trust=o.trust)
        # With logs the start is not known yet, but takes the same limits; the plan depends on their contents.
        start = base if o.like is not None else errors.read(lambda found: search.prepare_start(found)[0], base)
        plan = errors.read(search.load_plan, folder, start, o.resume) if o.like is None else None
        errors.read(search.make_request, start, limits, o.confidence, value_or_default(plan, None))
        errors.raise_errors()
        terminal.print_notes(start.notes)
        options.compile_before_bar(base, 32, "cpu")
    errors.raise_errors()
    what: Any = base if o.like is None else o.scenario
    how = {name: getattr(o, name) for name in ("confidence", "warm", "resume", "threads", "trust")}
    if o.like is not None:
        how |= {"like": base or o.like, "heard": o.heard}
    shown: list[str] = []
    with progress_line(o.json) as line:

        def watch(p: Any) -> None:
            line.update(terminal.progress_text(p), p.done, p.total)

        def note(text: str) -> None:
            shown.append(text)
            line.say(text)

        tuning = search.tune(what, folder, budget=seconds, limit=limits, watch=watch, note=note, **how)
    _print_tuned(tuning, shown, o.json)


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


def _print_tuned(tuning: Any, shown: list[str], as_json: bool = False) -> None:
    """Print the notes that were not printed during the search, and the result."""
    for note in () if as_json else tuning.notes:
        if note not in shown:
            typer.echo(f"start: {note}")
    terminal.print_result(tuning, as_json)


@verb(PANEL, "airflock.league", "threads quiet json")
def league(o: SimpleNamespace) -> Any:
    """Compare laws on robots in worlds: each is tuned by the same flights and judged on the same held-out seeds.

    The folder then holds result.toml, which anybody can compute again or add laws to, and league.html with table,
    picture and replays.

    Example: airflock league league.toml --out table --law mine.py
    """
    how = {name: getattr(o, name) for name in ("resume", "scheduler", "threads", "trust")}
    with run_progress(o.quiet or o.json) as watch:
        result = search.league(o.source, o.out, law=o.law or (), watch=watch, **how)
    return None if o.quiet and not o.json else result


@verb(PANEL, "airflock.certify", f"{SHARED} law precision out plot", without="folder")
def certify(o: SimpleNamespace, errors: ErrorCollector) -> None:
    """Show that an event is rare: exact bounds, seeds fixed in advance, every interim look accounted for.

    The flights of a certificate (--out) are kept beside it in FILE_flights. A --limit without a rate is bounded.
    --plot draws bounds, distances and tolerances. Exit status 0: every limit is shown to hold (or the check passes);
    1: not; 2: bad input.

    Example: airflock certify vasarhelyi_2018/real_6ms --limit "r_min<1 at 0.1/h" --budget 10min --out certificate.toml
    """
    if o.check:
        errors.raise_errors()
        names = "limit flights out resume tolerance tolerance_of split over uncertain plot scheduler settings law"
        others = {name: name for name in f"{names} agents duration".split()} | {"over": "map", "settings": "set"}
        left_out = ", ".join(f"--{text.replace('_', '-')}" for name, text in others.items() if getattr(o, name))
        options.raise_errors(
            [f"--check: flies again what the certificate holds; leave out {left_out}"] if left_out else []
        )
        return _check(o.scenario or "", o.threads, o.trust, o.json)
    from airflock.cli.flight_verbs import parse_axis

    errors.read(options.check_writable, (o.out, SCENARIOS), (o.plot, PICTURES), reads=[o.scenario or ""])
    seconds = None if o.budget is None else errors.read(options.parse_seconds, o.budget)
    folder = None if o.out is None else o.out.parent / f"{o.out.stem}_flights"
    settings = options.collect_settings(errors, o)
    how: dict[str, Any] = {"uncertain": o.uncertain, "precision": o.precision, "device": o.device}
    also: dict[str, Any] = {"split": o.split, "axes": {}}
    if o.scenario is None and o.resume and folder is not None:
        errors.raise_errors()
        campaign, held = certificates.resumed_campaign(
            folder, trust=o.trust, limit=o.limit, flights=o.flights, settings=settings, law=o.law,
            uncertain=o.uncertain,
        )  # fmt: skip
        loaded = campaign.scenario
        also = {"split": o.split or held["split"], "axes": held["map"]}
        o.tolerance_of = o.tolerance_of or held["tolerance"]
    else:
        loaded = options.collect_scenario(errors, o.scenario or "", settings, o.law, trust=o.trust)
        errors.read(certificates.check_confidence, o.confidence)
        errors.read(certificates.check_flight_count, o.flights)
        errors.read(certificates.check_flight_options, o.precision, o.device)
        campaign = errors.read(
            certificates.campaign_from_request, loaded, o.limit or [], o.confidence, o.flights, **how
        )
    also["keys"] = errors.read(certificates.tolerance_keys, loaded, o.tolerance_of or o.tolerance)
    if also["split"]:
        errors.read(certificates.check_split, campaign)
    if o.over:
        axes = errors.collect_each(partial(parse_axis, option="--map"), o.over)
        also["axes"] = errors.read(certificates.check_map_axes, loaded, errors.read(dict, axes))
    errors.read(certificates.check_workers, o.timeout, o.scheduler, o.device)
    if o.resume and o.out is None:
        errors.add("--resume: name the certificate whose flights are to be continued with --out")
    errors.raise_errors()
    terminal.print_notes(campaign.scenario.notes)
    if o.scheduler is None and o.scenario is not None:
        options.compile_before_bar(campaign.flown, o.precision, o.device)
    also |= {name: getattr(o, name) for name in ("scheduler", "threads", "timeout")}
    with run_progress(o.json) as watch:
        result = certificates.fly_campaign(campaign, folder, seconds, watch, resume=o.resume, **also)
    return _end(result, o.out, o.plot, o.json)


@verb(PANEL, "airflock.why", "settings law trust threads quiet plot json")
def why(o: SimpleNamespace, errors: ErrorCollector) -> None:
    """Say why two agents met in a flight: futures branch off before it, each without one thing.

    --plot draws the probability of the event over the time before it, one line for each thing taken away; of a
    certificate in how many of its flights each is named.

    Example: airflock why vasarhelyi_2018/real_4ms --seed 1001 --plot why.png
    """
    errors.read(options.check_writable, (o.plot, PICTURES), reads=[o.scenario])
    settings = errors.read(options.parse_settings, o.settings)
    seconds = None if o.budget is None else errors.read(options.parse_seconds, o.budget)
    leads = o.leads and errors.collect_each(partial(options.parse_seconds, option="--leads"), o.leads.split(","))
    errors.raise_errors()
    how = {name: getattr(o, name) for name in ("event", "limit", "futures", "threads", "law", "trust")}
    with progress_line(o.quiet or o.json) as line:
        found = certificates.why(
            o.scenario, o.seed, leads=leads, budget=seconds, settings=settings, interventions=o.interventions or None,
            say=lambda text: line.update(text), **how,
        )  # fmt: skip
    if o.plot is not None:
        terminal.save_picture(view.plot_why(found), o.plot)
    terminal.print_result(found, o.json)


@verb(PANEL, "airflock.attack", "settings law trust agents duration threads quiet out json")
def attack(o: SimpleNamespace, errors: ErrorCollector) -> None:
    """Find the smallest disturbance that breaks a flock: who, when, how long, which way and how much.

    --out writes a scenario for each kind that breaks it, which flies the disturbance: for several kinds
    FILE_gnss_offset.toml and so on. Replay it, evolve or harden against it, certify it.

    Example: airflock attack vasarhelyi_2018/real_6ms --kinds gnss_offset,wind --budget 2min --out broken.toml
    """
    names = [kind.partition("=")[0].strip() for kind in o.kinds.split(",")]
    places = {name: o.out.with_stem(f"{o.out.stem}_{name}") if names[1:] else o.out for name in names if o.out}
    errors.read(options.check_writable, *((place, SCENARIOS) for place in places.values()), reads=[o.scenario])
    seconds = errors.read(options.parse_seconds, o.budget)
    settings = options.collect_settings(errors, o)
    scenario = options.collect_scenario(errors, o.scenario, settings, o.law, trust=o.trust)
    errors.raise_errors()
    terminal.print_notes(scenario.notes)
    how = {name: getattr(o, name) for name in ("event", "limit", "probability", "threads")}
    with progress_line(o.quiet or o.json) as line:
        found = certificates.attack(scenario, o.kinds, budget=seconds, say=lambda text: line.update(text), **how)
    terminal.print_result(found, o.json)
    for row in (row for row in found.rows if o.out and math.isfinite(row.dose)):
        seed = "" if row.seed is None else f"; airflock replay {places[row.kind]} --seed {row.seed}"
        terminal.print_message(f"saved {found.save(places[row.kind], row.kind)}{seed}")


def _end(result: Any, out: Path | None, plot: Path | None, as_json: bool) -> None:
    """Write, print, and exit with status 1 where something is not shown."""
    if out is not None:
        result.save(out)
        terminal.print_message(f"saved {out}")
    if plot is not None:
        terminal.save_picture(view.plot_certificate(result), plot)
    terminal.print_result(result, as_json, seconds=result.seconds)


def _check(path: str, threads: int | None, trust: bool, as_json: bool) -> None:
    """Check a certificate; exit with status 1 where it does not hold."""
    with counting_parts(f"{path}: flights again", quiet=as_json) as done:
        result = certificates.check_certificate(path, threads=threads, trust=trust, on_done=done)
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
