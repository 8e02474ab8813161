"""From an optimum to parameters that may be flown: the two workarounds of Vásárhelyi et al. 2018, step by step.

The optimum of a fitness tolerates a few collisions. The paper makes it safe in two ways: (i) optimise with a larger
radius of collision or a larger delay, so that distances grow, or (ii) by hand, Table S4: more repulsion, more
alignment, a slower but earlier braking at walls. Each step here flies the same seeds as the one before, so that its
price in fitness and its gain in distance are differences of pairs.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from airflock.errors import ScenarioError
from airflock.evolve.after import interval
from airflock.evolve.folder import STUDY, open_folder, plain
from airflock.evolve.run import executor_for, run
from airflock.evolve.search import Watch
from airflock.evolve.space import Space, declared, with_parameters
from airflock.evolve.study import Study, make_study
from airflock.scenarios import formats
from airflock.scenarios.files import loaded, make
from airflock.scenarios.scenario import Scenario

S4 = "Table S4"


@dataclass(frozen=True)
class Step:
    """One change of the recipe: factors and additions to keys, and why."""

    name: str
    factors: Mapping[str, float]
    reason: str


# ratios of Table S4 to Table S1, columns 4, 6, 8 m/s: p_rep 2.3, 1.4, 1.7; C_frict 10, 10, 8; v_shill 0.74, 0.71, 0.61;
# r0_shill from 0.3, 0.5, 0.1 m to 0, 5, 30 m
RECIPE = (
    Step("p_rep up", {"model.p_rep": 1.5}, f"{S4}: gain increased to prevent collisions"),
    Step("c_frict up", {"model.c_frict": 3.0}, f"{S4}: increased substantially to minimise oscillations"),
    Step("c_frict up again", {"model.c_frict": 3.0}, f"{S4}: 8 to 10 times in all, here in two steps"),
    Step(
        "v_shill down, r0_shill up",
        {"model.v_shill": 0.7},
        f"{S4}: a higher r0_shill makes up for it",
    ),
)
EARLIER = 0.5  # s of flight by which r0_shill grows with the last step: 2 to 4 m; the paper's table has 0, 5 and 30 m


@dataclass(frozen=True)
class Measured:
    """Parameters of one step and what they cost and gain against the optimum, over paired seeds.

    fitness, r_min, n_coll : mean over seeds; r_min (m) is the smallest distance of two agents in a flight
    cost, gain : fitness lost and smallest distance won (m) against the first step: mean, and 95 % interval
    """

    name: str
    reason: str
    parameters: Mapping[str, float]
    fitness: float
    r_min: float
    n_coll: float
    cost: tuple[float, float, float]
    gain: tuple[float, float, float]

    def as_dict(self) -> dict[str, Any]:
        """The step as plain values."""
        return {
            "name": self.name,
            "reason": self.reason,
            "parameters": dict(self.parameters),
            "fitness": self.fitness,
            "r_min": self.r_min,
            "n_coll": self.n_coll,
            "cost": list(self.cost),
            "gain": list(self.gain),
        }


def recipe(scenario: Scenario, steps: Sequence[Step] = RECIPE) -> list[tuple[Step, dict[str, float]]]:
    """Parameters after each step, the optimum first. Values stay inside their declared ranges."""
    known = declared(scenario)
    keys = {key for step in steps for key in step.factors} | {"model.r0_shill"}
    missing = sorted(key for key in keys if key not in known)
    if missing:
        raise ScenarioError(
            [
                f"{scenario.name}: no recipe for model {scenario.model.name}: {key} is not a number of it"
                for key in missing
            ]
        )
    now = {key: float(known[key][1] or 0.0) for key in sorted(keys)}
    found = [(Step("optimum", {}, "where hardening begins"), dict(now))]
    for step in steps:
        for key, factor in step.factors.items():
            now[key] = _inside(now[key] * factor, known[key][0])
        if "model.v_shill" in step.factors:
            speed = scenario.measured_by().v_flock or 0.0
            now["model.r0_shill"] = _inside(now["model.r0_shill"] + EARLIER * speed, known["model.r0_shill"][0])
        found.append((step, dict(now)))
    return found


def _inside(value: float, how: Any) -> float:
    return min(max(value, float(how.low)), float(how.high))


def harden(
    scenario: Scenario | str | os.PathLike[str],
    seeds: Sequence[int] = range(100),
    *,
    steps: Sequence[Step] = RECIPE,
    threads: int | None = None,
    done: Callable[[], None] | None = None,
) -> list[Measured]:
    """Fly each step of the recipe of Vásárhelyi et al. 2018, Table S4, on the same seeds.

    Parameters
    ----------
    scenario : Scenario, str or path
        An optimum: a scenario, or its name or file, such as best.toml of a study.
    seeds : sequence of int
        Seeds of the flights of each step.
    steps : sequence of Step
        What is changed, one after another.
    threads : int, optional
        Flights side by side; by default one per core.
    done : callable, optional
        Called after each flight.

    Returns
    -------
    list of Measured
        The optimum and each step: parameters, fitness, r_min (m), and what the step costs and gains.

    Raises
    ------
    ScenarioError
        If the model has no such parameters, or the flights have no fitness.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> steps = airflock.harden(short, range(2))
    >>> steps[0].name, round(steps[1].parameters["model.p_rep"], 3)
    ('optimum', 0.195)
    """
    scenario = loaded(scenario)
    return measured(scenario, recipe(scenario, steps), seeds, threads, done)


def measured(
    scenario: Scenario,
    plans: Sequence[tuple[Step, dict[str, float]]],
    seeds: Sequence[int],
    threads: int | None = None,
    done: Callable[[], None] | None = None,
) -> list[Measured]:
    """Fly each plan's parameters on the same seeds and set them against the first plan."""
    from airflock.engine.simulate import score_flights

    flown = [with_parameters(scenario, parameters) for _, parameters in plans]
    rows = score_flights(
        [found for found in flown for _ in seeds], [s for _ in flown for s in seeds], threads=threads, done=done
    )
    if "fitness" not in rows[0] or "r_min" not in rows[0]:
        raise ScenarioError([f"{scenario.name}: metrics.kind = '{scenario.measures.name}' has no fitness and no r_min"])
    keys = ("fitness", "r_min", "n_coll")
    table = {key: np.array([row[key] for row in rows]).reshape(len(plans), -1) for key in keys}
    found = []
    for i, (step, parameters) in enumerate(plans):
        mean, _, low, high = interval((table["fitness"][0] - table["fitness"][i]).tolist())
        won, _, least, most = interval((table["r_min"][i] - table["r_min"][0]).tolist())
        means = {key: float(values[i].mean()) for key, values in table.items()}
        found.append(
            Measured(step.name, step.reason, parameters, **means, cost=(mean, low, high), gain=(won, least, most))
        )
    return found


def cautious(scenario: Scenario, r_coll: float = 1.5, delay: float = 1.0) -> dict[str, float]:
    """Settings of workaround (i): a radius of collision and a delay so many times as large."""
    return {"metrics.r_coll": scenario.metrics.r_coll * r_coll, "radio.delay": scenario.radio.delay * delay}


def stricter(scenario: Scenario, space: Space, settings: Mapping[str, float], search: Mapping[str, Any]) -> Study:
    """Study of workaround (i): the scenario's space, searched under the stricter settings."""
    own: dict[str, Any] = {"law": scenario.model, "measures": scenario.measures, "vehicle": scenario.vehicle}
    found = make(scenario.document, f"{scenario.name}, stricter", settings, **own)
    return replace(make_study({}, found.name, search=search, scenario=found), space=space)


def evolved_again(
    scenario: Scenario,
    study: Study,
    settings: Mapping[str, float],
    folder: Path,
    seeds: Sequence[int],
    threads: int | None = None,
    watch: Watch | None = None,
    note: Callable[[bool], None] | None = None,
) -> list[Measured]:
    """Workaround (i): run the stricter study, then measure its result where the optimum was found.

    folder : of that study; one that is there already is continued
    watch, note : told of flights of the search and after it, as by `run`
    """
    open_folder(folder, study, resume=(folder / STUDY).exists())
    result = run(study, folder, executor_for(study, threads=threads), watch, note)
    known = declared(scenario)
    before = {key: float(known[key][1] or 0.0) for key in result.parameters}
    told = ", ".join(f"{key} = {value:g}" for key, value in settings.items())
    plans = [
        (Step("optimum", {}, "where hardening begins"), before),
        (Step("evolved again", {}, f"workaround (i): evolved with {told}"), result.parameters),
    ]
    return measured(scenario, plans, seeds, threads)


def document(scenario: Scenario, step: Measured) -> dict[str, Any]:
    """A scenario file with the parameters of a step, each with its reason."""
    found: dict[str, Any] = {formats.KEY: formats.FORMAT, **plain(scenario.document)}
    found.pop("published", None)
    known = declared(scenario)
    for key, value in step.parameters.items():
        if value == known[key][1]:
            continue
        section, _, name = key.rpartition(".")
        entry = {"value": value, "unit": known[key][0].unit, "source": f"hardened from {known[key][1]:g}"}
        (found.setdefault(section, {}) if section else found)[name] = entry
    found["title"] = f"hardened from {scenario.name}: fitness {step.fitness:.4f}, r_min {step.r_min:.3g} m"
    return found
