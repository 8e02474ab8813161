"""Trial: steps that are tried one after another, the parameters that are kept, and their judgement on fresh seeds."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from airflock.errors import AirflockError, ScenarioError
from airflock.evolve.held import Broken, Constraints, excess_of, gains
from airflock.evolve.landscape import ZERO, why_zero
from airflock.evolve.margins import Margin
from airflock.evolve.measures import measures
from airflock.evolve.reach import Reach, reach, shortest
from airflock.evolve.steps import Measured, Step, Table, against, flown, joined, moved, together
from airflock.scenarios.scenario import Scenario

ROUNDS = 3  # of fresh seeds: 4 % of flights with a contact pass 60 seeds in 30 % of all cases, 180 in 7 %


class Trial:
    """Parameters that were kept so far, and their flights; each step is judged against them and the optimum.

    Flights are one table for each scenario.

    first  : the optimum; margins : how far those that were asked for reach with it, the shortest first
    along  : the shortest with what was kept so far, along which steps are judged; None where nothing breaks or none was
             asked for
    """

    def __init__(
        self,
        scenarios: Sequence[Scenario],
        optimum: tuple[Step, dict[str, float]],
        seeds: Sequence[int],
        constraints: Constraints,
        margins: Sequence[Margin] = (),
        threads: int | None = None,
        done: Callable[[], None] | None = None,
    ):
        self.scenarios, self.constraints, self.threads, self.done = scenarios, constraints, threads, done
        self.seeds, n = list(seeds), len(seeds)
        self.fresh = [[max(seeds) + 1 + n * k + i for i in range(n)] for k in range(ROUNDS)]
        self.optimum = self.table = self._fly(optimum[1], self.seeds)
        self.kept, self.seen = [optimum], [optimum[1]]
        for scenario, table in zip(scenarios, self.optimum, strict=True):
            if float(table["fitness"].max()) < ZERO:
                told = {name: values.tolist() for name, values in table.items()}
                rows = [dict(zip(told, row, strict=True)) for row in zip(*told.values(), strict=True)]
                raise ScenarioError([f"{scenario.name}: does not fly, so it cannot be hardened{why_zero(rows)}"])
        self.margins = shortest(margins, lambda worse: self._harm(worse, optimum[1], self.seeds, self.optimum))
        self.along = self.margins[0] if self.margins and self.margins[0].ends else None
        self.first = replace(
            against(together(self.optimum), together(self.optimum), *optimum),
            verdict=self._margins_told(),
            margins={each.margin.name: each.value for each in self.margins},
        )

    def _margins_told(self) -> str:
        """Which margin of the optimum is short, and how far the others reach; empty where none was asked for."""
        if not self.margins:
            return ""
        short = f"short is {self.margins[0].told}" if self.along else f"nothing is short; {self.margins[0].told}"
        others = ", ".join(f"{each.margin.name} {each.far}" for each in self.margins[1:])
        return f"{short}; farther reach {others}" if others else short

    def touches(self) -> bool:
        """Whether what was kept so far touches walls or obstacles in some flight, or more often than a limit allows.

        Or in some flight where the short margin ends.
        """
        seen = any("phi_wall" in table and float(table["phi_wall"].max()) > 0.0 for table in self.table)
        seen = seen or (self.along is not None and self.along.at_walls)
        return seen or excess_of(self.constraints.at_walls, self.scenarios, self.table) > 0.0

    def short_at_walls(self) -> bool:
        """Whether what is short is of walls and obstacles: the end of the short margin, or limits farther from kept."""
        if self.along is not None and self.along.at_walls:
            return True
        walls, others = (
            excess_of(limits, self.scenarios, self.table)
            for limits in (self.constraints.at_walls, self.constraints.elsewhere)
        )
        return walls > others

    def tried(self, step: Step) -> list[Measured]:
        """The step and, where it breaks something or costs too much, half of it."""
        found = []
        for part, name in ((1.0, step.name), (0.5, f"half of: {step.name}")):
            parameters = moved(self.scenarios[0], self.kept[-1][1], step, part)
            if parameters in self.seen:  # nothing changes, or it was undone before
                break
            self.seen.append(parameters)
            table, named = self._fly(parameters, self.seeds), replace(step, name=name)
            measured = against(together(self.optimum), together(table), named, parameters)
            refused = self.constraints.refused(self.scenarios, self.optimum, table)
            short = self.along
            now = None if refused or short is None else self._reach(short, parameters, self.seeds, self.optimum)
            if short is not None and now is not None:
                measured = replace(measured, margins={now.margin.name: now.value})
                refused = f"{now.told}; before {short.far}" if now.holds < short.holds else ""
            kept, said = (False, refused) if refused else self._gained(table, now)
            head = "kept" if kept else "undone"
            found.append(replace(measured, kept=kept, verdict=f"{head}: {said}" if said else head))
            if kept:
                self.kept.append((named, parameters))
                self.table = table
                self.along = None if now is None else self._short_now(now, parameters)
            if not refused:
                break
        return found

    def _short_now(self, now: Reach, parameters: Mapping[str, float]) -> Reach | None:
        """The margin that is short with what is kept now: this one, or another that did not reach so far before."""
        others = [
            each for each in self.margins if each.margin is not now.margin and each.ends and each.holds < now.holds
        ]
        found = [now, *(self._reach(each, parameters, self.seeds, self.optimum) for each in others)]
        return min((each for each in found if each.ends), key=lambda each: each.holds, default=None)

    def _gained(self, table: Sequence[Table], now: Reach | None) -> tuple[bool, str]:
        """Whether a step that breaks nothing is kept, and why; now : how far the short margin reaches with it."""
        if now is not None and self.along is not None and now.holds > self.along.holds:
            return True, f"{now.told}; before {self.along.far}"
        nearer = self.constraints.short(self.scenarios, table) < self.constraints.short(self.scenarios, self.table)
        if nearer or gains(together(self.table), together(table)):
            return True, "" if now is None else f"{now.margin.name} {now.far} as before"
        if now is None:
            return False, "gains no distance and no room at walls"
        return False, f"gains no distance, no room at walls and no {now.margin.name}"

    def on_fresh_seeds(self) -> Measured:
        """What was kept, on seeds that chose nothing; the last step is undone until everything that held holds.

        Seeds come in rounds, so that what breaks much is undone after the first; the optimum alone flies one round.
        The short margin is measured anew, of the optimum and of what was kept, on the first of them.
        """
        before = [self._fly(self.kept[0][1], self.fresh[0])]
        was = self._fresh_reach(before[0])
        now = was
        after: list[list[Table]] = []
        while len(self.kept) > 1 and not after:
            after = self._lasting(before)
            if after and was is not None:
                now = self._reach(was, self.kept[-1][1], self.fresh[0], before[0])
                if now.holds < was.holds or self._others_end(was.holds, before[0]):
                    after = []
            if not after:
                self.kept.pop()
                self.table, now = [], was
        parameters = self.kept[-1][1]
        then, last = (together(joined(rounds)) for rounds in (before, after or before))
        left = [step.name for step, _ in self.kept[1:]]
        said = f"kept: {', '.join(left)}" if left else "no step was kept: the optimum is unchanged"
        found = against(then, last, Step("on fresh seeds", {}, said), parameters)
        if was is not None and now is not None:
            said = f"{said}; {now.told}{f'; before {was.far}' if left else ''}"
            found = replace(found, margins={now.margin.name: now.value})
        return replace(found, verdict=said, kept=bool(left))

    def _fresh_reach(self, before: Sequence[Table]) -> Reach | None:
        """How far the margin that was short reaches with the optimum, on fresh seeds; None where none was."""
        if not self.margins or not self.margins[0].ends:
            return None
        return self._reach(self.margins[0], self.kept[0][1], self.fresh[0], before)

    def _others_end(self, factor: float, before: Sequence[Table]) -> bool:
        """Whether a margin that was longer now ends before the shortest did, on fresh seeds."""
        for other in self.margins[1:] if factor > 1.0 else ():
            worse = other.margin.worse(factor)
            now, was = self.kept[-1][1], self.kept[0][1]
            if self._harm(worse, now, self.fresh[0], before) and not self._harm(worse, was, self.fresh[0], before):
                return True
        return False

    def beside(self) -> list[Measured]:
        """What measures beside the numbers of the law would gain for what was kept, where agents come too near."""
        now, parameters = self.table or self._fly(self.kept[-1][1], self.seeds), self.kept[-1][1]
        before = together(now)
        near = excess_of(self.constraints.elsewhere, self.scenarios, now) > 0.0
        if not (before["n_coll"] > 0.0).any() and not near:
            return []
        found = []
        for step, scenarios, said in measures(self.scenarios):
            after = together(self._fly(parameters, self.seeds, scenarios))
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
            if self.constraints.refused(self.scenarios, joined(before[:count]), joined(after)):
                return []
        return after

    def _fly(
        self, parameters: Mapping[str, float], seeds: Sequence[int], scenarios: Sequence[Scenario] = ()
    ) -> list[Table]:
        return [flown(each, [parameters], seeds, self.threads, self.done)[0] for each in scenarios or self.scenarios]

    def _harm(
        self, worse: Sequence[Scenario], parameters: Mapping[str, float], seeds: Sequence[int], before: Sequence[Table]
    ) -> Broken | None:
        """What that held for the optimum no longer holds where scenarios are worse; None if all does."""
        try:
            return self.constraints.broken(worse, before, self._fly(parameters, seeds, worse), surely=True)
        except AirflockError as fault:  # no room for so many agents, for instance
            return Broken(f"cannot be flown: {str(fault).splitlines()[0]}")

    def _reach(
        self, near: Reach, parameters: Mapping[str, float], seeds: Sequence[int], before: Sequence[Table]
    ) -> Reach:
        """How far a margin reaches with other parameters or on other seeds, beginning where it did."""
        return reach(near.margin, lambda worse: self._harm(worse, parameters, seeds, before), near)
