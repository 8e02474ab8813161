"""Check an identified scenario: flights of it against the log, and synthetic logs of known numbers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from airflock.core import radio, random
from airflock.estimate.identification.radio_links import curve_parameters
from airflock.estimate.identification.vehicle_logs import MAX_STEP_RATIO, FlightLogs
from airflock.parts.radios import links
from airflock.parts.sensors import langevin
from airflock.recordings import packet_uniforms, simulate
from airflock.scenarios import Scenario, build_scenario

Array = NDArray[np.float64]
PERIOD = 0.2  # s between frames of the check
LONGEST = 600.0  # s that are flown
SETTLED = 30.0  # s at the start of a flight that are left out
# Tuning uses small seeds; a check on the same flights would be no check.
FIRST_SEED = 1_000_000  # beyond the seeds that people tune with


@dataclass
class LogCheck:
    """Check by measure: the log's value and the 2.5 and 97.5 % ends of the flights; polarisation over time with its
    band.
    """

    found: dict[str, tuple[float, float, float]]
    times: Array
    polarisation: Array
    band: Array

    def outside(self) -> list[str]:
        """Return the measures of the log that the flights do not explain."""
        return [name for name, (own, low, high) in self.found.items() if not low <= own <= high]


def log_measures(positions: Array, velocities: Array) -> tuple[dict[str, float], Array]:
    """Measure mean speed, polarisation, mean and least distance to the nearest neighbour; also polarisation over time.

    place, speed : (time, axis, individual), nan where one is absent
    """
    there: Any = np.isfinite(positions).all(axis=1) & np.isfinite(velocities).all(axis=1)
    size = np.where(there, np.linalg.norm(velocities, axis=1), np.nan)
    count = there.sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        heading = np.where(there[:, None], velocities / size[:, None], 0.0)
        order = np.where(count > 1, np.linalg.norm(heading.sum(axis=2), axis=1) / count, np.nan)
    nearest = np.full(there.shape, np.nan)
    for k in np.flatnonzero(count > 1):
        own = positions[k][:, there[k]]
        apart = np.linalg.norm(own[:, :, None] - own[:, None, :], axis=0)
        np.fill_diagonal(apart, np.inf)
        nearest[k, there[k]] = apart.min(axis=1)
    values = {"speed": float(np.nanmean(size)) if there.any() else float("nan")}
    if np.isfinite(nearest).any():
        values |= {"polarisation": float(np.nanmean(order)), "r_min_mean": float(np.nanmean(nearest)),
                   "r_min": float(np.nanmin(nearest))}  # fmt: skip
    return values, order


def frames_of_logs(logs: FlightLogs) -> tuple[Array, Array, Array]:
    """Return times, positions and velocities (time, axis, individual) on a common grid; nan across gaps beyond 1 s."""
    flying = logs.select_rows(~logs.standing & np.isfinite(logs.velocity).all(axis=1))
    times = np.arange(flying.time.min(), flying.time.max(), PERIOD)
    axes = flying.position.shape[1]
    place = np.full((len(times), axes, logs.drones), np.nan)
    speed = place.copy()
    # Each drone has its own times; interpolation stops at gaps, so that nothing is invented.
    for who in range(logs.drones):
        rows = flying.of(who)
        if len(rows) < 2:
            continue
        own = flying.time[rows]
        after = np.clip(np.searchsorted(own, times), 1, len(own) - 1)
        near = (own[after] - own[after - 1] <= 1.0) & (times >= own[0]) & (times <= own[-1])
        for axis in range(axes):
            place[near, axis, who] = np.interp(times[near], own, flying.position[rows, axis])
            speed[near, axis, who] = np.interp(times[near], own, flying.velocity[rows, axis])
    return times - times[0], place, speed


def check_against_logs(
    scenario: Scenario,
    logs: FlightLogs,
    flights: int,
    on_done: Callable[[], None] | None = None,
    *,
    comparable: bool = True,
) -> LogCheck:
    """Fly a scenario with as many agents and as long as the log, with the log's absences, and compare.

    Parameters
    ----------
    scenario : Scenario
        What flies.
    logs : FlightLogs
        What it is compared with.
    flights : int in [0, inf]
        Flights to compare with the log; 0: none.
    on_done : callable, optional
        Called after each.
    comparable : bool
        True if the drones' clocks agree; else only speeds are compared.
    """
    times, place, speed = frames_of_logs(logs)
    keep = times <= LONGEST
    times, place, speed = times[keep], place[keep], speed[keep]
    own, course = log_measures(place, speed)
    absent: Any = ~np.isfinite(place).all(axis=1)
    document = {key: value for key, value in scenario.document.items() if key != "published"}
    settings: dict[str, Any] = {
        "agents": logs.drones, "duration": float(times[-1]) + SETTLED + 2.0 * PERIOD, "metrics.period": PERIOD
    }  # fmt: skip
    ready = build_scenario(document, scenario.name, settings)
    rows: list[dict[str, float]] = []
    courses = []
    # Only measures are kept: a hundred flights of ten minutes would not fit in memory.
    for number in range(flights):
        values, order = log_measures(*_flown(ready, FIRST_SEED + number, absent))
        rows.append(values)
        courses.append(order[: len(times)])
        if on_done is not None:
            on_done()
    compared = own if comparable else {"speed": own["speed"]}
    found = {}
    for name, value in compared.items():
        drawn = np.array([row[name] for row in rows if name in row])
        if len(drawn):
            found[name] = (value, float(np.quantile(drawn, 0.025)), float(np.quantile(drawn, 0.975)))
    return LogCheck(found, times, course, _band(courses) if courses else np.full((2, len(times)), np.nan))


def _flown(scenario: Scenario, seed: int, absent: Any) -> list[Array]:
    """Fly, and return positions and velocities (time, axis, individual) after settling; nan where the log has none.

    absent : (time, individual) of the log
    """
    late, flown = round(SETTLED / PERIOD), simulate(scenario, seed)
    parts = [
        flown[name]
        .transpose("time", "space", "keypoint", "individual")
        .values[late : late + len(absent), :, 0]
        .astype(float)
        for name in ("position", "velocity")
    ]
    for part in parts:
        part[np.broadcast_to(absent[: len(part), None], part.shape)] = np.nan
    return parts


def _band(courses: Sequence[Array]) -> Array:
    """Return the 2.5 and 97.5 % ends (2, time) of courses over time; nan where none has a value."""
    drawn = np.array(courses)
    some = np.isfinite(drawn).any(axis=0)
    band = np.full((2, drawn.shape[1]), np.nan)
    band[:, some] = np.nanquantile(drawn[:, some], [0.025, 0.975], axis=0)
    return band


# Synthetic logs: the material that estimators are tested with. A recording keeps true states. The
# measurements of each drone and its received packets are drawn again from the counters (seed,
# stream, step, agent), so that nothing in the engine changes.
WARM = 8.0  # times of decay that receivers have been on before they are logged


@dataclass(frozen=True)
class LogDisturbance:
    """Disturbances of a log by its logger.

    offset, drift : SD of the clocks' offsets (s) and rates (1); jitter: SD of single stamps, s
    lost          : share of rows that are missing; bursts of `burst_seconds` s each are missing
                    besides
    white         : SD of white noise on velocities, m/s; resolution: of positions, m
    stamp_jitter  : SD of stamps of packets, s
    """

    offset: float = 0.5
    drift: float = 2e-5
    jitter: float = 0.002
    lost: float = 0.02
    bursts: int = 2
    burst_seconds: float = 3.0
    white: float = 0.0
    resolution: float = 0.01
    stamp_jitter: float = 0.0


def normal_pair(a: Any, b: Any) -> tuple[Array, Array]:
    """Draw as `core.random.normal_pair` does, for arrays of words."""
    radius = np.sqrt(-2.0 * np.log(random.uniform(a)))
    word = ((b << 2) & random.MASK).astype(np.int64)
    angle = (word ^ 0x80000000) - 0x80000000
    sine, cosine = (
        np.sin(angle * (random.QUARTER_PI / 2147483648.0)),
        np.cos(angle * (random.QUARTER_PI / 2147483648.0)),
    )
    radius = np.where((b & 0x80000000) > 0, -radius, radius)
    swapped = (b & 0x40000000) > 0
    return np.where(swapped, radius * sine, radius * cosine), np.where(swapped, radius * cosine, radius * sine)


def agent_words(seed: int, stream: int, step: int, agent: Any) -> Any:
    """Draw as `core.random.words` does, for an array of agents."""
    counters = np.asarray(agent, np.uint64)
    zero = np.zeros_like(counters)
    return random.philox(counters, zero + np.uint64(step), zero + np.uint64(stream), zero, seed, seed >> 32)


def own_state_errors(seed: int, decisions: int, agents: int, period: float, s: Any) -> Array:
    """Draw errors of own position and velocity (decision, 4, agent), m and m/s, as a flight in the plane does."""
    found = np.zeros((decisions, 4, agents))
    q, u = np.zeros((2, agents)), np.zeros((2, agents))
    # The error is a process with memory, so decisions follow one another; agents are side by side.
    for k in range(decisions):
        w = agent_words(seed, random.SENSOR, k, np.arange(agents))
        drawn = normal_pair(w[0], w[1])
        for axis in (0, 1):
            q[axis], u[axis] = langevin.error(q[axis], u[axis], drawn[axis], period, s)
        found[k, :2], found[k, 2:] = q, u
    return found


def fly_logs(
    scenario: Scenario, seed: int, disturbed: LogDisturbance, generator: np.random.Generator
) -> tuple[FlightLogs, pd.DataFrame, Any]:
    """Fly in the plane; return the logs, the packets, and the recording.

    The scenario's metrics.period is the period of the log. Packets: receiver, sender, t (receiver's
    clock), stamp (sender's clock), distance (m), got (0 or 1), fast and slow (packets due on each
    link).
    """
    recording = simulate(scenario, seed)
    order = ("time", "space", "keypoint", "individual")
    place, speed, wish = (
        recording[name].transpose(*order).values[:, :, 0].astype(float) for name in ("position", "velocity", "command")
    )
    times, period, n = recording["time"].values.astype(float), scenario.sensors.period, place.shape[2]
    at = (times / period + 1e-6).astype(int)
    errors = own_state_errors(seed, int(at[-1]) + 1, n, period, scenario.sensors.numbers)[at]
    clocks = np.stack([generator.normal(0.0, disturbed.offset, n), generator.normal(0.0, disturbed.drift, n)], axis=1)
    rows: list[list[Any]] = []
    # Per drone: noise, rounding, missing rows and bursts, then its own clock; a row whose clock
    # runs backwards is lost.
    for i in range(n):
        measured = speed[:, :, i] + errors[:, 2:, i] + generator.normal(0.0, disturbed.white, (len(times), 2))
        where = np.round((place[:, :, i] + errors[:, :2, i]) / disturbed.resolution) * disturbed.resolution
        keep = generator.random(len(times)) >= disturbed.lost
        for _ in range(disturbed.bursts):
            begin = generator.uniform(times[0], max(times[-1] - disturbed.burst_seconds, times[0]))
            keep &= ~((times > begin) & (times < begin + disturbed.burst_seconds))
        clock = times * (1.0 + clocks[i, 1]) + clocks[i, 0] + generator.normal(0.0, disturbed.jitter, len(times))
        keep &= np.concatenate([[True], np.diff(clock) > 0.0])
        step = float(np.median(np.diff(times)))
        own = clock[keep]
        new = np.concatenate([[True], np.diff(own) > MAX_STEP_RATIO * step])
        rows.append([own, where[keep], measured[keep], wish[keep, :, i], np.full(len(own), i), new])
    time, position, velocity, command, who, new = (np.concatenate(part) for part in zip(*rows, strict=True))
    names = [str(name) for name in recording["individual"].values]
    logs = FlightLogs(time, position, velocity, command, who, new.astype(bool), names, np.zeros(len(time), bool))
    heard = _packets(scenario, seed, times, place, clocks, disturbed, generator)
    for side in ("receiver", "sender"):
        heard[side] = np.array(names)[heard[side]]
    return logs, heard, recording


def _packets(
    scenario: Scenario, seed: int, times: Array, place: Array, clocks: Array, disturbed: LogDisturbance, generator: Any
) -> pd.DataFrame:
    """Return rows of every pair and decision of a radio of two lossy links."""
    k_, period, n = curve_parameters(scenario.radio.numbers), scenario.sensors.period, place.shape[2]
    every = max(1, round(period / (times[1] - times[0])))
    i, j = np.nonzero(~np.eye(n, dtype=bool))
    arrives = np.vectorize(links.received, otypes=[float], excluded=[1, 2])
    parts = []
    # The number of the flight's own draw decides, so that these are the packets that the flight
    # had.
    for step, points in enumerate(place[::every]):
        d = np.hypot(*(points[:, i] - points[:, j]))
        fast, slow = (radio.packets(step, rate, period) for rate in (k_.fast_rate, k_.slow_rate))
        grid = np.round(d, 2)
        missed = (1.0 - arrives(grid, 0.0, k_)) ** fast * (1.0 - arrives(grid, 1.0, k_)) ** slow
        drawn = packet_uniforms(seed, 0, step, n)[i, j]
        got = (d <= k_.range) & (drawn >= missed)
        now, sent = step * period, step * period - k_.delay
        jitter = generator.normal(0.0, disturbed.stamp_jitter, len(i)) if disturbed.stamp_jitter else 0.0
        parts.append(
            {
                "receiver": i, "sender": j, "t": now * (1.0 + clocks[i, 1]) + clocks[i, 0] + jitter,
                "stamp": sent * (1.0 + clocks[j, 1]) + clocks[j, 0], "distance": d, "got": got.astype(int),
                "fast": np.full(len(i), fast), "slow": np.full(len(i), slow),
            }
        )  # fmt: skip
    return pd.DataFrame({name: np.concatenate([part[name] for part in parts]) for name in parts[0]})


def standing_logs(
    seed: int, agents: int, seconds: float, s: Any, disturbed: LogDisturbance, generator: np.random.Generator
) -> FlightLogs:
    """Simulate logs of drones that stand on the ground, whose sensors' errors have settled."""
    count, before = round(seconds / s.period), round(WARM / s.damping / s.period)
    errors = own_state_errors(seed, before + count, agents, s.period, s)[before:]
    rows = []
    for i in range(agents):
        time = np.arange(count) * s.period
        home = generator.uniform(-50.0, 50.0, 2)
        where = np.round((home + errors[:, :2, i]) / disturbed.resolution) * disturbed.resolution
        moving = errors[:, 2:, i] + generator.normal(0.0, disturbed.white, (count, 2))
        first = np.arange(count) == 0
        rows.append([time, where, moving, np.full((count, 2), np.nan), np.full(count, i), first])
    time, place, speed, wish, who, new = (np.concatenate(part) for part in zip(*rows, strict=True))
    names = [f"agent_{i}" for i in range(agents)]
    return FlightLogs(time, place, speed, wish, who.astype(np.int64), new.astype(bool), names, np.ones(len(time), bool))
