"""Evaluator: the fitness of candidates, from flights that the store holds and flights that are flown now."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.runs import CandidateBatch, Executor, Flight, FlightStore
from airflock.scenarios import Scenario
from airflock.search.fitness import Objective
from airflock.search.racing import remaining_candidates
from airflock.search.several import combine_scenarios
from airflock.search.study import Study
from airflock.search.tables import DURATION_COLUMN

FlightScores = dict[tuple[int, int], Mapping[str, Any] | None]  # (candidate, repeat) → order parameters, None: failed


@dataclass(frozen=True)
class Evaluator:
    """A study with its store of flights and who flies them.

    note : called after each flight, with whether it is a new one
    """

    study: Study
    store: FlightStore
    executor: Executor
    note: Callable[[bool], None] | None = None

    def evaluate(
        self,
        batch: CandidateBatch,
        points: NDArray[np.float64],
        *,
        seeds: Sequence[Sequence[int]] | None = None,
        duration_share: float = 1.0,
        racing: bool = False,
    ) -> list[list[float | None]]:
        """Fitness (candidate, objective) of a batch; flies what the store lacks and stores it. None: failed.

        points : (candidate, axis) of the unit cube
        seeds  : (candidate, repeat); by default those of the search
        share  : of the scenarios' duration that is flown
        racing : whether seeds are flown in turn, and no further by candidates that cannot reach the better half
        """
        study = self.study
        parameters = [study.space.parameters(point) for point in points]
        numbers = _seeds(study, batch, len(points)) if seeds is None else seeds
        places = [_shortened(scenario, duration_share) for scenario in study.scenarios]
        self.store.ask(batch, points.tolist(), [{**each, **places[0]} for each in parameters])
        flown: FlightScores = self.store.flown(batch)
        if self.note:
            for _ in flown:
                self.note(False)
        n, last = len(places), max(len(row) for row in numbers)
        alive = list(range(len(parameters)))
        for seen in range(1, last + 1) if racing else [last]:
            missing = [
                Flight(i, j * n + k, {**parameters[i], **shorter}, seed, k)
                for i in alive
                for j, seed in enumerate(numbers[i][:seen])
                for k, shorter in enumerate(places)
                if (i, j * n + k) not in flown
            ]
            self._fly(batch, missing, flown)
            if seen < last:
                alive = self._still_needed(flown, alive, seen, last)
        rows = [
            [
                self._fitness(objective, [flown[i, r] for r in range(len(row) * n) if (i, r) in flown])
                for objective in study.objectives
            ]
            for i, row in enumerate(numbers)
        ]
        self.store.tell(batch, rows)
        return rows

    def _fly(self, batch: CandidateBatch, missing: Sequence[Flight], flown: FlightScores) -> None:
        """Fly what is missing; each flight is stored and known as soon as it lands."""
        for landed in self.executor.fly(missing):
            self.store.land(batch, landed)
            if landed.values is not None and all(values is None for values in flown.values()):
                for objective in self.study.objectives:  # a fault in one shows at the first flight
                    objective.of_flight(landed.values)
            flown[landed.flight.candidate_index, landed.flight.repeat] = landed.values
            if self.note:
                self.note(True)

    def _still_needed(self, flown: FlightScores, alive: Sequence[int], seen: int, last: int) -> list[int]:
        """Candidates that fly on after `seen` of `last` seeds; later flights that are stored already do not count."""
        first, n = self.study.objectives[0], len(self.study.scenarios)
        candidates = 1 + max(i for i, _ in flown)
        values = [
            [
                self._fitness(first, [flown[i, j * n + k] for k in range(n)])
                for j in range(seen)
                if all((i, j * n + k) in flown for k in range(n))
            ]
            for i in range(candidates)
        ]
        return remaining_candidates(values, alive, last - seen, first.maximise)

    def _fitness(self, objective: Objective, flights: Sequence[Mapping[str, Any] | None]) -> float | None:
        """Fitness of a candidate from its flights in their order: over the seeds of each scenario, then over these."""
        n = len(self.study.scenarios)
        each = [objective.of_candidate(flights[place::n]) for place in range(n)]
        return combine_scenarios(each, self.study.over_scenarios, objective.maximise)


def _shortened(scenario: Scenario, share: float) -> dict[str, float]:
    """Parameters of a flight that make it shorter than the scenario's; none for a whole one."""
    return {} if share == 1.0 else {DURATION_COLUMN: share * scenario.flight.duration}


def _seeds(study: Study, batch: CandidateBatch, candidates: int) -> list[list[int]]:
    """Seeds (candidate, repeat) of a generation of the search."""
    k, most = study.seeds(batch.generation), max(study.whole("seeds"), study.whole("late_seeds"))
    before = sum(study.population(run) for run in range(batch.run)) * study.whole("generations")
    first = before + batch.generation * study.population(batch.run)
    how = study.search.random_numbers
    return [
        [study.seed(0, most * {"fresh": first + i, "generation": first, "study": 0}[how] + j) for j in range(k)]
        for i in range(candidates)
    ]
