"""Flyer: flies flights of a campaign into its store, for as long as there is time."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from airflock.certificates.campaign import Campaign
from airflock.runs import CandidateBatch, Executor, Flight, FlightResult, FlightStore


@dataclass(frozen=True)
class CampaignFlyer:
    """A campaign with its store of flights, who flies them and until when.

    until : moment of `time.monotonic` at which the budget of time is spent, s
    note  : told in a few words what begins
    """

    campaign: Campaign
    store: FlightStore
    executor: Executor
    until: float = math.inf
    note: Callable[[str], None] | None = None

    def with_budget(self, budget: float) -> "CampaignFlyer":
        """The same, with so much time from now on, s."""
        return replace(self, until=time.monotonic() + budget)

    @property
    def left(self) -> float:
        """Time that is left, s; negative once it is over."""
        return self.until - time.monotonic()

    @property
    def is_time_over(self) -> bool:
        """Whether the budget is spent."""
        return self.left < 0.0

    def fly(self, batch: CandidateBatch, tasks: Sequence[Flight]) -> Iterator[FlightResult]:
        """Yield each flight as soon as it is over and stored."""
        for landed in self.executor.fly(tasks):
            self.store.land(batch, landed)
            yield landed

    def report(self, text: str) -> None:
        """Report what begins, if anybody asked for that."""
        if self.note:
            self.note(text)
