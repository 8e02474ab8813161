"""What each agent measured and whom it heard, beside a recording: flown in parts, drawn again from the same counters.

The flight is the closed one, bit for bit: it is cut at its decisions, which an open flight may be. Measured states are
read from it; packets of a plain radio are drawn again by the numbers that the driver drew them by.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock.core import radio, random
from airflock.engine import Flight
from airflock.recordings.layout import DIMENSIONS, VARIABLE_UNITS
from airflock.scenarios import Scenario, step_counts
from airflock.support import FlightError
from airflock.world import half_sizes

Array = NDArray[Any]
KINDS = ("measured", "heard")
FARTHEST = 1e8  # m; the limit of any range in a driver


def check_keep(keep: Sequence[str], events: Sequence[Any], scenario: Scenario) -> None:
    """Refuse what cannot be kept, one line each."""
    if isinstance(keep, str) or not isinstance(keep, Iterable):
        raise FlightError(f"keep = {keep!r} is not a list; give some of {', '.join(KINDS)}, such as keep=('measured',)")
    faults = [f"keep = {kind!r} is none of {', '.join(KINDS)}" for kind in keep if kind not in KINDS]
    if keep and events:
        faults.append("keep: a flight with events is cut by them already; keep nothing, or give no events")
    if keep and scenario.flight.update == "sequential":
        faults.append("keep: with update = 'sequential' each agent moves before the next one perceives")
    if faults:
        raise FlightError("\n".join(faults))


def finish_keeping(flight: Flight, keep: Sequence[str]) -> dict[str, xr.Variable]:
    """Fly to the end and return what was perceived, as variables of the recording.

    measured_position (m), measured_velocity (m/s) : (time, space, keypoint, individual), as last measured
    age : (time, receiver, sender), s since what was last heard had been sent; nan: never heard
    """
    scenario, n = flight.scenario, flight.agents
    times, dt = step_counts(scenario), scenario.flight.dt
    every, sample = times["decide_every"], times["sample_every"]
    late = times["delay"] * dt
    stamps = np.full((n, n), np.nan)
    measured: list[Array] = []
    ages: list[Array] = []
    following = 0  # frame
    while not flight.over:
        flight.sense()
        now = flight.step * dt
        last = min(flight.step + every, times["steps"])
        if "heard" in keep:
            stamps = _stamps(flight, stamps, flight.step // every, now, late)
        own = flight.measured if "measured" in keep else None
        while following * sample < last:
            _note(measured, ages, own, stamps if "heard" in keep else None, following * sample * dt)
            following += 1
        flight.advance(steps=last - flight.step)
    if following * sample <= times["steps"]:
        own = flight.measured if "measured" in keep else None
        _note(measured, ages, own, stamps if "heard" in keep else None, following * sample * dt)
    flight.finish()
    count = len(flight.frame_times)
    return _variables(measured[:count], ages[:count], scenario.dimensions)


def _note(measured: list[Array], ages: list[Array], own: Array | None, stamps: Array | None, time: float) -> None:
    if own is not None:
        measured.append(own)
    if stamps is not None:
        ages.append(time - stamps)


def _variables(measured: list[Array], ages: list[Array], dimensions: int) -> dict[str, xr.Variable]:
    found: dict[str, xr.Variable] = {}
    if measured:
        table = np.array(measured)[:, :, None, :]
        for c, name in enumerate(("position", "velocity")):
            part = table[:, c * dimensions : (c + 1) * dimensions]
            found[f"measured_{name}"] = xr.Variable(DIMENSIONS, part, {"units": VARIABLE_UNITS[name]})
    if ages:
        found["age"] = xr.Variable(("time", "receiver", "sender"), np.array(ages, np.float32), {"units": "s"})
    return found


def packet_uniforms(seed: int, world: int, decision: int, agents: int) -> Array:
    """Uniform number of each pair (receiver, sender) in a decision: `core.random.pair_uniform` for a whole flock."""
    fours, senders = -(-agents // 4), np.arange(agents, dtype=np.uint64)
    first = random.pair_number(4 * np.arange(fours, dtype=np.uint64)[:, None], senders, agents)
    zero = np.zeros_like(first)
    drawn = random.philox(
        first, zero + np.uint64(decision), zero + np.uint64(random.PACKET), zero + np.uint64(world), seed, seed >> 32
    )
    return np.asarray(random.uniform(np.stack(drawn, axis=1).reshape(4 * fours, agents)[:agents]))


def _stamps(flight: Flight, stamps: Array, number: int, now: float, late: float) -> Array:
    """When what each agent knows of each other one was sent, s, after a decision; nan: never heard."""
    k, n = flight.scenario.radio, flight.agents
    if flight.scenario.transceiver.keeps_packets:
        return np.where(np.eye(n, dtype=bool), np.nan, flight.sent)
    place = flight.state[: flight.scenario.dimensions].astype(float)
    offset = place[:, None, :] - place[:, :, None]  # from receiver (first) to sender
    if flight.scenario.world.edges == "periodic":
        halves = half_sizes(flight.scenario.world)
        for d, half in zip(offset, halves, strict=False):
            d -= 2.0 * half * np.round(d / (2.0 * half))
    apart = np.sqrt((offset**2).sum(axis=0))
    heard = (apart <= min(k.range, FARTHEST)) & ~np.eye(n, dtype=bool)
    if k.loss > 0.0:
        i, j = np.nonzero(heard)
        lost = np.array([radio.lost(float(d), k) for d in apart[i, j]])
        heard[i, j] = packet_uniforms(flight.seed, flight.world, number, n)[i, j] >= lost
    return np.where(heard, now - late, stamps)
