"""A fleet in software over several seeds: the loop behind `airflock fleet` and `airflock.fleet`."""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd
import xarray as xr

from airflock.drones import FlightCard
from airflock.fleets import compare
from airflock.fleets.drone_faults import InjectedFault, read_injected_faults
from airflock.fleets.fleet_observer import DEFAULT_WATCH_ADDRESS
from airflock.fleets.lockstep import write_card_and_key
from airflock.fleets.realtime import DEFAULT_CLIENT, FLEET_MODES, fly_in_realtime, lockstep_only_errors
from airflock.parts.metrics import reported_values
from airflock.recordings import measure_recording, with_units
from airflock.scenarios import Scenario, check_seeds, load, presets, scenario_variant
from airflock.support import ScenarioError, collect_errors, expand_path, log, suggest

VEHICLE_KINDS = ("px4", "ardupilot")
VEHICLE_BODIES = ("multirotor", "quadrotor", "autopilot")
LOCKSTEP_MODE = "lockstep"
FIRST_CLIENT_PORT = 14540  # port where the first vehicle contacts a client


def vehicle_body(
    scenario: str | os.PathLike[str] | Scenario, settings: Mapping[str, Any], vehicle: str, body: str | None
) -> dict[str, Any]:
    """Return the settings with the body that the vehicles have: a given one, or of ArduPilot the measured one.

    A preset's own body is that of a paper; a file of one's own, and settings of the body, are
    meant.
    """
    if body in VEHICLE_BODIES:
        return {**settings, "body.kind": body}
    meant = str(scenario) not in presets() or any(key == "body" or key.startswith("body.") for key in settings)
    if vehicle != "ardupilot" or meant or load(str(scenario)).body.rule.name != "multirotor":
        return dict(settings)
    return {**settings, "body.kind": "autopilot"}


@dataclass
class FleetRuns:
    """Flights of a fleet, seed after seed.

    scenario   : the scenario that was flown
    vehicle    : the autopilot that the vehicles imitated
    measured   : order parameters of each flight
    simulated  : those of the simulator beside it, if requested
    runs       : report of each flight: seed, digest, phases, notes, order parameters; on the real
                 clock its load
    recordings : of each flight (time, space, keypoint, individual), position m and velocity m/s,
                 where they are kept
    divergence : distance (m) between the first flight and the simulated one over time, where both
                 have the same start
    """

    scenario: Scenario
    vehicle: str
    measured: list[dict[str, Any]] = field(default_factory=list)
    simulated: list[dict[str, Any]] = field(default_factory=list)
    runs: list[dict[str, Any]] = field(default_factory=list)
    recordings: list[xr.Dataset] = field(default_factory=list)
    divergence: compare.Divergence | None = None

    @property
    def table(self) -> pd.DataFrame:
        """Return order parameters, one row per flight by its seed, with units and meanings in `attrs`."""
        index = pd.Index([run["seed"] for run in self.runs], name="seed")
        return with_units(pd.DataFrame(self.measured, index=index), dict(reported_values(self.scenario.metrics.rule)))

    @property
    def comparison(self) -> list[compare.MetricComparison]:
        """Return means of both, z and p after Holm's correction of each order parameter; empty for one seed."""
        return compare.compare_scores(self.simulated, self.measured) if len(self.simulated) > 1 else []

    def add(self, flown: Any, *, with_simulator: bool, starts_alike: bool) -> None:
        """Measure a flight, and fly the simulator beside it if requested.

        starts_alike : both start from equal states, on one clock
        """
        if with_simulator:
            simulated, measured = compare.simulated_and_flown_scores(flown.scenario, flown)
            self.simulated.append(simulated)
            if starts_alike and self.divergence is None:
                self.divergence = compare.divergence(flown)
        else:
            measured = measure_recording(compare.fleet_recording(flown))[0]
        self.measured.append(measured)
        phases = [phase.name for phase in flown.phases()]
        run = {"seed": flown.seed, "sha256": flown.digest(), "phases": phases, "notes": flown.log, **measured}
        load = getattr(flown, "load", None)
        self.runs.append(run if load is None else run | {"load": load._asdict()})


def fleet(
    scenario: Scenario | str | os.PathLike[str],
    seeds: int | Iterable[int] = 1,
    *,
    settings: Mapping[str, Any] | None = None,
    trust: bool = False,
    vehicle: str = "px4",
    body: str | None = None,
    mode: str = LOCKSTEP_MODE,
    join: int = FIRST_CLIENT_PORT,
    faults: str | os.PathLike[str] | None = None,
    beside: bool = False,
    silence: bool | None = None,
    ground: bool = False,
    card: str | os.PathLike[str] | None = None,
    done: Callable[[], None] | None = None,
    say: Callable[[str], None] | None = log,
) -> FleetRuns:
    """Fly a fleet in software: one node and one MAVLink vehicle per drone, in lock-step or on the real clock.

    Parameters
    ----------
    scenario : Scenario, str or path
        A scenario, or the name of a preset or scenario file.
    seeds : int or iterable of int
        A number of flights, with seeds 0, 1, 2, ..., or the seeds themselves.
    settings : mapping, optional
        Keys of the scenario to change, such as {"agents": 5, "duration": 60.0}.
    trust : bool
        Whether code that the file names may run.
    vehicle : {"px4", "ardupilot"}
        Autopilot that the vehicles imitate: px4 or ardupilot.
    body : {"multirotor", "quadrotor", "autopilot"}, optional
        How the vehicles move: multirotor, quadrotor or autopilot; by default as the scenario says, but imitations of
        ArduPilot that fly a preset move as ArduCopter at its defaults was measured to (autopilot).
    mode : {"lockstep", "tasks", "processes"}
        lockstep: on a virtual clock, the same bits each time. tasks, processes: on the real clock over UDP on this
        computer, in one process or with a process for each node and each vehicle.
    join : int in [1024, 65000]
        On the real clock: port where the first vehicle contacts MAVSDK, MAVProxy or QGroundControl; the others use
        the next ones.
    faults : str or path (FILE.toml), optional
        A TOML file of faults to inject, tables [[fault]].
    beside : bool
        Fly the simulator beside it, and compare.
    silence : bool, optional
        Stop while a neighbour that is lost could be near; by default yes, but beside the simulator
        as its silence.rule says.
    ground : bool
        Take off, gather, flock, return and land, instead of starting in the air.
    card : str or path (FILE.json), optional
        On the real clock: file (.json) for the flight card, its key beside it; `airflock.watch` of it shows the fleet.
    done : callable, optional
        Called after each second that is flown.
    say : callable, optional
        Called with a line when the card is written, before the first flight; by default the logger `airflock`.

    Returns
    -------
    FleetRuns
        `table`, one row per flight; `runs`, a report of each; `recordings` (time, space, keypoint, individual);
        beside the simulator `comparison` and `divergence`.

    Raises
    ------
    ScenarioError, ParameterError, CardError, LinkError
        If scenario, seeds or faults cannot be flown by a fleet, a card would be lost, or a port is in use.

    Examples
    --------
    >>> import airflock
    >>> small = {"agents": 3, "duration": 2.0}
    >>> found = airflock.fleet("vasarhelyi_2018/real_4ms", seeds=2, settings=small)
    >>> found.table.index.tolist(), dict(found.recordings[0].position.sizes)["individual"]
    ([0, 1], 3)
    """
    numbers = check_seeds(seeds)
    mistakes = [
        f"{name} = {word!r} is none of {', '.join(known)}{suggest(word, known, lead='; ')}"
        for name, word, known in (
            ("vehicle", vehicle, VEHICLE_KINDS),
            ("body", body, VEHICLE_BODIES),
            ("mode", mode, FLEET_MODES),
        )
        if word is not None and word not in known
    ]
    if card is not None and mode == LOCKSTEP_MODE:
        mistakes.append("card: in lock-step it flies too fast to watch; give mode = 'tasks' or 'processes'")
    known: Scenario | None = None
    injected: tuple[InjectedFault, ...] = ()
    with collect_errors(mistakes):
        keys = vehicle_body(scenario, settings or {}, vehicle, body)
        found = scenario_variant(scenario, keys, trust=trust)
        known = compare.with_metric_period(found, found.sensors.period or found.flight.dt)
        if faults is not None:
            injected = read_injected_faults(expand_path(faults), tuple(range(1, known.agents + 1)))
        mistakes += lockstep_only_errors(injected) if mode != LOCKSTEP_MODE else []
    if card is not None and known is not None and known.varied and len(numbers) > 1:
        mistakes.append(f"card = {card}: with tolerances each seed has its own card; give one seed")
    if mistakes or known is None:
        raise ScenarioError(mistakes)
    stops = True if silence is None and not beside else silence
    flights = FleetRuns(known, vehicle)
    how: dict[str, Any] = {
        "vehicle": vehicle,
        "mode": mode,
        "join": join,
        "stop_for_lost": stops,
        "from_ground": ground,
    }
    if card is not None:
        how["card_file"] = expand_path(card)
    for flown in fly_seeds(known, numbers, faults=injected, on_done=done, notify=say, **how):
        flights.add(flown, with_simulator=beside, starts_alike=not ground and mode == LOCKSTEP_MODE)
        flights.recordings.append(compare.fleet_recording(flown))
    return flights


def fly_seeds(
    scenario: Scenario,
    seeds: Sequence[int],
    *,
    vehicle: str,
    mode: str,
    stop_for_lost: bool | None,
    from_ground: bool,
    join: int,
    faults: Sequence[InjectedFault] = (),
    card_file: Path | None = None,
    on_done: Callable[[], None] | None = None,
    notify: Callable[[str], None] | None = None,
) -> Iterator[Any]:
    """Fly a scenario that fleets can fly, one seed after another, and yield each flight.

    stop_for_lost : whether the rule of silence stops a drone; None: where the scenario says so
    from_ground   : from the ground by orders of an operator, whose keys are made here
    card_file     : file for the card, written before the first flight for `airflock watch`
    notify        : function that takes a line when the card is written
    """
    private, public = b"", b""
    if from_ground:
        from airflock.drones import new_operator_keys

        private, public = new_operator_keys()
    live = mode != LOCKSTEP_MODE

    def card_of(seed: int) -> FlightCard:
        return compare.software_card(
            scenario, vehicle=vehicle, operator=public, stop_for_lost=stop_for_lost, realtime=live, seed=seed
        )

    card = card_of(seeds[0])
    if card_file is not None:
        write_card_and_key(card_file, card)
        if notify is not None:
            notify(f"wrote {card_file} and its key; airflock watch {card_file} shows the fleet")
    for seed in seeds:
        # Tolerances of manufacture differ by seed, and the card holds them.
        card = card_of(seed) if scenario.varied else card
        common: dict[str, Any] = {"faults": faults, "operator": private, "on_done": on_done}
        if live:
            start = None if from_ground else compare.simulated_start(scenario, seed)
            calls, watcher = (DEFAULT_CLIENT[0], join), DEFAULT_WATCH_ADDRESS if card_file else None
            yield fly_in_realtime(
                scenario, card, seed, mode, start=start, first_client=calls, watcher=watcher, **common
            )
        else:
            yield compare.fly_in_lockstep(scenario, card, seed, from_ground=from_ground, **common)
