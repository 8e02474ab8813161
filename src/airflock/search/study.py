"""Study: an optimisation as data: a scenario, a space, what is better, and how to search; from a file or by name."""

import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from html import escape
from pathlib import Path
from typing import Any

from airflock import __version__
from airflock.certificates import EventLimit
from airflock.runs import SearchSpace, declared_numbers, fingerprint, requested_scenario, unpublished
from airflock.scenarios import (
    Scenario,
    files_of_laws,
    formats,
    html_table,
    load,
    presets,
    scenario_variant,
    schema,
    tells_of_study,
)
from airflock.search.objectives import Objective, read_limits, read_objectives
from airflock.search.search_settings import CONSTANT_SEEDS_SHARE, SEED_BITS, SearchSettings, search_errors
from airflock.search.study_space import default_space, read_space
from airflock.support import (
    ErrorCollector,
    ScenarioError,
    StudyError,
    TextError,
    as_error,
    expand_path,
    is_file,
    read_toml,
    shortened,
    suggest,
)

KEYS = ("title", "scenario", "scenarios", "over_scenarios", "set", "space", "objective", "search")
LAYOUT = 1  # of the study folder; raised whenever an older folder could not be continued


@dataclass(frozen=True)
class Study:
    """An optimisation: everything that decides its result.

    others : further scenarios in which each candidate flies; over_scenarios: mean or worst of them all
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
        return f"<{study_summary(self)}>"

    def _repr_html_(self) -> str:
        """Return a table of the varied parameters, for a notebook."""
        return study_html(self)

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
            **self._several(),
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

    def _several(self) -> dict[str, Any]:
        """Return the entries of several scenarios for the document."""
        if not self.others:
            return {}
        found = {f"scenario_{i}": unpublished(scenario) for i, scenario in enumerate(self.others, 2)}
        return {"over_scenarios": self.over_scenarios, "labels": list(self.labels), **found}


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
        if not tells_of_study(document):
            # A scenario is a study without a space and an objective: both are defaults then.
            document = {"scenario": text, **(tables or {})}
            return make_study(document, text, settings=settings, search=search, limits=limits, trust=trust)
        where = text if text in known else str(path)
        document = {**document, **(tables or {})}
        return make_study(
            document, where, settings=settings, search=search, folder=path.parent, limits=limits, trust=trust
        )


def study_of_request(
    held: Mapping[str, Any], given: Study | None, *, settings: Mapping[str, Any] | None, search: Mapping[str, Any],
    limits: Sequence[str], objectives: tuple[Objective, ...] | None, trust: bool,
) -> Study:  # fmt: skip
    """Return the study that a folder holds, with what a call that resumes it gives besides.

    given      : the same study as this call names it, if it does; of use where an older folder keeps no names
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
    limits   : in place of those of its objective; each candidate then flies twice at least, unless `search` has seeds
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
    if len(scenarios) == 1:
        return space, notes
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


def study_summary(study: Study) -> str:
    """Summarise a study in one sentence: its goals and its flights."""
    q, goals = study.search, ", ".join(objective.name for objective in study.objectives)
    return (
        f"Study of {', '.join(s.name for s in study.scenarios)}: {len(study.space.axes)} parameters for {goals}, "
        f"{q.generations:g} generations of {q.population:g} candidates, {q.seeds:g} flight{'s' * (q.seeds > 1)} each"
    )


def study_html(study: Study) -> str:
    """Return a table of the varied parameters as HTML."""
    rows = [(a.key, f"{a.low:g} … {a.high:g}", a.unit, a.scale) for a in study.space.axes]
    return f"<p><b>{escape(study_summary(study))}</b></p>{html_table(('parameter', 'range', 'unit', 'scale'), rows)}"
