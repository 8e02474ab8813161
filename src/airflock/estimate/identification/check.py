"""The posterior check: flights of the identified scenario against the log, by the same measures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.identification.logs import FlightLogs
from airflock.recordings import simulate
from airflock.scenarios import Scenario, build_scenario

Array = NDArray[np.float64]
PERIOD = 0.2  # s between frames of the check
LONGEST = 600.0  # s that are flown
SETTLED = 30.0  # s at the start of a flight that are left out
FIRST_SEED = 1_000_000  # beyond the seeds that people tune with


@dataclass
class LogCheck:
    """By measure: the log's value and the 2.5 and 97.5 % ends of the flights; polarisation over time with its band."""

    found: dict[str, tuple[float, float, float]]
    times: Array
    polarisation: Array
    band: Array

    def outside(self) -> list[str]:
        """Measures of the log that the flights do not explain."""
        return [name for name, (own, low, high) in self.found.items() if not low <= own <= high]


def log_measures(positions: Array, velocities: Array) -> tuple[dict[str, float], Array]:
    """Mean speed, polarisation, mean and least distance to the nearest, over those present; polarisation over time.

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
    """Times, positions and velocities (time, axis, individual) on a common grid; nan across gaps beyond 1 s."""
    flying = logs.select_rows(~logs.standing & np.isfinite(logs.velocity).all(axis=1))
    times = np.arange(flying.time.min(), flying.time.max(), PERIOD)
    axes = flying.position.shape[1]
    place = np.full((len(times), axes, logs.drones), np.nan)
    speed = place.copy()
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

    flights : how many; done : called after each
    comparable : whether the drones' clocks agree; else only speeds are compared
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
    """Positions and velocities (time, axis, individual) of a flight once it has settled; nan where the log has none.

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
    """2.5 and 97.5 % ends (2, time) of courses over time; nan where none has a value."""
    drawn = np.array(courses)
    some = np.isfinite(drawn).any(axis=0)
    band = np.full((2, drawn.shape[1]), np.nan)
    band[:, some] = np.nanquantile(drawn[:, some], [0.025, 0.975], axis=0)
    return band
