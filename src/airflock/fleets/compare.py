"""Fleets beside the simulator: the same starts, the same dice, and whether order parameters differ."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from airflock.core.agent import State
from airflock.drones.onboard.card import Card, card_of, hash_of
from airflock.fleets.faults import Fault
from airflock.fleets.flown import Flown
from airflock.fleets.lockstep import Fleet, start_states
from airflock.fleets.prepare import card_document, limits_of
from airflock.fleets.starting import READY_TIME
from airflock.recordings.flights import provenance, simulate
from airflock.recordings.layout import dataset
from airflock.recordings.scores import measure
from airflock.scenarios.groups import names_of
from airflock.scenarios.scenario import Scenario
from airflock.support.many_tests import holm

SITE = (47.5, 19.0, 120.0)  # somewhere; a fleet in software is nowhere
EXPIRES = 2**39
NUDGE = 0.01  # m; what a packet resolves
NUDGES = 8
KEPT = ("x", "y", "z")


def software_card(
    scenario: Scenario, *, vehicle: str = "px4", operator: bytes = b"", silent: bool | None = None,
    margin: float = 40.0, as_simulated: bool = True, seed: int = 0, live: bool = False,
) -> Card:  # fmt: skip
    """Card of a fleet in software: one tick and one packet per decision, as the simulated agents.

    live   : on the real clock instead: ticks and packets as often as real drones have them, neighbours carried forward
    silent : whether the rule of silence stops a drone; by default where the scenario says so
    seed   : of the tolerances of manufacture that groups have
    """
    period = min(max(scenario.sensors.period or scenario.flight.dt, 0.02), 0.2)
    members = range(1, scenario.agents + 1)
    layer = min(3.0, 100.0 / max(scenario.agents, 1))
    limits = {"tick": period, "status_period": period, "layer": max(layer, 0.5), "mission_time": 36000.0}
    if live:
        as_simulated = False
        limits = {key: limits[key] for key in ("layer", "mission_time")}
    if scenario.dimensions == 3:
        limits["climb_max"] = min(limits_of(scenario).speed_max, 10.0)  # the law climbs as fast as it flies
    made = card_document(
        scenario, site=SITE, members=members, mission=1, expires=EXPIRES, operator=operator, autopilot=vehicle,
        margin=margin, as_simulated=as_simulated, silent=silent, seed=seed,
        safety=limits,
    )  # fmt: skip
    return card_of({**made, "hash": hash_of(made)})


def first_states(scenario: Scenario, seed: int) -> list[State]:
    """Where the simulated agents of a seed start."""
    short = replace(scenario, flight=replace(scenario.flight, duration=scenario.flight.dt))
    begun = simulate(short, seed, precision=64, device="python").isel(time=0)
    dims, n = scenario.dimensions, scenario.agents
    rows = [begun[name].values.reshape(dims, -1)[:, :n] for name in ("position", "velocity")]
    return start_states(np.concatenate(rows), dims)


def recording(fleet: Fleet | Flown) -> xr.Dataset:
    """The flight of a fleet in the simulator's layout, with what each node knew of itself."""
    scenario, dims = fleet.scenario, fleet.scenario.dimensions
    rows = fleet.array()
    if dims == 3:
        rows[:, :, [2, 11]] -= fleet.lift
    columns = [*range(dims), *range(3, 3 + dims), *range(6, 6 + dims)]
    frames = rows[:, :, columns].transpose(0, 2, 1)
    attributes = provenance(scenario, fleet.seed, 64) | {
        "random_start": 0, "airflock_device": "fleet", "airflock_vehicle": fleet.card.autopilot.name,
        "airflock_card": fleet.card.hash, "airflock_notes": "\n".join(f"{t:.2f} {w} {n}" for t, w, n in fleet.log),
    }  # fmt: skip
    recorded = dataset(
        frames, dims, fleet.card.period, attributes, "velocity", names_of(scenario.groups, scenario.agents)
    )
    known = rows[:, :, 9 : 9 + dims].transpose(0, 2, 1)[:, :, None, :]
    recorded["own_position"] = (recorded["position"].dims, known, {"units": "m", "meaning": "as the node knows it"})
    recorded["age"] = (("time", "receiver", "sender"), fleet.ages().astype(np.float32), {"units": "s"})
    return recorded


def fly(
    scenario: Scenario, card: Card, seed: int, *, faults: Sequence[Fault] = (), ground: bool = False,
    operator: bytes = b"", done: Callable[[], None] | None = None,
) -> Fleet:  # fmt: skip
    """Fly one fleet for the scenario's duration: from the simulator's start, or from the ground by the operator."""
    from airflock.drones.mavlink.orders import Do

    start = None if ground else first_states(scenario, seed)
    fleet = Fleet(scenario, card, seed, start=start, faults=faults, operator=operator)
    if ground:
        fleet.advance(READY_TIME, done)
        fleet.order(Do.START, at=fleet.now)
    fleet.advance(scenario.flight.duration + scenario.flight.dt, done)
    if ground:
        fleet.order(Do.RETURN)
        for _ in range(60):
            if fleet.airborne or any(vehicle.armed for vehicle in fleet.vehicles):
                fleet.advance(10.0)
    return fleet


class Departure(NamedTuple):
    """Largest distance (m) over agents to the simulated flight at some times (s), and that of nudged simulations."""

    times: list[float]
    fleet: list[float]
    nudged: list[float]


def departure(
    fleet: Fleet | Flown, times: Sequence[float] = (2.0, 5.0, 10.0, 20.0, 30.0, 60.0), device: str = "cpu"
) -> Departure:  # fmt: skip
    """How fast a fleet leaves the simulated flight of its seed, and the simulation itself after nudges.

    A nudge moves each agent at the start by 1 cm in a direction of its own; the largest of eight nudges counts.
    """
    scenario, dims, n = fleet.scenario, fleet.scenario.dimensions, fleet.scenario.agents
    states = first_states(scenario, fleet.seed)
    start = np.array([[*s[:dims], *s[3 : 3 + dims]] for s in states]).T

    def places(start: Any) -> Any:
        flown = simulate(scenario, fleet.seed, precision=64, start=start, device=device)
        return flown.position.transpose("time", "individual", "space", "keypoint").values.reshape(-1, n, dims)

    def nudged(number: int) -> Any:
        angle = 2.4 * np.arange(n) * (number + 1) + number  # all directions, none twice
        moved = start.copy()
        moved[:2] += NUDGE * np.array([np.cos(angle), np.sin(angle)])
        return places(moved)

    plain = places(start)
    ours = recording(fleet).position.transpose("time", "individual", "space", "keypoint").values.reshape(-1, n, dims)
    count = min(len(plain), len(ours))
    apart = _farthest(ours[:count] - plain[:count])
    chaos = np.max([_farthest(nudged(k) - plain) for k in range(NUDGES)], axis=0)
    period = fleet.card.period
    kept = [t for t in times if round(t / period) < count]
    at = [round(t / period) for t in kept]
    return Departure(kept, [float(apart[k]) for k in at], [float(chaos[k]) for k in at])


def _farthest(apart: Any) -> Any:
    """Largest length over agents, (time,), of differences (time, agent, axis); who is absent does not count."""
    return np.nanmax(np.linalg.norm(apart, axis=-1), axis=1, initial=0.0)


class Line(NamedTuple):
    """One order parameter of both: means, standard error of the paired difference, z, and p after Holm's correction."""

    name: str
    simulator: float
    fleet: float
    error: float
    z: float
    p: float


def table(simulated: Sequence[Mapping[str, Any]], flown: Sequence[Mapping[str, Any]]) -> list[Line]:
    """Paired comparison of order parameters over seeds; Holm's correction over all of them."""
    lines = []
    for name in simulated[0]:
        pairs = [(a.get(name), b.get(name)) for a, b in zip(simulated, flown, strict=True)]
        if not all(isinstance(v, (int, float)) and math.isfinite(v) for pair in pairs for v in pair):
            continue
        a, b = np.array(pairs, float).T
        spread = float(np.std(b - a, ddof=1)) if len(a) > 1 else math.nan
        error = spread / math.sqrt(len(a))
        gap = float(np.mean(b - a))
        flat = error <= 1e-9 * max(1.0, abs(gap))  # the same difference at each seed: no test of it
        z = math.nan if flat and abs(gap) > 1e-9 else (0.0 if flat else gap / error)
        lines.append(Line(name, float(a.mean()), float(b.mean()), error, z, math.erfc(abs(z) / math.sqrt(2.0))))
    corrected = holm([line.p for line in lines])
    return [line._replace(p=p) for line, p in zip(lines, corrected, strict=True)]


def sampled(scenario: Scenario, period: float) -> Scenario:
    """The scenario with order parameters taken once per decision, as a fleet is recorded."""
    document = {**scenario.document, "metrics": {**scenario.document.get("metrics", {}), "period": period}}
    return replace(scenario, metrics=replace(scenario.metrics, period=period), document=document)


def both(scenario: Scenario, fleet: Fleet | Flown) -> tuple[dict[str, Any], dict[str, Any]]:
    """Order parameters of the simulated flight and of the fleet of one seed, measured alike from recordings."""
    simulated = simulate(scenario, fleet.seed, precision=64)
    return measure(simulated)[0], measure(recording(fleet))[0]
