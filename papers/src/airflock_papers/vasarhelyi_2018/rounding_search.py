"""The search inside the printed digits of Table S1 for parameters that reproduce a column of Table S2.

Three stages, each kept point by point in Airflock's cache folder, so that a search that was stopped goes on where it
was. `map`: Morris' screening by SALib, a few flights a point, which tells what each digit does to each row. `near`: in
each round a polynomial is fitted to every flight so far, and the sets that it holds for the best are flown. `judge`:
the best set of each target once, with fresh flights that no other stage has seen.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution

from airflock.engine import score_flights
from airflock.recordings import provenance
from airflock.support import AirflockError, atomic, cache_folder, read_text
from airflock_papers.flights import Flights
from airflock_papers.vasarhelyi_2018.published import COLUMNS, EVALUATIONS
from airflock_papers.vasarhelyi_2018.rounding import NAMES, SURE, TARGETS, Target, box, measured_as, row_p, scenario

MEASURED = tuple(dict.fromkeys(measured_as(row, target) for target in TARGETS for row in COLUMNS))
FITTED = tuple(name for name in MEASURED if name not in SURE)
CURVED = ("p_rep", "c_frict")  # the coarsest digits: their squares and their product are fitted, too
FIRST = {"map": 1_000_000, "near": 2_000_000, "judge": 3_000_000}  # seeds: no stage shares one, nor the other parts


class Budget(NamedTuple):
    """Trajectories of the map and flights a point; rounds of the search and flights a set."""

    trajectories: int = 10
    flights: int = 4
    rounds: int = 6
    near: int = 20


QUICK = Budget(2, 2, 1, 4)


class Point(NamedTuple):
    """A set of parameters with its flights. stage, key : which; x : as shares of the box; rows : order parameters."""

    stage: str
    key: str
    x: tuple[float, ...]
    rows: Mapping[str, Sequence[float]]


class Kept:
    """Points of one column in a file, complete or not there."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.points: list[Point] = []
        if path.is_file():
            lines = map(json.loads, read_text(path).splitlines())
            self.points = [Point(stage, key, tuple(x), rows) for stage, key, x, rows in lines]

    def find(self, stage: str, key: str) -> Point | None:
        """A point that was flown."""
        return next((point for point in self.points if (point.stage, point.key) == (stage, key)), None)

    def add(self, point: Point) -> None:
        """Keep a point."""
        self.points.append(point)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        atomic.write_file(self.path, "".join(json.dumps(point) + "\n" for point in self.points))


def kept(v: int) -> Kept:
    """What was flown of a column; the name of the file holds all that decides a flight's bits."""
    middle = scenario(v, box(v).mean(axis=1))
    name = hashlib.sha256(json.dumps(provenance(middle, 0, 32)).encode()).hexdigest()[:20]
    return Kept(cache_folder() / "papers" / "vasarhelyi_2018" / "rounding" / f"{v}ms.{name}.jsonl")


def point(
    store: Kept, v: int, stage: str, key: str, x: NDArray[np.float64], seeds: range, flights: Flights, title: str
) -> Point:
    """A point of a stage, flown unless it is kept."""
    found = store.find(stage, key)
    if found is None:
        low, high = box(v).T
        flown = flights.as_changed(scenario(v, low + x * (high - low)))
        count = flights.counter(f"Rounding, {v} m/s, {title}", len(seeds))
        rows = score_flights([flown] * len(seeds), list(seeds), threads=flights.threads, on_done=count)
        values = {name: [float(row[name]) for row in rows] for name in MEASURED}
        found = Point(stage, key, tuple(map(float, x)), values)
        store.add(found)
    return found


def screened(store: Kept, v: int, flights: Flights, budget: Budget) -> tuple[NDArray[np.float64], list[Point]]:
    """Morris' trajectories through the box of a column, and what was flown at their points."""
    x = trajectories(budget.trajectories)
    seeds = range(FIRST["map"], FIRST["map"] + budget.flights)
    found = []
    for i, each in enumerate(x):
        key = f"{budget.trajectories} {budget.flights} {i}"
        found.append(point(store, v, "map", key, each, seeds, flights, f"map {i + 1}/{len(x)}"))
    return x, found


def trajectories(count: int) -> NDArray[np.float64]:
    """Points of Morris' trajectories, (12 · count, 11), as shares of the box."""
    sample = _salib("sample")
    return np.asarray(sample(_problem(), count, num_levels=4, seed=0), dtype=float)


def effects(x: NDArray[np.float64], points: Sequence[Point], row: str) -> dict[str, NDArray[np.float64]]:
    """Effect of each digit, from its lowest to its highest value, on the mean of a row: mu, mu_star, sigma."""
    means = np.array([np.mean(p.rows[row]) for p in points])
    found = _salib("analyze")(_problem(), x, means, num_levels=4, seed=0)
    return {name: np.asarray(found[name], dtype=float) for name in ("mu", "mu_star", "sigma")}


def _problem() -> dict[str, Any]:
    return {"num_vars": len(NAMES), "names": list(NAMES), "bounds": [[0.0, 1.0]] * len(NAMES)}


def _salib(what: str) -> Any:
    try:
        from SALib.analyze.morris import analyze
        from SALib.sample.morris import sample
    except ModuleNotFoundError as fault:
        raise AirflockError("the map of the rounding needs SALib: pip install 'airflock[evolve]'") from fault
    return {"analyze": analyze, "sample": sample}[what]


class Surface:
    """Means of every row as a polynomial of the parameters, fitted to all flights so far by least squares."""

    def __init__(self, points: Sequence[Point]) -> None:
        x = np.array([p.x for p in points])
        flights = np.sqrt([len(p.rows["fitness"]) for p in points])
        means = np.array([[np.mean(p.rows[name]) for name in FITTED] for p in points])
        self.weights = np.linalg.lstsq(_terms(x) * flights[:, None], means * flights[:, None], rcond=None)[0]
        within = np.array([[np.var(p.rows[name], ddof=1) for name in FITTED] for p in points])
        self.sds = np.sqrt(np.average(within, axis=0, weights=flights**2))

    def means(self, x: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Means of the rows at several sets, x: (sets, 11)."""
        found = _terms(x) @ self.weights
        return {name: found[:, i] for i, name in enumerate(FITTED)}

    def best(self, v: int, target: Target, seed: int) -> NDArray[np.float64]:
        """The set inside the box whose worst row has the largest p, by the fitted means and 100 flights."""
        sds = dict(zip(FITTED, self.sds, strict=True))

        def worst(x: NDArray[np.float64]) -> NDArray[np.float64]:
            means = self.means(x.T)
            logs = []
            for row in COLUMNS:
                if row not in SURE:
                    name = measured_as(row, target)
                    p = row_p(v, row, means[name], np.full(x.shape[1], sds[name]), EVALUATIONS, target.digits)
                    logs.append(np.log(np.maximum(np.nan_to_num(p), 1e-300)))
            found: NDArray[np.float64] = -(np.min(logs, axis=0) + 1e-3 * np.sum(logs, axis=0))
            return found

        bounds = [(0.0, 1.0)] * len(NAMES)
        found = differential_evolution(
            worst, bounds, seed=seed, maxiter=300, popsize=8, vectorized=True, updating="deferred", polish=False
        )
        return np.asarray(found.x, dtype=float)


def _terms(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Terms of the polynomial: 1, every parameter, squares and product of the coarsest."""
    a, b = (x[:, NAMES.index(name)] - 0.5 for name in CURVED)
    return np.column_stack([np.ones(len(x)), x - 0.5, a * a, b * b, a * b])


def searched(store: Kept, v: int, flights: Flights, budget: Budget) -> dict[Target, NDArray[np.float64]]:
    """The best set of each target after all rounds, as shares of the box."""
    points = screened(store, v, flights, budget)[1]
    for number in range(budget.rounds):
        surface, found = Surface(points), []
        for k, target in enumerate(TARGETS):
            first = FIRST["near"] + (len(TARGETS) * number + k) * 1000
            key = f"{budget} {number} {target.name}"
            at = store.find("near", key)
            x = np.array(at.x) if at else surface.best(v, target, number)
            title = f"round {number + 1}/{budget.rounds}, {target.name}"
            found.append(point(store, v, "near", key, x, range(first, first + budget.near), flights, title))
        points = points + found
    return {target: Surface(points).best(v, target, budget.rounds) for target in TARGETS}


def fresh(store: Kept, v: int, flights: Flights, budget: Budget) -> dict[Target, Point]:
    """The best sets with fresh flights, as many as Table S2 has evaluations; each is judged once."""
    found = {}
    for k, target in enumerate(TARGETS):
        key = f"{budget} {target.name}"
        at = store.find("judge", key)
        if at is None:
            x = searched(store, v, flights, budget)[target]
            first = FIRST["judge"] + k * 1000
            seeds = range(first, first + flights.count(EVALUATIONS, 10))
            at = point(store, v, "judge", key, x, seeds, flights, f"judged, {target.name}")
        found[target] = at
    return found
