"""Figs 3 and 4: 30 drones with the parameters that flew outdoors: distances, and patterns told apart by phi_LAP."""

from typing import Any

import pandas as pd

from airflock.papers import statistics
from airflock.papers.claims import Claim, judged
from airflock.papers.flights import Flights
from airflock.scenarios.files import load

FLIGHTS = 20
MIDDLE = (150.0, 450.0)  # s: Fig. 3 shows the middle five minutes
NEAREST, LEAST = (12.0, 30.0), (5.0, 15.0)  # m, Results: average and minimum of the nearest-neighbour distances
INSIDE = 0.95  # share of instants that "remained between"
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


def claims(found: Courses) -> list[Claim]:
    """All claims about Figs 3 and 4."""
    counts = {key: pd.Series([pattern(c) for c in courses]).value_counts().to_dict() for key, courses in found.items()}
    listed = "; ".join(
        f"{key}: " + ", ".join(f"{n} {name}" for name, n in count.items()) for key, count in counts.items()
    )
    result = [_average(key, found) for key in SHOWN] + [_least(key, found) for key in SHOWN]
    wanted = {"4ms": "diagonal", "8ms": "circular", "obstacles": "varied"}
    for key, name in wanted.items():
        share = [float(pattern(c) == name) for c in found[key]]
        value = statistics.mean(share)
        holds = value.ours > 0.5
        why = ""
        if not holds:
            why = (
                f"Flights by pattern: {listed}. The flights shown were selected (Results); without obstacles circle "
                "and diagonal are two persistent patterns, and at 4 m/s ours falls into the circle. None of the "
                "changes tried turns most flights into diagonals."
            )
        result.append(
            Claim(
                id=f"fig4.{name}",
                statement=f"share of flights with the {name} pattern of {SCENES[key][0]} ({key})",
                source=f"{SCENES[key][0]}, Fig. 4 D",
                test="more than half of the flights",
                **value.fields(),
                **judged(holds, why),
            )
        )
    return [*result, *_obstructed(found), _occurs(found, listed)]


def _average(key: str, found: Courses) -> Claim:
    value = statistics.mean([c["r_min_mean"].mean() for c in found[key]])
    holds = NEAREST[0] <= value.ours <= NEAREST[1]
    every = pd.concat([c["r_min_mean"] for c in found[key]]).quantile([0.025, 0.975])
    cap = sum(c["r_min_mean"].mean() for c in found[CAP]) / len(found[CAP])
    reason = f"95 % of instants between {every.iloc[0]:.1f} and {every.iloc[1]:.1f} m"
    if not holds:
        reason += (
            "; printed range 12 to 30 m. With r0_rep = 15 m of Table S4 drones repel each other only within 15 m; the "
            f"cap of Eq. 11, instead of the rescaling that Table S2 needs, gives {cap:.1f} m"
        )
    return Claim(
        id=f"fig3.average.{key}",
        statement=f"average distance to the nearest neighbour, m ({SCENES[key][0]})",
        source="Results, on Fig. 3: between 12 and 30 m",
        test="mean over time and flights between 12 and 30 m",
        **value.fields(),
        **judged(holds, reason + "."),
    )


def _least(key: str, found: Courses) -> Claim:
    every = pd.concat([c["r_min"] for c in found[key]])
    value = statistics.mean([c["r_min"].mean() for c in found[key]])
    share = float(every.between(*LEAST).mean())
    holds = share >= INSIDE
    reason = f"{share:.1%} of instants lie between 5 and 15 m, the 2.5 % quantile is {every.quantile(0.025):.1f} m"
    if not holds:
        other = CAP if key == "4ms" else GNSS_8
        every = pd.concat([c["r_min"] for c in found[other]])
        share, low = float(every.between(*LEAST).mean()), float(every.quantile(0.025))
        reason += f"; flown otherwise ({other}) {share:.1%}, quantile {low:.1f} m. "
        reason += (
            "The rescaling holds the speed up in the turns, where the flock is compressed; the cap of Eq. 11 does not"
            if key == "4ms"
            else "Ours misses on the safe side: the smallest distance is larger than printed"
        )
    return Claim(
        id=f"fig3.minimum.{key}",
        statement=f"smallest distance of two drones at an instant, mean over time, m ({SCENES[key][0]})",
        source="Results, on Fig. 3: remained between about 5 and 15 m",
        test=f"{INSIDE:.0%} of instants between 5 and 15 m",
        **value.fields(),
        **judged(holds, reason + "."),
    )


def _obstructed(found: Courses) -> list[Claim]:
    """Obstacles lower correlation and speed but not the smallest distance; both flown with the set of 6 m/s."""
    result = []
    for column, words in (("phi_corr", "velocity correlation"), ("phi_vel", "mean speed, m/s")):
        gap = statistics.difference(*([c[column].mean() for c in found[key]] for key in ("obstacles", "6ms")))
        result.append(
            Claim(
                id=f"fig3.obstacles.{column}",
                statement=f"{words} with obstacles minus without, at 6 m/s: it drops",
                source="Fig. 3 B, caption",
                test="95 % interval below 0",
                **gap.fields(),
                **judged(gap.high < 0.0, "" if gap.high < 0.0 else "The interval reaches 0."),
            )
        )
    least = statistics.ratio(*([c["r_min"].mean() for c in found[key]] for key in ("obstacles", "6ms")))
    holds = 0.8 <= least.ours <= 1.25
    spread = {key: [c["phi_lap"].std() for c in found[key]] for key in ("obstacles", "8ms")}
    wide, narrow = (statistics.mean(spread[key]).ours for key in ("obstacles", "8ms"))
    return [
        *result,
        Claim(
            id="fig3.obstacles.r_min",
            statement="smallest distance with obstacles over that without, at 6 m/s: it remains the same",
            source="Fig. 3 B, caption",
            test="ratio between 0.8 and 1.25",
            published=1.0,
            **least.fields(),
            **judged(holds, "" if holds else "The ratio lies outside."),
        ),
        Claim(
            id="fig4.variability",
            statement="SD of phi_LAP over time with obstacles (6 m/s) over that of the circle (8 m/s): variable",
            source="Fig. 4 D",
            test="ratio above 2, fixed beforehand",
            **statistics.ratio(spread["obstacles"], spread["8ms"]).fields(),
            **judged(wide > 2.0 * narrow, f"{wide:.2f} against {narrow:.2f}."),
        ),
    ]


def _occurs(found: Courses, listed: str) -> Claim:
    """How well phi_LAP alone tells the patterns apart."""
    size: dict[str, list[float]] = {"circular": [], "diagonal": [], "varied": []}
    for courses in found.values():
        for course in courses:
            size[pattern(course)].append(float(course["phi_lap_abs"].mean()))
    words = ", ".join(f"{name} {sum(s) / len(s):.2f} ({len(s)} flights)" for name, s in size.items() if s)
    diagonal = size["diagonal"]
    return Claim(
        id="fig4.patterns",
        statement="mean |phi_LAP| of diagonal flights, near 0",
        source="Fig. 4 D",
        test="how well phi_LAP tells the patterns apart is a finding",
        published=0.0,
        **(statistics.mean(diagonal).fields() if len(diagonal) > 1 else {}),
        verdict="finding",
        reason=(
            f"Mean |phi_LAP| by pattern: {words}. It tells the circle from the rest; diagonal and obstructed flights "
            "both pass through all values, and are told apart by their polarisation (above and below 0.9). "
            f"Flights by pattern: {listed}."
        ),
    )
