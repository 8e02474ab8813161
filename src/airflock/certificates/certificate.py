"""Certificate: what was shown about a scenario, by which flights, with which confidence; and what was not."""

import hashlib
import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

from scipy.stats import binomtest

from airflock import __version__
from airflock.certificates.campaign import COUNT_PURPOSE, Campaign, certificate_seed
from airflock.certificates.counting import LimitVerdict, looks_due
from airflock.certificates.limits import EventLimit, parse_limits, rate_per_hour, take_look
from airflock.runs import program_versions, to_toml_values, write_toml_file
from airflock.scenarios import Scenario, build_scenario
from airflock.support import (
    StudyError,
    as_error,
    expand_path,
    format_cell,
    read_toml,
    result_group,
    result_table,
)

MIN_EVENTS = 10  # events below which nothing is said
SUSPICIOUS = 0.01  # a chance of less than this is no chance


@dataclass(frozen=True)
class EventTiming:
    """Events of the first half of flights against what an even rate would give.

    events, early : first events of a flight, and those in its first half
    expected : share in the first half if the rate is even; chance : of a difference as large as
               this one
    """

    events: int
    early: int
    expected: float
    chance: float

    @property
    def verdict(self) -> str:
        """even, uneven, or too few events to say."""
        if self.events < MIN_EVENTS:
            return "too few events to say"
        return "uneven" if self.chance < SUSPICIOUS else "even"


def event_timing(times: Sequence[float], flights: int, duration: float) -> EventTiming:
    """Compare the times (s) of first events of so many flights with an even rate.

    An even rate h leaves 1 - p = exp(-h T) of the flights without an event, and of those with one
    the share (1 - sqrt(1 - p)) / p has it in the first half.
    """
    events, early = len(times), sum(1 for t in times if t <= 0.5 * duration)
    p = min(events / max(flights, 1), 1.0 - 1e-9)
    expected = 0.5 if p <= 0.0 else (1.0 - math.sqrt(1.0 - p)) / p
    chance = float(binomtest(early, events, expected).pvalue) if events else 1.0
    return EventTiming(events, early, expected, chance)


CERTIFICATE_FORMAT = 1
LOOK = ("flights", "events", "above", "below", "low", "high")
CHECKED = 100  # every so many flights one is kept for a check
MIN_CHECKED = 20  # of them at least, where there are so many
WORST = 5  # flights of each limit
UNIT_WORDS = {"h": "per flock hour", "drone-h": "per drone hour", "flight": "per flight"}
ALONE = "the confidence covers chance within this scenario,"
NOT_SAID = (
    "the model was flown, not an aircraft: a collision here is a distance between two centres",
    "only the faults that the scenario contains are covered; no pilot, and no GNSS jump that hits all at once",
    f"{ALONE} not numbers that are wrong in it",
    "this is not an airworthiness or SORA document",
)


@dataclass(frozen=True)
class Certificate:
    """Certificate: results of counting, splitting and tolerances of a campaign.

    verdicts  : one for each limit; hazards: timing of events by limit, where events have a moment
    rows      : scores of all flights that were counted, in the order of their seeds
    tolerance : plain values of `airflock.certificates.certification`, empty if not requested
    splitting : the same of `airflock.certificates.splitting`; over: of
                `airflock.certificates.certification`
    versions  : of what flew, and on which processor
    seconds, rate : of this process, s; flights per second
    where     : file or name of the scenario, by which flights are flown again
    """

    campaign: Campaign
    verdicts: tuple[LimitVerdict, ...]
    hazards: Mapping[int, EventTiming]
    rows: Sequence[Mapping[str, Any]]
    versions: Mapping[str, str]
    seconds: float = 0.0
    rate: float = 0.0
    tolerance: Mapping[str, Any] = field(default_factory=dict)
    splitting: Mapping[str, Any] = field(default_factory=dict)
    over: Mapping[str, Any] = field(default_factory=dict)
    where: str = ""

    @property
    def shown(self) -> bool:
        """True if all limits are shown."""
        return all(verdict.shown for verdict in self.verdicts)

    @property
    def statements(self) -> list[str]:
        """One sentence for each limit."""
        return [limit_statement(self.campaign, verdict, self.rate) for verdict in self.verdicts]

    @property
    def worst(self) -> list[dict[str, Any]]:
        """The worst flights of each limit, worst first: number, seed, value of the score, the line that replays it.

        Raises StudyError as `document` does.
        """
        found = []
        for verdict in self.verdicts:
            limit, sign = verdict.limit, 1.0 if verdict.limit.sign in ("<", "<=") else -1.0
            values = [(sign * flight_score(row, limit.score), number) for number, row in enumerate(self.rows)]
            for key, number in sorted(values)[:WORST]:
                own = certificate_seed(self.campaign.hash, COUNT_PURPOSE, number)
                entry = {"limit": limit.event, "flight": number, "seed": own, "value": sign * key}
                change = "".join(f" --set {key}={x!r}" for key, x in self.campaign.parameters(own).items())
                entry["replay"] = f"airflock replay {self.where} --seed {own}{change}"
                first = dict(zip(_timed(self.campaign), self.rows[number].get("first") or (), strict=False))
                if first.get(limit.event) is not None:
                    entry["first"] = first[limit.event]
                found.append(entry)
        return found

    def document(self) -> dict[str, Any]:
        """The certificate as plain values: what certificate.toml holds.

        Raises StudyError for a certificate of more flights than its numbers can tell apart.

        Examples
        --------
        >>> import airflock
        >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 2.0})
        >>> airflock.certify(short, "n_coll<1 at 90%", flights=100).document()["flights"]["count"]
        100
        """
        c, step = self.campaign, max(1, min(CHECKED, len(self.rows) // MIN_CHECKED))
        digests = [scores_digest(row) for row in self.rows]
        made = {
            "format": CERTIFICATE_FORMAT,
            "shown": self.shown,
            "statements": self.statements,
            "confidence": c.confidence,
            "not_said": self.disclaimers,
            "limit": [limit_entry(c, verdict, self.hazards.get(i)) for i, verdict in enumerate(self.verdicts)],
            "flights": {
                "count": len(self.rows),
                "duration": c.scenario.flight.duration,
                "agents": c.scenario.agents,
                "identity": c.hash,
                "first_seed": certificate_seed(c.hash, COUNT_PURPOSE, 0),
                "rule": "seed of flight i is first_seed + i; first_seed follows from the scenario alone",
                "looks": "fixed number of flights" if c.flights else "sizes fixed by the limit, all bounds together",
                "uncertain": c.flies_intervals,
                "digest": hashlib.sha256("".join(digests).encode()).hexdigest(),
            },
            "worst": self.worst,
            "tolerance": dict(self.tolerance),
            "splitting": dict(self.splitting),
            "map": dict(self.over),
            "check": {"every": step, "digests": digests[::step]},
            "flown": {
                "rules": c.document()["rules"], "precision": c.bits, "device": c.device, **self.versions
            },
            "scenario": {"name": c.scenario.name, **_without(c.scenario.document, "published")},
        }  # fmt: skip
        return with_checksum(to_toml_values(made))

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write certificate.toml to `path`, complete or not at all.

        Raises StudyError for a certificate of more flights than its numbers can tell apart.

        Examples
        --------
        >>> import airflock
        >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 2.0})
        >>> airflock.certify(short, "n_coll<1 at 90%", flights=100).save("certificate.toml").name
        'certificate.toml'
        """
        target = expand_path(path)
        write_toml_file(
            target, self.document(), "A certificate of Airflock; check it with: airflock certify FILE --check"
        )
        return target

    def check(self, threads: int | None = None) -> Any:
        """Fly one flight in a hundred again and compare the bits; see `check_document`.

        threads : of the flights, all processors by default

        Raises StudyError for a certificate of more flights than its numbers can tell apart, or
        where one flies no more.

        Examples
        --------
        >>> import airflock
        >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 2.0})
        >>> airflock.certify(short, "n_coll<1 at 90%", flights=100).check().same
        True
        """

        return check_document(self.document(), "certificate", scenario=self.campaign.scenario, threads=threads)

    @property
    def disclaimers(self) -> list[str]:
        """Sentences on what the certificate does not show."""
        return campaign_disclaimers(self.campaign)

    def __repr__(self) -> str:
        said = "shown" if self.shown else "not shown"
        return f"<Certificate of {self.campaign.scenario.name}: {said}; {' '.join(self.statements)}>"

    def _repr_html_(self) -> str:
        """A table of the limits, for a notebook."""
        heads = ("limit", "events", "flights", "at most", "shown")
        cells = [
            (
                v.limit.text,
                str(v.events),
                f"{v.flights:,}",
                upper_bound_in_unit(self.campaign, v),
                "yes" if v.shown else "no",
            )
            for v in self.verdicts
        ]
        rows = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in cells)
        table = f"<table><tr>{''.join(f'<th>{head}</th>' for head in heads)}</tr>{rows}</table>"
        notes = "".join(f"<li>{escape(text)}</li>" for text in (*self.statements, *self.disclaimers))
        return f"<p><b>{escape(self.campaign.scenario.name)}</b></p>{table}<ul>{notes}</ul>"

    def __rich__(self) -> Any:
        """Return what the certificate shows and what it does not show, for a terminal."""
        hazards = [(self.campaign.limits[i].event, hazard) for i, hazard in self.hazards.items() if hazard.events]
        return result_group(
            self._limit_table(),
            *self.statements,
            *(
                f"{event}: {hazard.early} of {hazard.events} first events in the first half of flights, "
                f"{100.0 * hazard.expected:.0f} % if even: {hazard.verdict}"
                for event, hazard in hazards
            ),
            *self._worst_lines(),
            self._tolerance_table(),
            self._map_table(),
            *self.splitting.get("statements", ()),
            f"Not said: {'; '.join(self.disclaimers)}.",
        )

    def _limit_table(self) -> Any:
        campaign = self.campaign
        rows = [
            (
                verdict.limit.text,
                f"{verdict.events:,}",
                f"{verdict.flights:,}",
                upper_bound_in_unit(campaign, verdict),
                "shown" if verdict.shown else "refuted" if verdict.is_refuted else "not shown",
            )
            for verdict in self.verdicts
        ]
        title = f"{campaign.scenario.name}: {len(self.rows):,} flights of {campaign.scenario.flight.duration:g} s"
        at_most = f"at most ({100.0 * campaign.confidence:g} %)"
        return result_table(title, f"limit; >events; >flights; {at_most}; verdict", rows)

    def _worst_lines(self) -> list[str]:
        """Return one line for the worst flight of each limit."""
        lines: dict[str, str] = {}
        for entry in self.worst:
            moment = f" before {entry['first']:.0f} s" if "first" in entry else ""
            worst = f"worst for {entry['limit']}: {format_cell(entry['value'])}{moment}; {entry['replay']}"
            lines.setdefault(entry["limit"], worst)
        return list(lines.values())

    def _tolerance_table(self) -> Any:
        tolerance = self.tolerance
        if not tolerance or "reason" in tolerance:
            return f"tolerance: {tolerance['reason']}" if tolerance else None
        level, confidence = (100.0 * tolerance[name] for name in ("level", "confidence"))
        rows = [
            (
                axis["key"],
                format_cell(axis["nominal"]),
                format_cell(axis["safe"]),
                f"{axis['factor']:.3g}" if "factor" in axis else "",
                format_cell(axis["not_shown"]) if "not_shown" in axis else "",
                f"{axis['flights']:,}",
                axis.get("note", ""),
            )
            for axis in tolerance["axis"]
        ]
        title = f"safe: fewer than {level:g} % of flights with an event ({confidence:g} %)"
        heads = "|number; >nominal; >safe to; >factor; >not shown at; >flights; "
        return result_table(title, heads, rows, overflow="fold")

    def _map_table(self) -> Any:
        """Return upper bounds in percent of flights, first key downwards, second across."""
        bounds = self.over
        if not bounds:
            return None
        (down, across), (rows, columns) = bounds["keys"], bounds["axes"]
        title = f"at most so many % of flights with an event; * safe, below {100.0 * bounds['level']:g} %"
        cells = [f"{100.0 * cell['high']:.3g}{'*' if cell['verdict'] == 'safe' else ''}" for cell in bounds["cell"]]
        lines = [(f"{value:g}", *cells[i * len(columns) : (i + 1) * len(columns)]) for i, value in enumerate(rows)]
        return result_table(title, "; ".join((f"*{down} / {across}", *(f">{value:g}" for value in columns))), lines)


def campaign_disclaimers(campaign: Campaign) -> list[str]:
    """Return sentences on what a certificate does not show, with the numbers whose intervals were flown."""
    if not campaign.number_intervals:
        return list(NOT_SAID)
    flown = (
        f"the confidence covers chance, and {', '.join(campaign.number_intervals)} anywhere in the given intervals, but"
    )
    return [text.replace(ALONE, flown) for text in NOT_SAID]


def flight_score(scores: Mapping[str, Any], score: str) -> float:
    """Score of a flight; of r_min the smallest distance at any motion step, where that was measured."""
    near = scores.get("closest") if score == "r_min" else None
    return float(scores[score] if near is None else near)


def _timed(campaign: Campaign) -> list[str]:
    return [limit.event for limit in campaign.limits if limit.is_timed]


def _without(document: Mapping[str, Any], key: str) -> dict[str, Any]:
    return {name: value for name, value in document.items() if name != key}


def upper_bound_in_unit(campaign: Campaign, verdict: LimitVerdict) -> str:
    """Upper bound in the limit's own unit."""
    if verdict.high == 1.0:
        return ""
    return f"{campaign.to_limit_unit(verdict.limit, verdict.high):.3g} {UNIT_WORDS[verdict.limit.unit]}"


def limit_statement(campaign: Campaign, verdict: LimitVerdict, rate: float = 0.0) -> str:
    """One sentence: what is shown of a limit, what is refuted, or what would be needed."""
    limit, n, s = verdict.limit, verdict.flights, campaign.scenario
    flown = f"{verdict.events:,} events in {n:,} flights of {s.flight.duration:g} s by {s.agents} agents"
    if verdict.flights_to_show:
        time = f", {format_duration(verdict.flights_to_show / rate)} on this machine" if rate else ""
        could = f"{campaign.to_limit_unit(limit, verdict.provable_probability):.2g} {UNIT_WORDS[limit.unit]}"
        return (
            f"{limit.text}: not shown: needs {verdict.flights_to_show:,} flights{time}; the given time can show {could}"
        )
    if verdict.high == 1.0 and not verdict.is_refuted:
        return f"{limit.text}: not shown: time ran out before there were enough flights: {flown}"
    sure = f"with {100.0 * campaign.confidence:g} % confidence"
    said = f"{limit.event} happens at most {upper_bound_in_unit(campaign, verdict)}"
    if limit.is_timed and limit.unit == "h":
        said += f" ({rate_per_hour(verdict.high, campaign.flight_hours) / s.agents:.3g} per drone hour)"
    if verdict.is_refuted:
        least = f"{campaign.to_limit_unit(limit, verdict.low):.3g} {UNIT_WORDS[limit.unit]}"
        return f"{limit.text}: refuted: {limit.event} happens at least {least} {sure}: {flown}"
    if verdict.shown:
        return f"{limit.text}: shown: {said} {sure}: {flown}"
    return f"{limit.text}: not shown: {said} {sure}: {flown}"


def format_duration(seconds: float) -> str:
    """A time as people say it."""
    for unit, length in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 1.5 * length:
            return f"{seconds / length:.3g} {unit}"
    return f"{max(seconds, 0.1):.2g} s"


def limit_entry(campaign: Campaign, verdict: LimitVerdict, timing: EventTiming | None) -> dict[str, Any]:
    """One limit as plain values."""
    limit = verdict.limit
    made: dict[str, Any] = {
        "text": limit.text,
        "event": limit.event,
        "unit": limit.unit,
        "shown": verdict.shown,
        "refuted": verdict.is_refuted,
        "flights": verdict.flights,
        "events": verdict.events,
        "low": verdict.low,
        "high": verdict.high,
        "low_told": campaign.to_limit_unit(limit, verdict.low),
        "high_told": campaign.to_limit_unit(limit, verdict.high),
    }
    if verdict.probability is not None:
        made["probability"] = verdict.probability
    if limit.is_timed:
        rate = rate_per_hour(verdict.high, campaign.flight_hours)
        made["high_per_flock_hour"], made["high_per_drone_hour"] = rate, rate / campaign.scenario.agents
    if verdict.flights_to_show:
        made["needs"] = verdict.flights_to_show
    if timing is not None:
        made["hazard"] = {**vars(timing), "verdict": timing.verdict}
    looks = [{name: getattr(x, name) for name in LOOK} for x in verdict.looks]
    finite = {key: x for key, x in made.items() if not isinstance(x, float) or abs(x) < float("inf")}
    return finite | {"looks": looks}


def scores_digest(scores: Mapping[str, Any]) -> str:
    """Short hash of all scores of a flight, to the bit."""
    known = {
        name: None if isinstance(x, float) and x != x else x for name, x in scores.items()
    }  # as the store has them
    text = json.dumps(known, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def certificate_checksum(document: Mapping[str, Any]) -> str:
    """Checksum of a certificate: it detects changes by accident or in an editor, and is no signature."""
    text = json.dumps(_without(document, "seal"), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def with_checksum(document: dict[str, Any]) -> dict[str, Any]:
    """A certificate's content with its checksum."""
    return {"seal": certificate_checksum(document), **document}


@dataclass(frozen=True)
class CheckReport:
    """Report of a check.

    flown : flights that were flown again; faults: what does not hold, one line each; notes: what
            may explain it
    """

    flown: int
    total: int
    faults: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def same(self) -> bool:
        """True if all flights and bounds agree."""
        return not self.faults

    def __repr__(self) -> str:
        said = "; ".join(self.faults) or "all bits agree, all bounds are right"
        return f"<check: {self.flown} of {self.total:,} flights flown again: {said}>"


def check_certificate(
    path: str | os.PathLike[str],
    *,
    threads: int | None = None,
    trust: bool = False,
    on_done: Callable[[], None] | None = None,
) -> CheckReport:
    """Check a certificate file: fly one flight in a hundred again and compare the bits.

    path    : of certificate.toml; threads : of the flights, all processors by default
    trust   : True lets a law run that stands in a Python file named by the scenario
    on_done : called after each flight

    Raises StudyError where the file is no certificate, of another format, version or scenario than
    it says; and an AirflockError where it cannot be read.

    Examples
    --------
    >>> import airflock
    >>> from airflock.certificates.certificate import check_certificate
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 2.0})
    >>> path = airflock.certify(short, "n_coll<1 at 90%", flights=100).save("certificate.toml")
    >>> check_certificate(path).same
    True
    """
    with as_error(path, StudyError):
        document = read_toml(expand_path(path))
    return check_document(document, str(path), threads=threads, trust=trust, on_done=on_done)


def check_document(
    document: Mapping[str, Any],
    where: str,
    *,
    scenario: Scenario | None = None,
    threads: int | None = None,
    trust: bool = False,
    on_done: Callable[[], None] | None = None,
) -> CheckReport:
    """Check the content of a certificate, whose scenario `scenario` replaces. Raises like `check_certificate`."""
    check_document_shape(document, where)
    with as_error(f"{where}: is damaged", StudyError):
        flown = document["flown"]
        if flown["airflock"] != __version__:
            raise StudyError(
                f"{where}: made by airflock {flown['airflock']}, this is {__version__}; check it with that"
            )
        faults = (
            ["was changed after it was written (its checksum differs)"]
            if certificate_checksum(document) != document["seal"]
            else []
        )
        campaign = campaign_of_document(document, where, scenario, trust)
        faults += _sums(document, campaign)
        rules = campaign.document()["rules"]
        if rules != flown["rules"]:
            raise StudyError(
                f"{where}: its flights were computed by other rules (text {flown['rules']}, here {rules}); "
                "check it with the version that wrote it, or certify again"
            )
        found, notes = _flown_again(document, campaign, threads, on_done), _differences(flown)
    return CheckReport(len(document["check"]["digests"]), int(document["flights"]["count"]), (*faults, *found), notes)


def check_document_shape(document: Mapping[str, Any], where: str) -> None:
    """Raise StudyError where a document is no certificate, is of another format, or lacks keys."""
    if not {"seal", "format", "limit", "flights", "scenario"} <= set(document):
        raise StudyError(f"{where}: is not a certificate; airflock certify writes one")
    if document["format"] != CERTIFICATE_FORMAT:
        raise StudyError(f"{where}: is of format {document['format']}; this Airflock reads format {CERTIFICATE_FORMAT}")
    if faults := _shape_faults(document):
        raise StudyError(f"{where}: is damaged: {'; '.join(faults)}")


MOST_DIGESTS = 1_000_000  # flights that a certificate may ask to be flown again
KeyTypes = Mapping[str, tuple[type, ...]]
_NUMBER = (int, float)
_TABLES: dict[str, KeyTypes] = {
    "flown": {"airflock": (str,), "rules": (str,), "precision": (int,), "device": (str,)},
    "flights": {
        "count": (int,), "looks": (str,), "uncertain": (bool,), "identity": (str,), "first_seed": (int,),
    },
    "check": {"every": (int,), "digests": (list,)},
    "scenario": {"name": (str,)},
}  # fmt: skip
_LIMIT: KeyTypes = {"text": (str,), "looks": (list,), "high": _NUMBER, "low": _NUMBER, "shown": (bool,)}
_LOOK: KeyTypes = {"flights": (int,), "events": (int,), "above": _NUMBER, "below": _NUMBER}


def _shape_faults(document: Mapping[str, Any]) -> list[str]:
    """Return errors for keys of a certificate that are missing or of another type."""
    faults = [] if _is(document.get("confidence"), _NUMBER) else ["confidence"]
    for name, kinds in _TABLES.items():
        faults += _wrong(name, document.get(name), kinds)
    limits = document["limit"]
    for i, limit in enumerate(limits if isinstance(limits, list) and limits else [None]):
        faults += _wrong(f"limit[{i}]", limit, _LIMIT)
        looks = limit.get("looks") if isinstance(limit, Mapping) else None
        for j, each in enumerate(looks if isinstance(looks, list) else []):
            faults += _wrong(f"limit[{i}].looks[{j}]", each, _LOOK)
    if not faults:
        digests, every = document["check"]["digests"], document["check"]["every"]
        if not all(isinstance(text, str) for text in digests) or len(digests) > MOST_DIGESTS or every < 1:
            faults.append("check")
    return [f"{fault} is missing or of another type than a certificate has there" for fault in faults[:5]]


def _wrong(name: str, table: Any, kinds: KeyTypes) -> list[str]:
    if not isinstance(table, Mapping):
        return [name]
    return [f"{name}.{key}" for key, kind in kinds.items() if not _is(table.get(key), kind)]


def _is(value: Any, kinds: tuple[type, ...]) -> bool:
    return isinstance(value, kinds) and (not isinstance(value, bool) or bool in kinds)


def campaign_of_document(document: Mapping[str, Any], where: str, scenario: Scenario | None, trust: bool) -> Campaign:
    """Return the campaign that a certificate holds. Raises StudyError where its scenario is not the one it names."""
    settings = dict(document["scenario"])
    name = str(settings.pop("name"))
    if scenario is None:
        scenario = build_scenario(settings, name, folder=Path(where).parent, trust=trust)
    flights, flown = document["flights"], document["flown"]
    campaign = Campaign(
        scenario,
        parse_limits([entry["text"] for entry in document["limit"]], scenario),
        float(document["confidence"]),
        int(flown["precision"]),
        int(flights["count"]) if str(flights["looks"]).startswith("fixed") else None,
        bool(flights["uncertain"]),
        str(flown["device"]),
    )
    if campaign.hash != flights["identity"]:
        raise StudyError(f"{where}: its flights were those of another scenario than the one that it holds")
    return campaign


def _sums(document: Mapping[str, Any], campaign: Campaign) -> list[str]:
    """Return errors of bounds and verdicts that do not follow from the counts."""
    # A changed file has to fail here even if its checksum was recomputed: every number follows from
    # counts and limits.
    faults = []
    if document["flights"]["first_seed"] != certificate_seed(campaign.hash, COUNT_PURPOSE, 0):
        faults.append("its seeds are not those that the scenario fixes")
    for entry, limit in zip(document["limit"], campaign.limits, strict=True):
        stored_looks = [
            (int(x["flights"]), int(x["events"]), float(x["above"]), float(x["below"])) for x in entry["looks"]
        ]
        again = [take_look(*each) for each in stored_looks]
        high, low = min((x.high for x in again), default=1.0), max((x.low for x in again), default=0.0)
        paid = max(sum(x.above for x in again), sum(x.below for x in again))
        probability = campaign.probability(limit)
        shown = high < 1.0 if probability is None else high <= probability
        right = abs(high - entry["high"]) <= 1e-9 * high and abs(low - entry["low"]) <= 1e-9 and shown == entry["shown"]
        if not right or paid > campaign.alpha * (1.0 + 1e-9):
            faults.append(f"limit '{limit.text}': its bounds do not follow from its counts")
        elif not _fixed(stored_looks, campaign, limit, int(document["flights"]["count"])):
            faults.append(f"limit '{limit.text}': its looks are not those that the limit fixes")
    return faults


def _fixed(
    stored_looks: Sequence[tuple[int, int, float, float]], campaign: Campaign, limit: EventLimit, count: int
) -> bool:
    """Return True if looks are the first of a limit's schedule, within the flights, with events that never decrease."""
    known = list(islice(looks_due(campaign, limit), len(stored_looks)))
    sizes = [(flights, above, below) for flights, _, above, below in stored_looks]
    same = len(known) == len(stored_looks) and all(
        each[0] == right[0] and all(math.isclose(a, b, rel_tol=1e-9) for a, b in zip(each[1:], right[1:], strict=True))
        for each, right in zip(sizes, known, strict=True)
    )
    events = [0, *(events for _, events, _, _ in stored_looks)]
    grow = all(old <= new for old, new in pairwise(events))
    return same and grow and all(events <= flights <= count for flights, events, _, _ in stored_looks)


def _flown_again(
    document: Mapping[str, Any], campaign: Campaign, threads: int | None, done: Callable[[], None] | None
) -> list[str]:
    from airflock.support import run_in_threads

    # One flight in `every` is enough: a certificate of other bits fails in nearly all of them.
    wanted, every = document["check"]["digests"], int(document["check"]["every"])
    numbers = [every * i for i in range(len(wanted))]
    if campaign.device == "cpu" and numbers:
        campaign.task.compile()

    def job(number: int) -> Callable[[], str]:
        own = certificate_seed(campaign.hash, COUNT_PURPOSE, number)
        return lambda: scores_digest(campaign.task.score(campaign.parameters(own), own))

    flown = run_in_threads([job(number) for number in numbers], 1 if campaign.device != "cpu" else threads, done)
    other = [number for number, now, then in zip(numbers, flown, wanted, strict=True) if now != then]
    return [
        f"flight {number}, seed {certificate_seed(campaign.hash, COUNT_PURPOSE, number)}: other bits"
        for number in other[:5]
    ] + ([f"and {len(other) - 5} more flights with other bits"] if len(other) > 5 else [])


def _differences(flown: Mapping[str, Any]) -> tuple[str, ...]:
    """Return versions that differ from those of the certificate: they may explain other bits."""
    now = program_versions()
    return tuple(
        f"{name}: {flown[name]} then, {value} now" for name, value in now.items() if flown.get(name, value) != value
    )
