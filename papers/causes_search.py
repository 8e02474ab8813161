"""Fly again what shows why sentences on Dimock and Selig's search are not reproduced: `python papers/causes_search.py NAME [SEEDS]`.

Names: takeover (ga.timid, ga.sporadic.rise), early (ga.early), rows (ga.row). One line a set of searches or flights;
the figures stand as reasons in the page's statements.
"""

import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from airflock.evolve.genetic import decode, genetic
from airflock_papers.breaks import in_words
from airflock_papers.dimock_2003.flights import Birds, Start, Task, in_row, spacing
from airflock_papers.dimock_2003.ga import EARLY, GREEDY, HORSESHOE, READINGS, Reading, Run, losses_of, settings_of
from airflock_papers.dimock_2003.units import HIGH, LOW, Gains

TAKEN, TENTH, BY = 10, 10, 0.75  # generation, generations that are compared, share of the controllers (ga.timid)
PAGE = READINGS["mean"]
SEARCHES: tuple[tuple[dict[str, Any], dict[str, float]], ...] = (
    ({}, {}),
    ({"start": (5.0, 5.0)}, {}),
    ({"model.centroid": "n"}, {}),
    *(({"model.avoidance": form}, {}) for form in ("present", "pairwise", "barrier")),
    *(({"model.cohesion": form}, {}) for form in ("C2", "C3", "C5", "C6", "C7")),
    ({"wing.segments": "5"}, {}),
    ({"metrics.r_coll": 0.762}, {}),
    ({}, {"crossover": 0.6}),
    ({}, {"mutation": 0.001}),
)


def searched(keys: dict[str, Any], operators: dict[str, float], seed: int, generations: int) -> tuple[Birds, Run]:
    """A search as the page's, with keys of the scenario and operators of the algorithm changed."""
    start = Start(*(("vee", *keys["start"]) if "start" in keys else ("vee", 5.0, 6.5)))
    changes = {key: value for key, value in keys.items() if key not in ("start", "model.centroid")}
    run = Run(Reading(keys.get("model.centroid", PAGE.centroid), start), seed)
    birds = Birds(threads=1, changes=changes)
    losses = losses_of(birds, run)
    genetic(lambda bits: losses(decode(bits)), 50, population=50, generations=generations, seed=seed, **operators)
    return birds, run


def takeover(seeds: int = 8, first: int = 101) -> None:
    """Share of controllers with a small K_a in generation 10, and of those that collide, by what is left open."""
    for keys, operators in SEARCHES:
        runs = [searched(keys, operators, seed, TAKEN + TENTH)[1] for seed in range(first, first + seeds)]
        small = np.array([run.timid[TAKEN] for run in runs])
        before, after = (np.array([np.mean(run.lost[part]) for run in runs]) for part in (slice(TENTH), slice(TENTH, 2 * TENTH)))
        tell(
            in_words({**keys, **operators}) or "as the page",
            f"{int((small > BY).sum())} of {seeds} over {BY:.0%} by generation {TAKEN}, median {np.median(small):.0%}; "
            f"colliding {before.mean():.1%} then {after.mean():.1%}, more in {int((after > before).sum())} of {seeds}",
        )


def tell(name: str, found: str) -> None:
    """One line."""
    print(f"{name}: {found}", flush=True)  # noqa: T201


CAUSES: dict[str, Callable[..., None]] = {each.__name__: each for each in (takeover,)}

if __name__ == "__main__":
    name, *seeds = sys.argv[1:] or [""]
    CAUSES[name](*map(int, seeds))
