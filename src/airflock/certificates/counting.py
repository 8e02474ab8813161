"""Counting: fly until a limit is shown, is refuted, or time is over; each look spends part of the error."""

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Any

from airflock.certificates.campaign import COUNT_PURPOSE, Campaign, certificate_seed
from airflock.certificates.limits import EventLimit, InterimLook, alpha_share, flights_needed, look_schedule, take_look
from airflock.runs import CandidateBatch, Executor, Flight, FlightResult, FlightStore, OnProgress, RunProgress
from airflock.support import StudyError


@dataclass(frozen=True)
class CampaignFlyer:
    """A campaign with its store of flights, who flies them and until when.

    until : moment of `time.monotonic` at which the budget of time is spent, s
    watch : called with the progress of each part
    """

    campaign: Campaign
    store: FlightStore
    executor: Executor
    until: float = math.inf
    watch: OnProgress | None = None

    def with_budget(self, budget: float) -> "CampaignFlyer":
        """Return a copy with a new time budget (s) from now on."""
        return replace(self, until=time.monotonic() + budget)

    @property
    def left(self) -> float:
        """Time that is left, s; negative once it is over."""
        return self.until - time.monotonic()

    @property
    def is_time_over(self) -> bool:
        """True if the budget is spent."""
        return self.left < 0.0

    def fly(self, batch: CandidateBatch, tasks: Sequence[Flight]) -> Iterator[FlightResult]:
        """Yield each flight as soon as it is over and stored."""
        return self.store.fly(self.executor, batch, tasks)

    def report(self, stage: str, *progress: Any) -> None:
        """Pass the progress to `watch`, if there is one; the arguments are those of a RunProgress."""
        if self.watch:
            self.watch(RunProgress(stage, *progress))


COUNT_BATCH: CandidateBatch = CandidateBatch("count", 0, 0)
CHUNK = 2.0  # s of flights that are handed out together
FIRST = 16  # flights before the first guess of how many there will be time for
MARGIN = 1.5  # a limit is given up early only if it needs so many times the flights that there is time for


@dataclass
class LimitVerdict:
    """Verdict of counting on one limit.

    probability : the limit per flight; None: it is only to be bounded
    looks    : in their order; all their bounds hold together
    needs    : flights without an event that would show it, where there is no time for so many; else
               0
    could    : the limit that there was time to show instead
    """

    limit: EventLimit
    probability: float | None
    looks: list[InterimLook] = field(default_factory=list)
    flights_to_show: int = 0
    provable_probability: float = 1.0

    @property
    def low(self) -> float:
        """Lower bound of the probability per flight."""
        return max((found.low for found in self.looks), default=0.0)

    @property
    def high(self) -> float:
        """Upper bound of the probability per flight."""
        return min((found.high for found in self.looks), default=1.0)

    @property
    def shown(self) -> bool:
        """True if the limit is shown; without a rate, if the event has been bounded."""
        return self.high < 1.0 if self.probability is None else self.high <= self.probability

    @property
    def is_refuted(self) -> bool:
        """True if the opposite is shown: the event happens more often than the limit allows."""
        return self.probability is not None and not self.shown and self.low > self.probability

    @property
    def flights(self) -> int:
        """Flights at the last look."""
        return self.looks[-1].flights if self.looks else 0

    @property
    def events(self) -> int:
        """Events among them."""
        return self.looks[-1].events if self.looks else 0


@dataclass
class CountResult:
    """Flights that were counted.

    rows  : scores of flight 0, 1, 2, ...; seconds : of this process; rate : flights per second, 0
            where unknown
    """

    verdicts: list[LimitVerdict]
    rows: list[Mapping[str, Any]]
    seconds: float = 0.0
    rate: float = 0.0


def count_events(flyer: CampaignFlyer) -> CountResult:
    """Count events over the seeds of a campaign, in their order, until its time is over.

    Raises StudyError for a flight that fails: a certificate leaves none out.
    """
    counting = _Counting(flyer)
    while counting.goes_on():
        counting.fly()
    counting.result.seconds = time.monotonic() - counting.began
    return counting.result


class _Counting:
    """Counting under way.

    scores : of flights by number, in whatever order they landed; only a prefix without holes counts
    """

    def __init__(self, flyer: CampaignFlyer):
        self.flyer = flyer
        self.campaign = campaign = flyer.campaign
        self.began, self.fresh, self.chunk = time.monotonic(), 0, FIRST
        self.scores: dict[int, Mapping[str, Any]] = {}
        for (_, number), values in flyer.store.flown(COUNT_BATCH).items():
            if values is None:
                raise StudyError(f"{flyer.store.path}: {_failure(campaign, number, _reason(flyer.store, number))}")
            self.scores[number] = values
        self.events = [0] * len(campaign.limits)
        self.result = CountResult([LimitVerdict(limit, campaign.probability(limit)) for limit in campaign.limits], [])
        self.aims: list[int] = []

    def goes_on(self) -> bool:
        """Count the landed flights; return True if more can decide anything and there is time for them."""
        # Only a prefix of the seeds counts, so that slow flights are not under-represented in what
        # has landed.
        rows, verdicts = self.result.rows, self.result.verdicts
        while len(rows) in self.scores:
            rows.append(self.scores[len(rows)])
            for i, verdict in enumerate(verdicts):
                self.events[i] += verdict.limit.has_happened(rows[-1])
                coming = _next(self.campaign, verdict)
                if coming is not None and coming[0] == len(rows):
                    verdict.looks.append(take_look(len(rows), self.events[i], *coming[1:]))
        still = [verdict for verdict in verdicts if _open(self.campaign, verdict)]
        self.aims = [coming[0] for verdict in still if (coming := _next(self.campaign, verdict))]
        self._note()
        left = self.flyer.left
        if not still or left <= 0.0:
            return False
        if self.fresh < FIRST or math.isinf(left):
            self.chunk = max(FIRST, math.ceil(CHUNK * self.result.rate))
            return True
        # Flights that the remaining time allows. A limit that needs many more is given up, so that
        # others get the time.
        able = len(rows) + left * self.result.rate
        for verdict in still:
            first = self._first(verdict)  # a limit with an event may yet be refuted
            hopeless = first > MARGIN * able and not self.events[verdicts.index(verdict)]
            verdict.flights_to_show, verdict.provable_probability = (
                (first, provable_probability(able, self.campaign.alpha)) if hopeless else (0, 1.0)
            )
        self.chunk = max(FIRST, math.ceil(min(CHUNK, left) * self.result.rate))
        return not all(verdict.flights_to_show for verdict in still)

    def _first(self, verdict: LimitVerdict) -> int:
        """Return the flights without an event that would show a limit; 0 if there is an upper bound already."""
        return 0 if verdict.high < 1.0 else flights_to_show(self.campaign, verdict.limit)

    def fly(self) -> None:
        """Fly the next few flights that the store does not hold."""
        done = len(self.result.rows)
        flights = []
        # In short chunks: looks may end counting, and time may run out.
        for number in range(done, min(max(self.aims), done + self.chunk)):
            if number not in self.scores:
                own = certificate_seed(self.campaign.hash, COUNT_PURPOSE, number)
                flights.append(Flight(0, number, self.campaign.parameters(own), own))
        for landed in self.flyer.fly(COUNT_BATCH, flights):
            if landed.values is None:
                raise StudyError(_failure(self.campaign, landed.flight.repeat, landed.reason))
            self.scores[landed.flight.repeat], self.fresh = landed.values, self.fresh + 1
            self.result.rate = self.fresh / max(time.monotonic() - self.began, 1e-9)
            self._note()

    def _note(self) -> None:
        events = ", ".join(str(count) for count in self.events)
        text = f"{events} events, {self.result.rate:.1f} flights/s"
        total = max([*self.aims, len(self.scores)])
        self.flyer.report("counting", text, len(self.scores), total, self.fresh)


def _open(campaign: Campaign, verdict: LimitVerdict) -> bool:
    """Return True if further flights could decide."""
    if campaign.flights:
        return not verdict.looks
    return not verdict.shown and not verdict.is_refuted


def looks_due(campaign: Campaign, limit: EventLimit) -> Iterator[tuple[int, float, float]]:
    """All looks at a limit: flights, and the error probabilities spent on the upper and on the lower bound."""
    probability = campaign.probability(limit)
    if campaign.flights:
        yield campaign.flights, campaign.alpha, campaign.alpha
    elif probability is not None:  # `planned` gives every campaign without a rate a number of flights
        yield from look_schedule(probability, campaign.alpha)


def _next(campaign: Campaign, verdict: LimitVerdict) -> tuple[int, float, float] | None:
    """The next look."""
    return next(islice(looks_due(campaign, verdict.limit), len(verdict.looks), None), None)


def flights_to_show(campaign: Campaign, limit: EventLimit) -> int:
    """Flights without an event that would show a limit; 0 for one that is only to be bounded."""
    probability = campaign.probability(limit)
    return 0 if probability is None else flights_needed(probability, campaign.alpha * alpha_share(1))


def provable_probability(flights: float, alpha: float) -> float:
    """Smallest limit per flight that so many flights without an event show at the first look."""
    return -math.expm1(math.log(alpha * alpha_share(1)) / max(flights, 1.0))


def _reason(store: FlightStore, number: int) -> str:
    reasons = store.rows("SELECT reason FROM flight WHERE stage=? AND repeat=?", (COUNT_BATCH.stage, number))
    return str(reasons[0][0]) if reasons else ""


def _failure(campaign: Campaign, number: int, reason: str) -> str:
    seed = certificate_seed(campaign.hash, COUNT_PURPOSE, number)
    return f"{campaign.scenario.name}: flight {number}, seed {seed}, failed: {reason}"
