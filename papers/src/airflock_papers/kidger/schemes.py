"""The five recombination schemes in a city and a forest, and why scheme 2 flies into obstacles (the thesis's bug 1)."""

import math
from typing import NamedTuple

import numpy as np
import pandas as pd

from airflock.core import BoundPercept, HeardNeighbour, Own, State, decide, norm, sum_neighbours
from airflock.parts.laws import kidger
from airflock.recordings import simulate
from airflock.scenarios import FlightWorld, GoalCourse, Scenario, load
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights

SCENES = ("city", "forest")
SCHEMES = ("1", "2", "3", "4", "5")
FINAL = "5"  # the scheme of the final set
SEEDS = 20
FEW = 10  # seeds of scheme 4 by N
EVENTS = 200  # collisions of scheme 2 that are looked into, per scene
COLUMNS = ("n_env_coll", "goals_reached", "flocked", "n_coll", "n_avoid")


class Overruled(NamedTuple):
    """One collision with the environment, as decided in the frame before.

    spoke : 1.0 if the way ahead was not free, so that obstacle avoidance spoke
    angle : between its free ray and what was flown, deg
    blocked : 1.0 if what was flown met the scene within that frame
    """

    spoke: float
    angle: float
    blocked: float


class Flown(NamedTuple):
    """Order parameters by (scene, scheme, seed); by scene the collisions of scheme 2; scheme 4 by (scene, N, seed)."""

    table: pd.DataFrame
    overruled: dict[str, list[Overruled]]
    most: pd.DataFrame


def fly(flights: Flights) -> Flown:
    """Fly every scheme in both scenes; in the small form only the final one, whose goals count, for the whole time."""
    short = {"duration": 20.0} if flights.quick else {}
    keys = {k: {"model.scheme": k} | (short if k != FINAL else {}) for k in SCHEMES}
    scenarios = {(s, k): load(f"kidger/{s}", keys[k]) for s in SCENES for k in SCHEMES}
    table = flights.score("Five schemes in two scenes", scenarios, flights.count(SEEDS, 3))
    most = 20 if flights.quick else EVENTS
    second = {"model.scheme": "2", "duration": 20.0}
    events = {s: overruled(flights.as_changed(load(f"kidger/{s}", second)), most) for s in SCENES}
    minute = {"model.scheme": "4", "duration": 20.0 if flights.quick else 60.0}
    tops = {(s, n): load(f"kidger/{s}", {"model.most": n, **minute}) for s in SCENES for n in range(1, 7)}
    return Flown(table, events, flights.score("Scheme 4 by N", tops, flights.count(FEW, 2)))


def overruled(scenario: Scenario, most: int) -> list[Overruled]:
    """What was decided in the frame before each collision with the environment, over as many seeds as it takes."""
    found: list[Overruled] = []
    place, radius = FlightWorld(scenario), scenario.resolved_metrics().r_body
    for seed in range(40):
        recording = simulate(scenario, seed)
        position, velocity = (recording[name].values[:, :, 0, :] for name in ("position", "velocity"))
        course, touching = GoalCourse(scenario), np.zeros(scenario.agents, bool)
        for k in range(1, len(position)):
            flock = [State(*map(float, row)) for row in np.hstack([position[k - 1].T, velocity[k - 1].T])]
            course.advance((k - 1) * scenario.flight.dt, scenario.flight.dt, flock)
            after = [State(*map(float, row)) for row in np.hstack([position[k].T, velocity[k].T])]
            now = np.array([place.touches(a, b, radius) > 0.5 for a, b in zip(flock, after, strict=True)])
            for i in np.flatnonzero(now & ~touching):
                found.append(looked_into(scenario, place, course, flock, int(i)))
                if len(found) == most:
                    return found
            touching = now
    return found


def looked_into(scenario: Scenario, place: FlightWorld, course: GoalCourse, flock: list[State], i: int) -> Overruled:
    """Decide once more for agent i, oracle by oracle."""
    p, own, dt = scenario.parameters, flock[i], scenario.flight.dt
    heard = [HeardNeighbour(j, state, 0.0) for j, state in enumerate(flock) if j != i]
    senses = BoundPercept.of(place, own, 0.0, course.of(i), (0, 0, i))
    flown = decide(scenario.model, p, own, heard, (), None, time=0.0, period=dt, index=i, percept=senses).command
    speed = norm(*own[3:])
    me = Own(*own[3:], *(v / speed for v in own[3:]))
    sums = sum_neighbours(scenario.model, p, own, heard, i)
    tally = kidger.others(kidger.Tally(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), me, sums, senses, p)
    suggested = kidger.movement(tally, p)
    size = norm(*suggested)
    ux, uy, uz = (c / size for c in suggested)
    width = p.radius + p.margin
    free = senses.cast(ux, uy, uz, p.r_ray, width)
    if free >= p.r_ray:
        return Overruled(0.0, 0.0, 0.0)
    way = kidger.way_out(senses, ux, uy, uz, free, p)
    pace = norm(*flown)
    along = sum(a * b for a, b in zip(way[:3], flown, strict=True)) / pace
    x, y, z = (v / pace for v in flown)
    met = place.cast(*own[:3], x, y, z, pace * dt + 0.01, width)
    return Overruled(1.0, math.degrees(math.acos(max(-1.0, min(1.0, along)))), 1.0 if met < pace * dt else 0.0)


def measured(flown: Flown) -> list[Measured]:
    """Who stays out of obstacles, who reaches goals, who flocks, and how avoidance is overruled."""
    found: list[Measured] = []
    for scene in SCENES:
        for scheme in SCHEMES:
            rows = flown.table.loc[(scene, scheme)]
            note = f"{rows['goals_reached'].mean():.3g} goals reached"
            note += f"; {_by_most(flown, scene)}" if scheme == "4" else ""
            at = f"{scene}, scheme {scheme}"
            found.append(
                Measured(f"schemes.{scene}.{scheme}", "n_env_coll", at, statistics.mean(rows["n_env_coll"]), note)
            )
        final = flown.table.loc[(scene, FINAL)]
        goals = statistics.mean(final["goals_reached"] / final["goals"])
        avoided = f"{final['n_avoid'].mean():.0f} avoidances per boid"
        at = f"{scene}, final set, share"
        found.append(Measured(f"schemes.{scene}.goals", "goals reached", at, goals, avoided))
        found += [_reason(flown.overruled[scene], scene)] if flown.overruled[scene] else []
    return [*found, _stragglers({scene: flown.table.loc[(scene, FINAL)] for scene in SCENES})]


def _stragglers(final: dict[str, pd.DataFrame]) -> Measured:
    """Share flocked in the scene where it is lower."""
    shares = {scene: statistics.mean(rows["flocked"]) for scene, rows in final.items()}
    times = ", ".join(
        f"{shares[scene].ours:.2f} in the {scene}, all for the first time after {rows['time_to_flock'].mean():.2g} s"
        for scene, rows in final.items()
    )
    lower = min(shares.values(), key=lambda share: share.ours)
    return Measured("schemes.flocked", "flocked", "city and forest, final set, the lower share of boids", lower, times)


def _by_most(flown: Flown, scene: str) -> str:
    """Scheme 4 by its N, which the thesis leaves open."""
    by_n = flown.most.loc[scene].groupby(level=0)[["n_env_coll", "goals_reached"]].mean()
    told = ", ".join(f"N = {n}: {row.n_env_coll:.3g} and {row.goals_reached:.3g}" for n, row in by_n.iterrows())
    return f"collisions and goals a minute by N, which the thesis leaves open: {told}"


def _reason(events: list[Overruled], scene: str) -> Measured:
    heard = [event for event in events if event.spoke > 0.5]
    angle = float(np.mean([event.angle for event in heard])) if heard else math.nan
    blocked = float(np.mean([event.blocked for event in heard])) if heard else math.nan
    note = (
        f"over {len(events)} collisions the mean was flown {angle:.0f}° off the free ray that avoidance suggested; in "
        f"{blocked:.0%} it met the scene within that frame"
    )
    spoke = statistics.mean([event.spoke for event in events])
    return Measured(f"schemes.{scene}.reason", "overruled", f"{scene}, scheme 2, share of collisions", spoke, note)
