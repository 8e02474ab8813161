"""The public door: start, evolve, harden, certify, report; each stage is continued where it was left."""

import json
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from airflock import atomic
from airflock.certify.asked import campaign_of
from airflock.certify.campaign import FOLDER
from airflock.certify.certificate import Certificate
from airflock.certify.executing import executor_for
from airflock.certify.run import run as certified
from airflock.certify.seeds import identity
from airflock.doors import from_outside, json_object, read_text
from airflock.errors import ScenarioError, StudyError
from airflock.evolve.after import Result
from airflock.evolve.bounds import usual_space
from airflock.evolve.folder import open_folder, read, write
from airflock.evolve.harden import document as hardened_document
from airflock.evolve.harden import harden
from airflock.evolve.run import executor_for as searching
from airflock.evolve.run import run as evolved
from airflock.evolve.safe import flights_that_count
from airflock.evolve.search import Watch
from airflock.evolve.steps import Measured
from airflock.evolve.study import make_study
from airflock.scenarios import formats
from airflock.scenarios.change import variant
from airflock.scenarios.files import load
from airflock.scenarios.scenario import Scenario
from airflock.tune.logs import TOLD, FromLogs, Paths, identified
from airflock.tune.plan import USUAL, Plan, plan_of
from airflock.tune.reach import out_of_reach
from airflock.tune.start import has_walls, start_of

PLAN, START, STUDY, TUNED, CERTIFICATE, STEPS = (
    "tune.toml", "start.toml", "study", "tuned.toml", "certificate.toml", "hardening.json",
)  # fmt: skip
MOST_SEEDS = 1_000_000  # of each step of hardening
STAGES = "search", "hardening", "certificate", "report"
PILOT = 4  # flights per core that tell how long one takes
Note = Callable[[str], None]


@dataclass(frozen=True)
class Tuned:
    """What tuning found: the scenario to fly, and what each stage said.

    identified : what logs told, where it began with logs
    steps : of hardening; empty where the law has no recipe, and `why` says so
    """

    folder: Path
    scenario: Scenario
    start: Scenario
    notes: tuple[str, ...]
    result: Result
    steps: tuple[Measured, ...]
    why: str
    certificate: Certificate
    seconds: float
    identified: Mapping[str, Any] = field(default_factory=dict)

    @property
    def shown(self) -> bool:
        """Whether the certificate shows all limits."""
        return self.certificate.shown

    def __repr__(self) -> str:
        return f"<Tuned {self.folder / TUNED}: fitness {self.result.fitness:.3f}; {self.certificate!r}>"

    def document(self) -> dict[str, Any]:
        """What was found as plain values, for --json."""
        return {
            "folder": str(self.folder),
            "tuned": str(self.folder / TUNED),
            "notes": list(self.notes),
            "evolved": self.result.document(),
            "hardening": [step.as_dict() for step in self.steps],
            "why_not_hardened": self.why,
            "certificate": self.certificate.document(),
            "seconds": self.seconds,
            **({"identified": dict(self.identified)} if self.identified else {}),
        }


def tune(
    scenario: Scenario | str | os.PathLike[str] | Paths,
    out: str | os.PathLike[str],
    *,
    budget: float = 1200.0,
    limit: Sequence[str] = (),
    confidence: float = 0.95,
    like: Scenario | str | os.PathLike[str] | None = None,
    heard: str | os.PathLike[str] | None = None,
    warm: bool = False,
    resume: bool = False,
    settings: Mapping[str, Any] | None = None,
    threads: int | None = None,
    watch: Watch | None = None,
    note: Note | None = None,
    trust: bool = False,
) -> Tuned:
    """From a scenario or logs of your own to a set that is evolved, hardened and certified, with a report.

    Parameters
    ----------
    scenario : Scenario, str or path, or a list of paths
        Your drones, field and speed; numbers of the law that it does not give are scaled to its speed. With `like`, log
        files of your drones, as `airflock.identify` reads them.
    out : str or path
        Folder of everything: start, study, hardening, certificate, report, and tuned.toml to fly.
    budget : float
        Time to spend, s.
    limit : sequence of str
        What is to be shown, as `airflock.certify` takes it; by default that collisions (`metrics.r_coll`) are rarer
        than 0.01 per flock hour, and so is leaving the arena or entering an obstacle. Search and hardening put sets
        that look as if they kept these limits before all others.
    confidence : float
        Of the certificate.
    like : Scenario, str or path, optional
        The scenario whose law, field and speed are tuned with the numbers that the logs tell of the drones.
    heard : str or path, optional
        Table of packets of these logs, as `airflock identify --heard` takes it.
    warm : bool
        Search from the start's own numbers on, which its speed scales, instead of the middle of all ranges.
    resume : bool
        Continue what is in the folder.
    settings : mapping, optional
        Keys of the scenario to change.
    threads : int, optional
        Flights side by side; by default one per core.
    watch, note : callable, optional
        Told of flights of the search; told which of STAGES begins, and before them in a line of each limit that the
        budget leaves too little time to show.
    trust : bool
        Whether code that files name may run.

    Returns
    -------
    Tuned
        The scenario to fly, what each stage found, and whether the limit is shown.

    Raises
    ------
    ScenarioError, StudyError
        If the scenario or the folder cannot be used, the budget is too small, or nothing flies; Interrupted at Ctrl-C.

    Examples
    --------
    >>> import airflock
    >>> airflock.tune("vasarhelyi_2018/4ms", "tuned", limit=["r_mim<3 at 1%"])  # refused before anything flies
    Traceback (most recent call last):
    airflock.errors.ScenarioError: limit 'r_mim<3 at 1%': r_mim: unknown order parameter; did you mean r_min?
    """
    began = time.monotonic()
    folder = Path(out)
    mine, logs = _mine(folder, scenario, like, heard, settings, trust)
    start, notes = start_of(mine)
    limits = list(limit) or usual_limits(start)
    asked = campaign_of(start, limits, confidence)  # refused before anything flies
    telling = flights_that_count([each for each in asked.limits if each.rate is not None], start)
    plan = _planned(folder, start, budget, resume, threads, warm=warm, telling=telling)
    searched = [each.text for each in asked.limits if each.rate is not None]
    if logs is not None and not (folder / TOLD).is_file():
        logs.save(folder)
    short = out_of_reach(asked, plan)
    for line in short:
        _say(note, line)
    _say(note, STAGES[0])
    result = _evolved(folder, start, plan, searched, threads, watch)
    notes = [*notes, *usual_space(start)[1], *short]
    if result.dead:
        raise StudyError(f"{mine.name}: {result.dead}")
    _say(note, STAGES[1])
    tuned, steps, why = _hardened(folder, result, plan, searched, threads, trust)
    _say(note, STAGES[2])
    certificate = _certified(folder, tuned, limits, confidence, plan, threads, note)
    found = Tuned(
        folder, tuned, start, tuple(notes), result, tuple(steps), why, certificate, time.monotonic() - began,
        {} if logs is None else logs.told,
    )  # fmt: skip
    _say(note, STAGES[3])
    from airflock.tune.report import save

    save(found)
    return found


def _mine(
    folder: Path,
    what: Scenario | str | os.PathLike[str] | Paths,
    like: Scenario | str | os.PathLike[str] | None,
    heard: str | os.PathLike[str] | None,
    settings: Mapping[str, Any] | None,
    trust: bool,
) -> tuple[Scenario, FromLogs | None]:
    """The scenario to tune, and what logs told of it if it began with logs."""
    paths = [what] if isinstance(what, (Scenario, str, os.PathLike)) else list(what)
    if like is None:
        if len(paths) != 1 or heard is not None:
            raise ScenarioError(["tune takes one scenario; of logs, give --like PRESET: whose law, field and speed"])
        return variant(paths[0], settings, trust=trust), None
    files = [path for path in paths if not isinstance(path, Scenario)]
    if not files or len(files) != len(paths):
        raise ScenarioError(["like is given, so log files are to be tuned, and no scenario"])
    found = identified(folder, files, variant(like, settings, trust=trust), heard)
    return found.scenario, found


def usual_limits(scenario: Scenario) -> list[str]:
    """Collisions, and contacts where there are walls or obstacles, rarer than once in a hundred flock hours each."""
    contacts = ["clearance<0 at 0.01/h"] if has_walls(scenario) else []
    return [f"r_min<{scenario.metrics.r_coll:g} at 0.01/h", *contacts]


def _say(note: Note | None, text: str) -> None:
    if note:
        note(text)


def _planned(
    folder: Path,
    start: Scenario,
    budget: float,
    resume: bool,
    threads: int | None,
    *,
    warm: bool = False,
    telling: int = USUAL,
) -> Plan:
    """The plan of the folder, made where there is none. Raises StudyError for a folder of something else."""
    if (folder / PLAN).is_file():
        if not resume:
            raise StudyError(f"{folder}: holds a tuning already; continue it with --resume, or give another --out")
        made, of = read_plan(folder / PLAN)
        if of != identity(start):
            raise StudyError(f"{folder}: holds the tuning of another scenario; give another --out")
        return made
    if resume:
        raise StudyError(f"{folder}: holds no tuning to resume ({PLAN} is missing)")
    if folder.is_dir() and any(not path.name.startswith(".") for path in folder.iterdir()):
        raise StudyError(f"{folder}: is not empty and holds no {PLAN}; give a new folder")
    plan = plan_of(budget, _rate(start, threads), warm=warm, telling=telling)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write(folder / START, _document(start), "Where tuning starts.")
        write(
            folder / PLAN,
            {**plan.document(), "identity": identity(start)},
            "A tuning of Airflock. Written once, when it began.",
        )
    except OSError as fault:
        raise StudyError(f"{folder}: cannot be written: {fault.strerror or fault}") from fault
    return plan


def read_plan(path: Path) -> tuple[Plan, str]:
    """The plan that a folder keeps, and the identity of its scenario; StudyError where the file is damaged."""
    found = read(path)
    try:
        search = {str(key): value for key, value in found["search"].items()}
        made = Plan(search, int(found["seeds"]), float(found["seconds"]), float(found["rate"]))
    except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as fault:
        raise StudyError(f"{path}: is damaged: no plan of a tuning is in it; give another --out") from fault
    if not (0 < made.seeds <= MOST_SEEDS and 0.0 <= made.seconds < 1e9 and 0.0 < made.rate < 1e9):
        raise StudyError(f"{path}: is damaged: its numbers are no plan of a tuning; give another --out")
    return made, str(found.get("identity"))


def _document(scenario: Scenario) -> dict[str, Any]:
    return {formats.KEY: formats.FORMAT, **{k: v for k, v in scenario.document.items() if k != "published"}}


def _rate(scenario: Scenario, threads: int | None) -> float:
    """Flights per second, from a few of them."""
    from airflock.engine import compile_for, score_flights
    from airflock.threads import cores

    compile_for(scenario)
    count = PILOT * (threads or cores())
    began = time.perf_counter()
    score_flights([scenario] * count, range(count), threads=threads)
    return count / max(time.perf_counter() - began, 1e-6)


def _evolved(
    folder: Path, start: Scenario, plan: Plan, limits: Sequence[str], threads: int | None, watch: Watch | None
) -> Result:
    objective = {"objective": {"limits": list(limits)}} if limits else {}
    study = make_study(objective, start.name, search=plan.search, scenario=start)
    open_folder(folder / STUDY, study, resume=(folder / STUDY / "study.toml").is_file())
    return evolved(study, folder / STUDY, searching(study, threads=threads), watch)


def _hardened(
    folder: Path, result: Result, plan: Plan, limits: Sequence[str], threads: int | None, trust: bool
) -> tuple[Scenario, list[Measured], str]:
    """The scenario after hardening, its steps, and why there are none."""
    if (folder / STEPS).is_file():
        steps, why = read_steps(folder / STEPS)
        return load(folder / TUNED, trust=trust), steps, why
    best = load(folder / STUDY / "best.toml", trust=trust)
    steps, why = [], ""
    try:
        steps = harden(best, range(plan.seeds), limit=limits, threads=threads)
        write(folder / TUNED, hardened_document(best, steps[-1]), "Evolved and hardened by airflock tune.")
    except ScenarioError as fault:
        why = fault.faults[0]
        law = folder / STUDY / str(best.document.get("model", {}).get("kind", ""))
        if law.suffix == ".py" and law.is_file():
            atomic.write(folder / law.name, law.read_bytes())
        write(folder / TUNED, _document(best), "Evolved by airflock tune; not hardened.")
    atomic.write(folder / STEPS, json.dumps({"why": why, "steps": [step.as_dict() for step in steps]}))
    return load(folder / TUNED, trust=trust), steps, why


def read_steps(path: Path) -> tuple[list[Measured], str]:
    """Steps of hardening that a folder keeps, and why there are none; StudyError where the file is damaged."""
    with from_outside(path, StudyError):
        told = json_object(read_text(path))
    try:
        return [_measured(step) for step in told["steps"]], str(told["why"])
    except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as fault:
        raise StudyError(f"{path}: is damaged; remove it, and the hardening is done once more") from fault


def _measured(told: Mapping[str, Any]) -> Measured:
    """One step from plain values; raises what its constructors raise."""

    def three(values: Any) -> tuple[float, float, float]:
        mean, low, high = map(float, values)
        return mean, low, high

    def table(name: str) -> dict[str, float]:
        return {str(key): float(value) for key, value in told[name].items()}

    return Measured(
        name=str(told["name"]), reason=str(told["reason"]), parameters=table("parameters"),
        fitness=float(told["fitness"]), r_min=float(told["r_min"]), n_coll=float(told["n_coll"]),
        cost=three(told["cost"]), gain=three(told["gain"]), parts=table("parts"), contacts=float(told["contacts"]),
        clearance=float(told.get("clearance", "nan")), kept=bool(told["kept"]), verdict=str(told["verdict"]),
    )  # fmt: skip


def _certified(
    folder: Path,
    tuned: Scenario,
    limits: Sequence[str],
    confidence: float,
    plan: Plan,
    threads: int | None,
    note: Note | None,
) -> Certificate:
    from airflock.certify.tolerance import usual_keys

    campaign = campaign_of(tuned, limits, confidence)
    path = folder / "certificate_flights"
    open_folder(path, campaign, resume=(path / f"{FOLDER}.toml").is_file(), kind=FOLDER)
    executor = executor_for(campaign, threads=threads)
    try:
        made = certified(campaign, path, executor, plan.seconds, keys=usual_keys(tuned), threads=threads, note=note)
    finally:
        executor.close()
    made.save(folder / CERTIFICATE)
    return made
