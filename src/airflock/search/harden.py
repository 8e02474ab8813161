"""From an optimum to parameters that may be flown: Table S4 of Vásárhelyi et al. 2018, step by step.

The optimum of a fitness tolerates a few collisions. The paper makes it safe by hand, Table S4: more repulsion, more
alignment, a slower but earlier braking at walls. Each step here flies the same seeds as the one before, so that its
price in fitness and its gain in distance are differences of pairs.

The table is a list of what to try, no more: what widens distances in one arena drives agents into the trees of another.
So a step stays only if it gains, costs little, and keeps every constraint that held; else half of it is tried, else it
is undone. What is left is judged on fresh seeds.
"""

import math
import os
from collections.abc import Callable, Sequence
from typing import Any

from airflock.runs import declared_numbers, to_toml_values
from airflock.scenarios import Scenario, formats, load_if_named
from airflock.search.held import Constraints
from airflock.search.objective_table import read_limits
from airflock.search.steps import (
    TABLE_S4_STEPS,
    WALL_STEPS,
    HardeningStep,
    StepResult,
    join_scenarios,
    recipe_parameters,
)
from airflock.search.trial import HardeningCandidate
from airflock.support import ScenarioError

COST = 0.05  # of fitness, at most
MAX_ROUNDS = 22  # rounds of flights, with all whole and half steps, the fresh seeds and measures beside the law


def harden(
    scenario: Scenario | str | os.PathLike[str] | Sequence[Scenario | str | os.PathLike[str]],
    seeds: Sequence[int] = range(100),
    *,
    steps: Sequence[HardeningStep] = TABLE_S4_STEPS,
    cost: float = COST,
    limit: str | Sequence[str] = (),
    threads: int | None = None,
    done: Callable[[], None] | None = None,
) -> list[StepResult]:
    """Make an optimum safer by the steps of Vásárhelyi et al. 2018, Table S4, as far as they keep what held.

    Parameters
    ----------
    scenario : Scenario, str or path
        An optimum: a scenario, or its name or file, such as best.toml of a study. Of several, which hold the same
        numbers of the law, a step must keep what held in each; means are over all of them.
    seeds : sequence of int
        Seeds of the flights of each step; the result is judged on three times as many seeds after the largest of them.
    steps : sequence of Step
        What is tried, one after another; earlier braking is added where agents touch walls or obstacles, and comes
        first where that is what is short.
    cost : float
        Fitness, 0 to 1, that may be given up in all; a step towards limits that are not kept yet may cost more.
    limit : str or sequence of str
        What may happen how rarely, as `airflock.certify` takes it. A step must not raise the estimated probability of
        an event above its limit, with a reserve of ten.
    threads : int, optional
        Flights side by side; by default one per core.
    done : callable, optional
        Called after each flight.

    Returns
    -------
    list of Measured
        The optimum, each step that was tried with whether it was kept and why, where agents still come too near what
        measures beside the law would gain (`search.measures`), and last what is left on fresh seeds: parameters,
        fitness, r_min (m), what it costs and gains, partial fitnesses, contacts with walls.

    Raises
    ------
    ScenarioError
        If the model has no such parameters, the flights have no fitness, the optimum does not fly, or a limit cannot
        be read.

    Examples
    --------
    >>> import airflock
    >>> small = airflock.load("vasarhelyi_2018/4ms", {"agents": 5, "duration": 20.0, "dt": 0.1, "world.side": 120.0})
    >>> steps = airflock.harden(small, range(4))
    >>> steps[0].name, steps[-1].name
    ('optimum', 'on fresh seeds')
    """
    single = isinstance(scenario, (Scenario, str, os.PathLike))
    scenarios = [load_if_named(each) for each in ([scenario] if single else scenario)]  # type: ignore[list-item, union-attr]
    trial = HardeningCandidate(
        scenarios,
        recipe_parameters(scenarios[0], steps)[0],
        seeds,
        hardening_request(scenarios, cost, limit),
        threads,
        done,
    )
    found = [trial.first]
    hit = float((join_scenarios(trial.optimum)["n_coll"] > 0.0).mean())
    touched = trial.touches()
    order = [*steps, *(WALL_STEPS if touched else ())]
    at_walls = trial.first.contacts > hit or trial.first.parts.get("f_wall", 1.0) < trial.first.parts.get("f_coll", 1.0)
    if at_walls or trial.is_short_at_walls():
        order.sort(key=lambda step: not step.braking_lead)
    for step in order:
        found += trial.tried(step)
    for step in WALL_STEPS if trial.touches() and not touched else ():
        found += trial.tried(step)
    last = trial.verify_on_fresh_seeds()
    return [*found, *trial.beside(), last]


def hardening_request(scenarios: Sequence[Scenario], cost: float, limit: str | Sequence[str] = ()) -> Constraints:
    """What must go on to hold. Raises ScenarioError, all faults together."""
    held, faults = read_limits({"limits": limit}, scenarios)
    faults += [] if 0.0 <= cost < math.inf else [f"cost = {cost:g} is not a fitness of 0 or more"]
    if faults:
        raise ScenarioError(faults)
    return Constraints(held, cost)


def hardened_document(scenario: Scenario, step: StepResult) -> dict[str, Any]:
    """A scenario file with the parameters of a step, each with its reason."""
    found: dict[str, Any] = {formats.KEY: formats.FORMAT, **to_toml_values(scenario.document)}
    found.pop("published", None)
    known = declared_numbers(scenario)
    for key, value in step.parameters.items():
        if value == known[key][1]:
            continue
        section, _, name = key.rpartition(".")
        entry = {"value": value, "unit": known[key][0].unit, "source": f"hardened from {known[key][1]:g}"}
        (found.setdefault(section, {}) if section else found)[name] = entry
    found["title"] = f"hardened from {scenario.name}: fitness {step.fitness:.4f}, r_min {step.r_min:.3g} m"
    return found
