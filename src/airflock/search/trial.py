"""Trial: steps that are tried one after another, the parameters that are kept, and their judgement on fresh seeds."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from airflock.scenarios import Scenario
from airflock.search.held import Constraints, has_gained, scenarios_excess
from airflock.search.landscape import ZERO_FITNESS, zero_fitness_reason
from airflock.search.measures import measures
from airflock.search.steps import (
    HardeningStep,
    ScoreColumns,
    StepResult,
    compare_with_optimum,
    fly_parameters,
    join_rounds,
    join_scenarios,
    parameters_after_step,
)
from airflock.support import ScenarioError

MAX_FRESH_ROUNDS = 3  # of fresh seeds: 4 % of flights with a contact pass 60 seeds in 30 % of all cases, 180 in 7 %


class HardeningCandidate:
    """Parameters that were kept so far, and their flights; each step is judged against them and the optimum.

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
                told = {name: values.tolist() for name, values in table.items()}
                rows = [dict(zip(told, row, strict=True)) for row in zip(*told.values(), strict=True)]
                raise ScenarioError(
                    [f"{scenario.name}: does not fly, so it cannot be hardened{zero_fitness_reason(rows)}"]
                )
        self.first = compare_with_optimum(join_scenarios(self.optimum), join_scenarios(self.optimum), *optimum)

    def touches(self) -> bool:
        """Whether what was kept so far touches walls or obstacles in some flight, or more often than a limit allows."""
        seen = any("phi_wall" in table and float(table["phi_wall"].max()) > 0.0 for table in self.table)
        return seen or scenarios_excess(self.constraints.wall_limits, self.scenarios, self.table) > 0.0

    def is_short_at_walls(self) -> bool:
        """Whether limits of walls and obstacles are farther from being kept than the others."""
        walls, others = (
            scenarios_excess(limits, self.scenarios, self.table)
            for limits in (self.constraints.wall_limits, self.constraints.other_limits)
        )
        return walls > others

    def tried(self, step: HardeningStep) -> list[StepResult]:
        """The step and, where it breaks something or costs too much, half of it."""
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
        """Whether a step that breaks nothing comes nearer to the limits, or gains distance or room at walls."""
        nearer = self.constraints.short(self.scenarios, table) < self.constraints.short(self.scenarios, self.table)
        return nearer or has_gained(join_scenarios(self.table), join_scenarios(table))

    def verify_on_fresh_seeds(self) -> StepResult:
        """What was kept, on seeds that chose nothing; the last step is undone until everything that held holds.

        Seeds come in rounds, so that what breaks much is undone after the first; the optimum alone flies one round.
        """
        before = [self._fly(self.kept[0][1], self.fresh[0])]
        after: list[list[ScoreColumns]] = []
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
        """What measures beside the numbers of the law would gain for what was kept, where agents come too near."""
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
        """Rounds of flights with what is kept, none if they break what held; `before` is of the optimum and grows."""
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
