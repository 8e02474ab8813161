"""Certificate: what was shown about a scenario, by which flights, with which confidence; and what was not."""

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

from airflock.certificates.bounds import rate_per_hour
from airflock.certificates.campaign import Campaign
from airflock.certificates.counting import LimitVerdict
from airflock.certificates.hazard import EventTiming
from airflock.certificates.seeds import COUNT_PURPOSE, certificate_seed
from airflock.runs import to_toml_values, write_toml_file
from airflock.support import expand_path

CERTIFICATE_FORMAT = 1
LOOK = ("flights", "events", "above", "below", "low", "high")
CHECKED = 100  # every so many flights one is kept for a check
FEWEST = 20  # of them at least, where there are so many
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
    """What counting showed.

    verdicts  : one for each limit; hazards: whether events came evenly, by limit, where that can be asked
    rows      : scores of all flights that were counted, in the order of their seeds
    tolerance : plain values of `airflock.certificates.tolerance`, empty if not asked for
    splitting : the same of `airflock.certificates.branches`; over: of `airflock.certificates.maps`
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
        """Whether all limits are shown."""
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
        c, step = self.campaign, max(1, min(CHECKED, len(self.rows) // FEWEST))
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
        """Fly one flight in a hundred again and compare the bits; see `airflock.certificates.check.check_document`.

        threads : of the flights, all processors by default

        Raises StudyError for a certificate of more flights than its numbers can tell apart, or where one flies no more.

        Examples
        --------
        >>> import airflock
        >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 2.0})
        >>> airflock.certify(short, "n_coll<1 at 90%", flights=100).check().same
        True
        """
        from airflock.certificates.check import check_document

        return check_document(self.document(), "certificate", scenario=self.campaign.scenario, threads=threads)

    @property
    def disclaimers(self) -> list[str]:
        """What it does not say."""
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


def campaign_disclaimers(campaign: Campaign) -> list[str]:
    """What a certificate does not say, with the numbers whose intervals were flown."""
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
    """Checksum of a certificate: it tells what was changed by accident or in an editor, and is no signature."""
    text = json.dumps(_without(document, "seal"), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def with_checksum(document: dict[str, Any]) -> dict[str, Any]:
    """A certificate's content with its checksum."""
    return {"seal": certificate_checksum(document), **document}
