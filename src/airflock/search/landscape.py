"""A flat or dead landscape: where no candidate is better than another there is nothing to search or to call best."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from airflock.runs import FlightStore, parse_values
from airflock.search.study import Study
from airflock.support import StudyError

EARLY = 3  # generations after which a search that has seen nothing but one value ends
FEWEST = 40  # candidates of which that can be said
ZERO_FITNESS = 1e-6  # a product of partial fitnesses below this does not fly
# partial fitness → what it says if it is zero, and what may be changed
ADVICE = {
    "f_speed": "the flock is too slow: lower model.v_flock, or take fewer agents, walls and obstacles",
    "f_coll": "agents collide: take fewer agents, a larger arena, a smaller metrics.r_coll, or a shorter radio.delay",
    "f_disc": "agents are too far from all others: raise radio.range, or take a smaller arena",
    "f_cluster": "the flock falls apart: raise radio.range or metrics.r_cluster, or take a smaller arena",
    "f_wall": "agents leave the arena or enter obstacles: lower model.v_flock, raise metrics.r_tol, or take more room",
    "f_corr": "neighbours do not fly the same way: lower radio.delay, the noise or model.v_flock",
}


def refuse_flat(study: Study, store: FlightStore, generation: int, values: Sequence[float | None]) -> None:
    """Raise StudyError once a search has seen one value only; what it is and why, in one line.

    generation : number of the generation, of those with whole flights, from 0
    values     : first objective of every candidate so far that flew a whole flight
    """
    found = [value for value in values if value is not None]
    last = generation + 1 == study.whole("generations")
    if len(found) < FEWEST or not (generation + 1 == EARLY or (last and generation < EARLY)):
        return
    if max(found) - min(found) <= 1e-12 * max(1.0, abs(max(found))):
        name = study.objectives[0].name
        raise StudyError(
            f"{study.scenario.name}: nothing to search: {name} = {found[0]:g} for all of {len(found)} candidates"
            f"{zero_fitness_reason(search_scores(store)) if found[0] == 0.0 else ''}"
        )


def dead_reason(study: Study, scores: Sequence[Mapping[str, Any] | None]) -> str:
    """Why a winner does not fly, if its fitness, a product, is zero in all flights on fresh seeds; else empty."""
    sound = [row for row in scores if row is not None]
    if study.objectives[0].name != "fitness" or not sound or not _parts(sound):
        return ""
    if max(float(row["fitness"]) for row in sound) >= ZERO_FITNESS:
        return ""
    return f"no candidate flies, so there is no best one{zero_fitness_reason(sound)}"


def search_scores(store: FlightStore) -> list[Mapping[str, Any]]:
    """Scores of all flights of the search."""
    return [
        parse_values(scores) for (scores,) in store.rows("SELECT scores FROM flight WHERE stage='search'") if scores
    ]


def zero_fitness_reason(scores: Sequence[Mapping[str, Any]]) -> str:
    """Which partial fitness is zero most often, in how many flights, and what may be changed; empty if none is."""
    shares = {name: sum(float(row[name]) < ZERO_FITNESS for row in scores) / len(scores) for name in _parts(scores)}
    worst = sorted(((share, name) for name, share in shares.items() if share > 0.5), reverse=True)
    if not worst:
        return ""
    told = ", ".join(f"{name} is zero in {100.0 * share:.0f} % of flights" for share, name in worst)
    advice = ADVICE.get(worst[0][1], "")
    return f": {told}{f'; {advice}' if advice else ''}"


def _parts(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Partial fitnesses that all flights have."""
    names = [name for name, value in (rows[0] if rows else {}).items() if name.startswith("f_") and _number(value)]
    return [name for name in names if all(_number(row.get(name)) for row in rows)]


def _number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not math.isnan(value)
