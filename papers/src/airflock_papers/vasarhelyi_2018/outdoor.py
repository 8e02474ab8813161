"""Figs 3 and 4: 30 drones with the parameters that flew outdoors: distances, and patterns told apart by phi_LAP."""

from typing import Any

import pandas as pd

from airflock.scenarios import load
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights

FLIGHTS = 20
MIDDLE = (150.0, 450.0)  # s: Fig. 3 shows the middle five minutes
LEAST = (5.0, 15.0)  # m, Results: minimum of the distances
NEAR = 3.0  # m, r_coll
GNSS = {"sensors.noise": 0.01, "sensors.scale": 28.0, "radio.kind": "links", "radio.delay": 0.2, "radio.range": 200.0}
# figure, preset, settings: A diagonal, B obstructed, C circular; the others explain
SCENES: dict[str, tuple[str, str, dict[str, Any]]] = {
    "4ms": ("Figs 3 A and 4 A", "real_4ms", {}),
    "obstacles": ("Figs 3 B and 4 B", "obstacles", {}),
    "8ms": ("Figs 3 C and 4 C", "real_8ms", {}),
    "6ms": ("Table S4", "real_6ms", {}),
    "4ms, cap of Eq. 11": ("Eq. 11", "real_4ms", {"model.limit": "cap"}),
    "4ms, satellite navigation": ("Results", "real_gnss", {}),
    "8ms, satellite navigation": ("Results", "real_8ms", GNSS),
}
CAP, GNSS_8 = "4ms, cap of Eq. 11", "8ms, satellite navigation"
SHOWN = ("4ms", "obstacles", "8ms")
PLACES = {"4ms": "30 drones, 4 m/s", "obstacles": "30 drones, 6 m/s, obstacles", "8ms": "30 drones, 8 m/s"}

Courses = dict[str, list[pd.DataFrame]]


def fly(flights: Flights) -> Courses:
    """Courses over time in the middle five minutes, by scene."""
    seeds = flights.count(FLIGHTS, 4)
    found = {}
    for key, (_, preset, settings) in SCENES.items():
        courses = flights.courses(f"Figs 3-4, {key}", load(f"vasarhelyi_2018/{preset}", settings), seeds)
        found[key] = [c[(c.index >= MIDDLE[0]) & (c.index <= MIDDLE[1])] for c in courses]
    return found


def pattern(course: pd.DataFrame) -> str:
    """Pattern of a flight: circular, diagonal or varied.

    Obstacles break up the common heading. With one, a circle keeps |phi_LAP| near 1, in either direction; flight along
    a diagonal passes near the centre and keeps it small but in the turns. The borders are ours, between the groups.
    """
    if course["polarisation"].mean() <= 0.9:
        return "varied"
    return "circular" if course["phi_lap_abs"].median() > 0.5 else "diagonal"


def measured(found: Courses) -> list[Measured]:
    """Everything that is said of Figs 3 and 4."""
    counts = {key: pd.Series([pattern(c) for c in courses]).value_counts().to_dict() for key, courses in found.items()}
    listed = "; ".join(
        f"{key}: " + ", ".join(f"{n} {name}" for name, n in count.items()) for key, count in counts.items()
    )
    result = [part(key, found) for part in (_average, _least, _collided) for key in SHOWN]
    for key, name in {"4ms": "diagonal", "8ms": "circular", "obstacles": "varied"}.items():
        share = statistics.mean([float(pattern(c) == name) for c in found[key]])
        result.append(Measured(f"fig4.{name}", "share of flights", PLACES[key], share, f"flights by pattern: {listed}"))
    return [*result, *_obstructed(found), _angle(found)]


def _average(key: str, found: Courses) -> Measured:
    value = statistics.mean([c["r_min_mean"].mean() for c in found[key]])
    every = pd.concat([c["r_min_mean"] for c in found[key]]).quantile([0.025, 0.975])
    note = f"95 % of instants between {every.iloc[0]:.1f} and {every.iloc[1]:.1f} m"
    if key == "4ms":
        note += f"; with the cap of Eq. 11 {sum(c['r_min_mean'].mean() for c in found[CAP]) / len(found[CAP]):.1f} m"
    return Measured(f"fig3.average.{key}", "r_min_mean", PLACES[key], value, note)


def _least(key: str, found: Courses) -> Measured:
    value = statistics.mean([float(c["r_min"].between(*LEAST).mean()) for c in found[key]])
    every = pd.concat([c["r_min"] for c in found[key]])
    note = f"mean over time {every.mean():.1f} m, 2.5 % quantile {every.quantile(0.025):.1f} m"
    if key != "obstacles":
        other = CAP if key == "4ms" else GNSS_8
        changed = pd.concat([c["r_min"] for c in found[other]])
        note += f"; flown otherwise ({other}) {changed.between(*LEAST).mean():.1%} of instants"
    return Measured(f"fig3.minimum.{key}", "instants in range", PLACES[key], value, note)


def _collided(key: str, found: Courses) -> Measured:
    share = statistics.mean([float(c["r_min"].min() < NEAR) for c in found[key]])
    least = min(float(c["r_min"].min()) for c in found[key])
    return Measured(f"fig3.collided.{key}", "collided", PLACES[key], share, f"least distance of all {least:.1f} m")


def _obstructed(found: Courses) -> list[Measured]:
    """Obstacles lower correlation and speed but not the smallest distance; both flown with the set of 6 m/s."""
    at = "6 m/s, with obstacles"
    result = [
        Measured(
            f"fig3.obstacles.{column}",
            column,
            f"{at} less without",
            statistics.difference(*([c[column].mean() for c in found[key]] for key in ("obstacles", "6ms"))),
        )
        for column in ("phi_corr", "phi_vel")
    ]
    least = statistics.ratio(*([c["r_min"].mean() for c in found[key]] for key in ("obstacles", "6ms")))
    spread = {key: [c["phi_lap"].std() for c in found[key]] for key in ("obstacles", "8ms")}
    note = ", ".join(f"SD over time {statistics.mean(values).ours:.2f} ({key})" for key, values in spread.items())
    lively = statistics.ratio(spread["obstacles"], spread["8ms"])
    return [
        *result,
        Measured("fig3.obstacles.r_min", "r_min", f"{at} over without", least),
        Measured("fig4.lively", "phi_lap", "SD over time, 6 m/s with obstacles over 8 m/s without", lively, note),
    ]


def _angle(found: Courses) -> Measured:
    """How well phi_LAP alone tells the patterns apart."""
    size: dict[str, list[float]] = {"circular": [], "diagonal": [], "varied": []}
    for courses in found.values():
        for course in courses:
            size[pattern(course)].append(float(course["phi_lap_abs"].mean()))
    words = ", ".join(f"{name} {sum(s) / len(s):.2f} ({len(s)} flights)" for name, s in size.items() if s)
    note = (
        f"by pattern: {words}; diagonal and obstructed flights both pass through all values and are told apart by "
        "their polarisation (above and below 0.9)"
    )
    return Measured(
        "fig4.angle", "phi_lap", "mean |phi_LAP|, all scenes", statistics.mean(sum(size.values(), [])), note
    )
