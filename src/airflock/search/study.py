"""Study: an optimisation as data: a scenario, a space, what is better, and how to search; from a file or by name."""

import hashlib
import math
import os
import re
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock import __version__
from airflock.certificates import EventLimit, parse_limits
from airflock.core import Parameters as Record, Quantity, choice, declarations, format_with_unit, number_names, quantity
from airflock.runs import (
    SearchAxis,
    SearchSpace,
    TiedParameter,
    declared_numbers,
    default_scale,
    fingerprint,
    full_space,
    requested_scenario,
    unpublished,
)
from airflock.scenarios import (
    Scenario,
    files_of_laws,
    formats,
    html_table,
    import_user_file,
    largest_extension,
    load,
    presets,
    scenario_variant,
    schema,
    tells_of_study,
)
from airflock.search.optimisers import ALGORITHMS, MULTI_OBJECTIVE
from airflock.support import (
    ErrorCollector,
    RuleError,
    ScenarioError,
    StudyError,
    TextError,
    as_error,
    describe_error,
    expand_path,
    is_file,
    is_number,
    read_toml,
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
    own, text  : a function of the user's own, and a hash of its text; file : that holds it, if it
                 is one
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


OBJECTIVE_KEYS = ("maximise", "minimise", "limits", "over_seeds", "quantile", "own", "source", "note")


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
        if key not in OBJECTIVE_KEYS:
            hint = suggest(key, OBJECTIVE_KEYS, f"known: {', '.join(OBJECTIVE_KEYS)}", prefix="objective.")
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
    for name in ("flights", "start", "spread", "averages", "windows") if search.algorithm != "cmaes" else ():
        if (value := getattr(search, name)) != getattr(SearchSettings(), name):
            shown = repr(value) if isinstance(value, str) else f"{value:g}"
            errors.append(
                f"search.{name} = {shown} is for algorithm cmaes, but search.algorithm = '{search.algorithm}'"
            )
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


KEYS = ("title", "scenario", "scenarios", "over_scenarios", "set", "space", "objective", "search")
LAYOUT = 1  # of the study folder; raised whenever an older folder could not be continued


@dataclass(frozen=True)
class Study:
    """An optimisation: everything that decides its result.

    others : further scenarios in which each candidate flies; over_scenarios: mean or worst of them
             all
    labels : what to call each scenario, the first included
    limits : events and their largest rates; candidates that keep them rank before all others
    """

    scenario: Scenario
    space: SearchSpace
    objectives: tuple[Objective, ...]
    search: SearchSettings
    title: str = ""
    device: str = "cpu"  # cpu or cuda: they agree to rounding, and a study's identity is to the bit
    notes: tuple[str, ...] = ()  # where its bounds come from, for a person to read
    others: tuple[Scenario, ...] = ()
    over_scenarios: str = "mean"
    labels: tuple[str, ...] = ()
    limits: tuple[EventLimit, ...] = ()
    kind = "study"

    def __repr__(self) -> str:
        return f"<{self._summary}>"

    @property
    def _summary(self) -> str:
        """Goals and flights in one sentence."""
        q, goals = self.search, ", ".join(objective.name for objective in self.objectives)
        return (
            f"Study of {', '.join(s.name for s in self.scenarios)}: {len(self.space.axes)} parameters for {goals}, "
            f"{q.generations:g} generations of {q.population:g} candidates, {q.seeds:g} flight"
            f"{'s' * (q.seeds > 1)} each"
        )

    def _repr_html_(self) -> str:
        """Return a table of the varied parameters, for a notebook."""
        rows = [(a.key, f"{a.low:g} … {a.high:g}", a.unit, a.scale) for a in self.space.axes]
        return f"<p><b>{escape(self._summary)}</b></p>{html_table(('parameter', 'range', 'unit', 'scale'), rows)}"

    @property
    def scenarios(self) -> tuple[Scenario, ...]:
        """Scenarios in which each candidate flies."""
        return (self.scenario, *self.others)

    def whole(self, name: str) -> int:
        """Return a setting of the search as a whole number."""
        return int(getattr(self.search, name))

    def seeds(self, generation: int) -> int:
        """Return the flights of a candidate in a generation: from `seeds` up to `late_seeds` in equal ratios."""
        first, last = self.search.seeds, self.search.late_seeds
        begin, end = CONSTANT_SEEDS_SHARE * self.search.generations, max(1.0, self.search.generations - 1.0)
        # Early candidates differ much and one flight ranks them; late ones differ by less than
        # chance does.
        grown = min(max(0.0, (generation - begin) / max(end - begin, 1.0)), 1.0)
        return round(float(first * (max(first, last) / first) ** grown))

    def seed(self, purpose: int, index: int) -> int:
        """Return the seed of a flight: `purpose` 0 searches, others are further parts; never a small number."""
        return ((self.whole("seed") + 1) << SEED_BITS) + (purpose << (SEED_BITS - 4)) + index

    def document(self) -> dict[str, Any]:
        """Return the study as plain values, for the request in its folder and for the comparison on resume."""
        q = self.search
        return {
            "layout": LAYOUT,
            "airflock": __version__,
            "rules": " ".join(fingerprint(scenario, int(q.precision)) for scenario in self.scenarios),
            "device": self.device,
            "title": self.title,
            "name": self.scenario.name,
            "search": {
                name: int(value) if isinstance(value, float) and value.is_integer() else value
                for name, value in ((n, getattr(q, n)) for n in q.__dataclass_fields__)
                if name != "reserve" or self.limits
            },
            "objective": [
                {
                    "name": o.name,
                    "maximise": o.maximise,
                    "over_seeds": o.over_seeds,
                    "quantile": o.quantile,
                    **({"own": o.text} if o.own else {}),
                }
                for o in self.objectives
            ],
            **({"limits": [limit.text for limit in self.limits]} if self.limits else {}),
            "space": self.space.document(),
            "scenario": unpublished(self.scenario),
            **({"over_scenarios": self.over_scenarios, "labels": list(self.labels)} if self.others else {}),
            **{f"scenario_{i}": unpublished(scenario) for i, scenario in enumerate(self.others, 2)},
        }

    @property
    def also(self) -> dict[str, Any]:
        """Names and files by which `study_of_request` finds what the document does not hold."""
        found: dict[str, Any] = {"scenarios": [each.name for each in self.scenarios]} if self.others else {}
        files = [objective.file for objective in self.objectives if objective.file]
        found |= {"own": files[0]} if files else {}
        # A file groups keys by section, and a point is read in the order of the axes.
        keys = [key.rpartition(".") for key in self.space.keys]
        sections = ["", *dict.fromkeys(section for section, _, _ in keys)]
        in_order = sorted(keys, key=lambda key: sections.index(key[0])) == keys
        return found if in_order else found | {"order": list(self.space.keys)}


def shipped_studies() -> dict[str, Path]:
    """Return name → file of each shipped study; a study for a preset bears the preset's name."""
    return dict(files_of_laws("studies"))


def is_study(name: str | os.PathLike[str]) -> bool:
    """Return True if a name is that of a study and not of a scenario; presets win over shipped studies."""
    path = expand_path(name)
    if str(name) in shipped_studies() and str(name) not in presets():
        return True
    if path.suffix != ".toml" or not is_file(path):
        return False
    try:
        return tells_of_study(read_toml(path))
    except (TextError, OSError):  # the next reader says what is wrong
        return False


def load_study(
    name: str | os.PathLike[str],
    *,
    settings: Mapping[str, Any] | None = None,
    search: Mapping[str, Any] | None = None,
    tables: Mapping[str, Any] | None = None,
    limits: Sequence[str] = (),
    trust: bool = False,
) -> Study:
    """Load a study from a file or by the name of a shipped one, or make one of a scenario with default bounds.

    settings : keys of the scenario to change, such as "duration"
    search   : keys of the table [search] to change, such as "population"
    tables   : tables "space" or "objective" that replace the file's
    limits   : events and their largest rates, in place of the file's
    trust    : True lets code run that the files name: a law, fitness functions
    Raises ScenarioError with one line for each error.
    """
    known = shipped_studies()
    text = str(name)
    path = known.get(text) or expand_path(text)
    document: Mapping[str, Any] = {}
    with as_error(path):
        if path.suffix == ".toml" and is_file(path):
            document = read_toml(path)
        folder: Path | None = path.parent
        where = text if text in known else str(path)
        if not tells_of_study(document):
            # A scenario is a study without a space and an objective: both are defaults then.
            document, folder, where = {"scenario": text}, None, text
        document = {**document, **(tables or {})}
        return make_study(document, where, settings=settings, search=search, folder=folder, limits=limits, trust=trust)


def study_of_request(
    held: Mapping[str, Any], given: Study | None, *, settings: Mapping[str, Any] | None, search: Mapping[str, Any],
    limits: Sequence[str], objectives: tuple[Objective, ...] | None, trust: bool,
) -> Study:  # fmt: skip
    """Return the study that a folder holds, with what a call that resumes it gives besides.

    given      : the same study as this call names it, if it does; of use where an older folder
                 keeps no names
    objectives : in place of those in the folder
    Raises ScenarioError or StudyError where that cannot be searched here.
    """
    also = held.get("also", {})
    names = also.get("scenarios") or ([each.name for each in given.scenarios] if given else [held["name"]])
    documents = [value for key, value in held.items() if re.fullmatch(r"scenario(_\d+)?", key)]
    if names[0] != held["name"] or len(names) != len(documents):
        raise StudyError(f"a study of {held['name']} and {len(documents) - 1} more, not of {', '.join(names)}")
    scenarios = [
        scenario_variant(requested_scenario(document, name, trust=trust), settings, trust=trust)
        for name, document in zip(names, documents, strict=True)
    ]
    goals = held["objective"]
    table: dict[str, Any] = {key: goals[0][key] for key in ("over_seeds", "quantile")}
    table |= {"limits": held.get("limits", []), **({"own": also["own"]} if "own" in also and not objectives else {})}
    if any("own" in goal for goal in goals) and not (objectives or "own" in also):
        raise StudyError("its fitness is a function of your own; give it again, or name the study file that holds it")
    for key, is_maximised in (("maximise", True), ("minimise", False)):
        table[key] = [goal["name"] for goal in goals if goal["maximise"] is is_maximised]
    document = {key: held[key] for key in ("title", "search", "space", "over_scenarios") if key in held}
    where = ", ".join(names)
    study = make_study(
        {**document, "objective": table}, where, search=search, scenario=scenarios, limits=limits, trust=trust
    )
    order = also.get("order", study.space.keys)
    axes = sorted(study.space.axes, key=lambda axis: order.index(axis.key))
    return replace(
        study, labels=tuple(held.get("labels", study.labels)), device=held["device"],
        objectives=objectives or study.objectives, space=replace(study.space, axes=tuple(axes)),
    )  # fmt: skip


def make_study(
    document: Mapping[str, Any],
    where: str = "study",
    *,
    settings: Mapping[str, Any] | None = None,
    search: Mapping[str, Any] | None = None,
    folder: Path | None = None,
    scenario: Scenario | Sequence[Scenario] | None = None,
    limits: Sequence[str] = (),
    trust: bool = False,
) -> Study:
    """Make a study from a nested dict; `trust` lets code run that it names.

    scenario : in place of its key of that name; or several, in place of `scenarios`
    limits   : in place of those of its objective; each candidate then flies twice at least, unless
               `search` has seeds
    """
    document, errors = formats.to_current_format(document, where), ErrorCollector()
    for key in document:
        if key not in KEYS:
            of_settings = key in {field.name for field in fields(SearchSettings)}
            hint = f"did you mean search.{key}?" if of_settings else suggest(key, KEYS, f"known: {', '.join(KEYS)}")
            errors.add(f"{key}: unknown key; {hint}")
    table = document.get("search", {})
    table = {**table, **(search or {})} if isinstance(table, Mapping) else table
    found, _ = schema.read_section("search", table, SearchSettings, errors)
    if scenario is None:
        of_scenarios = ErrorCollector()
        scenarios, labels = read_scenarios(document, settings or {}, folder, trust, of_scenarios)
        if of_scenarios:
            # An error of a scenario file may begin with the name of the study's file already.
            lines = (error.removeprefix(f"{where}: ") for error in (*errors.errors, *of_scenarios.errors))
            raise ScenarioError([f"{where}: {error}" for error in lines])
    else:
        scenarios = (scenario,) if isinstance(scenario, Scenario) else tuple(scenario)
        labels = distinct_labels([each.name for each in scenarios])
    space: SearchSpace | None
    notes: list[str] = []
    if "space" in document:
        space = read_space(document["space"], scenarios[0], errors)
    else:
        space, notes = common_space(scenarios)
    over, goals = document.get("over_scenarios", "mean"), document.get("objective", {})
    errors.add(*joint_errors(scenarios, labels, space, over))
    objectives = read_objectives(goals, scenarios[0], errors, folder, trust=trust)
    kept = read_limits({"limits": list(limits)} if limits else goals, scenarios, errors)
    if found is not None:
        # One flight has no spread, and limits are judged by the spread of flights.
        if limits and "seeds" not in (search or {}) and found.seeds < 2.0:
            found = replace(found, seeds=2.0)
        errors.add(*search_errors(found, objectives, space, limits=bool(kept)))
    errors.raise_errors(where)
    assert space is not None and found is not None, "what could not be read is an error"
    return Study(
        scenarios[0], space, objectives, found, str(document.get("title", "")), notes=(*notes, *errors.notes),
        others=scenarios[1:], over_scenarios=str(over), labels=labels, limits=kept,
    )  # fmt: skip


OVER_SCENARIOS = ("mean", "worst")
ENTRY_KEYS = ("scenario", "set")  # of an entry that is a table


def combine_scenarios(values: Sequence[float | None], over_scenarios: str, maximise: bool) -> float | None:
    """One number from that of each scenario: their mean, or the worst; None if a flight failed in one of them."""
    if any(value is None for value in values):
        return None
    found = [value for value in values if value is not None]
    if over_scenarios == "worst":
        return min(found) if maximise else max(found)
    return math.fsum(found) / len(found)


def read_scenarios(
    document: Mapping[str, Any], settings: Mapping[str, Any], folder: Path | None, trust: bool, errors: ErrorCollector
) -> tuple[tuple[Scenario, ...], tuple[str, ...]]:
    """Read the scenarios of a study's document, and how each is called.

    settings : keys to change in all of them, as the document's table `set` does
    """
    keys, one = document.get("set", {}), document.get("scenario")
    entries = document.get("scenarios", [one])
    if not isinstance(keys, Mapping):
        errors.add(f"set = {shortened(repr(keys), 80)} is not a table")
    elif "scenarios" not in document and not isinstance(one, str):
        given = f" = {shortened(repr(one), 80)} is not a name" if "scenario" in document else " is missing"
        errors.add(f'scenario{given}; write scenario = "NAME", of a preset or a scenario file')
    elif "scenarios" in document and "scenario" in document:
        errors.add("scenario and scenarios are both given; leave out one")
    elif not isinstance(entries, list) or not entries:
        errors.add(f"scenarios = {shortened(repr(entries), 80)} is not a list of presets, files or tables")
    found: list[Scenario] = []
    labels: list[str] = []
    for i, entry in enumerate(() if errors else entries):
        try:
            name, own = _entry(entry, i)
            beside = folder / name if folder is not None else None
            path = beside if beside is not None and is_file(beside) else name
            found.append(load(path, {**keys, **own, **settings}, trust=trust))
        except ScenarioError as error:
            errors.add(*error.errors)
            continue
        detail = ", ".join(f"{key} = {value}" for key, value in own.items())
        labels.append(f"{name} with {detail}" if detail else name)
    return tuple(found), distinct_labels(labels)


def distinct_labels(labels: Sequence[str]) -> tuple[str, ...]:
    """Return labels with a number added where two are equal."""
    return tuple(f"{label} ({i + 1})" if label in labels[:i] else label for i, label in enumerate(labels))


def _entry(entry: Any, number: int) -> tuple[str, Mapping[str, Any]]:
    """Return name and own settings of an entry of `scenarios`. Raises ScenarioError, all errors together."""
    at = f"scenarios[{number}]"
    if isinstance(entry, str):
        return entry, {}
    if not isinstance(entry, Mapping) or not isinstance(entry.get("scenario"), str):
        how = 'write a name, or { scenario = "NAME", set = { "radio.delay" = 1.0 } }'
        raise ScenarioError([f"{at} = {shortened(repr(entry), 80)} names no scenario; {how}"])
    errors = [f"{at}.{key}: unknown key; known: {', '.join(ENTRY_KEYS)}" for key in entry if key not in ENTRY_KEYS]
    own = entry.get("set", {})
    if not isinstance(own, Mapping):
        errors.append(f"{at}.set = {shortened(repr(own), 80)} is not a table")
    if errors:
        raise ScenarioError(errors)
    return str(entry["scenario"]), own


def common_space(scenarios: Sequence[Scenario]) -> tuple[SearchSpace, list[str]]:
    """Return the default space of the first scenario, with bounds that hold those of the others; and notes."""
    # One set of numbers has to fly in all scenarios, so the search sees every region that is usual
    # in one of them.
    space, notes = default_space(scenarios[0])
    axes = {axis.key: axis for axis in space.axes}
    for scenario in scenarios[1:]:
        more, more_notes = default_space(scenario)
        notes += [note for note in more_notes if note not in notes]
        for axis in more.axes:
            known = axes.get(axis.key, axis)
            axes[axis.key] = replace(known, low=min(known.low, axis.low), high=max(known.high, axis.high))
    return SearchSpace(tuple(axes.values())), notes


def joint_errors(
    scenarios: Sequence[Scenario], labels: Sequence[str], space: SearchSpace | None, over_scenarios: Any
) -> list[str]:
    """Why one set of numbers cannot be searched for these scenarios, one line each."""
    errors = []
    if over_scenarios not in OVER_SCENARIOS:
        errors.append(f"over_scenarios = {over_scenarios!r} is none of {', '.join(OVER_SCENARIOS)}")
    for label, scenario in zip(labels[1:], scenarios[1:], strict=True):
        first, law = scenarios[0].model.name, scenario.model.name
        if law != first:
            errors.append(f"scenarios: {label} flies {law}, {labels[0]} {first}; one set of numbers needs one law")
            continue
        known = declared_numbers(scenario)
        keys = () if space is None else (*space.keys, *space.fixed, *space.tied)
        errors += [f"space.{key}: {label} has no such number" for key in keys if key not in known]
    return errors


ENTRY = ("low", "high", "unit", "scale", "integer", "above", "fixed", "tied", "factor", "offset", "source", "note")


def read_space(table: Any, scenario: Scenario, errors: ErrorCollector) -> SearchSpace | None:
    """Read the space from the table [space] of a study file; None where it has errors. Only what is listed varies."""
    known, wrong = declared_numbers(scenario), ErrorCollector()
    axes: list[SearchAxis] = []
    fixed: dict[str, float] = {}
    tied: dict[str, TiedParameter] = {}
    for key, entry in _entries(table, wrong).items():
        if key not in known:
            hint = suggest(key, known, lead="; ", prefix="space.")
            if key.startswith("aero.") and not scenario.is_aerodynamic:
                hint = f", which has no section [aero]; --set {key}=VALUE adds drag descent to it"
            wrong.add(f"space.{key} is not a number of {scenario.name}{hint}")
        elif of_entry := _entry_errors(key, entry, known[key][0], known):
            wrong.add(*of_entry)
        elif "fixed" in entry:
            fixed[key] = float(entry["fixed"])
        elif "tied" in entry:
            tie = float(entry.get("factor", 1.0)), float(entry.get("offset", 0.0))
            tied[key] = TiedParameter(str(entry["tied"]), *tie)
        else:
            axes.append(_axis(key, entry, known[key][0]))
    for axis in axes:  # a number that another one must stay above takes part even if it does not vary
        other = axis.above
        if other in known and other not in {a.key for a in axes} | set(fixed) and known[other][1] is not None:
            fixed[other] = float(known[other][1] or 0.0)
    space = SearchSpace(tuple(axes), fixed, tied)
    wrong.add(*_errors_between(space, known, bool(wrong)))
    return None if errors.merge(wrong) else space


def _axis(key: str, entry: Mapping[str, Any], how: Quantity) -> SearchAxis:
    low, high = float(entry.get("low", how.low)), float(entry.get("high", how.high))
    scale = str(entry.get("scale", default_scale(low, high)))
    return SearchAxis(
        key, how.unit, low, high, scale, how.whole or bool(entry.get("integer", False)), str(entry.get("above", ""))
    )


def _entries(table: Any, errors: ErrorCollector) -> dict[str, Mapping[str, Any]]:
    """Return key → entry, from sections or dotted keys."""
    if not isinstance(table, Mapping):
        errors.add(f"space = {table!r} is not a table of keys")
        return {}
    found: dict[str, Any] = {}
    for section, entries in table.items():
        if not isinstance(entries, Mapping) or "." in section or (entries and set(entries) <= set(ENTRY)):
            found[section] = entries
        else:
            found |= {f"{section}.{name}": entry for name, entry in entries.items()}
    no_tables = {key: entry for key, entry in found.items() if not isinstance(entry, Mapping)}
    errors.add(
        *(f"space.{k} = {entry!r} is not a table; write {{ low = ..., high = ... }}" for k, entry in no_tables.items())
    )
    return {key: entry for key, entry in found.items() if key not in no_tables}


def _entry_errors(key: str, entry: Mapping[str, Any], how: Quantity, known: Mapping[str, Any]) -> list[str]:
    """Return the errors of one entry by itself."""
    errors = []
    for name, value in entry.items():
        numeric = is_number(value) and math.isfinite(value)
        if name not in ENTRY:
            errors.append(f"space.{key}.{name}: unknown key; {suggest(name, ENTRY, ', '.join(ENTRY))}")
        elif name in ("low", "high", "fixed", "factor", "offset") and not numeric:
            errors.append(f"space.{key}.{name} = {value!r} is not a number; give {how.span}")
        elif name in ("low", "high", "fixed") and not how.low <= value <= how.high:
            errors.append(
                f"space.{key}.{name} = {format_with_unit(f'{value:g}', how.unit)} lies outside the declared {how.span}"
            )
        elif name == "unit" and value != how.unit:
            errors.append(f"space.{key}.unit = {value!r}: the unit is {how.unit}")
        elif name == "scale" and value not in ("linear", "log"):
            errors.append(f"space.{key}.scale = {value!r} is none of linear, log")
        elif name == "integer" and not isinstance(value, bool):
            errors.append(f"space.{key}.integer = {value!r} is none of true, false")
        elif how.whole and (name == "tied" or (name == "integer" and not value)):
            errors.append(f"space.{key}.{name} = {str(value).lower()}: only whole numbers make sense")
        elif how.whole and name == "fixed" and value != int(value):
            errors.append(f"space.{key}.fixed = {value:g} is not a whole number")
        elif name in ("above", "tied") and not (isinstance(value, str) and value in known):
            errors.append(f"space.{key}.{name} = {value!r} is not a number{suggest(value, known, lead='; ')}")
    if errors or "fixed" in entry or "tied" in entry:
        return errors
    return _range_errors(_axis(key, entry, how))


def _range_errors(axis: SearchAxis) -> list[str]:
    where, span = f"space.{axis.key}", format_with_unit(f"[{axis.low:g}, {axis.high:g}]", axis.unit)
    if not axis.low < axis.high:
        word = "empty" if axis.low == axis.high else "inverted"
        return [f"{where}: the range {span} is {word}; low must lie below high"]
    if axis.scale == "log" and axis.low <= 0.0:
        return [f"{where}: low = {format_with_unit(f'{axis.low:g}', axis.unit)} must be above 0 on a logarithmic scale"]
    if axis.integer and math.floor(axis.high) < math.ceil(axis.low):
        return [f"{where}: the range {span} holds no whole number"]
    return []


def _errors_between(
    space: SearchSpace, known: Mapping[str, tuple[Quantity, float | None]], is_reported: bool
) -> list[str]:
    """Ties and orders that cannot hold."""
    errors = []
    axes = {axis.key: axis for axis in space.axes}
    for axis in space.axes:
        # Followed to its end: numbers that lie above each other in a circle have no order.
        chain = [axis.key]
        while axes.get(chain[-1]) and axes[chain[-1]].above:
            chain.append(axes[chain[-1]].above)
            if chain[-1] in chain[:-1]:
                errors.append(f"space.{axis.key}: above runs in a circle: {' > '.join(chain)}")
                break
        if axis.above and axis.above not in axes and axis.above not in space.fixed:
            errors.append(f"space.{axis.key}.above = {axis.above!r} neither varies nor is fixed")
        lower = axes[axis.above].high if axis.above in axes else space.fixed.get(axis.above, axis.low)
        if axis.above and lower > axis.high:
            high = format_with_unit(f"{axis.high:g}", axis.unit)
            errors.append(f"space.{axis.key}.high = {high} lies below {axis.above} = {lower:g}")
    for key, tie in space.tied.items():
        if tie.of not in axes and tie.of not in space.fixed:
            errors.append(f"space.{key}.tied = {tie.of!r} neither varies nor is fixed")
            continue
        # A tie is a straight line, so its extremes are at the ends of the range.
        ends = (axes[tie.of].low, axes[tie.of].high) if tie.of in axes else (space.fixed[tie.of],)
        how = known[key][0]
        for end in ends:
            value = tie.factor * end + tie.offset
            if not how.low <= value <= how.high:
                reached = format_with_unit(f"{value:g}", how.unit)
                errors.append(f"space.{key} = {reached} at {tie.of} = {end:g} lies outside {how.span}")
    if not space.axes and not is_reported:
        errors.append("space: nothing varies; give at least one key low and high")
    return errors


AROUND = 10.0  # factor about a scenario's own value, where no study is shipped
SCALED = {"m": 1, "m/s": 1}  # units that grow with the speed; times and rates stay


def default_space(scenario: Scenario) -> tuple[SearchSpace, list[str]]:
    """The numbers of the model that matter, between bounds in which it may fly; and what was done, for a person."""
    dead = unread_keys(scenario)
    searched = [axis for axis in full_space(scenario).axes if axis.key not in dead]
    found = _nearest_study(scenario)
    if found is None:
        axes = [_around(scenario, axis) for axis in searched]
        notes = [f"no study of {scenario.model.name} is shipped: bounds a factor of {AROUND:g} about its own values"]
    else:
        name, ratio, known = found
        # what the study held fixed stays as the scenario has it
        axes = [_scaled(scenario, known[axis.key], axis, ratio) for axis in searched if axis.key in known]
        scaled = f", lengths and speeds times {ratio:.3g}" if ratio != 1.0 else ""
        notes = [f"bounds of the study {name}{scaled}"]
    if dead:
        notes.append(f"not searched, because nothing reads them here: {', '.join(sorted(dead))}")
    keys = {axis.key for axis in axes}  # an order above a number that is not searched no longer holds
    return SearchSpace(tuple(a if a.above in keys or not a.above else replace(a, above="") for a in axes)), notes


def shipped_study_axes(scenario: Scenario) -> dict[str, tuple[float, float]]:
    """Bounds of the shipped study of the same law that is nearest in speed, by key; none where no study is shipped."""
    _, ratio, known = _nearest_study(scenario) or ("", 1.0, {})
    scaled = [_scaled(scenario, known[own.key], own, ratio) for own in full_space(scenario).axes if own.key in known]
    return {axis.key: (axis.low, axis.high) for axis in scaled}


def unread_keys(scenario: Scenario) -> set[str]:
    """Keys of the model's numbers that no rule reads under the scenario's choices."""
    from airflock.engine import driver_text

    text = driver_text(scenario)
    # The text of the driver is the proof: a choice has removed what it leaves unread.
    read = set(re.findall(r"\bp\.(\w+)", text)) | set(scenario.model.usual)
    return {f"model.{name}" for name in number_names(scenario.parameters) if name not in read}


def _speed(scenario: Scenario) -> float:
    """Preferred speed, m/s; 0 where the model has none."""
    preferred = scenario.model.preferred_speed
    return float(preferred(scenario.parameters)) if preferred else 0.0


def _nearest_study(scenario: Scenario) -> tuple[str, float, dict[str, SearchAxis]] | None:
    """Return name, ratio of the speeds and axes of the shipped study of the same law that is nearest in speed."""
    speed, best = _speed(scenario), None
    for name, model, theirs, axes in _studies():
        if model != scenario.model.name or not axes:
            continue
        away = abs(math.log(speed / theirs)) if speed > 0.0 and theirs > 0.0 else 0.0
        if name == scenario.name:
            away = -1.0
        if best is None or away < best[0]:
            best = (away, name, speed / theirs if speed > 0.0 and theirs else 1.0, {axis.key: axis for axis in axes})
    return None if best is None else best[1:]


@lru_cache(maxsize=1)
def _studies() -> list[tuple[str, str, float, tuple[SearchAxis, ...]]]:
    """Name, law, speed and axes of the shipped studies."""
    found = []
    for name, path in shipped_studies().items():
        document = read_toml(path)
        if "scenario" not in document:  # one set for several scenarios: no speed of its own
            continue
        scenario = load(str(document["scenario"]), document.get("set"))
        space = read_space(document["space"], scenario, ErrorCollector()) if "space" in document else None
        found.append((name, scenario.model.name, _speed(scenario), space.axes if space else ()))
    return found


def _scaled(scenario: Scenario, axis: SearchAxis, own: SearchAxis, ratio: float) -> SearchAxis:
    """An axis of a study at another speed, stretched to hold the scenario's own value; `own` has the declared ends."""
    factor = ratio ** SCALED.get(axis.unit, 0)
    low, high = axis.low * factor, axis.high * factor
    if axis.unit == "m" and (arena := largest_extension(scenario.world)):
        high = min(high, arena)
    value = float(declared_numbers(scenario)[axis.key][1] or 0.0)
    low, high = max(own.low, min(low, value)), min(own.high, max(high, value))
    scale = axis.scale if low > 0.0 else "linear"
    return replace(axis, low=low, high=high, scale=scale)


def _around(scenario: Scenario, axis: SearchAxis) -> SearchAxis:
    """An axis about the scenario's own value; from 0 where that is 0."""
    how, value = declared_numbers(scenario)[axis.key]
    own = float(value or 0.0)
    size = abs(own) if own else _typical(scenario, how)
    low, high = (own / AROUND, own * AROUND) if own > 0.0 else (-size, size)
    low, high = max(axis.low, low), min(axis.high, high)
    return replace(axis, low=low, high=high, scale=default_scale(low, high))


def _typical(scenario: Scenario, how: Quantity) -> float:
    """Size of a quantity of which nothing is known but its unit."""
    sizes: dict[str, Any] = {
        "m": 0.25 * (largest_extension(scenario.world) or scenario.radio.range), "m/s": _speed(scenario),
    }  # fmt: skip
    return min(float(sizes.get(how.unit) or 1.0), how.high - how.low)
