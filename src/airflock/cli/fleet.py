"""Verb fleet: a scenario flown by nodes and vehicles that speak MAVLink, beside the simulator if wanted."""

import gc
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli import options, tables
from airflock.cli.progress import counting_parts
from airflock.support import RECORDINGS, suggest, value_or_default

ALL_SYSTEM_IDS = tuple(range(1, 251))  # ids that drones may have


def fleet(
    ctx: typer.Context,
    scenario: options.Where,
    seeds: options.Seeds = 1,
    first_seed: options.FirstSeed = 0,
    changes: options.Set = None,
    trust: options.Trust = False,
    agents: options.Agents = None,
    duration: options.Duration = None,
    vehicle: Annotated[str, typer.Option(help="Autopilot that the vehicles imitate: px4 or ardupilot.")] = "px4",
    body: Annotated[
        str | None,
        typer.Option(metavar="multirotor|quadrotor", help="How the vehicles move.", show_default="the scenario's"),
    ] = None,
    mode: Annotated[
        str,
        typer.Option(
            help="lockstep: on a virtual clock, the same bits each time. tasks, processes: on the real clock over UDP "
            "on this computer, in one process or with a process for each node and each vehicle."
        ),
    ] = "lockstep",
    join: Annotated[
        int,
        typer.Option(
            min=1024,
            max=65000,
            help="On the real clock: port where the first vehicle contacts MAVSDK, MAVProxy or QGroundControl; "
            "the others use the next ones.",
        ),
    ] = 14540,
    faults: Annotated[
        Path | None, typer.Option(metavar="FILE.toml", help=r"Faults to inject: tables \[\[fault]].")
    ] = None,
    against: Annotated[
        str | None, typer.Option(metavar="simulator", help="Fly the simulator beside it, and compare.")
    ] = None,
    silence: Annotated[
        bool | None,
        typer.Option(
            "--silence/--no-silence",
            show_default=False,
            help="Stop while a neighbour that is lost could be near; by default yes, but beside the simulator as its "
            "silence.rule says.",
        ),
    ] = None,
    ground: Annotated[
        bool, typer.Option("--ground", help="Take off, gather, flock, return and land, instead of starting in the air.")
    ] = False,
    card_file: Annotated[
        Path | None,
        typer.Option(
            "--card",
            metavar="FILE.json",
            help="On the real clock: write the flight card and its key here; airflock watch FILE.json shows the fleet.",
        ),
    ] = None,
    save: options.SaveFile = None,
    as_json: options.Json = False,
) -> None:
    """Fly a fleet in software: one node and one MAVLink vehicle per drone, in lock-step or on the real clock.

    Example: airflock fleet vasarhelyi_2018/real_4ms --agents 10 --duration 60 --seeds 5 --against simulator

    Example: airflock fleet vasarhelyi_2018/real_4ms --agents 5 --duration 60 --mode processes --vehicle ardupilot

    Example: airflock fleet vasarhelyi_2018/real_4ms --agents 5 --duration 300 --mode processes --card fleet.json,
    and beside it airflock watch fleet.json
    """
    from airflock.fleets import SECONDS_BEFORE_START, compare, flying

    asked, live = options.collect_option_errors(ctx), mode != flying.LOCKSTEP_MODE
    asked.read(options.check_writable, (save, RECORDINGS), (card_file, (".json",)))
    settings = options.collect_settings(asked, changes, agents, duration)
    if body in flying.VEHICLE_BODIES:
        settings = asked.read(lambda given: given | {"body.kind": body}, settings)
    loaded = options.collect_scenario(asked, scenario, settings, trust=trust)
    loaded = asked.read(
        lambda found: compare.with_metric_period(found, found.sensors.period or found.flight.dt), loaded
    )
    numbers = asked.read(options.seeds_from, first_seed, seeds)
    members = asked.read(lambda found: tuple(range(1, found.agents + 1)), loaded)
    broken = asked.read(_broken, faults, value_or_default(members, ALL_SYSTEM_IDS), live)
    asked.note(*_option_errors(vehicle, body, mode, card_file, against))
    asked.read(_check_one_card, card_file, loaded, numbers)
    asked.raise_errors()
    tables.print_notes(loaded.notes)
    how: dict[str, Any] = {"vehicle": vehicle, "mode": mode, "ground": ground, "join": join, "card_file": card_file}
    how["silent"] = True if silence is None and not against else silence
    series = flying.FleetRuns(loaded, vehicle)
    ticks = seeds * int(loaded.flight.duration + (SECONDS_BEFORE_START if ground else 0.0))
    with counting_parts(f"{loaded.name}: fleet", ticks, quiet=as_json) as done, _frozen_imports():
        for flown in flying.fly_seeds(loaded, numbers, faults=broken, on_done=done, notify=tables.print_message, **how):
            series.add(flown, with_simulator=against is not None, starts_alike=not ground and not live)
            _save(save, flown.seed, seeds, flown)
    _print_runs(series, as_json)


def _broken(file: Path | None, members: tuple[int, ...], live: bool) -> Sequence[Any]:
    """Faults of a file, if there is one, that such a fleet can suffer."""
    from airflock.fleets import read_injected_faults, realtime

    found = () if file is None else read_injected_faults(file, members)
    options.raise_errors(realtime.lockstep_only_errors(found) if live else [])
    return found


def _check_one_card(file: Path | None, scenario: Any, seeds: Sequence[int]) -> None:
    """Refuse one card for several seeds where each seed has drones of its own."""
    if file is not None and scenario.varied and len(seeds) > 1:
        options.raise_errors([f"--card {file}: with tolerances each seed has its own card; add --seeds 1"])


def _option_errors(vehicle: str, body: str | None, mode: str, card_file: Path | None, against: str | None) -> list[str]:
    """What is wrong with options that do not concern the scenario."""
    from airflock.fleets import FLEET_MODES, VEHICLE_BODIES, VEHICLE_KINDS

    faults = [
        f"{option} {word} is none of {', '.join(known)}{suggest(word, known, lead='; ')}"
        for option, word, known in (
            ("--vehicle", vehicle, VEHICLE_KINDS),
            ("--body", body, VEHICLE_BODIES),
            ("--mode", mode, FLEET_MODES),
        )
        if word is not None and word not in known
    ]
    if card_file is not None and mode == FLEET_MODES[0]:
        faults.append(f"--card {card_file}: in lock-step it flies too fast to watch; add --mode tasks or processes")
    if against not in (None, "simulator"):
        faults.append(f"--against {against}: only simulator is known")
    return faults


@contextmanager
def _frozen_imports() -> Iterator[None]:
    """Let the collector leave alone what is there already; a look at it all takes a tenth of a second, now and then."""
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def _save(save: Path | None, seed: int, seeds: int, flown: Any) -> None:
    if save is None:
        return
    from airflock.fleets import fleet_recording
    from airflock.recordings import save as save_recording

    path = save if seeds == 1 else save.with_name(f"{save.stem}-seed{seed}{save.suffix}")
    tables.print_message(f"saved {save_recording(fleet_recording(flown), path)}")


def _print_runs(series: Any, as_json: bool) -> None:
    """Print what was flown."""
    from airflock.parts.metrics import reported_values

    scenario, lines, seeds = series.scenario, series.comparison, len(series.runs)
    if as_json:
        about = {"name": scenario.name, "agents": scenario.agents, "vehicle": series.vehicle, "seeds": seeds}
        content = {"fleet": about, "runs": series.runs, "comparison": [line._asdict() for line in lines]}
        tables.print_json(content | ({"departure": series.divergence._asdict()} if series.divergence else {}))
        return
    flown = f"{scenario.flight.duration:g} s, {seeds} seed{'s' if seeds > 1 else ''}"
    title = f"{scenario.name}: fleet of {scenario.agents} {series.vehicle}, {flown}"
    tables.print_score_table(title, series.measured, {}, reported_values(scenario.measures))
    for run in series.runs:
        _print_load(run.get("load"))
    for time, member, note in series.runs[0]["notes"][:40]:
        tables.print_message(f"{time:8.2f} s  drone {member:3d}  {note}")
    if series.divergence:
        tables.print_message(
            "largest distance to the simulated flight, m; and of the simulation itself after a nudge of 1 cm"
        )
        if scenario.has_sensor_error and scenario.sensor.error is not None:
            tables.print_message(
                "(a drone sends the position that it flies by; a simulated one has two errors: they part)"
            )
        for t, ours, theirs in zip(*series.divergence, strict=True):
            tables.print_message(f"  after {t:g} s: {ours:.4f}   {theirs:.4f}")
    for line in lines:
        tables.print_message(
            f"  {line.name:16s} simulator {line.simulator:10.4f}  fleet {line.fleet:10.4f}  z {line.z:+.2f}  "
            f"p (Holm) {line.p:.2f}"
        )
    if series.simulated and not lines:
        tables.print_message("note: a table of differences needs two or more seeds: --seeds 2")


def _print_load(load: dict[str, Any] | None) -> None:
    """Tell what a fleet on the real clock cost, and how late it was."""
    if load is None:
        return
    parts = ""
    if load["nodes"] is not None:
        parts = f" (nodes {load['nodes']:.2f}, vehicles and ether {load['vehicles']:.2f})"
    tables.print_message(f"processor: {load['cores']:.2f} of a core{parts}; load of this computer {load['others']:.1f}")
    share = load["late"] / max(load["ticks"], 1)
    tables.print_message(
        f"ticks of the nodes: {load['ticks']}, {load['late']} ({share:.1%}) late by more than half a period, at most "
        f"by {load['worst']:.2f} s"
    )
