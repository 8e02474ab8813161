"""Verb fleet: a scenario flown by nodes and vehicles that speak MAVLink, beside the simulator if wanted."""

from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli import options, tables
from airflock.endings import RECORDINGS
from airflock.errors import ScenarioError

VEHICLES = ("px4", "ardupilot")


def fleet(
    scenario: options.Where,
    seeds: options.Seeds = 1,
    first_seed: options.FirstSeed = 0,
    changes: options.Set = None,
    agents: options.Agents = None,
    duration: options.Duration = None,
    vehicle: Annotated[str, typer.Option(help="Autopilot that the vehicles imitate: px4 or ardupilot.")] = "px4",
    faults: Annotated[
        Path | None, typer.Option(metavar="FILE.toml", help=r"What goes wrong: tables \[\[fault]].")
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
    save: options.SaveFile = None,
    as_json: options.Json = False,
) -> None:
    """Fly a fleet in software: one node and one MAVLink vehicle per drone, in lock-step on a virtual clock.

    Example: airflock fleet vasarhelyi_2018/real_4ms --agents 10 --duration 60 --seeds 5 --against simulator
    """
    from airflock.fleet import compare, individuals
    from airflock.fleet.faults import read_faults
    from airflock.recordings.scores import measure
    from airflock.scenarios.files import load

    wrong: list[str] = []
    with options.gathering(wrong):
        options.writable((save, RECORDINGS))
    with options.gathering(wrong):
        found = load(scenario, options.settings(changes, agents, duration))
        period = found.sensors.period or found.flight.dt
        found = compare.sampled(found, period)
    if vehicle not in VEHICLES:
        wrong.append(f"--vehicle {vehicle} is none of {', '.join(VEHICLES)}")
    if against not in (None, "simulator"):
        wrong.append(f"--against {against}: only simulator can be compared with")
    options.refuse(wrong)
    operator = _operator(ground)
    options.refuse(individuals.refused(found))
    stops = True if silence is None and not against else silence
    given: dict[str, Any] = {"vehicle": vehicle, "operator": operator[1], "silent": stops}
    card = compare.software_card(found, **given, seed=first_seed)
    broken = read_faults(faults, card.members) if faults else ()
    rows: list[dict[str, Any]] = []
    beside: list[dict[str, Any]] = []
    runs, departed = [], None
    ticks = seeds * (int(found.flight.duration) + (12 if ground else 0))
    with options.progress(f"{found.name}: fleet", ticks, quiet=as_json) as done:
        for seed in range(first_seed, first_seed + seeds):
            card = compare.software_card(found, **given, seed=seed) if found.varied else card
            flown = compare.fly(found, card, seed, faults=broken, ground=ground, operator=operator[0], done=done)
            if against:
                simulated, measured = compare.both(found, flown)
                beside.append(simulated)
                departed = departed or (compare.departure(flown) if not ground else None)
            else:
                measured = measure(compare.recording(flown))[0]
            rows.append(measured)
            phases = [phase.name for phase in flown.phases()]
            runs.append({"seed": seed, "sha256": flown.digest(), "phases": phases, "notes": flown.log, **measured})
            _save(save, seed, seeds, flown)
    _tell(found, card, seeds, rows, beside, runs, departed, as_json)


def _operator(ground: bool) -> tuple[bytes, bytes]:
    """Keys of an operator where one is needed."""
    if not ground:
        return b"", b""
    from airflock.mavlink.orders import new_keys

    return new_keys()


def _save(save: Path | None, seed: int, seeds: int, flown: Any) -> None:
    if save is None:
        return
    from airflock.fleet.compare import recording
    from airflock.recordings.files import save as save_recording

    path = save if seeds == 1 else save.with_name(f"{save.stem}-seed{seed}{save.suffix}")
    tables.say(f"saved {save_recording(recording(flown), path)}")


def _tell(found: Any, card: Any, seeds: int, rows: Any, beside: Any, runs: Any, departed: Any, as_json: bool) -> None:
    """Print what was flown."""
    from airflock.fleet.compare import table
    from airflock.metrics.registry import reports

    lines = table(beside, rows) if len(beside) > 1 else []
    if as_json:
        about = {"name": found.name, "agents": found.agents, "vehicle": card.autopilot.name, "seeds": seeds}
        told: dict[str, Any] = {"fleet": about, "runs": runs, "comparison": [line._asdict() for line in lines]}
        tables.emit_json(told | ({"departure": departed._asdict()} if departed else {}))
        return
    title = f"{found.name}: fleet of {found.agents} {card.autopilot.name}, {found.flight.duration:g} s, {seeds} seeds"
    tables.score_table(title, rows, {}, reports(found.measures))
    for run in runs[:1]:
        for time, member, note in run["notes"][:40]:
            tables.say(f"{time:8.2f} s  drone {member:3d}  {note}")
    if departed:
        tables.say("largest distance to the simulated flight, m; and of the simulation itself after a nudge of 1 cm")
        if found.errs and found.sensor.error is not None:
            tables.say("(a drone sends the position that it flies by; a simulated one has two errors: they part)")
        for t, ours, theirs in zip(*departed, strict=True):
            tables.say(f"  after {t:g} s: {ours:.4f}   {theirs:.4f}")
    for line in lines:
        tables.say(
            f"  {line.name:16s} simulator {line.simulator:10.4f}  fleet {line.fleet:10.4f}  z {line.z:+.2f}  "
            f"p (Holm) {line.p:.2f}"
        )
    if beside and not lines:
        raise ScenarioError(["--against simulator compares over seeds; give --seeds 2 or more for the table"])
