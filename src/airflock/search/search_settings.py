"""The table [search] of a study file: which algorithm, how many flights, how long, from where; and what cannot be."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from airflock.core import Parameters as Record, Quantity, choice, declarations, quantity
from airflock.runs import SearchSpace
from airflock.search.objectives import Objective
from airflock.search.optimisers import ALGORITHMS, MULTI_OBJECTIVE

S6 = "Vásárhelyi et al. 2018, Table S6"
SEED_BITS = 40  # numbers of flights within one study; seeds 0, 1, 2, ... that people give by hand lie below all studies
CONSTANT_SEEDS_SHARE = (
    0.3  # share of generations after which flights of a candidate begin to grow from `seeds` to `late_seeds`
)
FEWEST = 8  # generations of a search with growing flights: one at least of each length but the last


# More generations, larger populations and averages alone all ended 0.035 below Table S1 at 6 m/s:
# single flights rank sets that are mostly good and sometimes bad. More flights late stay at the
# optimum. A third of the published study's flights. Measured with benchmarks/time_to_target.py: 9
# of 10 searches reach the fitness of Table S1 at 6 m/s.
FAST: Mapping[str, Any] = {
    "population": 24, "generations": 72, "late_seeds": 9, "averages": 2, "windows": 4, "pool": 20, "top": 4,
    "final_seeds": 60, "again": 3,
}  # fmt: skip


def fast_search_keys(search_keys: Mapping[str, Any], *, limits: bool) -> dict[str, Any]:
    """Return the keys of the fast search, overridden by `search_keys`; with limits no finalist flies a second time."""
    return {key: value for key, value in FAST.items() if key != "again" or not limits} | dict(search_keys)


@dataclass(frozen=True, kw_only=True)
class SearchSettings(Record):
    """How a study searches: the table [search]."""

    algorithm: str = choice(
        "cmaes",
        ALGORITHMS,
        source=S6,
        meaning="optimiser: cmaes (CMA-ES), ga (a binary genetic algorithm) or nsga2 (NSGA-II, Pareto fronts)",
    )
    population: float = quantity(100, "1", low=2, high=1e6, source=S6, meaning="candidates per generation")
    generations: float = quantity(150, "1", low=1, high=1e6, source=S6, meaning="generations per run")
    seeds: float = quantity(
        1, "1", low=1, high=1e5, source="Results: one simulation a candidate", meaning="flights per candidate"
    )
    late_seeds: float = quantity(
        0,
        "1",
        low=0,
        high=1e5,
        source="our choice: ranks of single flights drifted to 0.035 below Table S1 at 6 m/s, four flights stayed",
        meaning="flights per candidate in the last generation; they grow from seeds on, after three tenths of all",
    )
    random_numbers: str = choice(
        "fresh",
        ("fresh", "generation", "study"),
        source="our choice",
        meaning="flights' seeds: new for each candidate, common to a generation, or common to the whole study",
    )
    restarts: float = quantity(
        0, "1", low=0, high=1000, source="our choice", meaning="further independent runs after the first"
    )
    flights: str = choice(
        "whole",
        ("whole", "growing"),
        source="our choice: most of what a search flies first does not flock at all",
        meaning="length of the search's flights: whole, that of the scenario; growing, from an eighth of it up to it",
    )
    start: str = choice(
        "middle",
        ("middle", "scenario"),
        source="Methods, last paragraph of 'Fitness function': the middle",
        meaning="where CMA-ES starts: in the middle of all ranges, or at the numbers of the scenario (warm)",
    )
    spread: float = quantity(
        1.0 / 6.0,
        "1",
        low=0.001,
        high=1.0,
        source="Methods, last paragraph of 'Fitness function'",
        meaning="first standard deviation of CMA-ES as a share of each range",
    )
    averages: float = quantity(
        0,
        "1",
        low=0,
        high=20,
        source="our choice: the mean of CMA-ES wanders on a plateau",
        meaning="further finalists: means of CMA-ES averaged over its last half, quarter, eighth, ... of generations",
    )
    windows: float = quantity(
        0,
        "1",
        low=0,
        high=100,
        source="our choice: the best place may lie on the way of the search, not at its end",
        meaning="further finalists: means of CMA-ES averaged over each of so many equal parts of its last half",
    )
    reserve: float = quantity(
        10.0,
        "1",
        low=1.0,
        high=1e6,
        source="our choice, after benchmarks/limits.py",
        meaning="with limits: how many times rarer than allowed an event is to look",
    )
    seed: float = quantity(
        0, "1", low=0, high=2**20, source="our choice", meaning="seed of everything random in the study"
    )
    precision: str = choice("32", ("32", "64"), source="our choice", meaning="bits per number in a flight")
    top: float = quantity(20, "1", low=0, high=1e4, source="our choice", meaning="best candidates that are flown again")
    pool: float = quantity(
        200,
        "1",
        low=0,
        high=1e6,
        source="our choice",
        meaning="candidates that race for the top; 0: no race, the luckiest win",
    )
    final_seeds: float = quantity(
        100, "1", low=2, high=1e6, source="Results: 100 stochastic simulations", meaning="fresh flights of each of them"
    )
    again: float = quantity(
        0,
        "1",
        low=0,
        high=1e4,
        source="our choice: 60 flights cannot separate finalists that differ by 0.005",
        meaning="best finalists that fly twice as many fresh seeds; the worse half stops early; 0: none",
    )


BROKEN = ("spread", "reserve")  # numbers that need not be whole
WHOLE = tuple(
    n for n, declared, _ in declarations(SearchSettings()) if isinstance(declared, Quantity) and n not in BROKEN
)


def search_errors(
    search: SearchSettings,
    objectives: Sequence[Objective],
    space: SearchSpace | None,
    *,
    limits: bool = False,
) -> list[str]:
    """Return the errors of search settings, one line each.

    space  : None if it could not be read
    limits : True if the study has limits
    """
    errors = [
        f"search.{name} = {value:g} is not a whole number"
        for name in WHOLE
        if (value := getattr(search, name)) != int(value)
    ]
    if search.algorithm == MULTI_OBJECTIVE and len(objectives) < 2:
        errors.append(
            f"search.algorithm = '{MULTI_OBJECTIVE}' is for several objectives, but there is one; "
            "give objective.maximise a list"
        )
    if search.algorithm != MULTI_OBJECTIVE and len(objectives) > 1:
        errors.append(
            f"search.algorithm = '{search.algorithm}' takes one objective, but there are {len(objectives)}; "
            f"give one, or search.algorithm = '{MULTI_OBJECTIVE}'"
        )
    errors += _only_cmaes(search)
    if search.again and (limits or len(objectives) > 1):
        errors.append("search.again compares one fitness; leave it at 0 with limits or several objectives")
    if search.flights == "growing":
        if search.generations < FEWEST:
            errors.append(
                f"search.flights = 'growing' needs at least {FEWEST} generations, but search.generations = "
                f"{search.generations:g}"
            )
        if space is not None and "duration" in {*space.keys, *space.fixed, *space.tied}:
            errors.append("search.flights = 'growing' sets the duration, which the space does, too; leave out one")
    if search.algorithm == "ga" and search.population % 2:
        errors.append(
            f"search.population = {search.population:g} is odd: in algorithm ga two parents have two children"
        )
    flights = search.population * search.generations * (search.restarts + 1.0)
    flights *= max(search.seeds, search.late_seeds)
    if flights >= 2 ** (SEED_BITS - 4):
        errors.append(f"search: {flights:g} flights are more than a study can number")
    return errors


def _only_cmaes(search: SearchSettings) -> list[str]:
    """Faults of keys that mean something for CMA-ES alone, where another algorithm searches."""
    if search.algorithm == "cmaes":
        return []
    usual, found = SearchSettings(), []
    for name in ("flights", "start", "spread", "averages", "windows"):
        value = getattr(search, name)
        if value != getattr(usual, name):
            shown = repr(value) if isinstance(value, str) else f"{value:g}"
            found.append(f"search.{name} = {shown} is for algorithm cmaes, but search.algorithm = '{search.algorithm}'")
    return found
