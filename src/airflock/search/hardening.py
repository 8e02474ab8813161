"""From an optimum to parameters that may be flown: Table S4 of Vásárhelyi et al. 2018, step by step.

The optimum of a fitness tolerates a few collisions. The paper makes it safe by hand, Table S4: more
repulsion, more alignment, a slower but earlier braking at walls. Each step here flies the same
seeds as the one before, so that its price in fitness and its gain in distance are differences of
pairs.

The table is a list of what to try, no more: what widens distances in one arena drives agents into
the trees of another. So a step stays only if it gains, costs little, and keeps every constraint
that held; else half of it is tried, else it is undone. What is left is judged on fresh seeds.
"""

import itertools
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from airflock import __version__
from airflock.certificates import EventLimit, estimated_probability
from airflock.runs import (
    CandidateBatch,
    Executor,
    Flight,
    FlightStore,
    ScenarioTask,
    declared_numbers,
    fingerprint,
    make_executor,
    open_folder,
    open_run,
    run_folder,
    unpublished,
)
from airflock.scenarios import Scenario, check_seeds, load_if_named, rebuilt
from airflock.search.generations import ZERO_FITNESS, zero_fitness_reason
from airflock.search.limit_excess import allowed_probability, limit_excess
from airflock.search.study import SearchSettings, read_limits
from airflock.search.study_result import document_with_numbers, mean_interval
from airflock.support import ErrorCollector, ScenarioError

ScoreColumns = Mapping[str, NDArray[np.float64]]  # score → its values (seed,)

S4 = "Table S4"


@dataclass(frozen=True)
class HardeningStep:
    """One change of the recipe: factors on keys, and why.

    braking_lead : time of flight (s) by which r0_shill grows, so that agents brake earlier at walls
                   and obstacles
    """

    name: str
    factors: Mapping[str, float]
    reason: str
    braking_lead: float = 0.0


# ratios of Table S4 to Table S1, columns 4, 6, 8 m/s: p_rep 2.3, 1.4, 1.7; C_frict 10, 10, 8;
# v_shill 0.74, 0.71, 0.61; r0_shill from 0.3, 0.5, 0.1 m to 0, 5, 30 m
TABLE_S4_STEPS = (
    HardeningStep("p_rep up", {"model.p_rep": 1.5}, f"{S4}: gain increased to prevent collisions"),
    HardeningStep("c_frict up", {"model.c_frict": 3.0}, f"{S4}: increased substantially to minimise oscillations"),
    HardeningStep("c_frict up again", {"model.c_frict": 3.0}, f"{S4}: 8 to 10 times in all, here in two steps"),
    HardeningStep(
        "v_shill down, r0_shill up", {"model.v_shill": 0.7}, f"{S4}: a higher r0_shill makes up for it", 0.5
    ),  # 0.5 s: 2 to 4 m; the paper's table has 0, 5 and 30 m
)
# where agents leave the arena or enter obstacles
WALL_STEPS = tuple(
    HardeningStep(name, {}, "our choice: earlier braking, nothing else", 0.5) for name in ("r0_shill up", "and again")
)


@dataclass(frozen=True)
class StepResult:
    """Parameters of one step and what they cost and gain against the optimum, over paired seeds.

    fitness, r_min, n_coll : mean over seeds; r_min (m) is the smallest distance of two agents in a
                             flight
    cost, gain : fitness lost and smallest distance won (m) against the first step: mean, and 95 %
                 interval
    parts    : mean of each partial fitness
    contacts : share of flights in which somebody left the arena or entered an obstacle; nan where
               nobody looked
    clearance : mean over seeds of the smallest distance to walls and obstacles, m; nan where nobody
                looked
    kept     : whether the step stays; verdict: why, or why not
    """

    name: str
    reason: str
    parameters: Mapping[str, float]
    fitness: float
    r_min: float
    n_coll: float
    cost: tuple[float, float, float]
    gain: tuple[float, float, float]
    parts: Mapping[str, float] = field(default_factory=dict)
    contacts: float = math.nan
    clearance: float = math.nan
    kept: bool = True
    verdict: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Return the step as plain values."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in vars(self).items()}


def optimum_parameters(scenario: Scenario, steps: Sequence[HardeningStep] = TABLE_S4_STEPS) -> dict[str, float]:
    """Return the numbers that the steps change, where hardening begins; refuse a model that lacks one."""
    known = declared_numbers(scenario)
    keys = {key for step in (*steps, *TABLE_S4_STEPS) for key in step.factors} | {"model.r0_shill"}
    if missing := sorted(key for key in keys if key not in known):
        where = f"{scenario.name}: no recipe for model {scenario.model.name}"
        raise ScenarioError([f"{where}: {key} is not a number of it" for key in missing])
    return {key: float(known[key][1] or 0.0) for key in sorted(keys)}


def parameters_after_step(
    scenario: Scenario, parameters: Mapping[str, float], step: HardeningStep, step_share: float = 1.0
) -> dict[str, float]:
    """Return the parameters after a step or a part of it; values stay inside their declared ranges."""
    known, found = declared_numbers(scenario), dict(parameters)
    for key, factor in step.factors.items():
        found[key] = _inside(found[key] * factor**step_share, known[key][0])
    if step.braking_lead:
        far = step_share * step.braking_lead * (scenario.resolved_metrics().v_flock or 0.0)
        found["model.r0_shill"] = _inside(found["model.r0_shill"] + far, known["model.r0_shill"][0])
    return found


def _inside(value: float, how: Any) -> float:
    return min(max(value, float(how.low)), float(how.high))


def compare_with_optimum(
    before: ScoreColumns,
    after: ScoreColumns,
    step: HardeningStep,
    parameters: Mapping[str, float],
) -> StepResult:
    """Compare a step with the optimum on the same seeds."""
    mean, _, low, high = mean_interval((before["fitness"] - after["fitness"]).tolist())
    won, _, least, most = mean_interval((after["r_min"] - before["r_min"]).tolist())
    parts = {name: float(values.mean()) for name, values in after.items() if name.startswith("f_")}
    contacts = float((after["phi_wall"] > 0.0).mean()) if "phi_wall" in after else math.nan
    room = float(after["clearance"].mean()) if "clearance" in after else math.nan
    fitness, near, hits = (float(after[name].mean()) for name in ("fitness", "r_min", "n_coll"))
    cost, gain = (mean, low, high), (won, least, most)
    return StepResult(step.name, step.reason, parameters, fitness, near, hits, cost, gain, parts, contacts, room)


def table_rows(table: ScoreColumns) -> list[dict[str, float]]:
    """Return the scores of each flight as a row."""
    names = list(table)
    return [dict(zip(names, row, strict=True)) for row in np.array([table[name] for name in names]).T.tolist()]


def join_rounds(rounds: Sequence[Sequence[ScoreColumns]]) -> list[ScoreColumns]:
    """Join the flights of all rounds to one table for each scenario."""
    return [
        {name: np.concatenate([t[name] for t in tables]) for name in tables[0]} for tables in zip(*rounds, strict=True)
    ]


def join_scenarios(tables: Sequence[ScoreColumns]) -> ScoreColumns:
    """Join the flights of all scenarios to one table of the scores that all of them have."""
    if len(tables) == 1:
        return tables[0]
    names = [name for name in tables[0] if all(name in table for table in tables)]
    return {name: np.concatenate([table[name] for table in tables]) for name in names}


CARRIED = "neighbours carried forward"
STOPS = "stop near a lost neighbour"


def measures(scenarios: Sequence[Scenario]) -> list[tuple[HardeningStep, list[Scenario], str]]:
    """Return measures that could change a flight in any scenario: step, changed scenarios, and what to set."""
    # Reported, never applied: whether the drones have such a program is not for a search to decide.
    found = []
    for name, reason, settings in (
        (CARRIED, "Vásárhelyi et al. 2018, Drone setup: positions are carried forward by velocities", _carried),
        (STOPS, "our choice: a neighbour that is not heard may still be near", _stops),
    ):
        changes = [settings(scenario) for scenario in scenarios]
        if not any(changes):
            continue
        try:
            flown = [rebuilt(s, change) if change else s for s, change in zip(scenarios, changes, strict=True)]
        except ScenarioError:  # the law has no such form, or the flock is too large for it
            continue
        first = next(change for change in changes if change)
        found.append(
            (HardeningStep(name, {}, reason), flown, " ".join(f"--set {key}={value}" for key, value in first.items()))
        )
    return found


def _carried(scenario: Scenario) -> dict[str, Any]:
    """Return settings by which each packet is carried forward until the next one; no further packet is lost."""
    if scenario.radio.rule.name != "constant" or scenario.radio.delay <= 0.0:
        return {}
    rate = max(10.0, 1.0 / max(scenario.sensors.period, scenario.flight.dt))
    far = min(max(scenario.radio.range, 1.0), 1e6)
    whole = {"radio.received_near": 1.0, "radio.received_far": 1.0, "radio.near": 0.5 * far, "radio.far": far}
    return {"radio.kind": "links", **whole, "radio.fast_rate": rate}


def _stops(scenario: Scenario) -> dict[str, Any]:
    """Return settings by which an agent stops near a lost neighbour, if packets may be lost."""
    deaf = any(entry.fault.radio is not None for entry in scenario.faults)
    lost = deaf or scenario.radio.rule.name not in ("constant", "vision") or scenario.radio.loss > 0.0
    return {"silence.rule": "stop"} if lost and scenario.silence.rule == "fly_on" else {}


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

    def limits_of(self, *, walls: bool) -> list[EventLimit]:
        """Return the limits of contacts with walls and obstacles, or all others."""
        return [limit for limit in self.limits if (limit.score in WALLS) is walls]

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


@dataclass(frozen=True)
class Hardening:
    """A hardening: everything that decides its result."""

    scenarios: Sequence[Scenario]
    seeds: Sequence[int]
    steps: Sequence[HardeningStep]
    constraints: Constraints
    kind = "hardening"
    also: ClassVar[Mapping[str, Any]] = {}

    def document(self) -> dict[str, Any]:
        """Return the hardening as plain values: the request in its folder."""
        return {
            "airflock": __version__,
            "rules": " ".join(fingerprint(each, 32) for each in self.scenarios),
            "names": [each.name for each in self.scenarios],
            "seeds": list(self.seeds),
            "cost": self.constraints.cost,
            "limits": [limit.text for limit in self.constraints.limits],
            "steps": [{"name": s.name, "factors": dict(s.factors), "braking_lead": s.braking_lead} for s in self.steps],
            **{f"scenario_{i}": unpublished(each) for i, each in enumerate(self.scenarios, 1)},
        }


class HardeningCandidate:
    """Candidate of hardening: the kept parameters and their flights; steps are judged against them and the optimum.

    Flights are one table for each scenario.

    first : the optimum
    """

    def __init__(
        self,
        work: Hardening,
        optimum: tuple[HardeningStep, dict[str, float]],
        store: FlightStore,
        executor: Executor,
        on_done: Callable[[], None] | None = None,
    ):
        self.scenarios, self.constraints, self.done = work.scenarios, work.constraints, on_done
        self.store, self.executor, self.number = store, executor, itertools.count()
        self.seeds, n = list(work.seeds), len(work.seeds)
        self.fresh = [[max(self.seeds) + 1 + n * k + i for i in range(n)] for k in range(MAX_FRESH_ROUNDS)]
        self.optimum = self.table = self._fly(optimum[1], self.seeds)
        self.kept, self.seen = [optimum], [optimum[1]]
        for scenario, table in zip(self.scenarios, self.optimum, strict=True):
            if float(table["fitness"].max()) < ZERO_FITNESS:
                why = zero_fitness_reason(table_rows(table))
                raise ScenarioError([f"{scenario.name}: does not fly, so it cannot be hardened{why}"])
        self.first = compare_with_optimum(join_scenarios(self.optimum), join_scenarios(self.optimum), *optimum)

    def touches(self) -> bool:
        """Return True if the kept set touches walls or obstacles in a flight, or more often than a limit allows."""
        seen = any("phi_wall" in table and float(table["phi_wall"].max()) > 0.0 for table in self.table)
        return seen or scenarios_excess(self.constraints.limits_of(walls=True), self.scenarios, self.table) > 0.0

    def is_short_at_walls(self) -> bool:
        """Return True if the limits of walls and obstacles are farther from being kept than the others."""
        walls, others = (
            scenarios_excess(limits, self.scenarios, self.table)
            for limits in (self.constraints.limits_of(walls=True), self.constraints.limits_of(walls=False))
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
        near = scenarios_excess(self.constraints.limits_of(walls=False), self.scenarios, now) > 0.0
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
        """Fly parameters with these seeds in each scenario, of the law itself or with a program beside it."""
        # Steps follow from flights alone, so a hardening that is resumed asks for the same flights in the same order.
        batch, n = CandidateBatch("harden", next(self.number), 0), len(self.scenarios)
        self.store.ask(batch, [[]], [parameters])
        flights = [
            Flight(0, j * n + place, parameters, seed, place) for j, seed in enumerate(seeds) for place in range(n)
        ]
        executor = make_executor([ScenarioTask(each) for each in scenarios]) if scenarios else self.executor
        flown = self.store.fly_missing(executor, batch, flights, self.done)
        if scenarios:
            executor.close()
        return [
            score_columns(scenario, [flown[0, j * n + place] for j in range(len(seeds))])
            for place, scenario in enumerate(self.scenarios)
        ]


def score_columns(scenario: Scenario, rows: Sequence[Mapping[str, Any]]) -> ScoreColumns:
    """Return the numbers among the scores of flights as columns (seed,)."""
    if not {"fitness", "r_min"} <= set(rows[0]):
        kind = scenario.metrics.rule.name
        raise ScenarioError([f"{scenario.name}: metrics.kind = '{kind}' has no fitness and no r_min"])
    names = [name for name, value in rows[0].items() if isinstance(value, (int, float))]
    return {name: np.array([row[name] for row in rows], float) for name in names}


COST = 0.05  # of fitness, at most
MAX_ROUNDS = 22  # rounds of flights, with all whole and half steps, the fresh seeds and measures beside the law


def harden(
    scenario: Scenario | str | os.PathLike[str] | Sequence[Scenario | str | os.PathLike[str]],
    seeds: int | Sequence[int] = range(100),
    *,
    steps: Sequence[HardeningStep] = TABLE_S4_STEPS,
    cost: float = COST,
    limit: str | Sequence[str] = (),
    threads: int | None = None,
    done: Callable[[], None] | None = None,
    folder: str | os.PathLike[str] | None = None,
) -> list[StepResult]:
    """Make an optimum safer by the steps of Vásárhelyi et al. 2018, Table S4, as far as all constraints hold.

    Parameters
    ----------
    scenario : Scenario, str or path (FILE|PRESET|DIR)
        An optimum: a scenario, or its name or file, such as best.toml of a study. Of several, which hold the same
        numbers of the law, a step must keep the constraints in each; means are over all of them.
    seeds : int in [2, 1000000] or sequence of int
        Number of flights of each step, with seeds 0, 1, 2, ..., or the seeds themselves; the result is judged on three
        times as many seeds after the largest of them.
    steps : sequence of Step
        Steps to try, one after another. Earlier braking is added if agents touch walls or obstacles; it comes first if
        walls are the larger problem.
    cost : float in [0, inf]
        Fitness, 0 to 1, that may be given up in all; a step towards limits that are not kept yet may cost more.
    limit : str or sequence of str
        Events and their largest rates, as `airflock.certify` has them. A step must not raise the estimated probability
        of an event above its limit, with a reserve of ten.
    threads : int, optional
        Flights side by side; by default one per core.
    done : callable, optional
        Called after each flight.
    folder : str or path (DIR), optional
        Folder that keeps every flight, in which a hardening that was interrupted goes on.

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
    ParameterError
        If `seeds` are neither a number of flights nor seeds.
    StudyError, Interrupted
        If the folder holds something else, or a flight fails; at Ctrl-C.

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
    work = Hardening(scenarios, check_seeds(seeds), steps, hardening_request(scenarios, cost, limit))
    optimum = HardeningStep("optimum", {}, "where hardening begins"), optimum_parameters(scenarios[0], steps)
    with run_folder(folder) as path:
        open_folder(path, work)
        executor = make_executor([ScenarioTask(each) for each in scenarios], threads=threads)
        with open_run(path, executor, is_stored=folder is not None) as store:
            return harden_in_steps(HardeningCandidate(work, optimum, store, executor, done), steps)


def harden_in_steps(trial: HardeningCandidate, steps: Sequence[HardeningStep]) -> list[StepResult]:
    """Try steps one after another, judge what is kept on fresh seeds; return all of them."""
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
    errors = ErrorCollector()
    held = read_limits({"limits": limit}, scenarios, errors)
    errors.add(*([] if 0.0 <= cost < math.inf else [f"cost = {cost:g} is not a fitness of 0 or more"]))
    errors.raise_errors()
    return Constraints(held, cost)


def hardened_document(scenario: Scenario, step: StepResult) -> dict[str, Any]:
    """Return a scenario file with the parameters of a step, each with its reason."""
    known = declared_numbers(scenario)
    changed = {key: value for key, value in step.parameters.items() if value != known[key][1]}
    entries = {
        key: {"value": value, "unit": known[key][0].unit, "source": f"hardened from {known[key][1]:g}"}
        for key, value in changed.items()
    }
    title = f"hardened from {scenario.name}: fitness {step.fitness:.4f}, r_min {step.r_min:.3g} m"
    return document_with_numbers(scenario, entries, title)
