"""Causes: why two agents met, by ensembles of futures that branch off before it, each with one thing taken away.

The flight is flown up to some seconds before its event. From there many futures draw fresh noise,
once as the flight was, and once for each intervention: without delay, without a fault. All use the
same numbers, so that futures of the same number are compared in pairs.

One future with the same noise and one thing removed would say nothing: flocks are chaotic, and
nearly every change lets this one collision vanish (in 8 to 10 of 10 flights, whatever was removed).
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from html import escape
from os import PathLike
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.stats import binomtest

from airflock.certificates.limits import lower_bound
from airflock.engine import Flight
from airflock.recordings import (
    attributes,
    load_recording,
    replay_recording,
    scenario_to_fly_again,
    upper_probability_bound,
)
from airflock.scenarios import Event, Scenario, check_seed, named_fault_entries, scenario_variant, to_events
from airflock.support import (
    RECORDINGS,
    ErrorCollector,
    FlightError,
    RecordingError,
    ScenarioError,
    format_cell,
    holm_correction,
    is_number,
    result_group,
    result_table,
    run_in_threads,
    suggest,
)
from airflock.world import half_sizes

EVENTS = {"pair": "n_coll", "world": "n_contacts"}  # what may happen → the count that says so
LEADS = (8.0, 4.0, 2.0)  # s
FUTURES = 200
AFTER = 2.0  # s after the event: a future that is a little later than the flight has it, too
LEVEL = 0.02  # error probability of all causes that are named together (Holm 1979)
CONFIDENCE = 0.95  # of each interval
FEW = 0.05  # share of futures: below it one cause alone ends the event, and no second one is looked for
FIRST_WORLD = 1 << 31  # of the futures: no flight by hand counts so far
# m/s, standard deviation per axis of a push at the start of each future: without it all futures of a
# scenario whose only noise is taken away were one, and its chaos would pass for a cause.
PUSH = 0.1
NOTHING = "nothing"
TOGETHER = " + "
NEVER = 1e6  # s: a fault that begins then begins after every flight

ENDS = ("per_hour", "until", "lasts")
LOSSES = ("loss", "missed", "airtime", "bearing_sd", "range_sd")  # numbers of radios that are harmless at zero

Settings = dict[str, Any]


def declared_interventions(scenario: Scenario) -> dict[str, Settings]:
    """Return what can be taken away from a flight of a scenario: name → keys to change."""
    radio, wind, body = scenario.radio.numbers, scenario.wind, scenario.body.numbers
    late: Settings = {f"radio.{key}": 0.0 for key in ("delay", "jitter") if getattr(radio, key, 0.0)}
    lost: Settings = {f"radio.{key}": 0.0 for key in LOSSES if getattr(radio, key, 0.0)}
    if scenario.radio.rule.keeps_packets:  # else nothing reads these
        lost |= {f"radio.{key}": 1.0 for key, v in vars(radio).items() if key.startswith("received") and v < 1.0}
    blows: Settings = {f"wind.{key}": 0.0 for key in ("east", "north", "up", "gust") if getattr(wind, key)}
    blows |= {"wind.kind": "simple", "wind.gust": 0.0} if wind.kind == "dryden" else {}
    found: dict[str, Settings] = {"radio.delay": late, "radio.loss": lost, "wind": blows, "sensors": {}}
    if scenario.has_sensor_error:
        found["sensors"] = {"sensors.kind": "perfect"}
        if any(letter == "s" for group in scenario.groups for letter, _ in (*group.numbers, *group.spread)):
            groups = scenario.document["groups"]
            found["sensors"]["groups"] = [{k: v for k, v in group.items() if k != "sensors"} for group in groups]
    # A body that follows at once would need other gains; half its lag does not.
    for name, keys, share in (("body.noise", ("noise",), 0.0), ("body.tau", ("tau", "delay"), 0.5)):
        values = {f"body.{key}": getattr(body, key, 0.0) for key in keys}
        for group in scenario.groups:
            own = {key: group.numbers["b", key] for key in keys if ("b", key) in group.numbers}
            values |= {f"groups.{group.name}.body.{key}": value for key, value in own.items()}
        found[name] = {key: share * value for key, value in values.items() if value}
    entries = named_fault_entries(scenario)
    for number, entry in enumerate(scenario.faults):
        # An entry stays in the list, as the others are drawn by their numbers in it, and never
        # begins. Of equal entries one would go on for the other, so they go together.
        same = [k for k, other in enumerate(scenario.faults) if other == entry]
        if same[0] == number and entry.can_occur(scenario.flight.duration):
            never = {key: v for key, v in entries[number].items() if key not in ENDS} | {"at": NEVER}
            found[f"faults[{number}]"] = {"faults": [never if k in same else e for k, e in enumerate(entries)]}
    return {name: settings for name, settings in found.items() if settings}


@dataclass(frozen=True)
class CauseRow:
    """Futures from one moment on under one intervention.

    lead    : s from the branch to the event of the flight; without : what was taken away
    events  : futures in which the event happened, of `futures`; low, high : interval of their probability (95 %)
    p_value : of no difference to `nothing` (exact McNemar test, after Holm); of two together, to the better one alone
    is_named : whether it is a cause
    """

    lead: float
    without: str
    events: int
    futures: int
    low: float
    high: float
    p_value: float
    is_named: bool = False

    @property
    def share(self) -> float:
        """Share of futures with the event."""
        return self.events / self.futures


@dataclass(frozen=True)
class WhyResult:
    """Why something happened in a flight, and what would have avoided it.

    scenario, seed : what flew; event : what happened, in words; time : when, s; agents : which, where it is a pair
    rows  : of each lead and intervention; notes : what was assumed and what was left out
    """

    scenario: Scenario
    seed: int
    event: str
    time: float
    agents: tuple[int, ...]
    rows: tuple[CauseRow, ...]
    notes: tuple[str, ...] = field(default_factory=tuple)

    @property
    def causes(self) -> list[CauseRow]:
        """Named causes, each at the lead at which it lowers the probability most; strongest first."""
        best: dict[str, CauseRow] = {}
        for row in self.rows:
            if row.is_named and (row.without not in best or self._drop(row) > self._drop(best[row.without])):
                best[row.without] = row

        def rank(row: CauseRow) -> tuple[int, float, bool]:
            # What disturbs is said before another body that would stand it, and what ends the event
            # alone before two together; of equals a fault, as flights have the others at all times.
            kind = 2 if TOGETHER in row.without else int(row.without == "body.tau")
            return kind, -self._drop(row), not row.without.startswith("faults")

        return sorted(best.values(), key=rank)

    @property
    def avoidable_until(self) -> float | None:
        """Shortest lead, s, at which something that was tried lowered the probability; None: at no lead."""
        return min((row.lead for row in self.rows if row.is_named), default=None)

    @property
    def table(self) -> Any:
        """Return a table with a row for each lead (s) and intervention."""
        import pandas as pd  # not on top: a flight needs no tables

        return pd.DataFrame([{**asdict(row), "share": row.share} for row in self.rows])

    @property
    def text(self) -> str:
        """Return what happened and why, in plain sentences."""
        said = [f"{self.event}."]
        for row in self.causes:
            many = f"{row.events} of {row.futures} futures instead of {self._nothing(row.lead).events}"
            changed = "With half of" if row.without == "body.tau" else "Without"
            label = self._label(row.without)
            said.append(f"{changed} {label} it would have happened in {many} (from {row.lead:g} s before).")
        if not self.causes:
            said.append(self._unexplained())
        last = self.avoidable_until
        tried = [row.lead for row in self.rows if row.without != NOTHING]  # a budget may end before the last leads
        if last is not None and (later := [lead for lead in tried if lead < last]):
            said.append(f"From {max(later):g} s before, nothing that was tried lowers it measurably.")
        return " ".join(said)

    def _unexplained(self) -> str:
        first = self.rows[0]
        names = dict.fromkeys(row.without for row in self.rows if row.without != NOTHING)
        tried = ", ".join(names) or "nothing, as the scenario declares no perturbation and no fault"
        times = f"in {first.events} of {first.futures} futures from {first.lead:g} s before"
        if first.share < 0.5:
            return f"Chance decides: it happens {times}, and no cause is shown (tried: {tried})."
        return f"No cause is shown: it happens {times}, whatever is taken away (tried: {tried})."

    def _nothing(self, lead: float) -> CauseRow:
        return next(row for row in self.rows if row.lead == lead and row.without == NOTHING)

    def _drop(self, row: CauseRow) -> float:
        return self._nothing(row.lead).share - row.share

    def _label(self, name: str) -> str:
        """Return an intervention in words: a fault by its kind and number."""
        kinds = {f"faults[{k}]": f"{entry.fault.name} (faults[{k}])" for k, entry in enumerate(self.scenario.faults)}
        return " and ".join(kinds.get(part, part) for part in name.split(TOGETHER))

    def document(self) -> dict[str, Any]:
        """Return the result as plain values, for JSON.

        Examples
        --------
        >>> import airflock
        >>> close = {"agents": 5, "duration": 20.0, "model.p_rep": 0.0, "world.side": 60.0}
        >>> short = airflock.load("vasarhelyi_2018/4ms", close)
        >>> found = airflock.why(short, 3, leads=[2.0], futures=10, interventions=["radio.delay"])
        >>> [row["without"] for row in found.document()["rows"]]
        ['nothing', 'radio.delay']
        """
        rows = [{**asdict(row), "p_value": None if row.without == NOTHING else row.p_value} for row in self.rows]
        made = {key: value for key, value in vars(self).items() if key != "scenario"}
        made |= {"scenario": self.scenario.name, "text": self.text, "avoidable_until": self.avoidable_until}
        return {**made, "causes": [row.without for row in self.causes], "rows": rows}

    def __repr__(self) -> str:
        return f"<Why in {self.scenario.name}, seed {self.seed}: {self.text}>"

    def __rich__(self) -> Any:
        """Return sentence, table and notes, for a terminal."""
        rows = [
            (
                f"{row.lead:g}",
                self._label(row.without),
                f"{row.events} of {row.futures}",
                f"{row.low:.2f} to {row.high:.2f}",
                format_cell(row.p_value, ""),
                "yes" if row.is_named else "",
            )
            for row in self.rows
        ]
        table = result_table("", ">s before; without; >events; >95 % interval; >p; cause", rows)
        return result_group(self.text, table, *self.notes)

    def _repr_html_(self) -> str:
        """Return sentence and table, for a notebook."""
        notes = "".join(f"<li>{escape(note)}</li>" for note in self.notes)
        return f"<p><b>{escape(self.text)}</b></p>{self.table.to_html(index=False)}<ul>{notes}</ul>"


@dataclass(frozen=True)
class _FlownFlight:
    """A flight that can be flown again: scenario, measured by collisions and contacts, seed and events."""

    scenario: Scenario
    seed: int
    precision: int = 32
    device: str = "cpu"
    events: tuple[Event, ...] = ()

    def open(self, until: int = 0, fresh: bool = False) -> Flight:
        """Fly up to a step; `fresh` : what draws other noise from there on is left out of the events to come."""
        events = [event for event in self.events if not (fresh and event.kind == "branch" and event.step >= until)]
        flight = Flight(self.scenario, self.seed, precision=self.precision, device=self.device, events=events)
        return flight.advance(steps=until) if until else flight


def event_count(flight: Flight, score: str) -> float:
    """Return how often an event happened since the start of a flight, over all its windows."""
    return float(sum(window.scores[score] for window in flight.windows) + flight.scores()[score])


def why(
    scenario: Scenario | str | PathLike[str] | xr.Dataset,
    seed: int | None = None,
    *,
    event: str = "pair",
    limit: float | None = None,
    leads: Sequence[float] = LEADS,
    futures: int = FUTURES,
    interventions: Sequence[str] | None = None,
    budget: float | None = None,
    threads: int | None = None,
    settings: Mapping[str, Any] | None = None,
    law: Any = None,
    trust: bool = False,
    say: Callable[[str], None] | None = None,
) -> WhyResult:
    """Say why two agents met in a flight: by many futures that branch off before it, each without one thing.

    Parameters
    ----------
    scenario : Scenario, str, path or xarray.Dataset
        What flew, with its seed; or a recording, as `airflock.simulate` returns it, or its file (.nc).
    seed : int, optional
        Of the flight; a recording holds its own.
    event : str
        pair: two agents nearer than `limit`; world: an agent touches a wall, an obstacle or the scene, which soft
        walls allow. The first one of the flight is explained.
    limit : float, optional
        Distance of a pair, m; by default metrics.r_coll.
    leads : sequence of float
        How long before the event futures branch off, s.
    futures : int
        Flights for each lead and intervention, at least 10. Fewer than 100 show strong causes only.
    interventions : sequence of str, optional
        What to take away, such as ["radio.delay", "faults[0]"]; by default all that the scenario declares.
    budget : float, optional
        Time after which no further futures begin, s; compilation does not count.
    threads : int, optional
        Flights side by side; by default one per core.
    settings : mapping, optional
        Keys of the scenario to change; of a recording files of the user's own parts, as when it is flown again.
    law : optional
        A law of the user's own, as `airflock.load` takes it.
    trust : bool
        Whether code that files name may run.
    say : callable, optional
        Called with a line now and then.

    Returns
    -------
    WhyResult
        text, the sentence; table, a row for each lead and intervention; causes, strongest first.

    Raises
    ------
    FlightError, ScenarioError, RecordingError, ParameterError
        If nothing happened in the flight, it cannot be flown again, or an argument is out of its range.

    Notes
    -----
    A cause is named where fewer futures have the event than with nothing taken away, by McNemar's exact test of
    futures in pairs, corrected after Holm (1979) for all leads and interventions at 0.02.

    Examples
    --------
    >>> import airflock
    >>> close = {"agents": 5, "duration": 20.0, "model.p_rep": 0.0, "world.side": 60.0}
    >>> short = airflock.load("vasarhelyi_2018/4ms", close)
    >>> found = airflock.why(short, 3, leads=[2.0], futures=10, interventions=["radio.delay"])
    >>> found.table["without"].tolist()
    ['nothing', 'radio.delay']
    """
    _check_arguments(event, limit, leads, futures, budget)
    notify = say or (lambda line: None)
    flown = _flown_flight(scenario, seed, limit, settings, law, trust)
    step, time_of_event, agents, sentence = _first_event(flown, event)
    notify(sentence)
    dt = flown.scenario.flight.dt
    steps = dict.fromkeys(min(max(1, round(lead / dt)), step - 1) for lead in sorted(leads, reverse=True))
    notes = [f"each future begins with pushes of {PUSH:g} m/s (SD per axis), so that no two are the same"]
    if max(leads) > (step - 1) * dt:
        notes.append(f"the event comes {time_of_event:g} s after the start: no future branches off earlier")
    ensembles = _Ensembles(flown, step, EVENTS[event], futures, threads, budget, notify, notes)
    rows = ensembles.fly(list(steps), interventions)
    in_force = ensembles.bases[min(steps)].scenario  # with faults that were begun by hand
    return WhyResult(in_force, flown.seed, sentence, time_of_event, agents, rows, tuple(dict.fromkeys(notes)))


def _check_arguments(
    event: str, limit: float | None, leads: Sequence[float], futures: int, budget: float | None
) -> None:
    """Refuse what cannot be flown, one line each."""
    errors = ErrorCollector()
    if event not in EVENTS:
        errors.note(f"event = {event!r}: {suggest(event, EVENTS, 'known: ' + ', '.join(EVENTS))}")
    if limit is not None and not (is_number(limit) and 0.0 < limit <= 1000.0):
        errors.note(f"limit = {limit!r} m lies outside (0, 1000] m; 3.0 is usual")
    if limit is not None and event == "world":
        errors.note("limit: is that of a pair; metrics.r_body says how near the world an agent touches it")
    usable = not isinstance(leads, str) and isinstance(leads, Sequence) and len(leads)
    if not usable or not all(is_number(lead) and 0.0 < lead <= 1e6 for lead in leads):
        errors.note(f"leads = {leads!r} is no list of times within (0, 1e6] s, such as [8.0, 4.0, 2.0]")
    if not (is_number(futures) and int(futures) == futures and 10 <= futures <= 1_000_000):
        errors.note(f"futures = {futures!r} is not a whole number within [10, 1,000,000]; {FUTURES} are usual")
    if budget is not None and not (is_number(budget) and budget > 0.0):
        errors.note(f"budget = {budget!r} is no time above 0 s")
    errors.raise_errors()


def _flown_flight(
    given: Any, seed: int | None, limit: float | None, settings: Mapping[str, Any] | None, law: Any, trust: bool
) -> _FlownFlight:
    """Return what flew, measured by collisions and contacts at every step: metrics do not change a flight."""
    measured = {"metrics.kind": "contacts"} | ({} if limit is None else {"metrics.r_coll": float(limit)})
    if isinstance(given, str | PathLike) and str(given).endswith(RECORDINGS):
        given = load_recording(given)
    if not isinstance(given, xr.Dataset):
        if seed is None:
            raise ScenarioError(["seed: is needed to fly the flight again, such as why(scenario, seed=7)"])
        scenario = scenario_variant(given, settings, law, trust=trust)
        return _FlownFlight(scenario_variant(scenario, measured), check_seed(seed))
    if seed is not None:
        raise ScenarioError([f"seed = {seed}: a recording holds the seed of its flight; leave it out"])
    scenario = scenario_to_fly_again(given, law, settings, trust=trust)
    same, differences = replay_recording(given, law, settings, trust=trust)
    if not same:
        raise RecordingError(
            f"recording: flown again it is another flight; {'; '.join(differences) or 'it was changed'}"
        )
    events = []
    for event in to_events(attributes.recorded_events(given)):
        data = {key: value for key, value in event.data.items() if not key.startswith("metrics")}
        events += [Event(event.step, event.kind, data)] if data or not event.data else []
    bits = attributes.read_integer(given, "airflock_precision", 32)
    device, own = str(given.attrs.get("airflock_device", "cpu")), attributes.read_integer(given, "airflock_seed")
    return _FlownFlight(scenario_variant(scenario, measured), own, bits, device, tuple(events))


def _first_event(flown: _FlownFlight, event: str) -> tuple[int, float, tuple[int, ...], str]:
    """Find the first event of a flight: the step by which it is there, its time (s), its agents, and a sentence."""
    score, flight = EVENTS[event], flown.open()
    scenario, before = flown.scenario, 0
    if event == "pair" and scenario.agents < 2:
        raise FlightError(f"{scenario.name}: one agent meets nobody; event = 'world' explains what it touches")
    # In parts of a second, and once more step by step within the part that has the event.
    part = max(1, round(1.0 / scenario.flight.dt))
    while True:
        flight.advance(steps=part)
        if event_count(flight, score) > 0:
            break
        if flight.over:
            parts = (*(window.scores for window in flight.windows), flight.scores())
            least = min(float(values["r_min"]) for values in parts)
            near = f"the smallest distance was {least:.2g} m, and the limit is {scenario.metrics.r_coll:g} m"
            near = near if event == "pair" else "no agent touched a wall, an obstacle or the scene"
            raise FlightError(f"{scenario.name}, seed {flown.seed}: nothing to explain; {near}")
        before = flight.step
    flight = flown.open(before)
    while event_count(flight, score) == 0:
        flight.advance(steps=1)
    moment = flight.step * scenario.flight.dt
    if flight.step <= 2:
        raise FlightError(f"{scenario.name}, seed {flown.seed}: it happens at the start; nothing comes before it")
    if event == "world":
        return flight.step, moment, (), f"An agent touched a wall, an obstacle or the scene at t = {moment:.2f} s"
    agents, distance = _nearest_pair(flight)
    near = f"Agents {agents[0]} and {agents[1]} came within {scenario.metrics.r_coll:g} m"
    return flight.step, moment, agents, f"{near} at t = {moment:.2f} s ({distance:.2f} m)"


def _nearest_pair(flight: Flight) -> tuple[tuple[int, int], float]:
    """Return the two agents that are nearest to each other now, and their distance, m."""
    world, axes, there = flight.scenario.world, flight.scenario.dimensions, np.flatnonzero(flight.present)
    places = flight.state[:axes, there].T.astype(float)
    sides = 2.0 * np.array(half_sizes(world)[:axes]) if world.edges == "periodic" else None
    if sides is not None:
        places = np.minimum(places % sides, np.nextafter(sides, 0.0))  # a tree takes [0, side) alone
    distances, others = KDTree(places, boxsize=sides).query(places, k=2)
    one = int(distances[:, 1].argmin())
    first, second = sorted((int(there[one]), int(there[others[one, 1]])))
    return (first, second), float(distances[one, 1])


@dataclass
class _Ensembles:
    """Futures of a flight: of each lead (steps) and intervention, which of them have the event.

    outcomes : (lead, name) → (future,); bases : lead → flight from which futures branch off
    """

    flown: _FlownFlight
    step: int
    score: str
    futures: int
    threads: int | None
    budget: float | None
    notify: Callable[[str], None]
    notes: list[str]
    outcomes: dict[tuple[int, str], NDArray[np.bool_]] = field(default_factory=dict)
    bases: dict[int, Flight] = field(default_factory=dict)
    ends: float = np.inf

    def fly(self, leads: Sequence[int], chosen: Sequence[str] | None) -> tuple[CauseRow, ...]:
        """Fly all futures and judge them. Raises ScenarioError for an intervention that no lead has."""
        self.bases = {lead: self.flown.open(self.step - lead, fresh=True) for lead in leads}
        known = {lead: declared_interventions(base.scenario) for lead, base in self.bases.items()}
        every = list(dict.fromkeys(name for each in known.values() for name in each))
        known_line = f"this flight has {', '.join(every) or 'none'}"
        if isinstance(chosen, str):
            raise ScenarioError([f"interventions = {chosen!r} is no list of names; {known_line}"])
        if unknown := [name for name in chosen or () if name not in every]:
            raise ScenarioError([f"interventions: {name}: unknown; {known_line}" for name in unknown])
        self.ends = np.inf if self.budget is None else time.monotonic() + self.budget
        for lead in leads:
            taken = {name: each for name, each in known[lead].items() if chosen is None or name in chosen}
            self._fly(lead, NOTHING, {})
            for name, settings in taken.items():
                self._fly(lead, name, settings)
        if not self.outcomes:
            raise FlightError(f"budget = {self.budget:g} s is too short for {self.futures} futures; give more")
        rows = self._judged()
        return (*rows, *self._two_together(rows))

    def _fly(self, lead: int, name: str, settings: Settings) -> None:
        """Fly the futures of one intervention, and keep which of them have the event."""
        if time.monotonic() > self.ends or (name != NOTHING and (lead, NOTHING) not in self.outcomes):
            self.notes.append(f"budget = {self.budget:g} s was spent: some leads or interventions are left out")
            return
        base, later = self.bases[lead], self._done_later(lead)
        if later & {key.partition(".")[0] for key in settings}:
            self.notes.append(f"{name}: left out where the flight itself changed that between branch and event")
            return
        try:
            began, start = time.monotonic(), base.branch()
            if settings:
                start.change(settings)
            start.compile()
            self.ends += time.monotonic() - began
            jobs = [self._future(start, world, lead) for world in range(FIRST_WORLD, FIRST_WORLD + self.futures)]
            self.outcomes[lead, name] = np.array(list(run_in_threads(jobs, self.threads)), bool)
        except (FlightError, ScenarioError) as error:
            if name == NOTHING:
                raise
            self.notes.append(f"{name}: left out: {error}")
            return
        seconds, count = lead * self.flown.scenario.flight.dt, int(self.outcomes[lead, name].sum())
        self.notify(f"{seconds:g} s before, without {name}: {count} of {self.futures}")

    def _done_later(self, lead: int) -> set[str]:
        """Sections that the flight itself changes after a branch; noted, as every future has these changes."""
        later = [
            e for e in self.flown.events if self.step - lead <= e.step < self.step and e.kind in ("change", "fault")
        ]
        if later:
            self.notes.append("what was done to the flight between branch and event happens in every future")
        return {key.partition(".")[0] for event in later if event.kind == "change" for key in event.data}

    def _future(self, start: Flight, world: int, lead: int) -> Callable[[], bool]:
        """Return what flies one future: the same world and the same pushes under every intervention."""
        after = max(1, round(AFTER / self.flown.scenario.flight.dt))

        def fly() -> bool:
            future = start.branch(world)
            there = np.flatnonzero(future.present).tolist()
            drawn = np.random.default_rng([self.flown.seed, world])
            future.push(there, drawn.normal(0.0, PUSH, (len(there), future.scenario.dimensions)))
            future.advance(steps=lead + after)
            return event_count(future, self.score) > 0

        return fly

    def _judged(self) -> list[CauseRow]:
        """Compare each intervention with nothing taken away; all tests of the flight share the error."""
        keys = list(self.outcomes)
        tests = [self._p_value((lead, NOTHING), (lead, name)) if name != NOTHING else np.nan for lead, name in keys]
        corrected = holm_correction(tests)
        rows = [self._row(*key, p) for key, p in zip(keys, corrected, strict=True)]
        least = {row.lead: row.events for row in rows if row.without == NOTHING}
        return [replace(row, is_named=row.p_value <= LEVEL and row.events < least[row.lead]) for row in rows]

    def _p_value(self, one: tuple[int, str], other: tuple[int, str]) -> float:
        """Return the p value of no difference between futures in pairs (McNemar's exact test, two-sided)."""
        a, b = self.outcomes[one], self.outcomes[other]
        only, both = int((a & ~b).sum()), int((a != b).sum())
        return float(binomtest(only, both).pvalue) if both else 1.0

    def _row(self, lead: int, name: str, p_value: float) -> CauseRow:
        """Return the row of one set of futures."""
        events, sure = int(self.outcomes[lead, name].sum()), 0.5 * (1.0 + CONFIDENCE)
        low = lower_bound(events, self.futures, sure)
        high = upper_probability_bound(events, self.futures, sure)
        return CauseRow(lead * self.flown.scenario.flight.dt, name, events, self.futures, low, high, p_value)

    def _two_together(self, rows: Sequence[CauseRow]) -> list[CauseRow]:
        """Take the two strongest causes of one lead away together, where the stronger one alone leaves events."""
        named = sorted((row for row in rows if row.is_named), key=lambda row: row.events)
        if not named or named[0].events <= FEW * self.futures:
            return []
        lead = round(named[0].lead / self.flown.scenario.flight.dt)
        names = [row.without for row in named if row.lead == named[0].lead][:2]
        if len(names) < 2:
            return []
        known = declared_interventions(self.bases[lead].scenario)
        first, second = (known[name] for name in names)
        both, name = first | second, TOGETHER.join(names)
        if "faults" in first and "faults" in second:
            entries = named_fault_entries(self.bases[lead].scenario)
            both["faults"] = [
                b if a == e else a for a, b, e in zip(first["faults"], second["faults"], entries, strict=True)
            ]
        self._fly(lead, name, both)
        if (lead, name) not in self.outcomes:
            return []
        p = self._p_value((lead, names[0]), (lead, name))
        row = self._row(lead, name, p)
        return [replace(row, is_named=p <= LEVEL and row.events < named[0].events)]
