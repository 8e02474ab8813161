"""From an optimum to parameters that may be flown: the two workarounds of Vásárhelyi et al. 2018, step by step.

The optimum of a fitness tolerates a few collisions. The paper makes it safe in two ways: (i) optimise with a larger
radius of collision or a larger delay, so that distances grow, or (ii) by hand, Table S4: more repulsion, more
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

from airflock.errors import ScenarioError
from airflock.evolve.folder import plain
from airflock.evolve.held import Constraints
from airflock.evolve.margins import FAULTS, Margin, read_margins
from airflock.evolve.objective_table import read_limits
from airflock.evolve.space import declared
from airflock.evolve.steps import APART, RECIPE, ROOM, Measured, Step, recipe, together
from airflock.evolve.trial import Trial
from airflock.scenarios import formats
from airflock.scenarios.files import loaded
from airflock.scenarios.scenario import Scenario

COST = 0.05  # of fitness, at most
MOST = 22  # rounds of flights, with all whole and half steps, the fresh seeds and measures beside the law
ALONG, EACH, KINDS = 40, 3, 30  # rounds more along a margin, for each that was asked for, and for all kinds of fault


def rounds(margins: Sequence[str]) -> int:
    """Rounds of flights of hardening with these margins, about."""
    return MOST + (ALONG + EACH * len(margins) + KINDS * (FAULTS in margins) if margins else 0)


def harden(
    scenario: Scenario | str | os.PathLike[str] | Sequence[Scenario | str | os.PathLike[str]],
    seeds: Sequence[int] = range(100),
    *,
    steps: Sequence[Step] = RECIPE,
    cost: float = COST,
    limit: str | Sequence[str] = (),
    margin: str | Sequence[str] = (),
    threads: int | None = None,
    done: Callable[[], None] | None = None,
) -> list[Measured]:
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
        first where that is what is short; larger distances are added where a margin is to be widened.
    cost : float
        Fitness, 0 to 1, that may be given up in all; a step towards limits that are not kept yet may cost more.
    limit : str or sequence of str
        What may happen how rarely, as `airflock.certify` takes it. A step must not raise the estimated probability of
        an event above its limit, with a reserve of ten.
    margin : str or sequence of str
        Margins to widen beside distances and room at walls: keys of numbers of the environment, such as radio.delay, or
        "faults". Of several, the shortest is widened, and none may become shorter than that one was.
    threads : int, optional
        Flights side by side; by default one per core.
    done : callable, optional
        Called after each flight.

    Returns
    -------
    list of Measured
        The optimum, each step that was tried with whether it was kept and why, where agents still come too near what
        measures beside the law would gain (`evolve.measures`), and last what is left on fresh seeds: parameters,
        fitness, r_min (m), what it costs and gains, partial fitnesses, contacts with walls, margins.

    Raises
    ------
    ScenarioError
        If the model has no such parameters, the flights have no fitness, the optimum does not fly, or a limit or a
        margin cannot be read.

    Examples
    --------
    >>> import airflock
    >>> small = airflock.load("vasarhelyi_2018/4ms", {"agents": 5, "duration": 20.0, "dt": 0.1, "world.side": 120.0})
    >>> steps = airflock.harden(small, range(4))
    >>> steps[0].name, steps[-1].name
    ('optimum', 'on fresh seeds')
    """
    single = isinstance(scenario, (Scenario, str, os.PathLike))
    scenarios = [loaded(each) for each in ([scenario] if single else scenario)]  # type: ignore[list-item, union-attr]
    constraints, margins = asked_for(scenarios, cost, limit, margin)
    steps = [*steps, *(APART if margins else ())]
    trial = Trial(scenarios, recipe(scenarios[0], steps)[0], seeds, constraints, margins, threads, done)
    found = [trial.first]
    hit = float((together(trial.optimum)["n_coll"] > 0.0).mean())
    touched = trial.touches()
    order = [*steps, *(ROOM if touched else ())]
    at_walls = trial.first.contacts > hit or trial.first.parts.get("f_wall", 1.0) < trial.first.parts.get("f_coll", 1.0)
    if at_walls or trial.short_at_walls():
        order.sort(key=lambda step: not step.earlier)
    for step in order:
        found += trial.tried(step)
    for step in ROOM if trial.touches() and not touched else ():
        found += trial.tried(step)
    last = trial.on_fresh_seeds()
    return [*found, *trial.beside(), last]


def asked_for(
    scenarios: Sequence[Scenario], cost: float, limit: str | Sequence[str] = (), margin: str | Sequence[str] = ()
) -> tuple[Constraints, list[Margin]]:
    """What must go on to hold, and what is to be widened. Raises ScenarioError, all faults together."""
    held, faults = read_limits({"limits": limit}, scenarios)
    faults += [] if 0.0 <= cost < math.inf else [f"cost = {cost:g} is not a fitness of 0 or more"]
    margins, wrong = read_margins(margin, scenarios)
    faults += wrong
    if faults:
        raise ScenarioError(faults)
    return Constraints(held, cost), margins


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
