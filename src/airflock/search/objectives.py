"""Fitness of a candidate: from the order parameters of its flights to one number, or to several for a Pareto front."""

import hashlib
import math
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.certificates import EventLimit, parse_limits
from airflock.scenarios import Scenario, import_user_file
from airflock.support import (
    ErrorCollector,
    RuleError,
    ScenarioError,
    StudyError,
    describe_error,
    expand_path,
    is_file,
    is_number,
    shortened,
    suggest,
)

OVER_SEEDS = ("mean", "worst", "quantile")
UserFitness = Callable[
    [Mapping[str, Any]], float
]  # a fitness of the user's own, from the order parameters of one flight


@dataclass(frozen=True)
class Objective:
    """One aim: a larger (or smaller) order parameter, over the seeds of a candidate.

    name       : an order parameter, or the name of a function of the user's own
    maximise   : False where less is better
    own, text  : a function of the user's own, and a hash of its text; file : that holds it, if it is one
    over_seeds : mean, worst case, or the value that all but a share `quantile` of the flights reach
    """

    name: str
    maximise: bool = True
    over_seeds: str = "mean"
    quantile: float = 0.1
    own: UserFitness | None = None
    text: str = ""
    file: str = ""

    def of_flight(self, values: Mapping[str, Any]) -> float:
        """Value of one flight; nan where it is not finite, or where a function of the user's own fails."""
        if self.own is None and self.name not in values:
            known = ", ".join(key for key, value in values.items() if isinstance(value, (int, float)))
            raise StudyError(f"objective {self.name}: unknown order parameter; known: {known}")
        if self.own is not None:
            value = user_fitness(self.own, self.name, values)[0]
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
        # fsum rounds once: a mean must not depend on the order in which flights have landed.
        return math.fsum(found) / len(found)

    def error_of_flight(self, values: Mapping[str, Any]) -> tuple[str, bool]:
        """Return how the user's own function fails for a flight, "" where it does not; and True if in its numbers."""
        return ("", False) if self.own is None else user_fitness(self.own, self.name, values)[1:]


def user_fitness(function: UserFitness, name: str, values: Mapping[str, Any]) -> tuple[float, str, bool]:
    """Call the user's own function for one flight; an error in it becomes nan and one line with its place.

    The last value is True for an error of arithmetic, which a flight may cause; others are rather
    in the text.
    """
    try:
        return float(function(values)), "", False
    except (Exception, SystemExit) as error:  # the user's own function may fail in any way
        last = traceback.extract_tb(error.__traceback__)[-1]
        code = getattr(function, "__code__", None)
        place = f"{last.filename}:{last.lineno}"
        if last.filename == __file__ and code is not None:  # it returned, but no number
            place = f"{code.co_filename}:{code.co_firstlineno}"
        line = f"objective {name}: {place}: {describe_error(error)}"
        return math.nan, line, isinstance(error, ArithmeticError)


def candidate_losses(
    fitness_rows: Sequence[Sequence[float | None]], objectives: Sequence[Objective]
) -> NDArray[np.float64]:
    """Return losses (candidate, objective) to minimise; a failed candidate is worse than all of its generation."""
    signs = [-1.0 if objective.maximise else 1.0 for objective in objectives]
    table = np.array(
        [[math.nan if v is None else s * v for s, v in zip(signs, row, strict=True)] for row in fitness_rows], float
    )
    for column in table.T:
        lost = np.isnan(column)
        worst = column[~lost].max() if (~lost).any() else 0.0
        # Optimisers here rank candidates, so any loss beyond the worst will do.
        column[lost] = worst + 1.0
    return table


KEYS = ("maximise", "minimise", "limits", "over_seeds", "quantile", "own", "source", "note")


def read_objectives(
    table: Any, scenario: Scenario, errors: ErrorCollector, folder: Path | None = None, *, trust: bool = False
) -> tuple[Objective, ...]:
    """Read objectives from a table, by default the scenario's usual fitness.

    trust : whether the file of functions that objective.own names may run
    """
    if not isinstance(table, Mapping):
        errors.add(f"objective = {table!r} is not a table; write objective.maximise = {table!r}")
        return ()
    for key in table:
        if key not in KEYS:
            hint = suggest(key, KEYS, f"known: {', '.join(KEYS)}", prefix="objective.")
            errors.add(f"objective.{key}: unknown key; {hint}")
    over, quantile = table.get("over_seeds", "mean"), table.get("quantile", 0.1)
    if not isinstance(over, str) or over not in OVER_SEEDS:
        errors.add(f"objective.over_seeds = {over!r} is none of {', '.join(OVER_SEEDS)}")
    if not is_number(quantile) or not 0.0 <= quantile <= 1.0:
        errors.add(f"objective.quantile = {quantile!r} lies outside [0, 1]")
        quantile = 0.1
    own, text, file = _own(table.get("own"), folder, errors, trust)
    goals: list[tuple[str, bool]] = []
    for key in ("maximise", "minimise"):
        named = table.get(key, [])
        names = [named] if isinstance(named, str) else named
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            errors.add(f"objective.{key} = {named!r} is neither a name nor a list of names")
            continue
        goals += [(name, key == "maximise") for name in names]
    found = tuple(
        Objective(name, more, str(over), float(quantile), own.get(name), *((text, file) if name in own else ()))
        for name, more in goals or [(scenario.metrics.rule.best or "fitness", True)]
    )
    if text and not any(objective.own for objective in found):
        module = Path(str(table["own"])).stem
        names = [name for name, function in own.items() if getattr(function, "__module__", "") == module]
        write = f"write objective.maximise = '{names[0]}'" if names else "it holds no function"
        others = f" (it holds {', '.join(names)})" if len(names) > 1 else ""
        errors.add(f"objective.own = {table['own']!r}: no objective names a function of this file; {write}{others}")
    return found


def read_limits(table: Any, scenarios: Sequence[Scenario], errors: ErrorCollector) -> tuple[EventLimit, ...]:
    """Read the limits that candidates are to keep in all scenarios, from the key `limits` of a table."""
    texts = table.get("limits", []) if isinstance(table, Mapping) else []
    texts = [texts] if isinstance(texts, str) else texts
    if not isinstance(texts, list | tuple) or not all(isinstance(text, str) for text in texts):
        errors.add(f"objective.limits = {texts!r} is neither a limit nor a list of limits, as 'r_min<3 at 0.01/h'")
        return ()
    found: tuple[EventLimit, ...] = ()
    for scenario in scenarios if texts else ():
        with errors.collecting("objective.limits: "):
            parsed = parse_limits(list(texts), scenario)
            found = found or parsed
    how = "does not say how rarely; write {} at 0.01/h, for instance"
    unsaid = [limit for limit in found if limit.rate is None]
    errors.add(*(f"objective.limits: limit '{limit.text}': {how.format(limit.event)}" for limit in unsaid))
    return found


def _own(
    name: Any, folder: Path | None, errors: ErrorCollector, trust: bool
) -> tuple[dict[str, UserFitness], str, str]:
    """Return the functions of a user's own file by name, a hash of its text, and its place."""
    if name is None:
        return {}, "", ""
    path = expand_path(str(name)) if folder is None else folder / expand_path(str(name))
    if path.suffix != ".py" or not is_file(path):
        errors.add(f"objective.own = {name!r}: no such Python file")
        return {}, "", ""
    try:
        text = hashlib.sha256(path.read_bytes()).hexdigest()[:12]
        module = import_user_file(path, f"objective.own = {name!r}", trust=trust)
    except (RuleError, ScenarioError) as error:
        errors.add(*(error.errors if isinstance(error, ScenarioError) else [f"objective.own: {error}"]))
        return {}, "", ""
    own = {key: value for key, value in vars(module).items() if callable(value) and not key.startswith("_")}
    return own, text, str(path)
