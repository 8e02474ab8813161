"""Campaign: limits to show for a scenario, and everything else that decides the result; also its seeds and flights."""

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from airflock import __version__
from airflock.certificates.limits import R_COLL_METRICS, EventLimit, parse_limits
from airflock.core import Quantity, declarations
from airflock.engine import driver_text
from airflock.parts import SENSORS
from airflock.runs import (
    REQUEST_FILE,
    ScenarioTask,
    check_timeout,
    check_worker_device,
    declared_numbers,
    fingerprint,
    requested_scenario,
    unpublished,
    with_parameters,
)
from airflock.scenarios import FaultTiming, Scenario
from airflock.support import ErrorCollector, ScenarioError, StudyError, as_error, check_precision, suggest

LAYOUT = 1  # of the folder; raised whenever an older folder could not be continued


@dataclass(frozen=True)
class Campaign:
    """Flights that are to show limits.

    confidence : of all limits together
    flights    : a number fixed in advance: one look at its end; None: looks as `look_schedule`
                 says
    flies_intervals : whether each flight draws the numbers of its world from the intervals that the
                      scenario file holds
    """

    scenario: Scenario
    limits: tuple[EventLimit, ...]
    confidence: float = 0.95
    bits: int = 32
    flights: int | None = None
    flies_intervals: bool = False
    device: str = "cpu"
    kind = "campaign"
    also: ClassVar[Mapping[str, Any]] = {}

    @cached_property
    def hash(self) -> str:
        """Identity of the scenario; it fixes the seeds."""
        return scenario_identity(self.scenario)

    @cached_property
    def task(self) -> "CampaignTask":
        """How its flights are scored."""
        return CampaignTask(self.scenario, self.limits, self.bits, self.device)

    @property
    def flown(self) -> Scenario:
        """The scenario as it is measured."""
        return self.task.flown

    @property
    def alpha(self) -> float:
        """Error probability of one limit: the limits share 1 - confidence equally."""
        return (1.0 - self.confidence) / len(self.limits)

    @property
    def flight_hours(self) -> float:
        """Duration of a flight, h."""
        return self.scenario.flight.duration / 3600.0

    def probability(self, limit: EventLimit) -> float | None:
        """A limit as a probability per flight."""
        return limit.probability(self.flight_hours, self.scenario.agents)

    def to_limit_unit(self, limit: EventLimit, probability: float) -> float:
        """A probability per flight in the unit of a limit."""
        return limit.to_limit_unit(probability, self.flight_hours, self.scenario.agents)

    @cached_property
    def number_intervals(self) -> dict[str, tuple[float, float]]:
        """Key → interval of every number that the scenario's file is not sure of."""
        return read_intervals(self.scenario.document) if self.flies_intervals else {}

    def parameters(self, seed: int) -> dict[str, float]:
        """Numbers of the world of one flight, uniform in their intervals; the seed alone decides them."""
        if not self.number_intervals:
            return {}
        drawn = (
            np.random.default_rng(seed).random(len(self.number_intervals)).tolist()
        )  # plain numbers, for what is printed
        return {
            key: low + (high - low) * x
            for (key, (low, high)), x in zip(self.number_intervals.items(), drawn, strict=True)
        }

    def document(self) -> dict[str, Any]:
        """The campaign as plain values: the request in its folder, with which a resumed one is compared."""
        return {
            "layout": LAYOUT,
            "airflock": __version__,
            "rules": fingerprint(self.flown, self.bits),
            "device": self.device,
            "precision": self.bits,
            "name": self.scenario.name,
            "identity": self.hash,
            "confidence": self.confidence,
            "limits": [limit.text for limit in self.limits],
            "flights": self.flights,
            "uncertain": self.flies_intervals,
            "scenario": unpublished(self.scenario),
        }


def read_intervals(document: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Key → interval of the numbers of a scenario's document that have one, as `airflock identify` writes them."""
    found = {}
    for section, table in document.items():
        entries = table.items() if isinstance(table, Mapping) and "value" not in table else ((None, table),)
        for name, entry in entries:
            if isinstance(entry, Mapping) and isinstance(entry.get("interval"), list):
                low, high = entry["interval"]
                found[f"{section}.{name}" if name else section] = (float(low), float(high))
    return found


def campaign_from_request(
    scenario: Scenario,
    limit: str | Sequence[str],
    confidence: float = 0.95,
    flights: int | None = None,
    *,
    uncertain: bool = False,
    precision: int = 32,
    device: str = "cpu",
) -> Campaign:
    """Make the campaign of a request. Raises ScenarioError with all errors together."""
    errors = ErrorCollector()
    limits = errors.read(parse_limits, [limit] if isinstance(limit, str) else list(limit), scenario)
    errors.read(check_confidence, confidence)
    errors.read(check_flight_count, flights)
    errors.read(check_flight_options, precision, device)
    bits = 64 if device == "python" else precision
    campaign = Campaign(scenario, limits, confidence, bits, flights, uncertain, device)
    if uncertain and not campaign.number_intervals:
        errors.add(f"{scenario.name}: no number has an interval; airflock identify --uncertain writes them")
    errors.raise_errors()
    return campaign


def campaign_of_request(held: Mapping[str, Any], *, trust: bool = False) -> Campaign:
    """Return the campaign that a folder holds. Raises ScenarioError or StudyError where that cannot be flown here."""
    with as_error(REQUEST_FILE, StudyError):
        name, flights = str(held["name"]), held.get("flights")
        scenario = requested_scenario(held["scenario"], name, trust=trust)
        texts, bits, device = list(held["limits"]), int(held["precision"]), str(held["device"])
        campaign = campaign_from_request(
            scenario, texts, held["confidence"], flights, uncertain=held["uncertain"], precision=bits, device=device
        )
    return campaign


def check_confidence(confidence: float) -> None:
    """Refuse what is no confidence of a certificate."""
    if not 0.5 <= confidence < 1.0:
        raise ScenarioError([f"confidence = {confidence:g} lies outside [0.5, 1); 0.95 is usual"])


def check_flight_count(flights: int | None) -> None:
    """Refuse a number of flights that cannot be numbered."""
    if flights is not None and not 1 <= flights < 1 << 30:
        raise ScenarioError([f"flights = {flights} lies outside [1, {(1 << 30) - 1}]"])


def check_flight_options(precision: int, device: str) -> None:
    """Refuse a precision and a device on which no certificate flies."""
    errors = ErrorCollector()
    errors.read(check_precision, precision)
    if device not in ("cpu", "python"):
        errors.add(f"device = {device!r}: a certificate flies on cpu or python")
    errors.raise_errors()


def tolerance_keys(scenario: Scenario, tolerance_of: bool | Sequence[str]) -> tuple[str, ...]:
    """Return the keys whose tolerance is requested. Raises ScenarioError for one that cannot be varied.

    Parameters
    ----------
    scenario : Scenario
        What is flown.
    tolerance_of : bool or sequence of str (KEY)
        Only for this key, such as radio.delay; repeatable.
    """
    if not tolerance_of:
        return ()

    return (
        used_and_unused_keys(scenario) if tolerance_of is True else check_environment_keys(scenario, list(tolerance_of))
    )


def check_certify_budget(budget: float) -> None:
    """Refuse a time in which nothing could fly."""
    if not budget > 0.0:
        raise StudyError(f"budget = {budget:g} s is not positive")


def check_workers(timeout: float | None, scheduler: str | None, device: str) -> None:
    """Refuse a time in which no flight could fly on a worker, and a scheduler's workers in plain Python."""
    errors = ErrorCollector()
    errors.read(check_timeout, timeout)
    errors.read(check_worker_device, scheduler, device)
    errors.raise_errors()


# number of the environment → which way is worse
WORSE = {
    "radio.delay": 1, "radio.range": -1, "radio.far": -1, "radio.received_far": -1, "radio.loss": 1,
    "sensors.noise": 1, "sensors.sd": 1, "sensors.jump_rate": 1, "sensors.outage_rate": 1, "sensors.lag": 1,
    "sensors.period": 1, "body.noise": 1, "body.tau": 1, "body.delay": 1, "body.a_max": -1, "body.jerk": -1,
    "wind.gust": 1, "wind.at_6m": 1, "agents": 1,
}  # fmt: skip
# number that may be zero → first value above zero that is tried
FIRST_VALUE = {
    "radio.loss": 0.1,
    "wind.gust": 1.0,
    "sensors.jump_rate": 1.0 / 600.0,
    "sensors.outage_rate": 1.0 / 600.0,
}
READ_AS = {"sensors": "s", "radio": "k", "wind": "a"}  # section → what a driver calls its numbers

EnvironmentNumbers = dict[str, tuple[Quantity, float]]


def environment_numbers(scenario: Scenario) -> EnvironmentNumbers:
    """Key → declaration and value of all numbers of the environment that a scenario has, those of faults included."""
    known = declared_numbers(scenario)
    dryden = scenario.wind.kind == "dryden"
    left_out = {"wind.gust" if dryden else "wind.at_6m"}
    found = {key: (known[key][0], float(known[key][1] or 0.0)) for key in WORSE if key in known and key not in left_out}
    return found | _of_faults(scenario)


def used_and_unused_keys(scenario: Scenario) -> tuple[str, ...]:
    """Numbers of the environment that a scenario uses, and those that it leaves at zero and would read above it.

    The latter come last: another driver has to be compiled for some of them.
    """
    links = scenario.radio.rule.keeps_packets
    unused = {"radio.range"} if links else {"radio.far", "radio.received_far"}
    known = environment_numbers(scenario)
    used = [key for key, (_, value) in known.items() if value and key not in unused]
    zero = [key for key, (_, value) in known.items() if not value and key in FIRST_VALUE and _read(scenario, key)]
    return (*used, *zero)


def check_environment_keys(scenario: Scenario, keys: list[str]) -> tuple[str, ...]:
    """The keys that are named; ScenarioError for one that cannot be varied."""
    known, faults = environment_numbers(scenario), []
    for key in keys:
        if key not in known:
            hint = f"known: {', '.join(known)}"
            hint = hint if key in WORSE else suggest(key, list(known), hint)
            of = "a number of this scenario" if key in WORSE else "a number of the environment"
            faults.append(f"tolerance: {key} is not {of}; {hint}")
        elif not known[key][1] and key not in FIRST_VALUE:
            faults.append(f"tolerance: {key} = 0 in {scenario.name}; give it a value that a factor can change")
        elif not known[key][1] and not _read(scenario, key):
            faults.append(f"tolerance: {key}: nothing reads it in {scenario.name}")
    if faults:
        raise ScenarioError(faults)
    return tuple(dict.fromkeys(keys))


def worse_direction(key: str) -> int:
    """1 where a larger value is worse, -1 where a smaller one is."""
    return WORSE.get(key, 1)


def _of_faults(scenario: Scenario) -> EnvironmentNumbers:
    """How often each fault strikes at random, or how many agents it hits at its time."""
    known = {name: how for name, how, _ in declarations(FaultTiming()) if isinstance(how, Quantity)}
    found: EnvironmentNumbers = {}
    for i, entry in enumerate(scenario.faults):
        if entry.at is None and entry.per_hour > 0.0:
            found[f"faults[{i}].per_hour"] = (known["per_hour"], entry.per_hour)
        elif entry.at is not None and entry.number is not None and entry.number < len(entry.agents):
            most = known["number"]._replace(high=float(len(entry.agents)), whole=True)
            found[f"faults[{i}].number"] = (most, float(entry.number))
    return found


def _read(scenario: Scenario, key: str) -> bool:
    """Return True if flights read a number once it is above zero."""
    section, _, name = key.partition(".")
    if section == "wind" and scenario.wind.kind == "dryden":
        return False
    above = with_parameters(replace(scenario, groups=()) if scenario.groups else scenario, {key: FIRST_VALUE[key]})
    return bool(re.search(rf"\b{READ_AS[section]}\.{name}\b", driver_text(above)))


# A flight with an event is flown again, sampled at every step. Measuring all flights so would take
# thrice the time.
PARTS = 60  # of a flight that is flown again: when an event happened is known to a sixtieth of its duration


def with_distance_metrics(scenario: Scenario, limits: Sequence[EventLimit]) -> Scenario:
    """Return the scenario with metrics that miss no approach within the largest distance of a limit.

    Collisions are looked for at every motion step, so its radius becomes that distance, unless
    other limits mind it.
    """
    radii = [limit.value for limit in limits if limit.score == "r_min"]
    if not radii:
        return scenario
    if any(metric.name == "collisions" for metric in scenario.order_parameters):
        if any(limit.score in R_COLL_METRICS for limit in limits):
            return scenario
        return replace(scenario, metrics=scenario.metrics.with_numbers(r_coll=max(radii), collision_period=None))
    return sampled_every_step(scenario)


def sampled_every_step(scenario: Scenario) -> Scenario:
    """Return the scenario sampled at every motion step."""
    return replace(scenario, metrics=scenario.metrics.with_numbers(period=0.0, collision_period=None))


def event_details(
    scenario: Scenario, seed: int, limits: Sequence[EventLimit], precision: int, device: str = "cpu"
) -> dict[str, Any]:
    """Return the smallest distance at any motion step (`closest`, m) and times of events (`first`, s or None)."""
    from airflock.engine import Flight

    flight = Flight(sampled_every_step(scenario), seed, precision=precision, device=device)
    part = max(1, round(scenario.flight.duration / scenario.flight.dt / PARTS))
    first: list[float | None] = [None] * len(limits)
    scores: Mapping[str, Any] = {}
    while not flight.over:
        scores = flight.advance(steps=part).scores()
        for i, limit in enumerate(limits):
            if first[i] is None and limit.has_happened(scores):
                first[i] = flight.time
    scores = flight.finish()
    for i, limit in enumerate(limits):
        if first[i] is None and limit.has_happened(scores):
            first[i] = flight.time
    return {"closest": scores.get("r_min"), "first": first}


class CampaignTask(ScenarioTask):
    """How flights of a campaign are scored: the scenario as it is measured, and details of events."""

    def __init__(self, scenario: Scenario, limits: Sequence[EventLimit], precision: int, device: str = "cpu"):
        super().__init__(scenario, precision, device)
        self.limits = tuple(limits)

    @cached_property
    def flown(self) -> Scenario:
        """The scenario with metrics of the distances in the limits."""
        return with_distance_metrics(self.scenario, self.limits)

    def score(self, parameters: Mapping[str, float], seed: int) -> Mapping[str, Any]:
        """Return the scores of a flight, with `closest` (m) and `first` (s) after an event."""
        watched = [limit for limit in self.limits if limit.is_timed]
        radius = max((limit.value for limit in self.limits if limit.score == "r_min"), default=0.0)
        values = super().score(parameters, seed)
        found = {name: value for name, value in values.items() if isinstance(value, (int, float))}
        near = radius > 0.0 and (found["r_min"] <= radius or found.get("n_coll", 0.0) > 0.0)
        if near or any(limit.has_happened(found) for limit in watched):
            flown = with_parameters(self.flown, parameters) if parameters else self.flown
            found |= event_details(flown, seed, watched, self.precision, self.device)
        return found


# Beyond all seeds of studies and of people: no flight of a certificate has chosen anything.
FIRST = 1 << 62
BITS = 30  # numbers of flights within one part
# parts of a certificate; they share no seed
COUNT_PURPOSE: int = 0
TOLERANCE_PURPOSE: int = 1
SPLIT_PURPOSE: int = 2
MAP_PURPOSE: int = 3


def scenario_identity(scenario: Scenario) -> str:
    """Return a hash of everything that decides a flight but its seed: laws by name, numbers and choices.

    Comments (title, sources, published values) and the scoring of a flight do not count.
    """
    document: dict[str, Any] = {
        key: {name: getattr(record, name) for name in record.__dataclass_fields__}
        for key, record in scenario.records.items()
        if key != "metrics"
    }
    stands = hashlib.sha256(scenario.stands().shapes.tobytes()).hexdigest() if scenario.scene.draw == "once" else ""
    document["scene"] = {**document["scene"], "file": "", "stands": stands}
    if scenario.scene.up == "standard":  # which is z but in glTF, and what stands is in the hash
        document["scene"]["up"] = "z"
    document["world"] = {k: v for k, v in document["world"].items() if k not in ("latitude", "longitude")}
    for section, key in (("start", "wall_clearance"), ("body", "delay"), ("scene", "spheres")):
        if not document[section][key]:  # as in flights from before there was one
            del document[section][key]
    if not any(law.model.steer for law in scenario.laws):  # nothing reads them
        document.pop("steer", None)
    document["laws"] = [scenario.model.name, scenario.body.rule.name]
    # The default is left out, so that certificates from before there were others stay what they are.
    if scenario.sensors.rule.name != SENSORS.default:
        document["laws"].append(scenario.sensors.rule.name)
    if "kind" not in document["radio"]:  # which distinguishes records that are not the usual one
        document["laws"].append(scenario.radio.rule.name)
    if scenario.own_topology is not None:
        document["laws"].append(scenario.own_topology.name)
    return hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()


def certificate_seed(scenario_hash: str, purpose: int, index: int) -> int:
    """Seed of a flight of a certificate: of a part, COUNT or another, and its number from 0 on."""
    if not 0 <= index < 1 << BITS:
        raise StudyError(f"a certificate numbers at most {1 << BITS} flights; this would be number {index}")
    return FIRST + ((int(scenario_hash, 16) % (1 << 30)) << (BITS + 2)) + (purpose << BITS) + index
