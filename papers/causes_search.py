"""Fly again what shows why Dimock and Selig's search is not reproduced: `python papers/causes_search.py NAME [SEEDS]`.

Names: takeover (ga.timid, ga.sporadic.rise), early (ga.early), rows and exploited (ga.row). One line a set of
searches or flights; the figures stand as reasons in the page's statements.
"""

import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from airflock.search.optimisers import binary_genetic, decode
from airflock_papers.breaks import in_words
from airflock_papers.dimock_2003.flights import Birds, Start, Task, holds_vee, in_row, spacing
from airflock_papers.dimock_2003.ga import (
    EARLY,
    FIRST,
    GENERATIONS,
    GREEDY,
    HORSESHOE,
    POPULATION,
    READINGS,
    SEEDS,
    Reading,
    Run,
    losses_of,
    minimise_over_bits,
    settings_of,
)
from airflock_papers.dimock_2003.units import FOOT, FT_LBF, HIGH, LOW, Gains

TAKEN, TENTH, BY = 10, 10, 0.75  # generation, generations that are compared, share of the controllers
EARLIER: tuple[dict[str, Any], ...] = ({}, {"model.centroid": "n"})  # readings of ga.early
PRESSURE = 2  # controllers of a tournament
LIMITS = (1.0, 3.0)  # m/s
SEARCHES: tuple[dict[str, Any], ...] = (
    {},
    {"start": (5.0, 5.0)},
    {"model.centroid": "n"},
    *({"model.avoidance": form} for form in ("present", "pairwise", "barrier")),
    {"wing.segments": "5"},
    {"metrics.r_coll": 0.762},
    {"crossover": 0.6},
    {"mutation": 0.001},
    *({"pressure": k} for k in (3, 4, 8)),
)
OPERATORS = ("crossover", "mutation")
# keys, gains that are set, spacings of the start aside (ft): flights of random controllers with a high K_d
DRAG = {"k_c": 0.0, "k_a": 0.0}
ROWS: tuple[tuple[dict[str, Any], dict[str, float], float], ...] = (
    ({}, {}, 6.5),
    ({}, DRAG, 6.5),
    ({}, {}, 2.5),
    *(({"wing.core": round(core * FOOT, 4)}, gains, 6.5) for core in (0.5, 1.0, 1.5) for gains in ({}, DRAG)),
    *(({"model.v_max": v}, gains, 6.5) for v in (0.3, 1.0, 3.0) for gains in ({}, DRAG)),
    *(({"model.v_max": 1.0}, {name: 0.0}, 6.5) for name in DRAG),
    ({"model.v_max": 1.0, "wing.core": round(FOOT, 4)}, DRAG, 6.5),
)


def searched(keys: dict[str, Any], seed: int, generations: int) -> tuple[Birds, Run]:
    """A search as the page's, with keys of the scenario, the start or operators of the algorithm changed."""
    start = Start("vee", *keys["start"]) if "start" in keys else READINGS["mean"].start
    own = {key: value for key, value in keys.items() if key.partition(".")[0] in ("model", "wing", "metrics")}
    run = Run(Reading(own.pop("model.centroid", READINGS["mean"].centroid), start), seed)
    birds = Birds(changes=own)
    losses = losses_of(birds, run)
    state = binary_genetic(50, POPULATION, seed, **{name: keys[name] for name in OPERATORS if name in keys})
    state.algorithm.mating.selection.pressure = keys.get("pressure", PRESSURE)
    for _ in range(generations):
        bits = state.ask()
        state.tell(bits, losses(decode(bits)))
    return birds, run


def takeover(seeds: int = 8, first: int = 101) -> None:
    """Share of controllers with a small K_a in generation 10, and of those that collide, by what is left open."""
    stretches = (slice(TENTH), slice(TENTH, 2 * TENTH))
    for keys in SEARCHES:
        runs = [searched(keys, seed, TAKEN + TENTH)[1] for seed in range(first, first + seeds)]
        small = np.array([run.timid[TAKEN] for run in runs])
        before, after = (np.array([np.mean(run.lost[part]) for run in runs]) for part in stretches)
        tell(
            in_words(keys) or "as the page",
            f"{(small > BY).sum()} of {seeds} over {BY:.0%} by generation {TAKEN}, median {np.median(small):.0%}; "
            f"{before.mean():.1%} collide in the first ten, {after.mean():.1%} in the next, more in "
            f"{(after > before).sum()} of {seeds}",
        )


def early(seeds: int = 16, first: int = 101) -> None:
    """How far birds swing aside (ft) under the best controller of generation 5, and under the last of the page."""

    def told(keys: dict[str, Any], seed: int, generations: int) -> tuple[float, bool]:
        birds, run = searched(keys, seed, generations)
        (flight,) = birds.fly("", [Task(run.gains, run.reading.start)], **settings_of(run.reading))
        return spacing(flight)[1], holds_vee(flight)

    sets = ((f"generation {EARLY}", range(first, first + seeds), EARLY + 1), ("the last", SEEDS, GENERATIONS))
    for keys in EARLIER:
        for name, chosen, generations in sets:
            swings, held = zip(*(told(keys, seed, generations) for seed in chosen), strict=True)
            listed = ", ".join(f"{swing:.2f}" for swing in sorted(swings))
            tell(f"{in_words(keys) or 'as the page'}, {name}", f"a V in {sum(held)} of {len(held)}, swing {listed} ft")


def rows(seeds: int = 150, first: int = 7) -> None:
    """Where birds are after 20 s under random controllers with a high K_d, one horseshoe a wing."""
    for keys, fixed, aside in ROWS:
        rng, tasks = np.random.default_rng(first), []
        while len(tasks) < seeds:
            drawn = dict(zip(Gains._fields, LOW + (HIGH - LOW) * rng.random(5), strict=True))
            gains = Gains(**drawn | {"k_d": GREEDY + GREEDY * rng.random()} | fixed)
            if gains.r_c >= gains.r_a:
                tasks.append(Task(gains, Start(sy=aside)))
        whole = {"model.centroid": READINGS["mean"].centroid, **HORSESHOE, **keys}
        flown = [flight for flight in Birds().fly("", tasks, scatter=True, **whole) if len(flight.frames)]
        wide = [float(np.ptp(flight.frames[-1, 1])) / FOOT for flight in flown]
        alone = "".join(f", {name} = {value:g}" for name, value in fixed.items())
        tell(
            f"{in_words(keys) or 'as the page'}{alone}, start {aside:g} ft aside",
            f"{np.mean([in_row(flight) for flight in flown]):.1%} end in a row, {sum(f.collided for f in flown)} of "
            f"{len(flown)} collide; {np.median(wide):.0f} ft wide",
        )


def exploited(seeds: int = 3, first: int = 1) -> None:
    """What searches of one horseshoe a wing come to, where velocities are limited."""
    for v in LIMITS:
        for seed in range(first, first + seeds):
            run = Run(FIRST, seed)
            losses = losses_of(Birds(changes={"model.v_max": v}), run)
            minimise_over_bits(lambda bits, of=losses: of(decode(bits)), 50, seed=seed)
            half = len(run.rows) // 2
            parts = [[row for k_d, row in part if k_d >= GREEDY] for part in (run.rows, run.rows[half:])]
            whole, second = (f"{np.mean(part):.0%} of {len(part)}" if part else "none" for part in parts)
            tell(
                f"v_max of {v:g} m/s, seed {seed}",
                f"flights with a high K_d in a row: {whole}, in the second half {second}; best "
                f"{run.best[-1] / FT_LBF:.0f} ft lbf/s",
            )


def tell(name: str, found: str) -> None:
    """One line."""
    print(f"{name}: {found}", flush=True)  # noqa: T201


CAUSES: dict[str, Callable[..., None]] = {each.__name__: each for each in (takeover, early, rows, exploited)}

if __name__ == "__main__":
    name, *seeds = sys.argv[1:] or [""]
    if name not in CAUSES or len(seeds) > 1 or not all(text.isdecimal() and 0 < int(text) <= 1000 for text in seeds):
        sys.exit(f"usage: python papers/causes_search.py {'|'.join(CAUSES)} [SEEDS], 1 to 1000 of them")
    CAUSES[name](*map(int, seeds))
