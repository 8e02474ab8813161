"""Stages of a tuning: search, hardening, certificate; each is continued where it was left."""

import itertools
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

from airflock import __version__
from airflock.certificates import (
    Certificate,
    CountProgress as Counted,
    campaign_executor,
    campaign_from_request,
    run_campaign as certified,
    scenario_identity,
)
from airflock.runs import open_folder, read_toml_file, write_toml_file
from airflock.scenarios import Scenario, formats, load
from airflock.search.evolution import run_study as evolved, study_executor as searching
from airflock.search.generations import SearchProgress as Searched
from airflock.search.hardening import MAX_ROUNDS, harden, hardened_document as hardened_document
from airflock.search.hardening_steps import StepResult
from airflock.search.study import make_study
from airflock.search.study_result import BEST_FILE, EvolveResult
from airflock.support import ScenarioError, StudyError, as_error, atomic, parse_json_object, read_text

SEARCH, HARDEN, CERTIFY_SHARE = 0.45, 0.15, 0.4  # shares of the budget
TRIED = 15  # rounds of flights that hardening is planned with; all whole and half steps and fresh seeds would be 19
POPULATION = 24  # reaches a good set in less time than 100 do: small flocks' flights are few
LEAST = 6  # generations
FLIGHTS = 2  # of a candidate: from two on, chance and merit can be separated
AVERAGES = 2  # of the last means of the search, which also fly in its final
USUAL = 100  # flights of a finalist
DEFAULT_CONFIDENCE = 0.95


@dataclass(frozen=True)
class BudgetPlan:
    """Numbers of flights of each stage.

    search : keys of the table [search]; seeds: flights of each step of hardening; seconds: of certifying
    rate   : flights per second that the plan was made with
    limits, confidence : of the certificate; a resumed tuning keeps them unless others are given
    """

    search: dict[str, Any]
    seeds: int
    seconds: float
    rate: float
    limits: list[str] = field(default_factory=list)
    confidence: float = DEFAULT_CONFIDENCE

    def document(self) -> dict[str, Any]:
        """Return the plan as plain values."""
        return {"airflock": __version__, **asdict(self)}


def make_plan(budget: float, rate: float, *, warm: bool = False, flights_for_limits: int = USUAL) -> BudgetPlan:
    """Make a plan for a budget (s) at a rate (flights per second), searching from the start's own numbers if `warm`.

    flights_for_limits : flights that show if the rarest limit is kept: at most so many for each finalist and each step
    Raises StudyError if the budget is too small.
    """
    # Fixed when it begins and kept on resume: the same flights are flown, whatever the machine is
    # doing by then. A quarter of the search is left for its finals: race, final and score. The
    # generations take the rest.
    flights = budget * SEARCH * rate
    finals = flights / 4.0
    top = 4
    final_seeds = int(min(max(finals / (2.0 * (top + AVERAGES + 2)), 8), max(flights_for_limits, USUAL)))
    pool = int(min(max(finals / 16.0, 2 * top), 100))
    spent = 8 * pool + (top + AVERAGES + 2) * final_seeds
    generations = int((flights - spent) / (POPULATION * FLIGHTS))
    seeds = int(min(budget * HARDEN * rate / TRIED, max(flights_for_limits, 2 * USUAL)))
    if generations < LEAST or seeds < 10:
        flown = max((LEAST * POPULATION * FLIGHTS + spent) / SEARCH, 10 * TRIED / HARDEN)
        raise StudyError(
            f"the budget of {budget:g} s is too small: one flight takes {1.0 / rate:.2g} s here; give at least "
            f"{1.1 * flown / rate:.2g} s, or shorten the flights with --duration"
        )
    search: dict[str, Any] = {
        "population": POPULATION, "generations": generations, "seeds": FLIGHTS, "pool": pool, "top": top,
        "averages": AVERAGES, "final_seeds": final_seeds,
    }  # fmt: skip
    if warm:
        search["start"] = "scenario"
    return BudgetPlan(search, seeds, budget * CERTIFY_SHARE, rate)


PLAN_FILE, START_FILE, STUDY_FOLDER, TUNED_FILE, CERTIFICATE_FILE, STEPS_FILE = (
    "tune.toml", "start.toml", "study", "tuned.toml", "certificate.toml", "hardening.json",
)  # fmt: skip


@dataclass(frozen=True)
class TuneResult:
    """Result of a tuning: the scenario to fly, and the result of each stage.

    start      : the scenario that tuning began from; notes : what was noticed on the way
    result     : of the search
    steps      : of hardening; empty where the law has no recipe, and `why` says so
    seconds    : that it took, s
    identify_report : what logs said, where it began with logs
    """

    folder: Path
    scenario: Scenario
    start: Scenario
    notes: tuple[str, ...]
    result: EvolveResult
    steps: tuple[StepResult, ...]
    why: str
    certificate: Certificate
    seconds: float
    identify_report: Mapping[str, Any] = field(default_factory=dict)

    @property
    def shown(self) -> bool:
        """True if the certificate shows all limits."""
        return self.certificate.shown

    def __repr__(self) -> str:
        return f"<Tuned {self.folder / TUNED_FILE}: fitness {self.result.fitness:.3f}; {self.certificate!r}>"

    def _repr_html_(self) -> str:
        """Which file to fly, what its certificate says of the limits, and its keys, for a notebook."""
        head = f"<p><b>{escape(str(self.folder / TUNED_FILE))}</b>, in {self.seconds:.0f} s</p>"
        return head + self.certificate._repr_html_() + self.scenario._repr_html_()

    def document(self) -> dict[str, Any]:
        """Return the result as plain values, for --json."""
        return {
            "folder": str(self.folder),
            "tuned": str(self.folder / TUNED_FILE),
            "notes": list(self.notes),
            "evolved": self.result.document(),
            "hardening": [step.as_dict() for step in self.steps],
            "why_not_hardened": self.why,
            "certificate": self.certificate.document(),
            "seconds": self.seconds,
            **({"identified": dict(self.identify_report)} if self.identify_report else {}),
        }


MOST_SEEDS = 1_000_000  # of each step of hardening


def load_plan(folder: Path, start: Scenario, resume: bool) -> BudgetPlan | None:
    """Return the plan of a folder, or None if the folder is new. Raises StudyError for a folder of something else."""
    if (folder / PLAN_FILE).is_file():
        if not resume:
            raise StudyError(f"{folder}: holds a tuning already; continue it with --resume, or give another --out")
        made, of = read_plan(folder / PLAN_FILE)
        if of != scenario_identity(start):
            raise StudyError(f"{folder}: holds the tuning of another scenario; give another --out")
        return made
    if resume:
        raise StudyError(f"{folder}: holds no tuning to resume ({PLAN_FILE} is missing)")
    if folder.is_dir() and any(not path.name.startswith(".") for path in folder.iterdir()):
        raise StudyError(f"{folder}: is not empty and holds no {PLAN_FILE}; give a new folder")
    return None


def save_plan(folder: Path, start: Scenario, plan: BudgetPlan) -> None:
    """Write the plan and where the tuning starts into a new folder."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_toml_file(folder / START_FILE, scenario_text_document(start), "Where tuning starts.")
        write_toml_file(
            folder / PLAN_FILE,
            {**plan.document(), "identity": scenario_identity(start)},
            "A tuning of Airflock. Written once, when it began.",
        )
    except OSError as error:
        raise StudyError(f"{folder}: cannot be written: {error.strerror or error}") from error


def read_plan(path: Path) -> tuple[BudgetPlan, str]:
    """Read the plan of a folder and the identity of its scenario. Raises StudyError for a damaged file."""
    found = read_toml_file(path)
    try:
        search = {str(key): value for key, value in found["search"].items()}
        limits = [str(text) for text in found.get("limits", ())]
        sure = float(found.get("confidence", DEFAULT_CONFIDENCE))
        made = BudgetPlan(search, int(found["seeds"]), float(found["seconds"]), float(found["rate"]), limits, sure)
    except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as error:
        raise StudyError(f"{path}: is damaged: no plan of a tuning is in it; give another --out") from error
    if found.get("margins"):  # of a version that could widen them
        raise StudyError(f"{path}: margins are no longer widened; remove the line `margins` to go on without them")
    if not (0 < made.seeds <= MOST_SEEDS and 0.0 <= made.seconds < 1e9 and 0.0 < made.rate < 1e9):
        raise StudyError(f"{path}: is damaged: its numbers are no plan of a tuning; give another --out")
    return made, str(found.get("identity"))


def scenario_text_document(scenario: Scenario) -> dict[str, Any]:
    """Return the document of a scenario file without published values of a paper."""
    return {formats.KEY: formats.FORMAT, **{k: v for k, v in scenario.document.items() if k != "published"}}


def read_steps(path: Path) -> tuple[list[StepResult], str]:
    """Read the steps of hardening, and why there are none. Raises StudyError for a damaged file."""
    with as_error(path, StudyError):
        stored = parse_json_object(read_text(path))
    try:
        return [_measured(step) for step in stored["steps"]], str(stored["why"])
    except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as error:
        raise StudyError(f"{path}: is damaged; remove it, and the hardening is done once more") from error


def _measured(row: Mapping[str, Any]) -> StepResult:
    """Make one step from plain values; errors of the constructors pass through."""

    def three(values: Any) -> tuple[float, float, float]:
        mean, low, high = map(float, values)
        return mean, low, high

    def table(name: str) -> dict[str, float]:
        return {str(key): float(value) for key, value in row[name].items()}

    return StepResult(
        name=str(row["name"]), reason=str(row["reason"]), parameters=table("parameters"),
        fitness=float(row["fitness"]), r_min=float(row["r_min"]), n_coll=float(row["n_coll"]),
        cost=three(row["cost"]), gain=three(row["gain"]), parts=table("parts"), contacts=float(row["contacts"]),
        clearance=float(row.get("clearance", "nan")), kept=bool(row["kept"]), verdict=str(row["verdict"]),
    )  # fmt: skip


PILOT = 4  # flights per core by which the time of one flight is measured
Notify = Callable[[str], None]


class TuneProgress(NamedTuple):
    """Progress of a tuning: its stage, a short message, flights so far and in total.

    total : None where it is not known; hardening often ends before its total
    """

    stage: str
    told: str = ""
    done: int = 0
    total: int | None = None


OnTuneProgress = Callable[[TuneProgress], None]


def measure_flight_rate(scenario: Scenario, threads: int | None) -> float:
    """Measure flights per second by a few flights."""
    from airflock.engine import compile_for, score_flights
    from airflock.support import available_cores

    # Compiled first: the time of the compiler says nothing of the rate of flights.
    compile_for(scenario)
    count = PILOT * (threads or available_cores())
    began = time.perf_counter()
    score_flights([scenario] * count, range(count), threads=threads)
    return count / max(time.perf_counter() - began, 1e-6)


def run_search_stage(
    folder: Path,
    start: Scenario,
    plan: BudgetPlan,
    limits: Sequence[str],
    threads: int | None,
    on_progress: OnTuneProgress,
) -> EvolveResult:
    """Run or continue the search in the folder; return its result."""
    on_progress(TuneProgress("search"))

    def searched(p: Searched) -> None:
        best = "" if p.best is None else f", best {p.best:.4f}"
        on_progress(TuneProgress("search", f"generation {p.generation + 1}{best}", p.done, p.total))

    objective = {"objective": {"limits": list(limits)}} if limits else {}
    study = make_study(objective, start.name, search=plan.search, scenario=start)
    open_folder(folder / STUDY_FOLDER, study)
    return evolved(study, folder / STUDY_FOLDER, searching(study, threads=threads), searched)


def run_hardening_stage(
    folder: Path, plan: BudgetPlan, limits: Sequence[str], threads: int | None, trust: bool, on_progress: OnTuneProgress
) -> tuple[Scenario, list[StepResult], str]:
    """Harden or read the hardened set; return the scenario, its steps, and why there are none."""
    # steps.json is written last: if it is there, the stage is complete.
    if (folder / STEPS_FILE).is_file():
        steps, why = read_steps(folder / STEPS_FILE)
        return load(folder / TUNED_FILE, trust=trust), steps, why
    best = load(folder / STUDY_FOLDER / BEST_FILE, trust=trust)
    steps, why = [], ""
    flown = itertools.count(1)
    on_progress(TuneProgress("hardening"))

    def done() -> None:
        count = next(flown)
        on_progress(TuneProgress("hardening", "", count, max(count, MAX_ROUNDS * plan.seeds)))

    try:
        steps = harden(best, range(plan.seeds), limit=limits, threads=threads, done=done)
        write_toml_file(
            folder / TUNED_FILE, hardened_document(best, steps[-1]), "Evolved and hardened by airflock tune."
        )
    except ScenarioError as error:
        why = error.errors[0]
        law = folder / STUDY_FOLDER / str(best.document.get("model", {}).get("kind", ""))
        if law.suffix == ".py" and law.is_file():
            atomic.write_file(folder / law.name, law.read_bytes())
        write_toml_file(folder / TUNED_FILE, scenario_text_document(best), "Evolved by airflock tune; not hardened.")
    outcome = {"why": why, "steps": [step.as_dict() for step in steps]}
    atomic.write_file(folder / STEPS_FILE, json.dumps(outcome))
    return load(folder / TUNED_FILE, trust=trust), steps, why


def run_certificate_stage(
    folder: Path,
    tuned: Scenario,
    limits: Sequence[str],
    confidence: float,
    plan: BudgetPlan,
    threads: int | None,
    on_progress: OnTuneProgress,
) -> Certificate:
    """Certify the tuned set; save the certificate in the folder and return it."""
    on_progress(TuneProgress("certificate"))

    def counted(p: Counted) -> None:
        events = ", ".join(str(count) for count in p.events)
        on_progress(TuneProgress("certificate", f"{events} events", p.done, p.total))

    def follows(text: str) -> None:
        on_progress(TuneProgress("certificate", text))

    from airflock.certificates import used_and_unused_keys

    campaign = campaign_from_request(tuned, limits, confidence)
    path = folder / "certificate_flights"
    open_folder(path, campaign)
    executor = campaign_executor(campaign, threads=threads)
    try:
        keys = used_and_unused_keys(tuned)
        made = certified(campaign, path, executor, plan.seconds, counted, keys=keys, threads=threads, notify=follows)
    finally:
        executor.close()
    made.save(folder / CERTIFICATE_FILE)
    return made
