"""Tolerance: how far each number of the environment may move until a limit can no longer be shown.

Every value that is tried flies the same seeds, so that values differ by nothing but themselves. A value is safe where
the upper bound falls below the limit, and not shown where it does not within MOST flights, or where the lower bound
exceeds it. Rare limits would need too many flights at each value: they are screened at LEVEL per flight.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import Any

from airflock.certify.campaign import Campaign
from airflock.certify.counting import Count
from airflock.certify.flyer import Flyer
from airflock.certify.seeds import TOLERANCE, seed
from airflock.core.parameters import Quantity
from airflock.errors import ScenarioError
from airflock.evolve.space import declared
from airflock.evolve.store import Batch
from airflock.executors import Flight
from airflock.limits.bounds import Look, look, needed, schedule, share
from airflock.scenarios.scenario import Scenario
from airflock.spelling import meant

LEVEL = 0.02  # probability per flight at which rare limits are screened
MOST = 4.0  # flights at one value, as a multiple of those that show the level without an event
REACH = 8.0  # factor up to which a number is moved
HALVINGS = 3  # after a value that is safe and one that is not are known
# number of the environment → which way is worse; where it is zero there is no factor to move it by
WORSE = {
    "radio.delay": 1, "radio.range": -1, "radio.far": -1, "radio.received_far": -1, "radio.loss": 1,
    "sensors.noise": 1, "sensors.sd": 1, "sensors.jump_rate": 1, "sensors.outage_rate": 1, "sensors.lag": 1,
    "sensors.period": 1, "body.noise": 1, "body.tau": 1, "body.a_max": -1, "wind.gust": 1,
    "agents": 1,
}  # fmt: skip
WHOLE = ("agents",)
TIME_OVER = "time was over"


def usual_keys(scenario: Scenario) -> tuple[str, ...]:
    """Numbers of the environment that a scenario uses and that a factor can change."""
    known = declared(scenario)
    links = scenario.transceiver.keeps
    of_links = ("radio.far", "radio.received_far")
    return tuple(
        key
        for key in WORSE
        if key in known and known[key][1] and (key not in of_links or links) and not (key == "radio.range" and links)
    )


def sound_keys(scenario: Scenario, keys: Sequence[str]) -> tuple[str, ...]:
    """The keys that are named; ScenarioError for one that cannot be varied."""
    known, faults = declared(scenario), []
    for key in keys:
        if key not in WORSE or key not in known:
            may = [name for name in WORSE if name in known]
            listed = f"known: {', '.join(may)}"
            hint = listed if key in WORSE else meant(key, may, listed)
            what = "a number of this scenario" if key in WORSE else "a number of the environment"
            faults.append(f"tolerance: {key} is not {what}; {hint}")
        elif not known[key][1]:
            faults.append(f"tolerance: {key} = 0 in {scenario.name}; give it a value that a factor can change")
    if faults:
        raise ScenarioError(faults)
    return tuple(dict.fromkeys(keys))


def tolerance(flyer: Flyer, counted: Count, keys: Sequence[str]) -> dict[str, Any]:
    """Largest value of each key at which the events of all limits stay below a level, and the next that is not shown.

    Returns plain values: level, and for each key nominal, unit, safe, not_shown, factor (safe to nominal), flights.
    """
    campaign = flyer.campaign
    level = level_of(campaign)
    screen = Screen(flyer, level)
    events = sum(any(limit.happened(row) for limit in campaign.limits) for row in counted.rows)
    told: dict[str, Any] = {"level": level, "confidence": campaign.confidence, "axis": []}
    if not counted.rows or look(len(counted.rows), events, 1.0 - campaign.confidence, 0.0).high > level:
        told["reason"] = f"without any change, the scenario is not shown to stay below {100.0 * level:g} % per flight"
        return told
    for number, key in enumerate(keys):
        flyer.say(f"tolerance of {key}")
        told["axis"].append(_axis(screen, number, key, *declared(campaign.scenario)[key]))
    return told


def level_of(campaign: Campaign) -> float:
    """Probability per flight against which values are judged: that of the limits, or LEVEL where they are rarer."""
    return max([LEVEL, *(p for p in map(campaign.probability, campaign.limits) if p is not None)])


class Screen:
    """Judges one value at a time against a level per flight, on seeds that all values share."""

    def __init__(self, flyer: Flyer, level: float, part: int = TOLERANCE):
        self.flyer, self.level, self.part = flyer, level, part
        alpha = 1.0 - flyer.campaign.confidence
        most = MOST * needed(level, alpha * share(1))
        self.looks = list(takewhile(lambda due: due[0] <= most, schedule(level, alpha)))

    def judged(self, batch: Batch, parameters: Mapping[str, float]) -> tuple[str, Look | None]:
        """safe, unsafe, open, or a reason why it cannot be flown; and the last look."""
        campaign = self.flyer.campaign
        flown = {number: values for (_, number), values in self.flyer.store.flown(batch).items()}
        events, done, last = 0, 0, None
        for size, above, below in self.looks:
            missing = [number for number in range(done, size) if number not in flown]
            if missing and self.flyer.time_over:
                return TIME_OVER, last
            seeds = [seed(campaign.hash, self.part, number) for number in missing]
            flights = [
                Flight(0, number, {**campaign.parameters(own), **parameters}, own)
                for number, own in zip(missing, seeds, strict=True)
            ]
            for landed in self.flyer.fly(batch, flights):
                flown[landed.flight.repeat] = landed.values
                if landed.values is None:
                    return f"cannot be flown: {landed.reason}", last
            rows = [flown[number] for number in range(done, size)]
            if any(row is None for row in rows):
                return "cannot be flown", last
            events += sum(any(limit.happened(row or {}) for limit in campaign.limits) for row in rows)
            done, last = size, look(size, events, above, below)
            if last.high < self.level:
                return "safe", last
            if last.low > self.level:
                return "unsafe", last
        return "open", last


class Trials:
    """Values of one number that are tried one after another.

    flights : flown at all of them; verdict : on the last one, as `Screen.judged` says it
    """

    def __init__(self, screen: Screen, number: int, key: str):
        self._screen, self._number, self._key, self._tried = screen, number, key, 0
        self.flights, self.verdict = 0, ""

    def safe(self, value: float) -> bool | None:
        """Whether a value is safe; None where time was over before that was known."""
        batch, parameters = Batch("tolerance", self._number, self._tried), {self._key: value}
        self._screen.flyer.store.ask(batch, [[value]], [parameters])
        self.verdict, last = self._screen.judged(batch, parameters)
        self._tried, self.flights = self._tried + 1, self.flights + (last.flights if last else 0)
        return None if self.verdict == TIME_OVER else self.verdict == "safe"


def _axis(screen: Screen, number: int, key: str, how: Quantity, nominal: float | None) -> dict[str, Any]:
    """Move one number until it is no longer safe, then halve the way between."""
    value, worse, end = float(nominal or 0.0), WORSE[key], ""
    trials, safe, bad = Trials(screen, number, key), value, math.nan
    while abs(math.log(safe / value)) < math.log(REACH) - 1e-9:
        candidate = _whole(key, min(max(safe * 2.0**worse, how.low), how.high))
        if candidate == safe:
            end = f"the end of its range, {how.span}"
            break
        good = trials.safe(candidate)
        if not good:
            bad = candidate if good is not None else math.nan
            break
        safe = candidate
    for _ in range(0 if math.isnan(bad) else HALVINGS):
        middle = _whole(key, math.sqrt(safe * bad))
        if middle in (safe, bad):
            break
        good = trials.safe(middle)
        if good is None:
            break
        safe, bad = (middle, bad) if good else (safe, middle)
    note = end or ("" if trials.verdict in ("safe", "unsafe", "open") else trials.verdict)
    made = {"key": key, "unit": how.unit, "nominal": value, "safe": safe, "factor": safe / value}
    made |= {"flights": trials.flights} | ({} if math.isnan(bad) else {"not_shown": bad})
    return made | ({"note": note} if note else {})


def _whole(key: str, value: float) -> float:
    return float(round(value)) if key in WHOLE else value
