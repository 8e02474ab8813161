"""Folder: the plan of a tuning and its steps of hardening, as its folder keeps them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from airflock.certificates import scenario_identity
from airflock.runs import read_toml_file, write_toml_file
from airflock.scenarios import Scenario, formats
from airflock.search.steps import StepResult
from airflock.search.tune.plan import DEFAULT_CONFIDENCE, BudgetPlan
from airflock.search.tune.result import PLAN_FILE, START_FILE
from airflock.support import StudyError, as_error, parse_json_object, read_text

MOST_SEEDS = 1_000_000  # of each step of hardening


def load_plan(folder: Path, start: Scenario, resume: bool) -> BudgetPlan | None:
    """The plan that a folder keeps, or None where it is new. Raises StudyError for a folder of something else."""
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
    except OSError as fault:
        raise StudyError(f"{folder}: cannot be written: {fault.strerror or fault}") from fault


def read_plan(path: Path) -> tuple[BudgetPlan, str]:
    """The plan that a folder keeps, and the identity of its scenario; StudyError where the file is damaged."""
    found = read_toml_file(path)
    try:
        search = {str(key): value for key, value in found["search"].items()}
        limits = [str(text) for text in found.get("limits", ())]
        sure = float(found.get("confidence", DEFAULT_CONFIDENCE))
        made = BudgetPlan(search, int(found["seeds"]), float(found["seconds"]), float(found["rate"]), limits, sure)
    except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as fault:
        raise StudyError(f"{path}: is damaged: no plan of a tuning is in it; give another --out") from fault
    if found.get("margins"):  # of a version that could widen them
        raise StudyError(f"{path}: margins are no longer widened; remove the line `margins` to go on without them")
    if not (0 < made.seeds <= MOST_SEEDS and 0.0 <= made.seconds < 1e9 and 0.0 < made.rate < 1e9):
        raise StudyError(f"{path}: is damaged: its numbers are no plan of a tuning; give another --out")
    return made, str(found.get("identity"))


def scenario_text_document(scenario: Scenario) -> dict[str, Any]:
    """A scenario as a file holds it, without what a paper prints of it."""
    return {formats.KEY: formats.FORMAT, **{k: v for k, v in scenario.document.items() if k != "published"}}


def read_steps(path: Path) -> tuple[list[StepResult], str]:
    """Steps of hardening that a folder keeps, and why there are none; StudyError where the file is damaged."""
    with as_error(path, StudyError):
        told = parse_json_object(read_text(path))
    try:
        return [_measured(step) for step in told["steps"]], str(told["why"])
    except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as fault:
        raise StudyError(f"{path}: is damaged; remove it, and the hardening is done once more") from fault


def _measured(told: Mapping[str, Any]) -> StepResult:
    """One step from plain values; raises what its constructors raise."""

    def three(values: Any) -> tuple[float, float, float]:
        mean, low, high = map(float, values)
        return mean, low, high

    def table(name: str) -> dict[str, float]:
        return {str(key): float(value) for key, value in told[name].items()}

    return StepResult(
        name=str(told["name"]), reason=str(told["reason"]), parameters=table("parameters"),
        fitness=float(told["fitness"]), r_min=float(told["r_min"]), n_coll=float(told["n_coll"]),
        cost=three(told["cost"]), gain=three(told["gain"]), parts=table("parts"), contacts=float(told["contacts"]),
        clearance=float(told.get("clearance", "nan")), kept=bool(told["kept"]), verdict=str(told["verdict"]),
    )  # fmt: skip
