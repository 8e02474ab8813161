"""What a tuning is: its plan for a budget of time, its request, its progress and its result."""

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from html import escape
from pathlib import Path
from typing import Any, ClassVar

from airflock import __version__
from airflock.certificates import Certificate, scenario_identity
from airflock.runs import REQUEST_FILE, read_request, write_toml_file
from airflock.scenarios import Scenario, formats
from airflock.search.hardening import StepResult
from airflock.search.study_result import EvolveResult
from airflock.support import StudyError, as_error

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


START_FILE, STUDY_FOLDER, TUNED_FILE, CERTIFICATE_FILE = "start.toml", "study", "tuned.toml", "certificate.toml"
HARDENING_FOLDER, CERTIFICATE_FOLDER = "hardening_flights", "certificate_flights"


@dataclass(frozen=True)
class Tuning:
    """A tuning: everything that decides its result; `also` are notes on how its start was made."""

    start: Scenario
    plan: BudgetPlan
    also: Mapping[str, Any]
    kind: ClassVar[str] = "tuning"

    def document(self) -> dict[str, Any]:
        """Return the tuning as plain values: the request in its folder."""
        scenario = {key: value for key, value in self.start.document.items() if key != "published"}
        of = {"identity": scenario_identity(self.start), "name": self.start.name, "scenario": scenario}
        return {**self.plan.document(), **of}


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


def load_plan(folder: Path, start: Scenario, resume: bool | None) -> BudgetPlan | None:
    """Return the plan of a folder, or None if the folder is new. Raises StudyError for a folder of something else."""
    held = read_request(folder, Tuning.kind, resume=resume)
    if held is None:
        return None
    if held.get("identity") != scenario_identity(start):
        raise StudyError(f"{folder}: holds the tuning of another scenario; give another --out")
    plan = read_plan(held, folder)
    if "scenario" not in held:  # of a version whose request did not hold it
        write_toml_file(folder / REQUEST_FILE, {"run": Tuning.kind, **Tuning(start, plan, {}).document()})
    return plan


def read_plan(held: Mapping[str, Any], where: object) -> BudgetPlan:
    """Read the plan in the request of a tuning. Raises StudyError for a damaged one."""
    with as_error(f"{where}: is damaged", StudyError):
        made = BudgetPlan(**{each.name: held[each.name] for each in fields(BudgetPlan) if each.name in held})
        numbers = made.seeds, made.seconds, made.rate, made.confidence
        sound = all(isinstance(value, int | float) for value in numbers) and isinstance(made.search, dict)
        if held.get("margins"):  # of a version that could widen them
            raise StudyError(f"{where}: margins are no longer widened; remove the line `margins` to go on without them")
        if not (sound and 0 < made.seeds <= MOST_SEEDS and 0.0 <= made.seconds < 1e9 and 0.0 < made.rate < 1e9):
            raise StudyError(f"{where}: is damaged: its numbers are no plan of a tuning; give another --out")
    return made


def scenario_text_document(scenario: Scenario) -> dict[str, Any]:
    """Return the document of a scenario file without published values of a paper."""
    return {formats.KEY: formats.FORMAT, **{k: v for k, v in scenario.document.items() if k != "published"}}


PILOT = 4  # flights per core by which the time of one flight is measured


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
