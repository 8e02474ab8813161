"""Attack: the smallest disturbance that breaks a flock, found by search and judged on flights that chose nothing.

Search: each candidate (who, when, how long, which way) branches off undisturbed flights, which are
flown once. What is minimised is the smallest distance of a branch, which says how near a candidate
comes long before any has the event. As soon as one breaks the flock, all go on with less.

Choice and judging: whole flights from their start. Seeds of search, choice and judging never meet,
as the best of many candidates looks better on the seeds that chose it than it is.
"""

import math
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from os import PathLike
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from airflock.certificates.causes import EVENTS, check_event, measured_by_contacts
from airflock.certificates.limits import lower_bound
from airflock.core import declarations
from airflock.engine import Flight, score_flights
from airflock.parts import FAULTS
from airflock.recordings import upper_probability_bound
from airflock.runs import write_toml_file
from airflock.scenarios import Scenario, formats, named_fault_entries, scenario_variant
from airflock.support import (
    ErrorCollector,
    FlightError,
    ScenarioError,
    expand_path,
    log,
    result_group,
    result_table,
    run_in_threads,
    suggest,
)

WIND = "wind"
KINDS = "gnss_offset,gnss_drift,radio_silent,pretender,wind"
PROBABILITY = 0.5
BUDGET = 300.0  # s
# Seeds of search, choice and judging begin beyond those of studies and people, and below those of certificates.
SEARCH, CHOICE, JUDGING = (1 << 61, (1 << 61) + (1 << 30), (1 << 61) + (1 << 31))
SEARCH_FLIGHTS, CHOICE_FLIGHTS, JUDGED_FLIGHTS = 6, 24, 100
MOMENTS = 16  # at which a disturbance may begin, from a tenth of the flight to its half
LONGEST = 0.5  # of a flight, that a disturbance can last whenever it begins
PART = 5.0  # s: a branch ends in the part in which the event happens,
AFTER = 10.0  # s: or so long after the end of its disturbance
NO_EVENT = 1e-3  # m: margin of a branch that was measured to be nearer than a limit, and yet has no event
BATCH = 16  # candidates of a round; a number of its own, so that threads change no result
ELITES = 8
PATIENCE = 6  # rounds in which nothing breaks the flock, after which no smaller dose is looked for
RESTARTS = 6  # times that the search begins anew while no flight at all has had the event
FRESH = 0.3  # share of candidates that are drawn anew: restarts
SEARCH_STEP = 1.5  # ratio of two doses of the search
CURVE_STEP, CURVE = 1.25, range(-5, 6)  # ratio and places of the judged doses, around the one that was found
CONFIDENCE = 0.95  # of the interval of a dose: all bounds of its curve hold together
WIND_MOST = 20.0  # m/s, a gale

Settings = dict[str, Any]


class Candidate(NamedTuple):
    """A disturbance but for its dose: of which agent, from which of MOMENTS on, share of the rest, direction (rad)."""

    agent: int
    moment: int
    lasts: float
    direction: float


@dataclass(frozen=True)
class Disturbance:
    """How much of a kind is how much of its dose: `amount` of `unit`, at most `most`.

    numbers : of the fault, by which its dose is given: east and north, share (that is lost), one
              other, or none, and
    then the dose is how long it lasts
    """

    kind: str
    unit: str
    most: float
    numbers: tuple[str, ...] = ()

    def time(self, scenario: Scenario, candidate: Candidate, amount: float) -> tuple[float, float]:
        """Return when a disturbance begins and how long it lasts, s."""
        if self.kind == WIND:
            return 0.0, scenario.flight.duration
        begin = begin_of(scenario, candidate.moment)
        return begin, candidate.lasts * (scenario.flight.duration - begin) if self.numbers else amount

    def settings(self, scenario: Scenario, candidate: Candidate, amount: float) -> Settings:
        """Return the keys of a scenario that is disturbed so."""
        east, north = (amount * turn(candidate.direction) for turn in (math.cos, math.sin))
        if self.kind == WIND:
            return {"wind.east": scenario.wind.east + east, "wind.north": scenario.wind.north + north}
        begin, lasts = self.time(scenario, candidate, amount)
        values: Settings = dict(zip(self.numbers, (east, north), strict=False))
        if self.numbers == ("share",):
            values = {"share": 1.0 - amount}
        elif len(self.numbers) == 1:
            values = {self.numbers[0]: math.copysign(amount, east)}
        entry = {"kind": self.kind, "agents": [candidate.agent], "at": begin, "lasts": max(lasts, scenario.flight.dt)}
        return {"faults": [*named_fault_entries(scenario), entry | values]}


def begin_of(scenario: Scenario, moment: int) -> float:
    """Return when a disturbance begins, s, at a motion step; the start for moment -1."""
    share = 0.0 if moment < 0 else 0.1 + (1.0 - LONGEST - 0.1) * moment / (MOMENTS - 1)
    return round(share * scenario.flight.duration / scenario.flight.dt) * scenario.flight.dt


def disturbance(text: str, scenario: Scenario) -> Disturbance:
    """Return how the dose of a kind is given, KIND or KIND=LARGEST. Raises ScenarioError where that cannot be flown."""
    kind, equals, largest = (part.strip() for part in text.partition("="))
    known = {} if kind not in FAULTS else {name: how for name, how, _ in declarations(FAULTS[kind].Parameters)}
    pairs = (("east", "north"), ("share",))
    names = next((each for each in pairs if {*each} <= {*known}), tuple(known)[:1])
    how: Any = known[names[0]] if names else None
    if kind == WIND:
        made = Disturbance(kind, "m/s", WIND_MOST, pairs[0])
    elif kind not in FAULTS:
        hint = suggest(kind, [WIND, *FAULTS], f"known: {WIND}, {', '.join(FAULTS)}")
        raise ScenarioError([f"kinds: {kind}: unknown; {hint}"])
    elif FAULTS[kind].leaves is not None:
        raise ScenarioError([f"kinds: {kind}: an agent that drops out has no dose; add the fault to the scenario"])
    elif how is None:
        made = Disturbance(kind, "s", LONGEST * scenario.flight.duration)
    else:
        most = 1.0 if names == ("share",) else float((how.usual or (0.0, how.high))[1])
        made = Disturbance(kind, how.unit, most, names)
    if equals:
        most = float(largest) if re.fullmatch(r"[\d.]+(e-?\d+)?", largest) else math.nan
        if not 0.0 < most <= (1e3 if kind == WIND else how.high if how is not None else made.most):
            raise ScenarioError([f"kinds: {text}: {largest} is no largest dose in {made.unit}; {made.most:g} is usual"])
        made = replace(made, most=float(most))
    try:
        scenario_variant(scenario, made.settings(scenario, Candidate(0, 0, 1.0, 0.0), made.most))
    except ScenarioError as error:
        raise ScenarioError([f"kinds: {kind}: {scenario.name} cannot suffer it: {error}"]) from error
    return made


def _amount(dose: float, unit: str) -> str:
    """Return a dose in words; one without unit is a share that is lost."""
    return f"a loss of {dose:.0%}" if unit == "1" else f"{dose:.3g} {unit}"


@dataclass(frozen=True)
class AttackRow:
    """The smallest dose of one kind that was found to break the flock.

    dose, low, high : at which the event has the stated probability, with its interval (95 %); inf
                      where it is not
    reached; unit : of all doses; share : of judged flights with the event at `dose`, or else at the
                    largest dose
    agent, at, lasts, direction : who (None: all), from when and for how long (s), towards where
                                  (degrees from east)
    curve : for each dose: dose, events, flights, low, high (probability, all together 95 %)
    settings : keys of the scenario that flies it; seed : of a judged flight with the event, None if
               there is none
    flights : flown by the search, in durations of a whole flight; first : those before its first
              event; None: no event
    """

    kind: str
    unit: str
    dose: float
    low: float
    high: float
    share: float
    agent: int | None
    at: float
    lasts: float
    direction: float
    curve: tuple[tuple[float, int, int, float, float], ...]
    settings: Settings
    seed: int | None
    flights: float
    first: float | None


@dataclass(frozen=True)
class AttackResult:
    """Which smallest disturbances break a flock.

    scenario : as it was given; event : in words; probability : share of flights with the event that
               counts as broken
    undisturbed : events and flights without any disturbance, on the seeds of judging; rows : one a
                  kind
    """

    scenario: Scenario
    event: str
    probability: float
    undisturbed: tuple[int, int]
    rows: tuple[AttackRow, ...]
    notes: tuple[str, ...] = field(default_factory=tuple)

    def attacked(self, kind: str) -> Scenario:
        """Return the scenario with the disturbance of a kind in it: a further world for evolve, harden and certify.

        Raises ScenarioError for a kind that was not tried.

        Examples
        --------
        >>> import airflock
        >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 20.0})
        >>> found = airflock.attack(short, ["gnss_offset"], budget=1.0)
        >>> found.attacked("gnss_offset").faults[0].fault.name
        'gnss_offset'
        """
        for row in self.rows:
            if row.kind == kind:
                return scenario_variant(self.scenario, row.settings)
        raise ScenarioError([f"kind = {kind!r}: was not tried; there are {', '.join(row.kind for row in self.rows)}"])

    def save(self, path: str | PathLike[str], kind: str) -> Any:
        """Write a scenario file that flies the disturbance of a kind, and return its path.

        Raises ScenarioError for a kind that was not tried.

        Examples
        --------
        >>> import airflock
        >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 20.0})
        >>> airflock.attack(short, ["gnss_offset"], budget=1.0).save("broken.toml", "gnss_offset").name
        'broken.toml'
        """
        document = {key: value for key, value in self.attacked(kind).document.items() if key != "published"}
        target = expand_path(path)
        write_toml_file(target, {formats.KEY: formats.FORMAT, **document}, f"{kind} that was found by airflock attack.")
        return target

    @property
    def table(self) -> Any:
        """Return a table with a row for each kind."""
        import pandas as pd  # not on top: a flight needs no tables

        return pd.DataFrame([asdict(row) for row in self.rows]).drop(columns=["curve", "settings"])

    @property
    def text(self) -> str:
        """Return which dose of which kind breaks the flock, in plain sentences."""
        said = [f"{self.event}, in {self.undisturbed[0]} of {self.undisturbed[1]} flights without any disturbance."]
        for row in self.rows:
            if math.isinf(row.dose):
                most = _amount(row.curve[-1][0], row.unit)
                said.append(f"{row.kind}: nothing up to {most} was found to do so; {row.share:.0%} of flights at most.")
                continue
            upper = "more than was tried" if math.isinf(row.high) else _amount(row.high, row.unit)
            who = "for all" if row.agent is None else f"for agent {row.agent} from {row.at:.3g} s on"
            low = f"{row.low:.0%}" if row.unit == "1" else f"{row.low:.3g}"
            span = f"{_amount(row.dose, row.unit)} (between {low} and {upper}, 95 %)"
            said.append(f"{row.kind}: {span} {who} brings it in {row.share:.0%} of flights.")
        return " ".join(said)

    def document(self) -> dict[str, Any]:
        """Return the result as plain values, for JSON.

        Examples
        --------
        >>> import airflock
        >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 20.0})
        >>> airflock.attack(short, ["gnss_offset"], budget=1.0).document()["rows"][0]["kind"]
        'gnss_offset'
        """
        made = {**vars(self), "scenario": self.scenario.name, "text": self.text}
        return made | {"rows": [asdict(row) for row in self.rows]}

    def __repr__(self) -> str:
        return f"<Attack on {self.scenario.name}: {self.text}>"

    def __rich__(self) -> Any:
        """Return sentences, table and notes, for a terminal."""

        def shown(value: float) -> str:
            return f"{value:.3g}" if math.isfinite(value) else "none"

        cells = []
        for row in self.rows:
            who = "all" if row.agent is None else f"agent {row.agent}"
            way = f" towards {row.direction:.0f}°" if math.isfinite(row.direction) else ""
            how = f"{who}{way}, {row.at:.0f} to {row.at + row.lasts:.0f} s"
            span = f"{shown(row.low)} to {shown(row.high)}" if math.isfinite(row.dose) else f"above {shown(row.low)}"
            cells.append((row.kind, row.unit, shown(row.dose), span, f"{row.share:.0%}", how, f"{row.flights:.0f}"))
        title = f"smallest dose with the event in {self.probability:.0%} of flights"
        heads = "kind; unit; >dose; >95 %; >broken; disturbance; >flights"
        return result_group(self.text, result_table(title, heads, cells), *self.notes)


def attack(
    scenario: Scenario | str | PathLike[str],
    kinds: str | Sequence[str] = KINDS,
    *,
    event: str = "pair",
    limit: float | None = None,
    probability: float = PROBABILITY,
    budget: float = BUDGET,
    threads: int | None = None,
    settings: Mapping[str, Any] | None = None,
    law: Any = None,
    trust: bool = False,
    say: Callable[[str], None] = log,
) -> AttackResult:
    """Find the smallest disturbance that breaks a flock: who, when, how long, which way and how much.

    Parameters
    ----------
    scenario : Scenario, str or path (PRESET|FILE)
        What is flown. Its flights should be safe: those with the event are no start of a search.
    kinds : str or sequence of str (KIND,KIND)
        Kinds of faults of one agent, such as gnss_offset or motor, or wind, which all have in the whole flight; with
        the largest dose to try, such as gnss_offset=8. The dose is the length of the vector, the share that is lost,
        or how long a fault without numbers lasts.
    event : {"pair", "world"}
        pair: two agents nearer than `limit`; world: an agent touches a wall, an obstacle or the scene.
    limit : float, optional
        Distance of a pair, m; by default metrics.r_coll.
    probability : float in [0.05, 0.95]
        Share of flights with the event from which on the flock counts as broken.
    budget : float
        Time for the search over all kinds, s; judging comes on top, with about a thousand flights a kind.
    threads : int, optional
        Flights side by side; by default one per core.
    settings : mapping, optional
        Keys of the scenario to change.
    law : optional
        A law of the user's own, as `airflock.load` takes it.
    trust : bool
        Whether code that files name may run.
    say : callable
        Called with a line now and then.

    Returns
    -------
    AttackResult
        text, in sentences; table, a row for each kind; `attacked` and `save`, the scenario that flies it.

    Raises
    ------
    ScenarioError, FlightError, ParameterError
        If a kind is unknown or the scenario cannot suffer it, an argument is out of its range, or the flock breaks
        without any disturbance.

    Notes
    -----
    That nothing smaller breaks it is not shown: a search may miss it. Doses are judged on 100 fresh flights each, by
    the bounds of Clopper and Pearson (1934), which hold together for all doses of a kind at 95 %.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 20.0})
    >>> airflock.attack(short, ["gnss_offset"], budget=1.0).rows[0].unit
    'm'
    """
    errors = ErrorCollector()
    errors.read(check_event, event, limit)
    kinds = kinds.split(",") if isinstance(kinds, str) else kinds
    names = [kind.partition("=")[0].strip() for kind in kinds]
    errors.add(*(["kinds: names none; " + KINDS + " are usual"] if not names else []))
    errors.add(*(f"kinds: {name}: given {names.count(name)} times" for name in names if names.count(name) > 1))
    if not 0.05 <= probability <= 0.95:
        errors.add(f"probability = {probability:g} lies outside [0.05, 0.95]; {PROBABILITY} is usual")
    if not budget > 0.0:
        errors.add(f"budget = {budget:g} s is no time above 0 s")
    errors.raise_errors()
    given = scenario_variant(scenario, settings, law, trust=trust)
    flown = measured_by_contacts(given, limit)
    chosen = errors.collect_each(lambda kind: disturbance(kind, flown), kinds)
    if event == "pair" and flown.agents < 2:
        errors.add(f"{given.name}: one agent meets nobody; event = 'world' attacks what it touches")
    errors.raise_errors()
    target = _Target(flown, event, probability, threads)
    target.fly_bases()
    undisturbed = target.fly_undisturbed()
    rows = []
    for kind in chosen:
        row = _Search(target, kind, time.monotonic() + budget / len(chosen), say).run()
        say(f"{kind.kind}: judged")
        rows.append(row)
    near = f"Two agents within {flown.metrics.r_coll:g} m"
    near = near if event == "pair" else "An agent touches a wall, an obstacle or the scene"
    notes = ("this is what was found to break the flock; that nothing smaller does is not shown",)
    return AttackResult(given, near, probability, undisturbed, tuple(rows), notes)


@dataclass
class _Target:
    """Scenario to attack, and undisturbed flights of it off which candidates branch: (number, moment) → flight."""

    scenario: Scenario
    event: str
    probability: float
    threads: int | None
    bases: dict[tuple[int, int], Flight] = field(default_factory=dict)

    def fly_bases(self) -> None:
        """Fly undisturbed flights up to each moment. Raises FlightError where too few of them are safe."""
        tries = range(SEARCH, SEARCH + 4 * SEARCH_FLIGHTS)
        happened = self.events({}, tries)
        safe = [seed for seed, event in zip(tries, happened, strict=True) if not event][:SEARCH_FLIGHTS]
        if len(safe) < SEARCH_FLIGHTS:
            self._refuse(happened)
        for number, seed in enumerate(safe):
            flight = Flight(self.scenario, seed)
            for moment in range(-1, MOMENTS):
                steps = round(begin_of(self.scenario, moment) / self.scenario.flight.dt) - flight.step
                self.bases[number, moment] = (flight.advance(steps=steps) if steps > 0 else flight).branch()
            if self.event == "world" and math.isnan(flight.scores()["clearance"]):
                raise FlightError(f"{self.scenario.name}: has neither walls nor obstacles nor a scene to touch")

    def fly_undisturbed(self) -> tuple[int, int]:
        """Return flights with the event, of how many, on the seeds of judging. Raises FlightError where they break."""
        happened = self.events({}, range(JUDGING, JUDGING + JUDGED_FLIGHTS))
        if happened.mean() >= self.probability:
            self._refuse(happened)
        return int(happened.sum()), len(happened)

    def _refuse(self, happened: NDArray[np.bool_]) -> NoReturn:
        many = f"{int(happened.sum())} of {len(happened)} flights have the event"
        raise FlightError(f"{self.scenario.name}: breaks without any disturbance: {many}; airflock why explains one")

    def events(self, settings: Settings, seeds: Sequence[int]) -> NDArray[np.bool_]:
        """Return which whole flights have the event, (flight,)."""
        flown = scenario_variant(self.scenario, settings)
        rows = score_flights([flown] * len(seeds), seeds, threads=self.threads)
        return np.array([row[EVENTS[self.event]] > 0.0 for row in rows])

    def margin(self, number: int, moment: int, settings: Settings, lasts: float) -> tuple[float, float]:
        """Fly one branch; return how near it came to the event, m, 0 where it happened, and how long it took, s."""
        future = self.bases[number, moment].branch().change(settings)
        begin, part = future.time, max(1, round(PART / self.scenario.flight.dt))
        while not future.over and future.time < begin + lasts + AFTER:
            scores = future.advance(steps=part).scores()
            if scores[EVENTS[self.event]] > 0.0:
                return 0.0, future.time - begin
        least = self.scenario.metrics.r_coll if self.event == "pair" else 0.0
        near = float(scores["r_min" if self.event == "pair" else "clearance"])
        return max(near - least, NO_EVENT), future.time - begin


@dataclass
class _Search:
    """Search for the smallest dose of one kind.

    flown : flights so far, in durations; first : those before the first event
    """

    target: _Target
    how: Disturbance
    ends: float
    notify: Callable[[str], None]
    flown: float = 0.0
    first: float | None = None

    def run(self) -> AttackRow:
        """Search at the largest dose, go on with less whenever that suffices, and judge what is left."""
        random, amount, stalled = np.random.default_rng(SEARCH), self.how.most, 0
        elites = self._raced([self._drawn(random, []) for _ in range(BATCH)], amount)
        smallest, candidates, breaks = amount, [each for *_, each in elites], False
        while time.monotonic() < self.ends:
            if -elites[0][0] >= self.target.probability:
                smallest, candidates, breaks, stalled = amount, [each for *_, each in elites], True, 0
                self.notify(f"{self.how.kind}: {_amount(amount, self.how.unit)} breaks it in the search")
                amount /= SEARCH_STEP
                elites = self._raced(candidates, amount)
                continue
            stalled += 1
            if stalled > PATIENCE and (self.first is not None or stalled > PATIENCE * (1 + RESTARTS)):
                break
            # Elites in whose neighbourhood nothing happens are dropped, and other places are looked at.
            stuck, is_quiet = stalled % (PATIENCE + 1) == 0, self.first is None
            near = [] if stuck else [each for *_, each in elites]
            batch = self._raced([self._drawn(random, near) for _ in range(BATCH)], amount)
            elites = sorted({*batch} if stuck else {*elites, *batch})[:ELITES]
            if is_quiet and self.first is not None:
                stalled = 0
        return self._judged(smallest, candidates if breaks else [each for *_, each in elites], breaks)

    def _drawn(self, random: np.random.Generator, elites: Sequence[Candidate]) -> Candidate:
        """Draw a candidate anew, or near one of the best."""
        agent, moment = (int(random.integers(most)) for most in (self.target.scenario.agents, MOMENTS))
        lasts, direction = float(random.uniform(0.05, 1.0)), float(random.uniform(-math.pi, math.pi))
        if not elites or random.random() < FRESH:
            return Candidate(agent, moment, lasts, direction)
        near = elites[int(random.integers(len(elites)))]
        moment = int(np.clip(near.moment + round(random.normal(0.0, 2.0)), 0, MOMENTS - 1))
        lasts = float(np.clip(near.lasts + random.normal(0.0, 0.2), 0.05, 1.0))
        turned = near.direction + float(random.normal(0.0, 0.4))
        return Candidate(agent if random.random() < 0.2 else near.agent, moment, lasts, turned)

    def _raced(self, batch: Sequence[Candidate], amount: float) -> list[tuple[float, float, Candidate]]:
        """Fly candidates, the better half of them on once more; return (-share with the event, margin, candidate)."""
        scores: dict[Candidate, list[float]] = {each: [] for each in batch}
        for number in range(SEARCH_FLIGHTS):
            jobs = [partial(self._fly, number, each, amount) for each in scores]
            for each, (margin, seconds) in zip(scores, run_in_threads(jobs, self.target.threads), strict=True):
                self.flown += seconds / self.target.scenario.flight.duration
                scores[each].append(margin)
                if margin == 0.0 and self.first is None:
                    self.first = self.flown
            better = sorted(scores, key=lambda each: (self._nearness(scores[each]), each))
            kept = better[: max(ELITES // 2, math.ceil(len(better) / 2))]
            scores = {each: scores[each] for each in kept}
        return sorted((-float(np.mean(np.equal(m, 0.0))), self._nearness(m), each) for each, m in scores.items())

    def _nearness(self, margins: Sequence[float]) -> float:
        """Return the mean margin, m, of the share of flights that has to break: how safe the others are is nothing."""
        return float(np.mean(np.sort(margins)[: math.ceil(self.target.probability * len(margins))]))

    def _fly(self, number: int, candidate: Candidate, amount: float) -> tuple[float, float]:
        moment = -1 if self.how.kind == WIND else candidate.moment
        settings = self.how.settings(self.target.scenario, candidate, amount)
        return self.target.margin(number, moment, settings, self.how.time(self.target.scenario, candidate, amount)[1])

    def _judged(self, amount: float, candidates: Sequence[Candidate], breaks: bool) -> AttackRow:
        """Choose among candidates by whole flights, and judge doses around `amount` on seeds that chose nothing."""
        target, how = self.target, self.how

        def flown(candidate: Candidate, dose: float, first: int, flights: int) -> NDArray[np.bool_]:
            settings = how.settings(target.scenario, candidate, dose)
            return target.events(settings, range(first, first + flights))

        finalists = candidates[: ELITES // 2]
        shares = [flown(each, amount, CHOICE, CHOICE_FLIGHTS).mean() for each in finalists]
        best = finalists[int(np.argmax(shares))]
        doses = [amount * CURVE_STEP**k for k in CURVE] if breaks else [amount]
        doses = [dose for dose in doses if dose <= how.most * (1.0 + 1e-9)]
        sure = 1.0 - 0.5 * (1.0 - CONFIDENCE) / len(doses)
        outcomes = [flown(best, dose, JUDGING, JUDGED_FLIGHTS) for dose in doses]
        counts, n, p = [int(each.sum()) for each in outcomes], JUDGED_FLIGHTS, target.probability
        curve = [
            (d, k, n, lower_bound(k, n, sure), upper_probability_bound(k, n, sure))
            for d, k in zip(doses, counts, strict=True)
        ]
        # A larger dose breaks no less, which chance alone may turn round between neighbours.
        rising = np.maximum.accumulate(counts) / n
        reached = int(np.searchsorted(rising, p)) if rising[-1] >= p else len(doses) - 1
        dose = float(np.exp(np.interp(p, rising, np.log(doses)))) if rising[-1] >= p else math.inf
        low = max((d for d, *_, high in curve if high < p and d <= dose), default=0.0)
        high = min((d for d, *_, least, _ in curve if least >= p and d >= dose), default=math.inf)
        hits = np.flatnonzero(outcomes[reached])
        begin, lasts = how.time(target.scenario, best, doses[reached])
        return AttackRow(
            how.kind, how.unit, dose, low, high, counts[reached] / n, None if how.kind == WIND else best.agent, begin,
            lasts, math.degrees(best.direction) % 360.0 if "east" in how.numbers else math.nan, tuple(curve),
            how.settings(target.scenario, best, doses[reached]), JUDGING + int(hits[0]) if len(hits) else None,
            self.flown, self.first,
        )  # fmt: skip
