"""Causes: why two agents met, by ensembles of futures that branch off before it, each with one thing taken away.

Of a certificate, each flight with an event is explained so, with fewer futures, and causes are
ranked over all.

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
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.stats import binomtest

from airflock.certificates.campaign import COUNT_PURPOSE, certificate_seed
from airflock.certificates.certificate import Certificate, campaign_of_document, check_document_shape
from airflock.certificates.certification import certify
from airflock.certificates.limits import lower_bound
from airflock.engine import Flight
from airflock.recordings import (
    attributes,
    load_recording,
    replay_recording,
    scenario_to_fly_again,
    upper_probability_bound,
)
from airflock.runs import RESULT_FILE, with_parameters
from airflock.scenarios import (
    Event,
    Scenario,
    check_seed,
    named_fault_entries,
    scenario_variant,
    to_events,
    with_settings,
)
from airflock.support import (
    RECORDINGS,
    AirflockError,
    ErrorCollector,
    FlightError,
    RecordingError,
    ScenarioError,
    StudyError,
    as_error,
    expand_path,
    format_cell,
    holm_correction,
    is_number,
    parse_toml_value,
    read_toml,
    result_group,
    result_table,
    run_in_threads,
    suggest,
)
from airflock.world import half_sizes

EVENTS = {"pair": "n_coll", "world": "n_contacts"}  # what may happen → the count that says so
# score of a limit → the event that it bounds; other scores have no moment to branch off before
EVENT_OF_SCORE = {**dict.fromkeys(("r_min", "n_coll", "phi_coll"), "pair")}
EVENT_OF_SCORE |= dict.fromkeys(("n_contacts", "touching", "clearance", "phi_wall"), "world")
LEADS = (8.0, 4.0, 2.0)  # s
FUTURES = 200
# Of all hits of a certificate, which together say more than one: strong causes show with fewer futures.
HIT_LEADS, HIT_FUTURES, HIT_INTERVENTIONS = (4.0,), 60, 12
AFTER = 2.0  # s after the event: a future that is a little later than the flight has it, too
LEVEL = 0.02  # error probability of all causes that are named together (Holm 1979)
CONFIDENCE = 0.95  # of each interval
FEW = 0.05  # share of futures: an intervention that leaves no more of them ends the event
MOST_TOGETHER = 3  # interventions of a set
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


def own_interventions(names: Sequence[str]) -> dict[str, Settings]:
    """Return the changes among interventions, KEY=VALUE: name → keys to change."""
    parts = {name: name.partition("=") for name in names if "=" in name}
    return {name: {key.strip(): parse_toml_value(value.strip())} for name, (key, _, value) in parts.items()}


@dataclass(frozen=True)
class CauseRow:
    """Futures from one moment on under one intervention.

    lead    : s from the branch to the event of the flight; without : what was taken away
    events  : futures in which the event happened, of `futures`; low, high : interval of their
              probability (95 %)
    p_value : of no difference to `nothing` (exact McNemar test, after Holm); of two together, to
              the better one alone
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

    scenario, seed : what flew; event : what happened, in words; time : when, s; agents : which,
                     where it is a pair
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
            kind = 2 if TOGETHER in row.without else int(row.without == "body.tau" or "=" in row.without)
            return kind, -self._drop(row), not row.without.startswith("faults")

        return sorted(best.values(), key=rank)

    @property
    def avoidable_until(self) -> float | None:
        """Shortest lead, s, at which something that was tried lowered the probability; None: at no lead."""
        return min((row.lead for row in self.rows if row.is_named), default=None)

    @property
    def smallest_set(self) -> tuple[str, ...]:
        """Fewest interventions that were found to end it, in all but 5 % of the futures; empty if none does."""
        ending = [row for row in self.rows if row.is_named and row.share <= FEW]
        best = min(ending, key=lambda row: (row.without.count(TOGETHER), row.share, row.lead), default=None)
        return () if best is None else tuple(best.without.split(TOGETHER))

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
            changed = self.change(row.without)
            said.append(
                f"{changed[0].upper()}{changed[1:]} it would have happened in {many} (from {row.lead:g} s before)."
            )
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

    def label(self, name: str) -> str:
        """Return an intervention in words: a fault by its kind and number."""
        kinds = {f"faults[{k}]": f"{entry.fault.name} (faults[{k}])" for k, entry in enumerate(self.scenario.faults)}
        return " and ".join(kinds.get(part, part) for part in name.split(TOGETHER))

    def change(self, name: str) -> str:
        """Return in words what an intervention changes, such as `without radio.delay`."""
        if name == NOTHING:
            return name
        return f"{'with half of' if name == 'body.tau' else 'with' if '=' in name else 'without'} {self.label(name)}"

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
        named = {"causes": [row.without for row in self.causes], "smallest_set": self.smallest_set}
        return {**made, **named, "rows": rows}

    def __repr__(self) -> str:
        return f"<Why in {self.scenario.name}, seed {self.seed}: {self.text}>"

    def __rich__(self) -> Any:
        """Return sentence, table and notes, for a terminal."""
        rows = [
            (
                f"{row.lead:g}",
                self.label(row.without),
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
class HitCauses:
    """Causes of all flights of a certificate that have an event, ranked.

    name : of the scenario; flights : the results, one a flight; notes : what was left out
    """

    name: str
    flights: tuple[WhyResult, ...]
    notes: tuple[str, ...] = field(default_factory=tuple)

    @property
    def table(self) -> Any:
        """Return a row for each intervention: flights that name it, its futures with the event and those of nothing."""
        import pandas as pd  # not on top: a flight needs no tables

        tried: dict[str, list[tuple[int, int, int]]] = {}
        for flight in self.flights:
            named = {part for cause in flight.causes for part in cause.without.split(TOGETHER)}
            bare = {row.lead: row.events for row in flight.rows if row.without == NOTHING}
            alone: dict[str, list[CauseRow]] = {}  # a flight counts once, however many leads it has
            for row in flight.rows:
                if row.without != NOTHING and TOGETHER not in row.without:
                    alone.setdefault(row.without, []).append(row)
            for name, rows in alone.items():
                events, of_nothing = sum(row.events for row in rows), sum(bare[row.lead] for row in rows)
                tried.setdefault(flight.label(name), []).append((name in named, events, of_nothing))
        lines = [(name, *np.sum(each, axis=0).tolist(), len(each)) for name, each in tried.items()]
        table = pd.DataFrame(lines, columns=["without", "named_in", "events", "events_of_nothing", "tried_in"])
        return table.sort_values(["named_in", "events"], ascending=[False, True], ignore_index=True)

    @property
    def causes(self) -> list[str]:
        """Interventions that at least one flight names, in most flights first."""
        table = self.table
        return list(table["without"][table["named_in"] > 0])

    @property
    def text(self) -> str:
        """Return which causes are named in how many flights, in a sentence."""
        total, table = len(self.flights), self.table
        said = [f"{row.without} in {row.named_in} of {total}" for row in table.itertuples() if row.named_in]
        none = sum(not flight.causes for flight in self.flights)
        lone = [f"in {none} of {total} no cause is shown"] if none else []
        return f"Flights with an event, by cause: {', '.join([*said, *lone])}."

    def document(self) -> dict[str, Any]:
        """Return the result as plain values, for JSON.

        Examples
        --------
        >>> import airflock
        >>> close = {"agents": 5, "duration": 20.0, "model.p_rep": 0.0, "world.side": 60.0}
        >>> certificate = airflock.certify(airflock.load("vasarhelyi_2018/4ms", close), "r_min<3 at 0.1/h", flights=8)
        >>> found = airflock.why(certificate, futures=10, interventions=["radio.delay"])
        >>> [row["without"] for row in found.document()["rows"]]
        ['radio.delay']
        """
        rows, flights = self.table.to_dict("records"), [flight.document() for flight in self.flights]
        return {"scenario": self.name, "text": self.text, "rows": rows, "flights": flights, "notes": list(self.notes)}

    def __rich__(self) -> Any:
        """Return sentence, table, one line a flight, and notes, for a terminal."""
        cells = [[str(cell) for cell in row] for row in self.table.itertuples(index=False)]
        heads = "without; >named in flights; >futures with it; >with nothing taken away; >tried in"
        table = result_table(f"{self.name}: {len(self.flights)} flights with an event", heads, cells)
        lines = [f"seed {flight.seed}: {flight.text}" for flight in self.flights]
        return result_group(table, self.text, *lines, *self.notes)


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


def measured_by_contacts(scenario: Scenario, limit: float | None) -> Scenario:
    """Return the scenario measured by collisions and contacts at every step: metrics do not change a flight."""
    radius = {} if limit is None else {"metrics.r_coll": float(limit)}
    return scenario_variant(scenario, {"metrics.kind": "contacts"} | radius)


def event_count(flight: Flight, score: str) -> float:
    """Return how often an event happened since the start of a flight, over all its windows."""
    return float(sum(window.scores[score] for window in flight.windows) + flight.scores()[score])


@dataclass(frozen=True)
class _Request:
    """How a flight is to be explained, as `why` takes it."""

    leads: Sequence[float]
    futures: int
    interventions: Sequence[str] | None
    budget: float | None
    threads: int | None
    notify: Callable[[str], None]


def why(
    scenario: Scenario | Certificate | str | PathLike[str] | xr.Dataset,
    seed: int | None = None,
    *,
    event: str = "pair",
    limit: float | None = None,
    leads: Sequence[float] | None = None,
    futures: int | None = None,
    interventions: Sequence[str] | None = None,
    budget: float | None = None,
    threads: int | None = None,
    settings: Mapping[str, Any] | None = None,
    law: Any = None,
    trust: bool = False,
    say: Callable[[str], None] | None = None,
) -> "WhyResult | HitCauses":
    """Say why two agents met in a flight: by many futures that branch off before it, each without one thing.

    Parameters
    ----------
    scenario : Scenario, Certificate, str, path or xarray.Dataset (FLIGHT.nc|PRESET|FILE|CERTIFICATE)
        A recording, as `airflock.simulate` returns it, or its file; what flew, with its seed; or a certificate, of
        which every flight with an event is explained, or that of `seed` alone.
    seed : int, optional
        Of the flight; a recording holds its own.
    event : {"pair", "world"}
        pair: two agents nearer than `limit`; world: an agent touches a wall, an obstacle or the scene, which soft
        walls allow. The first one of the flight is explained; a certificate has its own.
    limit : float, optional
        Distance of a pair, m; by default metrics.r_coll.
    leads : sequence of float (S,S), optional
        How long before the event futures branch off, s; by default 8,4,2, and 4 for all flights of a certificate.
    futures : int, optional
        Flights for each lead and intervention, at least 10. Fewer than 100 show strong causes only; by default 200, and
        60 for all flights of a certificate.
    interventions : sequence of str, optional
        What to take away, such as radio.delay or faults[0], or to change, such as model.p_rep=0.2; by default all that
        the scenario declares.
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
    WhyResult or HitCauses
        text, the sentence; table, a row for each lead and intervention; causes, strongest first. Of a certificate
        HitCauses: the same over all its flights with an event.

    Raises
    ------
    FlightError, ScenarioError, RecordingError, StudyError, ParameterError
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
    source = _certificate(scenario)
    is_survey = source is not None and seed is None
    leads = (HIT_LEADS if is_survey else LEADS) if leads is None else leads
    futures = (HIT_FUTURES if is_survey else FUTURES) if futures is None else futures
    _check_arguments(event, limit, leads, futures, budget)
    how = _Request(leads, futures, interventions, budget, threads, say or (lambda line: None))
    if source is None:
        return _explained(_flown_flight(scenario, seed, limit, settings, law, trust), event, how)
    if limit is not None or event != "pair" or settings or law is not None:
        raise ScenarioError(["why: a certificate holds its scenario and events; leave out event, limit, settings, law"])
    name, hits, notes = _hits(source, trust)
    if seed is None:
        return _survey(name, hits, notes, how)
    if (chosen := next((hit for hit in hits if hit[0].seed == seed), None)) is None:
        known = ", ".join(str(flown.seed) for flown, _ in hits[:5])
        raise FlightError(f"{name}: seed {seed} is no flight with an event; there are {len(hits)}: {known}, ...")
    return _explained(*chosen, how)


def _explained(flown: _FlownFlight, event: str, how: _Request) -> WhyResult:
    """Explain the first event of one flight."""
    step, time_of_event, agents, sentence = _first_event(flown, event)
    how.notify(sentence)
    dt = flown.scenario.flight.dt
    steps = dict.fromkeys(min(max(1, round(lead / dt)), step - 1) for lead in sorted(how.leads, reverse=True))
    notes = [f"each future begins with pushes of {PUSH:g} m/s (SD per axis), so that no two are the same"]
    if max(how.leads) > (step - 1) * dt:
        notes.append(f"the event comes {time_of_event:g} s after the start: no future branches off earlier")
    ensembles = _Ensembles(flown, step, EVENTS[event], how, notes)
    rows = ensembles.fly(list(steps))
    in_force = ensembles.bases[min(steps)].scenario  # with faults that were begun by hand
    return WhyResult(in_force, flown.seed, sentence, time_of_event, agents, rows, tuple(dict.fromkeys(notes)))


def _certificate(given: Any) -> Certificate | Path | None:
    """Return the certificate, or the path of one, that `why` was given; None for anything else."""
    if isinstance(given, Certificate):
        return given
    path = expand_path(given) if isinstance(given, str | PathLike) and str(given).endswith(".toml") else None
    if path is None or not path.is_file():
        return None
    try:
        return path if "seal" in read_toml(path) else None
    except AirflockError:  # loading it as a scenario says what is wrong
        return None


def _hits(source: Certificate | Path, trust: bool) -> tuple[str, list[tuple[_FlownFlight, str]], list[str]]:
    """Return the name of a certificate's scenario, its flights that have an event, and notes on what is left out."""
    notes, found = [], source if isinstance(source, Certificate) else None
    if isinstance(source, Path):
        document, folder = read_toml(source), source.parent / f"{source.stem}_flights"
        check_document_shape(document, str(source))
        campaign = campaign_of_document(document, str(source), None, trust)
        if (folder / RESULT_FILE).is_file():
            kept = certify(folder=folder, resume=True, trust=trust)  # which is over, so that nothing flies
            found = kept if kept.document()["flights"] == document["flights"] else None
        if found is None:
            notes.append(f"only the worst flights are known: {folder.name}, which keeps all, is not that of {source}")
    if found is not None:
        campaign = found.campaign
        seeds = [certificate_seed(campaign.hash, COUNT_PURPOSE, number) for number in range(len(found.rows))]
        rows = list(zip(seeds, found.rows, strict=True))
        events = [(limit, own) for limit in campaign.limits for own, row in rows if limit.has_happened(row)]
    else:
        limits = {limit.event: limit for limit in campaign.limits}
        with as_error(f"{source}: is damaged", StudyError):
            worst = [(limits[entry["limit"]], entry) for entry in document["worst"]]
            events = [(limit, int(e["seed"])) for limit, e in worst if limit.has_happened({limit.score: e["value"]})]
    hits: dict[tuple[int, str], _FlownFlight] = {}
    for limit, own in events:
        if (event := EVENT_OF_SCORE.get(limit.score)) is None:
            notes.append(f"limit {limit.event}: left out, as it has no moment that could be explained")
            continue
        flown = with_parameters(campaign.scenario, campaign.parameters(own))
        measured = measured_by_contacts(flown, limit.value if limit.score == "r_min" else None)
        hits.setdefault((own, event), _FlownFlight(measured, own, campaign.bits, campaign.device))
    if not hits:
        raise FlightError("; ".join([f"{campaign.scenario.name}: nothing to explain: no flight has an event", *notes]))
    if len({own for own, _ in hits}) < len(hits):
        notes.append("a flight in which two agents met and one touched the world counts twice, once for each")
    return campaign.scenario.name, [(flown, event) for (_, event), flown in hits.items()], list(dict.fromkeys(notes))


def _survey(name: str, hits: Sequence[tuple[_FlownFlight, str]], notes: list[str], how: _Request) -> HitCauses:
    """Explain every hit: perturbations and faults alone, so that no flight takes long."""
    ends = np.inf if how.budget is None else time.monotonic() + how.budget
    flights: list[WhyResult] = []
    for flown, event in hits:
        if time.monotonic() > ends:
            notes.append(f"budget = {how.budget:g} s was spent: {len(hits) - len(flights)} flights are left out")
            break
        names = [name for name in declared_interventions(flown.scenario) if name != "body.tau"]
        if len(names) > HIT_INTERVENTIONS and how.interventions is None:
            notes.append(f"tried: the first {HIT_INTERVENTIONS} of {len(names)} perturbations and faults")
        chosen = names[:HIT_INTERVENTIONS] if how.interventions is None else how.interventions
        try:
            flights.append(_explained(flown, event, replace(how, interventions=chosen, budget=None)))
        except FlightError as error:
            notes.append(f"left out: {error}")
    if not flights:
        raise FlightError(f"{name}: no flight could be explained; {'; '.join(notes)}")
    return HitCauses(name, tuple(flights), tuple(dict.fromkeys(notes)))


def check_event(event: str, limit: float | None) -> None:
    """Refuse an event that is unknown, and a limit that it does not have."""
    errors = ErrorCollector()
    if event not in EVENTS:
        errors.add(f"event = {event!r}: {suggest(event, EVENTS, 'known: ' + ', '.join(EVENTS))}")
    if limit is not None and not (is_number(limit) and 0.0 < limit <= 1000.0):
        errors.add(f"limit = {limit!r} m lies outside (0, 1000] m; 3.0 is usual")
    if limit is not None and event == "world":
        errors.add("limit: is that of a pair; metrics.r_body says how near the world an agent touches it")
    errors.raise_errors()


def _check_arguments(
    event: str, limit: float | None, leads: Sequence[float], futures: int, budget: float | None
) -> None:
    """Refuse what cannot be flown, one line each."""
    errors = ErrorCollector()
    errors.read(check_event, event, limit)
    usable = not isinstance(leads, str) and isinstance(leads, Sequence) and len(leads)
    if not usable or not all(is_number(lead) and 0.0 < lead <= 1e6 for lead in leads):
        errors.add(f"leads = {leads!r} is no list of times within (0, 1e6] s, such as [8.0, 4.0, 2.0]")
    if not (is_number(futures) and int(futures) == futures and 10 <= futures <= 1_000_000):
        errors.add(f"futures = {futures!r} is not a whole number within [10, 1,000,000]; {FUTURES} are usual")
    if budget is not None and not (is_number(budget) and budget > 0.0):
        errors.add(f"budget = {budget!r} is no time above 0 s")
    errors.raise_errors()


def _flown_flight(
    given: Any, seed: int | None, limit: float | None, settings: Mapping[str, Any] | None, law: Any, trust: bool
) -> _FlownFlight:
    """Return what flew."""
    if isinstance(given, str | PathLike) and str(given).endswith(RECORDINGS):
        given = load_recording(given)
    if not isinstance(given, xr.Dataset):
        if seed is None:
            raise ScenarioError(["seed: is needed to fly the flight again, such as seed 7"])
        scenario = scenario_variant(given, settings, law, trust=trust)
        return _FlownFlight(measured_by_contacts(scenario, limit), check_seed(seed))
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
    return _FlownFlight(measured_by_contacts(scenario, limit), own, bits, device, tuple(events))


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

    outcomes : (lead, name) → (future,); bases : lead → flight from which futures branch off; known
               : its interventions
    """

    flown: _FlownFlight
    step: int
    score: str
    how: _Request
    notes: list[str]
    outcomes: dict[tuple[int, str], NDArray[np.bool_]] = field(default_factory=dict)
    bases: dict[int, Flight] = field(default_factory=dict)
    known: dict[int, dict[str, Settings]] = field(default_factory=dict)
    ends: float = np.inf

    def fly(self, leads: Sequence[int]) -> tuple[CauseRow, ...]:
        """Fly all futures and judge them. Raises ScenarioError for an intervention that no lead has."""
        chosen = self.how.interventions
        self.bases = {lead: self.flown.open(self.step - lead, fresh=True) for lead in leads}
        own = {} if chosen is None or isinstance(chosen, str) else own_interventions(chosen)
        self.known = {lead: declared_interventions(base.scenario) | own for lead, base in self.bases.items()}
        every = list(dict.fromkeys(name for each in self.known.values() for name in each))
        known_line = f"this flight has {', '.join(every) or 'none'}; a change of your own is KEY=VALUE"
        if isinstance(chosen, str):
            raise ScenarioError([f"interventions = {chosen!r} is no list of names; {known_line}"])
        if unknown := [name for name in chosen or () if name not in every]:
            raise ScenarioError([f"interventions: {name}: unknown; {known_line}" for name in unknown])
        for settings in own.values():
            with_settings(self.flown.scenario, settings)  # a wrong key is an error, and no note
        self.ends = np.inf if self.how.budget is None else time.monotonic() + self.how.budget
        for lead in leads:
            taken = {name: each for name, each in self.known[lead].items() if chosen is None or name in chosen}
            self._fly(lead, NOTHING, {})
            for name, settings in taken.items():
                self._fly(lead, name, settings)
        if not self.outcomes:
            raise FlightError(f"budget = {self.how.budget:g} s is too short for {self.how.futures} futures; give more")
        rows = self._judged()
        return (*rows, *self._together(rows))

    def _fly(self, lead: int, name: str, settings: Settings) -> None:
        """Fly the futures of one intervention, and keep which of them have the event."""
        if time.monotonic() > self.ends or (name != NOTHING and (lead, NOTHING) not in self.outcomes):
            self.notes.append(f"budget = {self.how.budget:g} s was spent: some leads or interventions are left out")
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
            jobs = [self._future(start, world, lead) for world in range(FIRST_WORLD, FIRST_WORLD + self.how.futures)]
            self.outcomes[lead, name] = np.array(list(run_in_threads(jobs, self.how.threads)), bool)
        except (FlightError, ScenarioError) as error:
            if name == NOTHING:
                raise
            self.notes.append(f"{name}: left out: {error}")
            return
        seconds, count = lead * self.flown.scenario.flight.dt, int(self.outcomes[lead, name].sum())
        self.how.notify(f"{seconds:g} s before, without {name}: {count} of {self.how.futures}")

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
        low = lower_bound(events, self.how.futures, sure)
        high = upper_probability_bound(events, self.how.futures, sure)
        return CauseRow(lead * self.flown.scenario.flight.dt, name, events, self.how.futures, low, high, p_value)

    def _together(self, rows: Sequence[CauseRow]) -> list[CauseRow]:
        """Take further causes of a lead away with the strongest one while events are left: a smallest set."""
        named = sorted((row for row in rows if row.is_named), key=lambda row: row.events)
        if not named:
            return []
        best, made = named[0], []
        lead = round(best.lead / self.flown.scenario.flight.dt)
        known, entries = self.known[lead], named_fault_entries(self.bases[lead].scenario)
        settings = known[best.without]
        for name in [row.without for row in named if row.lead == best.lead][1:MOST_TOGETHER]:
            if best.events <= FEW * self.how.futures:
                break
            both, label = settings | known[name], f"{best.without}{TOGETHER}{name}"
            if "faults" in settings and "faults" in known[name]:  # each leaves the entries of the other as they were
                pairs = zip(settings["faults"], known[name]["faults"], entries, strict=True)
                both["faults"] = [b if a == entry else a for a, b, entry in pairs]
            self._fly(lead, label, both)
            if (lead, label) not in self.outcomes:
                break
            p = self._p_value((lead, best.without), (lead, label))
            row = self._row(lead, label, p)
            made.append(replace(row, is_named=p <= LEVEL and row.events < best.events))
            if made[-1].is_named:
                best, settings = made[-1], both
        return made
