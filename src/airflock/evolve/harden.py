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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from airflock.errors import ScenarioError
from airflock.evolve.folder import plain
from airflock.evolve.intervals import interval
from airflock.evolve.landscape import ZERO, why_zero
from airflock.evolve.measures import measures
from airflock.evolve.objective_table import read_limits
from airflock.evolve.safe import allowed, excess
from airflock.evolve.search_table import Search
from airflock.evolve.space import declared
from airflock.evolve.steps import (
    RECIPE,
    ROOM,
    Measured,
    Step,
    Table,
    against,
    flown,
    joined,
    moved,
    recipe,
    rows_of,
    together,
)
from airflock.limits.chance import chance
from airflock.limits.limit import Limit
from airflock.scenarios import formats
from airflock.scenarios.files import loaded
from airflock.scenarios.scenario import Scenario

SAFETY = ("f_coll", "f_disc", "f_cluster", "f_wall")  # partial fitnesses that are constraints; the others are its price
SLACK = 0.02  # by which the mean of one may fall, and the share of flights with a contact may rise
COST = 0.05  # of fitness, at most
WALLS = ("clearance", "phi_wall", "n_contacts")  # scores of what flies into walls and obstacles
ROUNDS = 3  # of fresh seeds: 4 % of flights with a contact pass 60 seeds in 30 % of all cases, 180 in 7 %
MOST = 22  # rounds of flights, with all whole and half steps, the fresh seeds and measures beside the law
RESERVE = Search().reserve  # how many times rarer than allowed an event is to look, as in a search


def harden(
    scenario: Scenario | str | os.PathLike[str] | Sequence[Scenario | str | os.PathLike[str]],
    seeds: Sequence[int] = range(100),
    *,
    steps: Sequence[Step] = RECIPE,
    cost: float = COST,
    limit: str | Sequence[str] = (),
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
        measures beside the law would gain (`evolve.measures`), and last what is left on fresh seeds: parameters,
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
    scenarios = [loaded(each) for each in ([scenario] if single else scenario)]  # type: ignore[list-item, union-attr]
    held, faults = read_limits({"limits": limit}, scenarios)
    faults += [] if 0.0 <= cost < math.inf else [f"cost = {cost:g} is not a fitness of 0 or more"]
    if faults:
        raise ScenarioError(faults)
    trial = _Trial(scenarios, recipe(scenarios[0], steps)[0], seeds, cost, held, threads, done)
    found = [trial.first]
    hit = float((together(trial.optimum)["n_coll"] > 0.0).mean())
    touched = trial.touches()
    order = [*steps, *ROOM] if touched else list(steps)
    at_walls = trial.first.contacts > hit or trial.first.parts.get("f_wall", 1.0) < trial.first.parts.get("f_coll", 1.0)
    if at_walls or trial.short_at_walls():
        order.sort(key=lambda step: not step.earlier)
    for step in order:
        found += trial.tried(step)
    for step in ROOM if trial.touches() and not touched else ():
        found += trial.tried(step)
    last = trial.on_fresh_seeds()
    return [*found, *trial.beside(), last]


class _Trial:
    """Parameters that were kept so far, and their flights; each step is judged against them and the optimum.

    Flights are one table for each scenario.
    """

    def __init__(
        self,
        scenarios: Sequence[Scenario],
        optimum: tuple[Step, dict[str, float]],
        seeds: Sequence[int],
        cost: float,
        limits: Sequence[Limit],
        threads: int | None,
        done: Callable[[], None] | None,
    ):
        self.scenarios, self.cost, self.limits, self.threads, self.done = scenarios, cost, limits, threads, done
        self.at_walls = [limit for limit in limits if limit.score in WALLS]
        self.seeds, n = list(seeds), len(seeds)
        self.fresh = [[max(seeds) + 1 + n * k + i for i in range(n)] for k in range(ROUNDS)]
        self.optimum = self.table = self._fly(optimum[1], self.seeds)
        self.kept, self.seen = [optimum], [optimum[1]]
        self.first = against(together(self.optimum), together(self.optimum), *optimum)
        for scenario, table in zip(scenarios, self.optimum, strict=True):
            if float(table["fitness"].max()) < ZERO:
                told = {name: values.tolist() for name, values in table.items()}
                rows = [dict(zip(told, row, strict=True)) for row in zip(*told.values(), strict=True)]
                raise ScenarioError([f"{scenario.name}: does not fly, so it cannot be hardened{why_zero(rows)}"])

    def _fly(self, parameters: Mapping[str, float], seeds: Sequence[int]) -> list[Table]:
        return [flown(each, [parameters], seeds, self.threads, self.done)[0] for each in self.scenarios]

    def touches(self) -> bool:
        """Whether what was kept so far touches walls or obstacles in some flight, or more often than a limit allows."""
        seen = any("phi_wall" in table and float(table["phi_wall"].max()) > 0.0 for table in self.table)
        return seen or self._excess(self.table, self.at_walls) > 0.0

    def short_at_walls(self) -> bool:
        """Whether limits of walls and obstacles are farther from being kept than the others."""
        others = [limit for limit in self.limits if limit not in self.at_walls]
        return self._excess(self.table, self.at_walls) > self._excess(self.table, others)

    def tried(self, step: Step) -> list[Measured]:
        """The step and, where it breaks something or costs too much, half of it."""
        found = []
        for part, name in ((1.0, step.name), (0.5, f"half of: {step.name}")):
            parameters = moved(self.scenarios[0], self.kept[-1][1], step, part)
            if parameters in self.seen:  # nothing changes, or it was undone before
                break
            self.seen.append(parameters)
            table = self._fly(parameters, self.seeds)
            broken = self._broken(self.optimum, table)
            gains = _gains(together(self.table), together(table)) or self._short(table) < self._short(self.table)
            verdict = broken or ("kept" if gains else "undone: gains no distance and no room at walls")
            kept = verdict == "kept"
            named = replace(step, name=name)
            found.append(
                replace(against(together(self.optimum), together(table), named, parameters), kept=kept, verdict=verdict)
            )
            if kept:
                self.kept.append((named, parameters))
                self.table = table
            if not broken:
                break
        return found

    def on_fresh_seeds(self) -> Measured:
        """What was kept, on seeds that chose nothing; the last step is undone until everything that held holds.

        Seeds come in rounds, so that what breaks much is undone after the first; the optimum alone flies one round.
        """
        before = [self._fly(self.kept[0][1], self.fresh[0])]
        after: list[list[Table]] = []
        while len(self.kept) > 1 and not after:
            after = self._lasting(before)
            if not after:
                self.kept.pop()
                self.table = []
        parameters = self.kept[-1][1]
        was, now = (together(joined(rounds)) for rounds in (before, after or before))
        left = [step.name for step, _ in self.kept[1:]]
        said = f"kept: {', '.join(left)}" if left else "no step was kept: the optimum is unchanged"
        return replace(against(was, now, Step("on fresh seeds", {}, said), parameters), verdict=said, kept=bool(left))

    def beside(self) -> list[Measured]:
        """What measures beside the numbers of the law would gain for what was kept, where agents come too near."""
        now, parameters = self.table or self._fly(self.kept[-1][1], self.seeds), self.kept[-1][1]
        before, near = together(now), [limit for limit in self.limits if limit not in self.at_walls]
        if not (before["n_coll"] > 0.0).any() and self._excess(now, near) == 0.0:
            return []
        found = []
        for step, scenarios, said in measures(self.scenarios):
            after = together([flown(each, [parameters], self.seeds, self.threads, self.done)[0] for each in scenarios])
            was, is_now = (100.0 * float((table["n_coll"] > 0.0).mean()) for table in (before, after))
            verdict = f"no part of the set: {is_now:.0f} % of flights have collisions, {was:.0f} % without it; {said}"
            found.append(replace(against(before, after, step, parameters), kept=False, verdict=verdict))
        return found

    def _lasting(self, before: list[list[Table]]) -> list[list[Table]]:
        """Rounds of flights with what is kept, none if they break what held; `before` is of the optimum and grows."""
        after: list[list[Table]] = []
        for count, seeds in enumerate(self.fresh, start=1):
            if len(before) < count:
                before.append(self._fly(self.kept[0][1], seeds))
            after.append(self._fly(self.kept[-1][1], seeds))
            if self._broken(joined(before[:count]), joined(after)):
                return []
        return after

    def _broken(self, before: Sequence[Table], after: Sequence[Table]) -> str:
        """What a step breaks in one of the scenarios or costs too much, in words; empty if nothing."""
        for scenario, was, now in zip(self.scenarios, before, after, strict=True):
            if found := _broken(was, now) or self._limit_broken(scenario, was, now):
                return f"{found}, in {scenario.name}" if len(self.scenarios) > 1 else found
        if self._short(after) < self._short(before):
            return ""
        price = float((together(before)["fitness"] - together(after)["fitness"]).mean())
        return f"undone: costs {price:.3g} of fitness, more than {self.cost:g}" if price > self.cost else ""

    def _limit_broken(self, scenario: Scenario, before: Table, after: Table) -> str:
        """Which limit a step breaks that was kept, or breaks more than before, in words; empty if none."""
        for limit in self.limits:
            most = allowed(limit, scenario)
            was, now = (chance(limit, rows_of(table)) for table in (before, after))
            if now > max(was, most / RESERVE):
                return f"undone: {limit.event} in about {now:.2g} of flights, before {was:.2g}; allowed are {most:.2g}"
        return ""

    def _short(self, tables: Sequence[Table]) -> float:
        """How far flights are from keeping all limits in all scenarios; 0: they keep them."""
        return self._excess(tables, self.limits)

    def _excess(self, tables: Sequence[Table], limits: Sequence[Limit]) -> float:
        return math.fsum(
            float(excess(limits, scenario, [rows_of(table)], RESERVE)[0])
            for scenario, table in zip(self.scenarios, tables, strict=True)
        )


def _broken(before: Table, after: Table) -> str:
    """Which constraint that held a step breaks in one scenario, in words; empty if none."""
    for name in SAFETY:
        if name in before:
            drop, _, low, _ = interval((before[name] - after[name]).tolist())
            if drop > SLACK and low > 0.0:
                return f"undone: {name} falls from {before[name].mean():.3g} to {after[name].mean():.3g}"
    for name, what in (("phi_wall", "leave the arena or enter obstacles"), ("n_coll", "have collisions")):
        if name in before:
            was, now = float((before[name] > 0.0).mean()), float((after[name] > 0.0).mean())
            if now - was > SLACK:
                return f"undone: {100.0 * now:.0f} % of flights {what}, before {100.0 * was:.0f} %"
    return ""


def _gains(before: Table, after: Table) -> bool:
    """Whether distances or clearances grew or excursions shrank, each with 95 % confidence."""
    wider = interval((after["r_min"] - before["r_min"]).tolist())[2] > 0.0
    if "phi_wall" not in before:
        return wider
    fewer = 1.0 * (before["phi_wall"] > 0.0) - 1.0 * (after["phi_wall"] > 0.0)
    changes = [fewer, before["phi_wall"] - after["phi_wall"]]
    if "clearance" in before:
        changes.append(after["clearance"] - before["clearance"])
    return wider or any(interval(change.tolist())[2] > 0.0 for change in changes)


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
