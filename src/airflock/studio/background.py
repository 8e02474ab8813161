"""Background: a study that evolves the present scenario in a process of its own, and how far it has come."""

import json
import math
import os
import subprocess
import sys
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from airflock import atomic
from airflock.core.parameters import Quantity, declarations
from airflock.errors import AirflockError, StudioError
from airflock.evolve.folder import write
from airflock.evolve.store import Store
from airflock.evolve.study import load_study, shipped
from airflock.scenarios.scenario import Scenario

NICE = 10  # the page goes first
WIDER = 2.0  # the search reaches from the value divided by it to the value times it
FEW = {"pool": 0, "top": 3, "final_seeds": 20}  # flights after the search: somebody waits for it


class Progress(NamedTuple):
    """How far a study is.

    generations : of each, the best fitness so far and its own mean
    best        : fitness of the best candidate; nan before there is any
    parameters  : of that candidate
    """

    generations: list[tuple[float, float]]
    best: float
    parameters: dict[str, float]


class Study:
    """A study in a process of its own, in a folder that outlives it; `airflock evolve --resume` goes on with it.

    folder      : that is made for it, with the scenario and the study file beside it
    scenario    : text of the scenario file that is evolved
    space       : keys of parameters → their bounds
    objective   : what is maximised
    """

    def __init__(
        self, folder: Path, scenario: str, space: Mapping[str, tuple[float, float]], objective: str, *,
        population: int = 20, generations: int = 20, trust: bool = False,
    ):  # fmt: skip
        if not space:
            raise StudioError("evolve: the law has no number that can vary")
        self.folder, self.objective, self.generations = folder, objective, generations
        start = folder.with_name(f"{folder.name}_start.toml")
        study = folder.with_name(f"{folder.name}_search.toml")
        atomic.write(start, scenario)
        tables: dict[str, Any] = {}
        for key, (low, high) in space.items():
            section, _, name = key.partition(".")
            scale = "log" if low > 0.0 else "linear"
            tables.setdefault(section, {})[name] = {"low": low, "high": high, "scale": scale}
        document = {
            "scenario": start.name, "space": tables, "objective": {"maximise": objective},
            "search": {"population": population, "generations": generations, **FEW},
        }  # fmt: skip
        self.file = study
        write(study, document, "Written by airflock watch: a search around the values that were set by hand.")
        load_study(study, trust=trust)  # every fault is told before anything is begun
        command = [sys.executable, "-m", "airflock", "evolve", str(study), "--out", str(folder), "--quiet"]
        self.log = folder.with_name(f"{folder.name}_log.txt")
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [*command, *(["--trust"] if trust else [])], stdin=subprocess.DEVNULL, stdout=log, stderr=log
            )
        os.setpriority(os.PRIO_PROCESS, self.process.pid, NICE)

    @property
    def running(self) -> bool:
        """Whether the process is still at it."""
        return self.process.poll() is None

    @property
    def fault(self) -> str:
        """What the process said when it failed; empty while all is well."""
        if self.running or self.process.returncode == 0 or self.process.returncode < 0:
            return ""
        said = self.log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        return said[-1] if said else f"the study ended with status {self.process.returncode}"

    def stop(self) -> None:
        """End the process; what has landed stays in the folder."""
        if self.running:
            self.process.terminate()
            self.process.wait(10.0)

    def progress(self) -> Progress:
        """How far it is, as its store says."""
        try:
            with Store(self.folder, write=False) as store:
                rows = list(
                    store.rows("SELECT generation, fitness, parameters FROM candidate WHERE stage=?", ("search",))
                )
        except AirflockError:
            return Progress([], math.nan, {})  # it has not begun to write
        return summary(rows)


def summary(rows: list[tuple[int, str | None, str]]) -> Progress:
    """Progress of candidates: generation, fitness (a list of numbers as JSON, if it was flown), parameters (JSON)."""
    by: dict[int, list[float]] = {}
    best, parameters = -math.inf, "{}"
    for generation, fitness, given in rows:
        value = json.loads(fitness)[0] if fitness else None
        if value is None:
            continue
        by.setdefault(generation, []).append(value)
        if value > best:
            best, parameters = value, given
    course, so_far = [], -math.inf
    for generation in sorted(by):
        so_far = max(so_far, *by[generation])
        course.append((so_far, sum(by[generation]) / len(by[generation])))
    return Progress(course, best if by else math.nan, json.loads(parameters))


def varied(where: str) -> set[str]:
    """Keys that the study of a preset varies; none of a scenario that has no study of its own."""
    return {axis.key for axis in load_study(where).space.axes} if where in shipped() else set()


def around(scenario: Scenario, only: Collection[str] = ()) -> dict[str, tuple[float, float]]:
    """Bounds of a search around the numbers of a scenario's law: from half of each to twice it, as far as is declared.

    only : keys that may vary; none: all
    A number that is 0, or that may not change by so much, stays as it is.
    """
    found = {}
    for name, declared, _ in declarations(scenario.parameters):
        value = getattr(scenario.parameters, name)
        if not isinstance(declared, Quantity) or not value or (only and f"model.{name}" not in only):
            continue
        low, high = sorted((value / WIDER, value * WIDER))
        low, high = max(low, declared.low), min(high, declared.high)
        if low < high:
            found[f"model.{name}"] = (low, high)
    return found
