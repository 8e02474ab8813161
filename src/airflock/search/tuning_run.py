"""Tune a flock: from a scenario or logs through search, hardening and certificate to a report, in one folder.

Each stage is kept in the folder and continued where it was interrupted.
"""

import hashlib
import json
import math
import os
import time
import tomllib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, asdict, dataclass, field, fields, replace
from html import escape
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from airflock import __version__
from airflock.certificates import (
    COUNT_BUDGET_SHARE,
    Campaign,
    Certificate,
    campaign_from_request,
    flights_to_show,
    fly_campaign,
    scenario_identity,
    used_and_unused_keys,
)
from airflock.estimate import IdentifyResult, identify, read_heard
from airflock.parts.metrics import scalar_names
from airflock.runs import (
    REQUEST_FILE,
    RESULT_FILE,
    Interrupted,
    OnProgress,
    ProgressTally,
    RunProgress,
    held_request,
    open_folder,
    read_request,
    requested_scenario,
    run_place,
    unpublished,
    write_toml_file,
)
from airflock.scenarios import Scenario, build_scenario, formats, load, rebuilt, scenario_variant, starting_set
from airflock.search.evolution import run_study, study_executor
from airflock.search.hardening import MAX_ROUNDS, StepResult, harden, hardened_document
from airflock.search.limit_excess import flights_per_event, limit_report_line
from airflock.search.study import default_space, make_study
from airflock.search.study_result import BEST_FILE, EvolveResult
from airflock.support import (
    ErrorCollector,
    RecordingError,
    ScenarioError,
    StudyError,
    as_error,
    atomic,
    expand_path,
    parse_json_object,
    read_text,
    result_group,
    value_or_default,
)

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

    search : keys of the table [search]; seeds: flights of each step of hardening; seconds: of
             certifying
    rate   : flights per second that the plan was made with
    limits, confidence : of the certificate; a resumed tuning keeps them unless others are given
    """

    search: dict[str, Any]
    seeds: int
    seconds: float
    rate: float
    limits: list[str] = field(default_factory=list)
    confidence: float = DEFAULT_CONFIDENCE


def make_plan(budget: float, rate: float, *, warm: bool = False, flights_for_limits: int = USUAL) -> BudgetPlan:
    """Make a plan for a budget (s) at a rate (flights per second), searching from the start's own numbers if `warm`.

    flights_for_limits : flights that show if the rarest limit is kept: at most so many for each
                         finalist and each step
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
        start = self.start
        of = {"identity": scenario_identity(start), "name": start.name, "scenario": unpublished(start)}
        return {"airflock": __version__, **asdict(self.plan), **of}


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

    def __rich__(self) -> Any:
        """Return what each stage found and where it is, for a terminal."""
        r = self.result
        return result_group(
            f"evolved: fitness {r.fitness:.4f} ({r.low:.4f} to {r.high:.4f}) on {r.seeds} fresh seeds",
            *(f"evolved: {limit_report_line(entry)}" for entry in r.limits),
            f"hardened: {self.steps[-1].verdict}" if self.steps else f"not hardened: {self.why}",
            *self.certificate.statements,
            f"saved {self.folder}: tuned.toml, certificate.toml, report.html, figures.pdf",
        )

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
        missing = [each.name for each in fields(BudgetPlan) if each.default is MISSING and each.name not in held]
        if missing:
            raise StudyError(f"{where}: is damaged: it lacks {', '.join(missing)}; give another --out")
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
    return {formats.KEY: formats.FORMAT, **unpublished(scenario)}


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


SCENARIO, REPORT_FILE = "identified.toml", "identified.json"
Paths = Sequence[str | os.PathLike[str]]


@dataclass(frozen=True)
class IdentifiedFleet:
    """A fleet identified from logs: the scenario with its numbers, its file, and a report.

    report : files with their hashes, the law's scenario, numbers with intervals or the reason why
             not, notes
    """

    scenario: Scenario
    document: Mapping[str, Any]
    report: Mapping[str, Any]

    def save(self, folder: Path) -> None:
        """Write identified.toml and identified.json, the latter last: it says that the stage is over."""
        write_toml_file(folder / SCENARIO, self.document, "Identified from logs by airflock tune.")
        atomic.write_file(folder / REPORT_FILE, json.dumps(self.report))


def identify_fleet(folder: Path, logs: Paths, like: Scenario, heard: str | os.PathLike[str] | None) -> IdentifiedFleet:
    """Return the identified fleet of the folder, or identify it now from the logs.

    Raises StudyError where the folder holds what other logs said, RecordingError or AirflockError
    for bad logs.
    """
    request = _identify_request(logs, like, heard)
    if (folder / REPORT_FILE).is_file():
        report = read_report(folder)
        for key, value in request.items():
            if report.get(key) != value:
                raise StudyError(f"{folder}: holds the tuning of other logs ({key} differs); give another --out")
        return IdentifiedFleet(load(folder / SCENARIO), {}, report)
    found = identify(list(logs), like, heard=None if heard is None else read_heard(heard))
    document = found.document()
    # by the name of the file that it becomes, so that a tuning that is resumed is the same one
    return IdentifiedFleet(
        build_scenario(document, str(folder / SCENARIO)), document, {**request, **_identify_report(found)}
    )


def read_report(folder: Path) -> dict[str, Any]:
    """Read what the logs told, from the folder of a tuning. Raises StudyError for a damaged file."""
    with as_error(folder / REPORT_FILE, StudyError):
        return parse_json_object(read_text(folder / REPORT_FILE))


def _identify_request(logs: Paths, like: Scenario, heard: str | os.PathLike[str] | None) -> dict[str, Any]:
    """Return everything that decides the outcome, as plain values."""
    files = [*logs, *([] if heard is None else [heard])]
    return {
        "logs": {Path(path).name: _hash(path) for path in files},
        "like": hashlib.sha256(json.dumps(unpublished(like), sort_keys=True, default=str).encode()).hexdigest()[:12],
    }


def _hash(path: str | os.PathLike[str]) -> str:
    try:
        with expand_path(path).open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()[:12]
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from error


def _identify_report(found: IdentifyResult) -> dict[str, Any]:
    """Every number with its interval, or the reason why the logs do not tell it; and notes."""
    numbers = [
        {"key": n.key, "value": n.value, "low": n.low, "high": n.high, "origin": n.origin}
        if n.told
        else {"key": n.key, "reason": n.reason or "not found in the logs"}
        for n in found.numbers.values()
    ]
    return {"name": found.like.name, "drones": found.logs.drones, "numbers": numbers, "notes": list(found.notes)}


SCALES = "vasarhelyi_2018"  # the law whose scaling with the speed is published


def prepare_start(scenario: Scenario) -> tuple[Scenario, list[str]]:
    """Return the scenario to start from, and notes on the numbers that were set.

    Only numbers that the scenario's document does not give are set; every other value stays.
    """
    values, remarks = _scaled(scenario)
    start = rebuilt(scenario, values) if values else scenario
    for room in _off_the_walls(scenario):
        with suppress(ScenarioError):  # they have no place so far from the walls
            why = f"no agent starts nearer than {room:g} m to walls and obstacles"
            away = rebuilt(start, {"start.wall_clearance": room})
            return away, [*remarks, f"{why} (start.wall_clearance, which is not given)"]
    return start, remarks


def measures_walls(scenario: Scenario) -> bool:
    """Return True if there are walls or obstacles and the metrics measure clearance to them."""
    stand = scenario.world.arena != "none" or bool(scenario.world.obstacles)
    return stand and "clearance" in scalar_names(scenario.metrics.rule, scenario.metrics.numbers)


def _scaled(scenario: Scenario) -> tuple[dict[str, Any], list[str]]:
    """Return numbers of the law scaled to the speed of the scenario, and notes."""
    if scenario.model.name != SCALES:
        return {}, [
            f"{scenario.model.name}: no scaling with the speed is published; the search starts from its own values"
        ]
    speed = float(scenario.parameters.v_flock)
    scaled: Mapping[str, Any] = tomllib.loads(starting_set(speed))["model"]
    given = scenario.document.get("model", {})
    values = {
        f"model.{name}": entry["value"]
        for name, entry in scaled.items()
        if isinstance(entry, dict) and name not in given and name != "v_max"
    }
    if not values:
        return {}, ["all numbers of the law are given; the search starts from them"]
    return values, [f"{len(values)} numbers of the law scaled to {speed:g} m/s, as Tables S1 and S3 of {SCALES} say"]


def _off_the_walls(scenario: Scenario) -> list[float]:
    """Return clearances (m) to walls and obstacles at the start to try, largest first; none if the document has one.

    Half of the distance between agents, or r_coll.
    """
    # Starts as close as 1 cm to a wall decided `clearance` of most flights, whatever the law: a
    # fitness of 0.05, with room at the start 0.777.
    drawn = scenario.start.kind in ("arena", "ball", "box")
    if not (measures_walls(scenario) and drawn) or "wall_clearance" in scenario.document.get("start", {}):
        return []
    least = float(scenario.metrics.r_coll)
    return sorted({max(least, 0.5 * scenario.separation()), least}, reverse=True)


def make_request(
    start: Scenario,
    limit: Sequence[str] = (),
    confidence: float | None = None,
    plan: BudgetPlan | None = None,
) -> Campaign:
    """Return what a certificate is to show. Missing values come from the plan of a resumed tuning, or are defaults.

    Raises ScenarioError, all errors together.
    """
    errors = ErrorCollector()
    limits = list(limit) or (plan.limits if plan else []) or errors.read(default_limits, start)
    sure = (plan.confidence if plan else DEFAULT_CONFIDENCE) if confidence is None else confidence
    campaign = errors.read(campaign_from_request, start, limits, sure)
    errors.raise_errors()
    return campaign


def check_tune_budget(budget: float) -> None:
    """Refuse a time in which nothing could be tuned, and one without an end."""
    if not 0.0 < budget < math.inf:
        raise StudyError(f"budget = {budget:g} s is not positive")


def default_limits(scenario: Scenario) -> list[str]:
    """Collisions, and contacts where there are walls or obstacles, rarer than once in a hundred flock hours each.

    Raises ScenarioError where distances are not measured.
    """
    if "r_min" not in scalar_names(scenario.metrics.rule, scenario.metrics.numbers):
        kind = scenario.metrics.rule.name
        raise ScenarioError(
            [f"{scenario.name}: metrics.kind = {kind!r} has no r_min to limit; say what is to be shown with --limit"]
        )
    contacts = ["clearance<0 at 0.01/h"] if measures_walls(scenario) else []
    return [f"r_min<{scenario.metrics.r_coll:g} at 0.01/h", *contacts]


def infeasible_limit_lines(campaign: Campaign, plan: BudgetPlan) -> list[str]:
    """Return a line for each limit that the plan's flights could not show even without any event."""
    able = int(COUNT_BUDGET_SHARE * plan.seconds * plan.rate)
    return [
        f"{limit.text}: needs {flights:,} flights without an event to be shown, and there is time for {able:,}; "
        f"give --budget {_time(1.1 * flights / plan.rate / CERTIFY_SHARE / COUNT_BUDGET_SHARE)}, "
        "or ask for a larger limit"
        for limit in campaign.limits
        if (flights := flights_to_show(campaign, limit)) > able
    ]


def _time(seconds: float) -> str:
    """Format a time, rounded up, as --budget takes it."""
    return f"{math.ceil(seconds / 3600.0)}h" if seconds > 7200.0 else f"{math.ceil(seconds / 60.0)}min"


def tune(
    scenario: Scenario | str | os.PathLike[str] | Paths | None = None,
    out: str | os.PathLike[str] | None = None,
    *,
    budget: float = 1200.0,
    limit: Sequence[str] = (),
    confidence: float | None = None,
    like: Scenario | str | os.PathLike[str] | None = None,
    heard: str | os.PathLike[str] | None = None,
    warm: bool = False,
    resume: bool = False,
    settings: Mapping[str, Any] | None = None,
    threads: int | None = None,
    watch: OnProgress | None = None,
    note: Callable[[str], None] | None = None,
    trust: bool = False,
) -> TuneResult:
    """From a scenario or logs of your own to a set that is evolved, hardened and certified, with a report.

    Parameters
    ----------
    scenario : Scenario, str or path, a list of paths, or None (FILE|PRESET|LOGS...)
        Your drones, field and speed; numbers of the law that it does not give are scaled to its speed. With `like`, log
        files of your drones, as `airflock.identify` reads them. None continues what the folder holds.
    out : str or path (DIR)
        Folder of everything: start, study, hardening, certificate, report, and tuned.toml to fly.
    budget : float
        Time to spend, s; for a command also 20min or 2h.
    limit : sequence of str
        What is to be shown, as `airflock.certify` takes it; by default that collisions (`metrics.r_coll`) are rarer
        than 0.01 per flock hour, and so is leaving the arena or entering an obstacle. Search and hardening put sets
        that look as if they kept these limits before all others.
    confidence : float, optional
        Confidence of the certificate, a share in [0.5, 1); by default 0.95.
    like : Scenario, str or path (PRESET|FILE), optional
        The scenario whose law, field and speed are tuned with the numbers that the logs tell of the drones.
    heard : str or path (FILE.csv), optional
        Table of packets of these logs, as `airflock identify --heard` takes it.
    warm : bool
        Search from the start's own numbers on, which its speed scales, instead of the middle of all ranges.
    resume : bool
        Continue the work in the folder, which holds its start, plan, limits and confidence.
    settings : mapping, optional
        Keys of the scenario to change.
    threads : int, optional
        Flights side by side; by default one per core.
    watch, note : callable, optional
        Called as each stage begins and after its flights (`airflock.runs.RunProgress`); called with a
        line for each limit that the budget leaves too little time to show.
    trust : bool
        Whether code that files name may run.

    Returns
    -------
    Tuned
        The scenario to fly, what each stage found, and whether the limit is shown.

    Raises
    ------
    ScenarioError, StudyError
        If the scenario or the folder cannot be used, the budget is too small, or nothing flies.
    Interrupted
        At Ctrl-C.

    Examples
    --------
    >>> import airflock
    >>> airflock.tune("vasarhelyi_2018/4ms", "tuned", limit=["r_mim<3 at 1%"])  # refused before anything flies
    Traceback (most recent call last):
    airflock.support.errors.ScenarioError: limit 'r_mim<3 at 1%': r_mim: unknown order parameter; did you mean r_min?
    """
    began = time.monotonic()
    folder = run_place(out)
    parts = ErrorCollector()  # all of it is refused before anything flies
    parts.read(check_tune_budget, budget)
    if like is not None:
        parts.raise_errors()  # before logs are read, which takes long
    begun = parts.read(_begun, scenario, like, heard, settings, folder, resume, trust)
    # Each part that could be read is checked further, so that one message names all errors.
    start = parts.read(lambda found: found.start, begun)
    plan = parts.read(load_plan, folder, start, resume)
    campaign = parts.read(make_request, start, limit, confidence, value_or_default(plan, None))
    parts.raise_errors()
    logs, limits = begun.logs, [each.text for each in campaign.limits]
    rated = [each for each in campaign.limits if each.rate is not None]
    if plan is None:
        telling = flights_per_event(rated, start)
        plan = make_plan(budget, measure_flight_rate(start, threads), warm=warm, flights_for_limits=telling)
    plan = replace(plan, limits=limits, confidence=campaign.confidence)
    open_folder(folder, Tuning(start, plan, {"notes": begun.notes, "logs": logs is not None}), resume=resume)
    write_toml_file(folder / START_FILE, scenario_text_document(start), "Where tuning starts.")
    if logs is not None and not (folder / REPORT_FILE).is_file():
        logs.save(folder)
    short = infeasible_limit_lines(campaign, plan)
    for line in short:
        if note is not None:
            note(line)
    notes = [*begun.notes, *default_space(start)[1], *short]
    watch = watch or (lambda stage: None)
    searched = [each.text for each in rated]
    try:
        result = search_set(folder / STUDY_FOLDER, start, plan.search, searched, threads, watch)
        if result.dead_reason:
            raise StudyError(f"{start.name}: {result.dead_reason}")
        tuned, steps, why = harden_set(folder, plan.seeds, searched, threads, trust, watch)
        shown = certify_set(folder, tuned, limits, plan, threads, watch)
        found = TuneResult(
            folder, tuned, start, tuple(notes), result, tuple(steps), why, shown, time.monotonic() - began,
            {} if logs is None else logs.report,
        )  # fmt: skip
        if not (folder / RESULT_FILE).is_file():
            watch(RunProgress("report"))
            from airflock.search.tune_report import save

            save(found)
            write_toml_file(folder / RESULT_FILE, found.document(), "What airflock tune found.")
    except KeyboardInterrupt as stop:
        raise Interrupted(f"interrupted: all flights so far are kept in {folder}; continue with --resume") from stop
    return found


def search_set(
    folder: Path, start: Scenario, search: Mapping[str, Any], limits: Sequence[str], threads: int | None,
    watch: OnProgress,
) -> EvolveResult:  # fmt: skip
    """Begin or continue the search in its folder; return its result."""
    objective = {"objective": {"limits": list(limits)}} if limits else {}
    study = make_study(objective, start.name, search=search, scenario=start)
    open_folder(folder, study)
    return run_study(study, folder, study_executor(study, threads=threads), watch)


def harden_set(
    folder: Path, seeds: int, limits: Sequence[str], threads: int | None, trust: bool, watch: OnProgress
) -> tuple[Scenario, list[StepResult], str]:
    """Harden the set that the search found; return it as tuned.toml holds it, its steps, and why there are none."""
    best = load(folder / STUDY_FOLDER / BEST_FILE, trust=trust)
    tally = ProgressTally("hardening", MAX_ROUNDS * seeds, watch)
    steps, why = [], ""
    try:
        steps = harden(
            best,
            range(seeds),
            limit=limits,
            threads=threads,
            done=lambda: tally.note(True),
            folder=folder / HARDENING_FOLDER,
        )
        document, comment = hardened_document(best, steps[-1]), "Evolved and hardened by airflock tune."
    except ScenarioError as error:
        why = error.errors[0]
        document, comment = scenario_text_document(best), "Evolved by airflock tune; not hardened."
        law = folder / STUDY_FOLDER / str(best.document.get("model", {}).get("kind", ""))
        if law.suffix == ".py" and law.is_file():
            atomic.write_file(folder / law.name, law.read_bytes())
    write_toml_file(folder / TUNED_FILE, document, comment)
    return load(folder / TUNED_FILE, trust=trust), steps, why


def certify_set(
    folder: Path, tuned: Scenario, limits: Sequence[str], plan: BudgetPlan, threads: int | None, watch: OnProgress
) -> Certificate:
    """Certify the tuned set; save the certificate in the folder and return it."""
    place = folder / CERTIFICATE_FOLDER
    made = fly_campaign(
        campaign_from_request(tuned, limits, plan.confidence), place,
        None if (place / RESULT_FILE).is_file() else plan.seconds, watch,
        keys=used_and_unused_keys(tuned), threads=threads,
    )  # fmt: skip
    made.save(folder / CERTIFICATE_FILE)
    return made


class _Begun(NamedTuple):
    """Start of a tuning: its scenario, notes on numbers that were set, and the fleet identified from logs."""

    start: Scenario
    notes: list[str]
    logs: IdentifiedFleet | None


def _begun(
    what: Scenario | str | os.PathLike[str] | Paths | None,
    like: Scenario | str | os.PathLike[str] | None,
    heard: str | os.PathLike[str] | None,
    settings: Mapping[str, Any] | None,
    folder: Path,
    resume: bool,
    trust: bool,
) -> _Begun:
    if what is None:
        held = held_request(folder if resume else None, Tuning.kind, {"like": like, "heard": heard, "set": settings})
        with as_error(folder, StudyError):
            if "scenario" not in held:
                raise StudyError(f"{folder}: was begun by an older version; name its scenario again")
            name, notes = str(held["name"]), list(held.get("also", {}).get("notes", []))
            start = requested_scenario(held["scenario"], name, trust=trust)
        report = read_report(folder) if (folder / REPORT_FILE).is_file() else None
        if report is None and held.get("also", {}).get("logs"):  # killed before it was written
            raise StudyError(f"{folder}: holds nothing of its logs yet; name them again, with --like")
        return _Begun(start, notes, None if report is None else IdentifiedFleet(start, {}, report))
    paths = [what] if isinstance(what, (Scenario, str, os.PathLike)) else list(what)
    if like is None:
        if len(paths) != 1 or heard is not None:
            raise ScenarioError(
                ["tune takes one scenario; for logs, give --like PRESET, the scenario with their law, field and speed"]
            )
        return _Begun(*prepare_start(scenario_variant(paths[0], settings, trust=trust)), None)
    files = [path for path in paths if not isinstance(path, Scenario)]
    if not files or len(files) != len(paths):
        raise ScenarioError(["like is given, so give log files, not a scenario"])
    found = identify_fleet(folder, files, scenario_variant(like, settings, trust=trust), heard)
    return _Begun(*prepare_start(found.scenario), found)
