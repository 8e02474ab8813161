"""Fitness of a candidate: from the order parameters of its flights to one number, or to several for a Pareto front."""

import math
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.support import StudyError, describe_error, shortened

OVER_SEEDS = ("mean", "worst", "quantile")
UserFitness = Callable[
    [Mapping[str, Any]], float
]  # a fitness of the user's own, from the order parameters of one flight


@dataclass(frozen=True)
class Objective:
    """One aim: a larger (or smaller) order parameter, over the seeds of a candidate.

    name       : an order parameter, or the name of a function of the user's own
    maximise   : False where less is better
    own, text  : a function of the user's own, and a hash of its text
    over_seeds : mean, worst case, or the value that all but a share `quantile` of the flights reach
    """

    name: str
    maximise: bool = True
    over_seeds: str = "mean"
    quantile: float = 0.1
    own: UserFitness | None = None
    text: str = ""

    def of_flight(self, values: Mapping[str, Any]) -> float:
        """Value of one flight; nan where it is not finite."""
        if self.own is None and self.name not in values:
            known = ", ".join(key for key, value in values.items() if isinstance(value, (int, float)))
            raise StudyError(f"objective {self.name}: unknown order parameter; known: {known}")
        if self.own is not None:
            value = user_fitness(self.own, self.name, values)
        elif isinstance(values[self.name], (int, float)):
            value = float(values[self.name])
        else:
            raise StudyError(f"objective {self.name} = {shortened(repr(values[self.name]), 80)} is not a number")
        return value if math.isfinite(value) else math.nan

    def of_candidate(self, flights: Sequence[Mapping[str, Any] | None]) -> float | None:
        """Value over the flights of a candidate; None if one of them failed."""
        if any(values is None for values in flights):
            return None
        found = [self.of_flight(values) for values in flights if values is not None]
        if not found or not all(math.isfinite(value) for value in found):
            return None
        if self.over_seeds == "worst":
            return min(found) if self.maximise else max(found)
        if self.over_seeds == "quantile":
            return float(np.quantile(found, self.quantile if self.maximise else 1.0 - self.quantile))
        return math.fsum(found) / len(found)


def user_fitness(function: UserFitness, name: str, values: Mapping[str, Any]) -> float:
    """What a function of the user's own gives for one flight; whatever goes wrong in it is one line with its place."""
    try:
        return float(function(values))
    except Exception as fault:  # the user's own function may fail in any way
        last = traceback.extract_tb(fault.__traceback__)[-1]
        code = getattr(function, "__code__", None)
        place = f"{last.filename}:{last.lineno}"
        if last.filename == __file__ and code is not None:  # it returned, but no number
            place = f"{code.co_filename}:{code.co_firstlineno}"
        raise StudyError(f"objective {name}: {place}: {describe_error(fault)}") from fault


def candidate_losses(
    fitness_rows: Sequence[Sequence[float | None]], objectives: Sequence[Objective]
) -> NDArray[np.float64]:
    """What an optimiser minimises (candidate, objective). A failed candidate is worse than all of its generation."""
    signs = [-1.0 if objective.maximise else 1.0 for objective in objectives]
    table = np.array(
        [[math.nan if v is None else s * v for s, v in zip(signs, row, strict=True)] for row in fitness_rows], float
    )
    for column in table.T:
        lost = np.isnan(column)
        worst = column[~lost].max() if (~lost).any() else 0.0
        column[lost] = worst + 1.0
    return table
