"""Check: a certificate read again, one flight in a hundred flown again, and its bounds computed again."""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

from airflock import __version__
from airflock.certificates.bounds import take_look
from airflock.certificates.campaign import Campaign
from airflock.certificates.certificate import CERTIFICATE_FORMAT, certificate_checksum, scores_digest
from airflock.certificates.counting import looks_due
from airflock.certificates.flights import limit_score_function
from airflock.certificates.limit import EventLimit, parse_limits
from airflock.certificates.seeds import COUNT_PURPOSE, certificate_seed
from airflock.runs import program_versions
from airflock.scenarios import Scenario, build_scenario
from airflock.support import StudyError, as_error, expand_path, read_toml


@dataclass(frozen=True)
class CheckReport:
    """What a check found.

    flown : flights that were flown again; faults: what does not hold, one line each; notes: what may explain it
    """

    flown: int
    total: int
    faults: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def same(self) -> bool:
        """Whether everything agrees."""
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
    """Check a certificate file.

    path    : of certificate.toml; threads : of the flights, all processors by default
    trust   : whether a law in a Python file that the scenario names may run
    done    : called after each flight

    Raises StudyError where the file is no certificate, of another format, version or scenario than it says; and an
    AirflockError where it cannot be read.

    Examples
    --------
    >>> import airflock
    >>> from airflock.certificates.check import check
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 2.0})
    >>> path = airflock.certify(short, "n_coll<1 at 90%", flights=100).save("certificate.toml")
    >>> check(path).same
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
    if not {"seal", "format", "limit", "flights", "scenario"} <= set(document):
        raise StudyError(f"{where}: is not a certificate; airflock certify writes one")
    if document["format"] != CERTIFICATE_FORMAT:
        raise StudyError(f"{where}: is of format {document['format']}; this Airflock reads format {CERTIFICATE_FORMAT}")
    faults = _shape_faults(document)
    if faults:
        raise StudyError(f"{where}: is damaged: {'; '.join(faults)}")
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
        campaign = _campaign(document, where, scenario, trust)
        faults += _sums(document, campaign)
        rules = campaign.document()["rules"]
        if rules != flown["rules"]:
            raise StudyError(f"{where}: its flights were computed by other rules (text {flown['rules']}, here {rules})")
        found, notes = _flown_again(document, campaign, threads, on_done), _differences(flown)
    return CheckReport(len(document["check"]["digests"]), int(document["flights"]["count"]), (*faults, *found), notes)


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
    """Keys of a certificate that are missing or of another kind than it is written with."""
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


def _campaign(document: Mapping[str, Any], where: str, scenario: Scenario | None, trust: bool) -> Campaign:
    told = dict(document["scenario"])
    name = str(told.pop("name"))
    if scenario is None:
        scenario = build_scenario(told, name, folder=Path(where).parent, trust=trust)
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
    """Bounds and verdicts that do not follow from the counts."""
    faults = []
    if document["flights"]["first_seed"] != certificate_seed(campaign.hash, COUNT_PURPOSE, 0):
        faults.append("its seeds are not those that the scenario fixes")
    for entry, limit in zip(document["limit"], campaign.limits, strict=True):
        told = [(int(x["flights"]), int(x["events"]), float(x["above"]), float(x["below"])) for x in entry["looks"]]
        again = [take_look(*each) for each in told]
        high, low = min((x.high for x in again), default=1.0), max((x.low for x in again), default=0.0)
        paid = max(sum(x.above for x in again), sum(x.below for x in again))
        probability = campaign.probability(limit)
        shown = high < 1.0 if probability is None else high <= probability
        right = abs(high - entry["high"]) <= 1e-9 * high and abs(low - entry["low"]) <= 1e-9 and shown == entry["shown"]
        if not right or paid > campaign.alpha * (1.0 + 1e-9):
            faults.append(f"limit '{limit.text}': its bounds do not follow from its counts")
        elif not _fixed(told, campaign, limit, int(document["flights"]["count"])):
            faults.append(f"limit '{limit.text}': its looks are not those that the limit fixes")
    return faults


def _fixed(told: Sequence[tuple[int, int, float, float]], campaign: Campaign, limit: EventLimit, count: int) -> bool:
    """Whether looks are the first of those that a limit fixes, at flights that there are, and no event is undone."""
    known = list(islice(looks_due(campaign, limit), len(told)))
    sizes = [(flights, above, below) for flights, _, above, below in told]
    same = len(known) == len(told) and all(
        each[0] == right[0] and all(math.isclose(a, b, rel_tol=1e-9) for a, b in zip(each[1:], right[1:], strict=True))
        for each, right in zip(sizes, known, strict=True)
    )
    events = [0, *(events for _, events, _, _ in told)]
    grow = all(old <= new for old, new in pairwise(events))
    return same and grow and all(events <= flights <= count for flights, events, _, _ in told)


def _flown_again(
    document: Mapping[str, Any], campaign: Campaign, threads: int | None, done: Callable[[], None] | None
) -> list[str]:
    from airflock.engine import compile_for
    from airflock.support import run_in_threads

    wanted, every = document["check"]["digests"], int(document["check"]["every"])
    numbers = [every * i for i in range(len(wanted))]
    score = limit_score_function(campaign.flown, campaign.limits, campaign.bits, campaign.device)
    if campaign.device == "cpu" and numbers:
        compile_for(campaign.flown, precision=campaign.bits)

    def job(number: int) -> Callable[[], str]:
        own = certificate_seed(campaign.hash, COUNT_PURPOSE, number)
        return lambda: scores_digest(score(campaign.parameters(own), own))

    flown = run_in_threads([job(number) for number in numbers], 1 if campaign.device != "cpu" else threads, done)
    other = [number for number, now, then in zip(numbers, flown, wanted, strict=True) if now != then]
    return [
        f"flight {number}, seed {certificate_seed(campaign.hash, COUNT_PURPOSE, number)}: other bits"
        for number in other[:5]
    ] + ([f"and {len(other) - 5} more flights with other bits"] if len(other) > 5 else [])


def _differences(flown: Mapping[str, Any]) -> tuple[str, ...]:
    """Versions that differ from those of the certificate: what may explain other bits."""
    now = program_versions()
    return tuple(
        f"{name}: {flown[name]} then, {value} now" for name, value in now.items() if flown.get(name, value) != value
    )
