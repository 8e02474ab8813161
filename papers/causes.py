"""Fly again what shows why some sentences are not reproduced: `python papers/causes.py NAME [SEEDS]`.

Names: diagonal (fig4.diagonal), shill (model.shill_terms.6ms), collisions (minimum.f_collision), fitness
(controller.fitness), ranges (s1.range), nearest (fig3.minimum), turns (limits.turns), against
(limits.delay, limits.noise), crowd (pressure.free), best (quality.best). One line a set of flights; the figures stand
as reasons in the pages' statements.
"""

import sys
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

import airflock
from airflock.recordings.scores import over_time
from airflock.scenarios.files import load
from airflock_papers import zapotecatl_2016
from airflock_papers.breaks import in_words
from airflock_papers.dimock_2003.controller import STARTS
from airflock_papers.dimock_2003.flights import Birds, Task
from airflock_papers.dimock_2003.units import BEST, FT_LBF
from airflock_papers.flights import with_changes
from airflock_papers.vasarhelyi_2018 import outdoor, pressure, real
from airflock_papers.vasarhelyi_2018.limits import IN_TURNS, QUARTER, turn_rate
from airflock_papers.vasarhelyi_2018.published import optimum
from airflock_papers.vasarhelyi_2018.tuning import SETTLED, SPEEDS

# Table S4, columns of 4 and 6 m/s: m and 1/s
REPULSION = {4: {"model.r0_rep": 15.0, "model.p_rep": 0.3}, 6: {"model.r0_rep": 35.0, "model.p_rep": 0.1}}
# r_s and r_a in cm of the configurations of Zapotecatl et al. with the highest quality; first that which they name
LEVEL = ((20, 30), (30, 30), (30, 40), (20, 40), (30, 50), (40, 40), (20, 50), (40, 50))
# preset, settings, distance of drones that start along the diagonal, m
DIAGONAL: dict[str, tuple[str, dict[str, Any], float]] = {
    "column of 4 m/s": ("real_4ms", {}, 12.0),
    "column of 6 m/s": ("real_6ms", {}, 20.0),
    "column of 6 m/s at 4 m/s": ("real_6ms", {"model.v_flock": 4.0, "model.v_max": 6.0}, 20.0),
    "column of 6 m/s, repulsion of 4": ("real_6ms", REPULSION[4], 12.0),
    "column of 6 m/s, v_frict of 4": ("real_6ms", {"model.v_frict": 1.0}, 20.0),
    "column of 6 m/s, arena of 4": ("real_6ms", {"world.side": 200.0}, 20.0),
    "column of 4 m/s, repulsion of 6": ("real_4ms", REPULSION[6], 20.0),
    "column of 4 m/s, delay of 0.2 s": ("real_4ms", {"radio.delay": 0.2}, 12.0),
    "column of 4 m/s, range of 200 m": ("real_4ms", {"radio.range": 200.0}, 12.0),
    "column of 4 m/s, satellite navigation": ("real_gnss", {}, 12.0),
    "column of 4 m/s, cap of Eq. 11": ("real_4ms", {"model.limit": "cap"}, 12.0),
    "column of 4 m/s, no errors": ("real_4ms", {"sensors.noise": 0.0, "body.noise": 0.0}, 12.0),
    "column of 4 m/s, tau of 2 s": ("real_4ms", {"body.tau": 2.0}, 12.0),
    "column of 4 m/s, wind of 3 m/s": ("real_4ms", {"wind.east": 3.0}, 12.0),
    "column of 4 m/s, at 6 m/s": ("real_4ms", {"model.v_flock": 6.0, "model.v_max": 8.0}, 12.0),
}
# Table S1: ends of printed ranges outside which our evolved numbers lie; speed (m/s), number, nearest end
ENDS: tuple[tuple[int, str, float], ...] = (
    (4, "r0_rep", 28.2), (4, "r0_frict", 87.8), (6, "a_frict", 5.04), (8, "a_frict", 2.89), (16, "r0_frict", 198.0),
    (16, "a_frict", 5.25), (16, "p_shill", 3.42), (32, "r0_frict", 252.0), (32, "r0_shill", 25.7),
)  # fmt: skip
NEAREST: dict[str, tuple[str, dict[str, Any]]] = {
    "4 m/s": ("real_4ms", {}),
    "4 m/s, no errors of sensors": ("real_4ms", {"sensors.noise": 0.0}),
    "4 m/s, repulsion of 6 m/s": ("real_4ms", REPULSION[6]),
    "4 m/s, delay of 0.2 s": ("real_4ms", {"radio.delay": 0.2}),
    "8 m/s": ("real_8ms", {}),
    "8 m/s, repulsion of 6 m/s": ("real_8ms", REPULSION[6]),
    "8 m/s, repulsion of 4 m/s": ("real_8ms", REPULSION[4]),
}
# Algorithm A at the delay of Table S5: constants of the caption, what it leaves open, and the delay
CROWD: tuple[dict[str, Any], ...] = ({}, {"model.c_frict": 0.2}, {"model.p_rep": "times 2"}, {"radio.delay": 0.2})
LAGS = (-4.0, -2.0, 0.0, 1.0, 2.0, 3.0, 4.0)  # s, from a turn to the order that is looked at
READINGS: tuple[dict[str, Any], ...] = (
    {},
    *({"dt": dt} for dt in (0.05, 0.01)),
    *({"wing.segments": n} for n in ("1", "5")),
    {"wing.core": 0.0762},
    {"model.gradient": "cells_frozen"},
    *({"model.cohesion": form} for form in ("C0", "C2", "C3", "C5", "C6", "C7")),
    *({"model.centroid": form} for form in ("others", "weights")),
    *({"model.avoidance": form} for form in ("present", "pairwise", "barrier")),
    {"model.k_d": "times 0.5"},
    *({"model.k_c": f"times {part}"} for part in (0.5, 0.2)),
    {"model.k_c": "times 0.5", "wing.segments": "5"},
)


def along_the_diagonal(speed: float, apart: float, seed: int) -> NDArray[np.float64]:
    """Positions and velocities (x, y, vx, vy; m, m/s) of 30 drones in rows that fly to a corner."""
    i = np.arange(30)
    grid = apart * np.array([i % 6 - 2.5, i // 6 - 2.0])
    grid = grid + np.random.default_rng(seed).normal(0.0, 0.5, grid.shape)
    return np.concatenate([grid, np.full((2, 30), speed / 2**0.5)])


def diagonal(seeds: int = 20, first: int = 2000) -> None:
    """Patterns and distances of nearest neighbours (m), from random places and along the diagonal."""
    low, high = outdoor.MIDDLE
    for name, (preset, settings, apart) in DIAGONAL.items():
        scenario = load(f"vasarhelyi_2018/{preset}", settings)
        for start in ("random places", "along the diagonal"):
            counts: Counter[str] = Counter()
            near = []
            for seed in range(first, first + seeds):
                begin = (
                    along_the_diagonal(scenario.parameters.v_flock, apart, seed) if start != "random places" else None
                )
                course = over_time(airflock.simulate(scenario, seed, start=begin))
                course = course[(course.index >= low) & (course.index <= high)]
                counts[outdoor.pattern(course)] += 1
                near.append(float(course["r_min_mean"].mean()))
            tell(f"{name}, {start}", f"{dict(counts)}, nearest {np.mean(near):.1f} m")


def shill(seeds: int = 60, first: int = 1000) -> None:
    """Wall terms (m/s) of Table S4 and with the shill agents of Table S1, by whether the flock circles."""
    sides = real.sides(6)
    rows = []
    for seed in range(first, first + seeds):
        flown = {name: airflock.simulate(scenario, seed) for name, scenario in sides.items()}
        rows.append(
            [real.wall_term(flown[n], sides[n]) for n in ("s4", "s1")] + [turning(flown[n]) for n in ("s4", "s1")]
        )
    s4, s1, turns, turns_s1 = np.array(rows).T
    tell("circling flights", f"Table S4 {(turns > 0.8).sum()}, Table S1 {(turns_s1 > 0.8).sum()} of {seeds}")
    for name, those in (("Table S4 circles", turns > 0.8), ("it does not", turns <= 0.8)):
        gap = (s4 - s1)[those]
        if gap.size < 2:
            continue
        error = gap.std(ddof=1) / gap.size**0.5
        tell(name, f"{s4[those].mean():.2f} against {s1[those].mean():.2f}, {gap.mean():.3f} ± {error:.3f}")


def turning(recording: Any) -> float:
    """How much of the flock's turning about the centre goes one way round: 1 circles, 0 there and back."""
    place, velocity = (recording[name].values[::5, :, 0, :].mean(axis=2) for name in ("position", "velocity"))
    moment = place[:, 0] * velocity[:, 1] - place[:, 1] * velocity[:, 0]
    return float(abs(moment.mean()) / abs(moment).mean())


def collisions(seeds: int = 40, first: int = 5000) -> None:
    """Frequency of collision at r_s = r_a = 50 cm, as counted and with a nearer contact, and of boids at once."""
    sets: dict[str, tuple[str, dict[str, Any]]] = {
        "as the page": ("sequential", {}),
        "r_b of 4.5 cm": ("sequential", {"metrics.r_b": 0.045}),
        "all boids at once": ("synchronous", {}),
    }
    for name, (update, settings) in sets.items():
        made = zapotecatl_2016.configurations(
            "zapotecatl_2016/best", update=update, **{"metrics.count": "program", **settings}
        )
        x = np.sort(airflock.score(made[50, 50], range(first, first + seeds))["f_collision"].to_numpy())
        worst = x[-max(seeds // 10, 1) :].sum() / x.sum()
        tell(name, f"mean {x.mean():.5f}, median {np.median(x):.5f}, the worst tenth has {worst:.2f} of the sum")


def ranges(seeds: int = 100, first: int = 4000) -> None:
    """Fitness of our evolved sets with one number at the nearest end of its printed range, less as they are."""
    for speed, key, end in ENDS:
        evolved = load(f"vasarhelyi_2018/evolved_{speed}ms")
        moved = load(f"vasarhelyi_2018/evolved_{speed}ms", {f"model.{key}": end})
        plain, changed = (airflock.score(each, range(first, first + seeds))["fitness"] for each in (evolved, moved))
        gap = changed.to_numpy() - plain.to_numpy()
        half = 1.96 * gap.std(ddof=1) / seeds**0.5
        tell(
            f"{speed} m/s, {key}",
            f"{getattr(evolved.parameters, key):.3g} evolved, {end:g} printed: {gap.mean():+.4f} ± {half:.4f}",
        )


def nearest(seeds: int = 10, first: int = 6000) -> None:
    """Share of instants with a smallest distance of 5 to 15 m, and that distance (m), in the middle five minutes."""
    low, high = outdoor.MIDDLE
    for name, (preset, settings) in NEAREST.items():
        scenario = load(f"vasarhelyi_2018/{preset}", settings)
        courses = [over_time(airflock.simulate(scenario, seed)) for seed in range(first, first + seeds)]
        least = [course["r_min"][(course.index >= low) & (course.index <= high)] for course in courses]
        shares = np.array([each.between(*outdoor.LEAST).mean() for each in least])
        half = 1.96 * shares.std(ddof=1) / seeds**0.5
        tell(name, f"{shares.mean():.3f} ± {half:.3f}, mean {np.mean([each.mean() for each in least]):.1f} m")


def turns(seeds: int = 20, first: int = 0) -> None:
    """What the optima of Table S1 lose in turns and some time after them, by whether the flock circles."""
    for v in SPEEDS:
        found: dict[str, list[list[float]]] = {"circles": [], "flies to and fro": []}
        for seed in range(first, first + seeds):
            recording = airflock.simulate(optimum(v), seed)
            times, rate, course = recording["time"].values, turn_rate(recording), over_time(recording)
            course = course[(course.index >= SETTLED) & (course.index <= times[-1] - 2.0 * max(LAGS))]
            row = list(np.quantile(rate[times >= SETTLED], [QUARTER, 1.0 - QUARTER]))
            for name in IN_TURNS:
                for lag in LAGS:
                    then = np.interp(course.index.to_numpy() - lag, times, rate)
                    slow, fast = np.quantile(then, [QUARTER, 1.0 - QUARTER])
                    row.append(course[name][then >= fast].mean() - course[name][then <= slow].mean())
            found["circles" if turning(recording) > 0.8 else "flies to and fro"].append(row)
        for name, rows in found.items():
            if rows:
                slow, fast, *lost = np.mean(rows, axis=0)
                lost = [f"{lag:+g} s {x:+.3f}" for lag, x in zip(LAGS * len(IN_TURNS), lost, strict=True)]
                half = len(LAGS)
                tell(
                    f"{v} m/s, {name}, {len(rows)} flights",
                    f"turns by {slow:.3f} to {fast:.3f} rad/s; phi_vel {', '.join(lost[:half])}; "
                    f"phi_corr {', '.join(lost[half:])}",
                )


def against(seeds: int = 40, first: int = 0) -> None:
    """Correlation of the optima of Table S1 by the delay and by the noise, which are 1 s and once the paper's."""
    for v in SPEEDS:
        sets = [(f"delay of {t:g} s", {"radio.delay": t}) for t in (0.0, 1.0, 2.0, 3.0)]
        sets += [(f"{k:g} times the noise", {"sensors.noise": 0.005 * k, "body.noise": 0.2 * k}) for k in (0.0, 4.0)]
        for name, keys in sets:
            x = airflock.score(optimum(v, keys), range(first, first + seeds))["phi_corr"]
            tell(f"{v} m/s, {name}", f"mean {x.mean():.4f} ± {x.std():.4f}, median {x.median():.4f}")


def crowd(seeds: int = 6, first: int = 7000) -> None:
    """Collisions a flight among obstacles, and in how many flights there is one, by number of drones."""
    for agents in pressure.FLIGHTS:
        for keys in CROWD:
            scenario = with_changes(pressure.scene(agents, obstacles=True), keys)
            x = airflock.score(scenario, range(first, first + seeds))["n_coll"]
            told = f"{x.mean():.2f} collisions a flight, in {(x > 0).sum()} of {seeds} flights"
            tell(f"{agents} drones, {in_words(keys) or 'as the page'}", told)


def best(seeds: int = 100, first: int = 1000) -> None:
    """Quality of the configurations of Fig. 8 that come out best, each less that which the paper names, with 95 %."""
    scenarios = zapotecatl_2016.configurations(
        "zapotecatl_2016/best", update="sequential", **{"metrics.count": "program"}
    )
    found = {at: airflock.score(scenarios[at], range(first, first + seeds))["quality"].to_numpy() for at in LEVEL}
    for (r_s, r_a), quality in found.items():
        less = quality - found[LEVEL[0]]
        error = 1.96 * less.std(ddof=1) / seeds**0.5
        tell(
            f"r_s = {r_s} cm, r_a = {r_a} cm", f"{quality.mean():.4f}, less the first {less.mean():+.4f} ± {error:.4f}"
        )


def fitness(seeds: int = 1) -> None:
    """Power of the published gains, ft lbf/s, over the 28 starts, by reading; no seed changes anything.

    Birds that each save for themselves come to rest where they need 11.1 (static.selfish), and the best formation
    needs 8.9 (static.best): the last two seconds tell how near to rest a reading comes.
    """
    for keys in READINGS:
        birds, tasks = Birds(changes=keys), [Task(BEST, start) for start in STARTS]
        flown, before = (birds.fly("", tasks, seconds, gradient="cells") for seconds in (20.0, 18.0))
        pairs = [
            (all_of.power / FT_LBF, (20.0 * all_of.power - 18.0 * begun.power) / (2.0 * FT_LBF))
            for all_of, begun in zip(flown, before, strict=True)
            if not all_of.collided
        ]
        name = in_words(keys) or "as the page"
        if not pairs:
            tell(name, "all collide")
            continue
        power, end = np.array(pairs).T
        told = f"least {power.min():.2f}, median {np.median(power):.2f}"
        tell(name, f"{told}; the last two seconds {end.min():.2f}, {np.median(end):.2f}")


def tell(name: str, found: str) -> None:
    """One line."""
    print(f"{name}: {found}", flush=True)  # noqa: T201


CAUSES: dict[str, Callable[..., None]] = {
    each.__name__: each for each in (diagonal, shill, collisions, fitness, ranges, nearest, turns, against, crowd, best)
}

if __name__ == "__main__":
    name, *seeds = sys.argv[1:] or [""]
    if name not in CAUSES or len(seeds) > 1 or not all(text.isdecimal() and 0 < int(text) <= 1000 for text in seeds):
        sys.exit(f"usage: python papers/causes.py {'|'.join(CAUSES)} [SEEDS], 1 to 1000 of them")
    CAUSES[name](*map(int, seeds))
