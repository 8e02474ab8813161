"""Fleets beside the simulator: equal starts and random numbers, and the difference of their order parameters."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from airflock.core import State
from airflock.drones import FlightCard, card_hash, parse_card
from airflock.fleets.card_document import default_safety, make_card_document
from airflock.fleets.drone_faults import InjectedFault
from airflock.fleets.lockstep import SECONDS_BEFORE_START, LockstepFleet, states_from_arrays
from airflock.fleets.realtime import RealtimeFleet
from airflock.recordings import make_dataset, measure_recording, provenance, simulate
from airflock.scenarios import Scenario, group_names
from airflock.support import holm_correction

SOFTWARE_SITE = (47.5, 19.0, 120.0)  # somewhere; a fleet in software is nowhere
NEVER_EXPIRES = 2**39
NUDGE_DISTANCE = 0.01  # m; what a packet resolves
NUDGE_COUNT = 8


def software_card(
    scenario: Scenario, *, vehicle: str = "px4", operator: bytes = b"", stop_for_lost: bool | None = None,
    margin: float = 40.0, as_simulated: bool = True, seed: int = 0, realtime: bool = False,
) -> FlightCard:  # fmt: skip
    """Make the card of a fleet in software: one tick and one packet per decision, as in the simulation.

    realtime      : on the real clock: ticks and packets as often as on real drones, neighbours
                    carried forward
    stop_for_lost : whether the rule of silence stops a drone; by default where the scenario says so
    seed          : of the tolerances of manufacture that groups have
    """
    period = min(max(scenario.sensors.period or scenario.flight.dt, 0.02), 0.2)
    members = range(1, scenario.agents + 1)
    layer = min(3.0, 100.0 / max(scenario.agents, 1))
    # One tick, one packet and one decision coincide, as for a simulated agent; layers shrink so
    # that a large flock fits.
    limits = {"tick": period, "status_period": period, "layer": max(layer, 0.5), "mission_time": 36000.0}
    if realtime:
        as_simulated = False
        limits = {key: limits[key] for key in ("layer", "mission_time")}
    if scenario.dimensions == 3:
        limits["climb_max"] = min(default_safety(scenario).speed_max, 10.0)  # the law climbs as fast as it flies
    document = make_card_document(
        scenario,
        site=SOFTWARE_SITE,
        members=members,
        mission=1,
        expires=NEVER_EXPIRES,
        operator=operator,
        autopilot=vehicle,
        margin=margin,
        as_simulated=as_simulated,
        stop_for_lost=stop_for_lost,
        seed=seed,
        safety=limits,
    )
    return parse_card({**document, "hash": card_hash(document)})


def simulated_start(scenario: Scenario, seed: int) -> list[State]:
    """Return the start states of the simulated agents of a seed."""
    short = replace(scenario, flight=replace(scenario.flight, duration=scenario.flight.dt))
    begun = simulate(short, seed, precision=64, device="python").isel(time=0)
    dims, n = scenario.dimensions, scenario.agents
    rows = [begun[name].values.reshape(dims, -1)[:, :n] for name in ("position", "velocity")]
    return states_from_arrays(np.concatenate(rows), dims)


def fleet_recording(fleet: LockstepFleet | RealtimeFleet) -> xr.Dataset:
    """Return the flight of a fleet in the simulator's layout, with each node's knowledge of itself."""
    scenario, dims = fleet.scenario, fleet.scenario.dimensions
    rows = fleet.array()
    if dims == 3:
        # A recording counts heights as the law does, so that it compares with a simulated one.
        rows[:, :, [2, 11]] -= fleet.law_zero_height
    columns = [*range(dims), *range(3, 3 + dims), *range(6, 6 + dims)]
    frames = rows[:, :, columns].transpose(0, 2, 1)
    attributes = provenance(scenario, fleet.seed, 64) | {
        "random_start": 0, "airflock_device": "fleet", "airflock_vehicle": fleet.card.autopilot.name,
        "airflock_card": fleet.card.hash, "airflock_notes": "\n".join(f"{t:.2f} {w} {n}" for t, w, n in fleet.log),
    }  # fmt: skip
    recorded = make_dataset(
        frames, dims, fleet.card.period, attributes, "velocity", group_names(scenario.groups, scenario.agents)
    )
    own_position = rows[:, :, 9 : 9 + dims].transpose(0, 2, 1)[:, :, None, :]
    recorded["own_position"] = (
        recorded["position"].dims,
        own_position,
        {"units": "m", "meaning": "as the node knows it"},
    )
    recorded["age"] = (("time", "receiver", "sender"), fleet.packet_ages().astype(np.float32), {"units": "s"})
    return recorded


def fly_in_lockstep(
    scenario: Scenario, card: FlightCard, seed: int, *, faults: Sequence[InjectedFault] = (), from_ground: bool = False,
    operator: bytes = b"", on_done: Callable[[], None] | None = None,
) -> LockstepFleet:  # fmt: skip
    """Fly one fleet for the scenario's duration: from the simulator's start, or from the ground by the operator."""
    from airflock.drones import OrderKind

    start = None if from_ground else simulated_start(scenario, seed)
    fleet = LockstepFleet(scenario, card, seed, start=start, faults=faults, operator=operator)
    if from_ground:
        fleet.advance(SECONDS_BEFORE_START, on_done)
        fleet.order(OrderKind.START, at=fleet.now)
    fleet.advance(scenario.flight.duration + scenario.flight.dt, on_done)
    if from_ground:
        fleet.order(OrderKind.RETURN)
        # Ten minutes at most: a drone that never lands is left to the report.
        for _ in range(60):
            if fleet.is_airborne or any(vehicle.armed for vehicle in fleet.vehicles):
                fleet.advance(10.0)
    return fleet


class Divergence(NamedTuple):
    """Largest distance (m) over agents to the simulated flight at some times (s), and that of nudged simulations."""

    times: list[float]
    fleet: list[float]
    nudged: list[float]


def divergence(
    fleet: LockstepFleet | RealtimeFleet,
    times: Sequence[float] = (2.0, 5.0, 10.0, 20.0, 30.0, 60.0),
    device: str = "cpu",
) -> Divergence:
    """Measure how fast a fleet leaves the simulated flight of its seed, and the simulation itself after nudges.

    A nudge moves each agent at the start by 1 cm in a direction of its own; the largest of eight
    nudges counts.
    """
    scenario, dims, n = fleet.scenario, fleet.scenario.dimensions, fleet.scenario.agents
    states = simulated_start(scenario, fleet.seed)
    start = np.array([[*s[:dims], *s[3 : 3 + dims]] for s in states]).T

    def places(start: Any) -> Any:
        flown = simulate(scenario, fleet.seed, precision=64, start=start, device=device)
        return flown.position.transpose("time", "individual", "space", "keypoint").values.reshape(-1, n, dims)

    def nudged(number: int) -> Any:
        # 2.4 rad is the golden angle: the directions cover the circle, and none occurs twice.
        angle = 2.4 * np.arange(n) * (number + 1) + number  # all directions, none twice
        moved = start.copy()
        moved[:2] += NUDGE_DISTANCE * np.array([np.cos(angle), np.sin(angle)])
        return places(moved)

    plain = places(start)
    ours = (
        fleet_recording(fleet).position.transpose("time", "individual", "space", "keypoint").values.reshape(-1, n, dims)
    )
    count = min(len(plain), len(ours))
    apart = _largest_distance(ours[:count] - plain[:count])
    # A flock is chaotic: the fleet may not leave the simulated flight faster than nudges of 1 cm do
    # by themselves.
    chaos = np.max([_largest_distance(nudged(k) - plain) for k in range(NUDGE_COUNT)], axis=0)
    period = fleet.card.period
    kept = [t for t in times if round(t / period) < count]
    at = [round(t / period) for t in kept]
    return Divergence(kept, [float(apart[k]) for k in at], [float(chaos[k]) for k in at])


def _largest_distance(apart: Any) -> Any:
    """Return the largest length over agents, (time,), of differences (time, agent, axis); nan does not count."""
    return np.nanmax(np.linalg.norm(apart, axis=-1), axis=1, initial=0.0)


class MetricComparison(NamedTuple):
    """One order parameter of both: means, standard error of the paired difference, z, and p by Holm."""

    name: str
    simulator: float
    fleet: float
    error: float
    z: float
    p: float


def compare_scores(
    simulated: Sequence[Mapping[str, Any]], flown: Sequence[Mapping[str, Any]]
) -> list[MetricComparison]:
    """Compare order parameters in pairs over seeds, with Holm's correction over all of them."""
    lines = []
    for name in simulated[0]:
        pairs = [(a.get(name), b.get(name)) for a, b in zip(simulated, flown, strict=True)]
        if not all(isinstance(v, (int, float)) and math.isfinite(v) for pair in pairs for v in pair):
            continue
        a, b = np.array(pairs, float).T
        # Paired by seed: both flights share start and random numbers, so most of the spread between
        # seeds cancels.
        spread = float(np.std(b - a, ddof=1)) if len(a) > 1 else math.nan
        error = spread / math.sqrt(len(a))
        gap = float(np.mean(b - a))
        flat = error <= 1e-9 * max(1.0, abs(gap))  # the same difference at each seed: no test of it
        z = math.nan if flat and abs(gap) > 1e-9 else (0.0 if flat else gap / error)
        lines.append(
            MetricComparison(name, float(a.mean()), float(b.mean()), error, z, math.erfc(abs(z) / math.sqrt(2.0)))
        )
    corrected = holm_correction([line.p for line in lines])
    return [line._replace(p=p) for line, p in zip(lines, corrected, strict=True)]


def with_metric_period(scenario: Scenario, period: float) -> Scenario:
    """Return the scenario with order parameters taken once per decision, as a fleet is recorded."""
    document = {**scenario.document, "metrics": {**scenario.document.get("metrics", {}), "period": period}}
    return replace(scenario, metrics=scenario.metrics.with_numbers(period=period), document=document)


def simulated_and_flown_scores(
    scenario: Scenario, fleet: LockstepFleet | RealtimeFleet
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Measure order parameters of the simulated flight and of the fleet of one seed from their recordings."""
    simulated = simulate(scenario, fleet.seed, precision=64)
    return measure_recording(simulated)[0], measure_recording(fleet_recording(fleet))[0]
