"""From an optimum to parameters that may be flown: Table S4 of Vásárhelyi et al. 2018, step by step.

The optimum of a fitness tolerates a few collisions. The paper makes it safe by hand, Table S4: more
repulsion, more alignment, a slower but earlier braking at walls. Each step here flies the same
seeds as the one before, so that its price in fitness and its gain in distance are differences of
pairs.

The table is a list of what to try, no more: what widens distances in one arena drives agents into
the trees of another. So a step stays only if it gains, costs little, and keeps every constraint
that held; else half of it is tried, else it is undone. What is left is judged on fresh seeds.
"""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from airflock.certificates import EventLimit, estimated_probability
from airflock.runs import declared_numbers, to_toml_values
from airflock.scenarios import Scenario, formats, load_if_named
from airflock.search.generations import ZERO_FITNESS, zero_fitness_reason
from airflock.search.hardening_steps import (
    TABLE_S4_STEPS,
    WALL_STEPS,
    HardeningStep,
    ScoreColumns,
    StepResult,
    compare_with_optimum,
    fly_parameters,
    join_rounds,
    join_scenarios,
    measures,
    parameters_after_step,
    recipe_parameters,
    table_rows,
)
from airflock.search.limit_excess import allowed_probability, limit_excess
from airflock.search.objectives import read_limits
from airflock.search.search_settings import SearchSettings
from airflock.search.study_result import mean_interval
from airflock.support import ScenarioError

SAFETY = ("f_coll", "f_disc", "f_cluster", "f_wall")  # partial fitnesses that are constraints; the others are its price
# The recipe of Table S4, flown to its end, moved the partial fitness of walls from 0.995 to 0.14 in
# an L-shaped field.
SLACK = 0.02  # by which the mean of one may fall, and the share of flights with a contact may rise
WALLS = ("clearance", "phi_wall", "n_contacts", "f_wall")  # scores of what flies into walls and obstacles
RESERVE = SearchSettings().reserve  # how many times rarer than allowed an event is to look, as in a search


@dataclass(frozen=True)
class Constraints:
    """Constraints that each step must keep in all scenarios; flights are one table for each scenario.

    limits : events that may happen so rarely; cost : fitness that may be given up in all
    """

    limits: Sequence[EventLimit]
    cost: float

    @property
    def wall_limits(self) -> list[EventLimit]:
        """Limits of contacts with walls and obstacles."""
        return [limit for limit in self.limits if limit.score in WALLS]

    @property
    def other_limits(self) -> list[EventLimit]:
        """All other limits."""
        return [limit for limit in self.limits if limit.score not in WALLS]

    def refused(
        self, scenarios: Sequence[Scenario], before: Sequence[ScoreColumns], after: Sequence[ScoreColumns]
    ) -> str:
        """Return why a step is refused: the constraint that it breaks, or its cost; empty if it may stay."""
        for scenario, was, now in zip(scenarios, before, after, strict=True):
            if found := violation_text(was, now) or self._limit_broken(scenario, was, now):
                return f"{found}, in {scenario.name}" if len(scenarios) > 1 else found
        # Safety is worth more than the price: a step towards limits that are not kept yet may cost
        # any fitness.
        if self.short(scenarios, after) < self.short(scenarios, before):
            return ""
        price = float((join_scenarios(before)["fitness"] - join_scenarios(after)["fitness"]).mean())
        return f"costs {price:.3g} of fitness, more than {self.cost:g}" if price > self.cost else ""

    def short(self, scenarios: Sequence[Scenario], tables: Sequence[ScoreColumns]) -> float:
        """Return how far flights are from keeping all limits in all scenarios; 0: they keep them."""
        return scenarios_excess(self.limits, scenarios, tables)

    def _limit_broken(self, scenario: Scenario, before: ScoreColumns, after: ScoreColumns) -> str:
        """Return which limit that was kept is broken, or broken more than before, in words; empty if none."""
        for limit in self.limits:
            # With the reserve: an estimate from some flights is uncertain by about that factor.
            most = allowed_probability(limit, scenario)
            was, now = (estimated_probability(limit, table_rows(table)) for table in (before, after))
            if now > max(was, most / RESERVE):
                return f"{limit.event} in about {now:.2g} of flights, before {was:.2g}; allowed are {most:.2g}"
        return ""


def scenarios_excess(
    limits: Sequence[EventLimit], scenarios: Sequence[Scenario], tables: Sequence[ScoreColumns]
) -> float:
    """Return how far flights are from keeping these limits, in standard deviations added up over scenarios."""
    return math.fsum(
        float(limit_excess(limits, scenario, [table_rows(table)], RESERVE)[0])
        for scenario, table in zip(scenarios, tables, strict=True)
    )


def violation_text(before: ScoreColumns, after: ScoreColumns) -> str:
    """Return which constraint that held is broken in one scenario, in words; empty if none."""
    for name in SAFETY:
        if name in before:
            drop, _, low, _ = mean_interval((before[name] - after[name]).tolist())
            # Both: a mean may drop by chance, and with many seeds a harmless drop is significant.
            if drop > SLACK and low > 0.0:
                return f"{name} falls from {before[name].mean():.3g} to {after[name].mean():.3g}"
    for name, what in (("phi_wall", "leave the arena or enter obstacles"), ("n_coll", "have collisions")):
        if name in before:
            was, now = float((before[name] > 0.0).mean()), float((after[name] > 0.0).mean())
            if now - was > SLACK:
                return f"{100.0 * now:.0f} % of flights {what}, before {100.0 * was:.0f} %"
    return ""


def has_gained(before: ScoreColumns, after: ScoreColumns) -> bool:
    """Return True if distances or clearances grew or excursions shrank, each with 95 % confidence."""
    wider = mean_interval((after["r_min"] - before["r_min"]).tolist())[2] > 0.0
    if "phi_wall" not in before:
        return wider
    fewer = 1.0 * (before["phi_wall"] > 0.0) - 1.0 * (after["phi_wall"] > 0.0)
    changes = [fewer, before["phi_wall"] - after["phi_wall"]]
    if "clearance" in before:
        changes.append(after["clearance"] - before["clearance"])
    return wider or any(mean_interval(change.tolist())[2] > 0.0 for change in changes)


MAX_FRESH_ROUNDS = 3  # of fresh seeds: 4 % of flights with a contact pass 60 seeds in 30 % of all cases, 180 in 7 %


class HardeningCandidate:
    """Candidate of hardening: the kept parameters and their flights; steps are judged against them and the optimum.

    Flights are one table for each scenario.

    first : the optimum
    """

    def __init__(
        self,
        scenarios: Sequence[Scenario],
        optimum: tuple[HardeningStep, dict[str, float]],
        seeds: Sequence[int],
        constraints: Constraints,
        threads: int | None = None,
        on_done: Callable[[], None] | None = None,
    ):
        self.scenarios, self.constraints, self.threads, self.done = scenarios, constraints, threads, on_done
        self.seeds, n = list(seeds), len(seeds)
        self.fresh = [[max(seeds) + 1 + n * k + i for i in range(n)] for k in range(MAX_FRESH_ROUNDS)]
        self.optimum = self.table = self._fly(optimum[1], self.seeds)
        self.kept, self.seen = [optimum], [optimum[1]]
        for scenario, table in zip(scenarios, self.optimum, strict=True):
            if float(table["fitness"].max()) < ZERO_FITNESS:
                columns = {name: values.tolist() for name, values in table.items()}
                rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
                raise ScenarioError(
                    [f"{scenario.name}: does not fly, so it cannot be hardened{zero_fitness_reason(rows)}"]
                )
        self.first = compare_with_optimum(join_scenarios(self.optimum), join_scenarios(self.optimum), *optimum)

    def touches(self) -> bool:
        """Return True if the kept set touches walls or obstacles in a flight, or more often than a limit allows."""
        seen = any("phi_wall" in table and float(table["phi_wall"].max()) > 0.0 for table in self.table)
        return seen or scenarios_excess(self.constraints.wall_limits, self.scenarios, self.table) > 0.0

    def is_short_at_walls(self) -> bool:
        """Return True if the limits of walls and obstacles are farther from being kept than the others."""
        walls, others = (
            scenarios_excess(limits, self.scenarios, self.table)
            for limits in (self.constraints.wall_limits, self.constraints.other_limits)
        )
        return walls > others

    def tried(self, step: HardeningStep) -> list[StepResult]:
        """Try the step and, if it breaks a constraint or costs too much, half of it."""
        found = []
        for part, name in ((1.0, step.name), (0.5, f"half of: {step.name}")):
            parameters = parameters_after_step(self.scenarios[0], self.kept[-1][1], step, part)
            if parameters in self.seen:  # nothing changes, or it was undone before
                break
            self.seen.append(parameters)
            table, named = self._fly(parameters, self.seeds), replace(step, name=name)
            measured = compare_with_optimum(join_scenarios(self.optimum), join_scenarios(table), named, parameters)
            refused = self.constraints.refused(self.scenarios, self.optimum, table)
            kept = not refused and self._gained(table)
            verdict = "kept" if kept else f"undone: {refused or 'gains no distance and no room at walls'}"
            found.append(replace(measured, kept=kept, verdict=verdict))
            if kept:
                self.kept.append((named, parameters))
                self.table = table
            if not refused:
                break
        return found

    def _gained(self, table: Sequence[ScoreColumns]) -> bool:
        """Return True if a step comes nearer to the limits, or gains distance or room at walls."""
        nearer = self.constraints.short(self.scenarios, table) < self.constraints.short(self.scenarios, self.table)
        return nearer or has_gained(join_scenarios(self.table), join_scenarios(table))

    def verify_on_fresh_seeds(self) -> StepResult:
        """Fly the kept set on seeds that chose nothing; undo the last step until all constraints hold.

        Seeds come in rounds, so that a set that breaks much is undone after the first. The optimum
        flies one round.
        """
        before = [self._fly(self.kept[0][1], self.fresh[0])]
        after: list[list[ScoreColumns]] = []
        # From the last step backwards: later steps were judged on top of the earlier ones.
        while len(self.kept) > 1 and not after:
            after = self._lasting(before)
            if not after:
                self.kept.pop()
                self.table = []
        parameters = self.kept[-1][1]
        then, last = (join_scenarios(join_rounds(rounds)) for rounds in (before, after or before))
        left = [step.name for step, _ in self.kept[1:]]
        said = f"kept: {', '.join(left)}" if left else "no step was kept: the optimum is unchanged"
        found = compare_with_optimum(then, last, HardeningStep("on fresh seeds", {}, said), parameters)
        return replace(found, verdict=said, kept=bool(left))

    def beside(self) -> list[StepResult]:
        """Measure what programs on board would gain for the kept set, if agents come too near."""
        now, parameters = self.table or self._fly(self.kept[-1][1], self.seeds), self.kept[-1][1]
        before = join_scenarios(now)
        near = scenarios_excess(self.constraints.other_limits, self.scenarios, now) > 0.0
        if not (before["n_coll"] > 0.0).any() and not near:
            return []
        found = []
        for step, scenarios, said in measures(self.scenarios):
            after = join_scenarios(self._fly(parameters, self.seeds, scenarios))
            was, is_now = (100.0 * float((table["n_coll"] > 0.0).mean()) for table in (before, after))
            verdict = f"no part of the set: {is_now:.0f} % of flights have collisions, {was:.0f} % without it; {said}"
            found.append(replace(compare_with_optimum(before, after, step, parameters), kept=False, verdict=verdict))
        return found

    def _lasting(self, before: list[list[ScoreColumns]]) -> list[list[ScoreColumns]]:
        """Return rounds of flights of the kept set; none if they break a constraint. `before` (optimum) grows."""
        after: list[list[ScoreColumns]] = []
        for count, seeds in enumerate(self.fresh, start=1):
            if len(before) < count:
                before.append(self._fly(self.kept[0][1], seeds))
            after.append(self._fly(self.kept[-1][1], seeds))
            if self.constraints.refused(self.scenarios, join_rounds(before[:count]), join_rounds(after)):
                return []
        return after

    def _fly(
        self, parameters: Mapping[str, float], seeds: Sequence[int], scenarios: Sequence[Scenario] = ()
    ) -> list[ScoreColumns]:
        return [
            fly_parameters(each, [parameters], seeds, self.threads, self.done)[0]
            for each in scenarios or self.scenarios
        ]


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
    """Make an optimum safer by the steps of Vásárhelyi et al. 2018, Table S4, as far as all constraints hold.

    Parameters
    ----------
    scenario : Scenario, str or path
        An optimum: a scenario, or its name or file, such as best.toml of a study. Of several, which hold the same
        numbers of the law, a step must keep the constraints in each; means are over all of them.
    seeds : sequence of int
        Seeds of the flights of each step; the result is judged on three times as many seeds after the largest of them.
    steps : sequence of Step
        Steps to try, one after another. Earlier braking is added if agents touch walls or obstacles; it comes first if
        walls are the larger problem.
    cost : float
        Fitness, 0 to 1, that may be given up in all; a step towards limits that are not kept yet may cost more.
    limit : str or sequence of str
        Events and their largest rates, as `airflock.certify` has them. A step must not raise the estimated probability
        of an event above its limit, with a reserve of ten.
    threads : int, optional
        Flights side by side; by default one per core.
    done : callable, optional
        Called after each flight.

    Returns
    -------
    list of StepResult
        The optimum, each tried step with its verdict, the gain of programs on board if agents still come too near, and
        last the kept set on fresh seeds: parameters, fitness, r_min (m), cost and gain, partial fitnesses, contacts
        with walls.

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
    # Walls first if they are hit more often than agents: a step that widens distances drives agents
    # into walls.
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
    """Return the constraints of a request. Raises ScenarioError with all errors together."""
    held, errors = read_limits({"limits": limit}, scenarios)
    errors += [] if 0.0 <= cost < math.inf else [f"cost = {cost:g} is not a fitness of 0 or more"]
    if errors:
        raise ScenarioError(errors)
    return Constraints(held, cost)


def hardened_document(scenario: Scenario, step: StepResult) -> dict[str, Any]:
    """Return a scenario file with the parameters of a step, each with its reason."""
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
