"""Campaign: what is to be shown about a scenario and how; everything that decides the result, but not the time."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from airflock import __version__
from airflock.certificates import seeds
from airflock.certificates.flights import with_distance_metrics
from airflock.certificates.limit import EventLimit
from airflock.runs import fingerprint
from airflock.scenarios import Scenario

LAYOUT = 1  # of the folder; raised whenever an older folder could not be continued
CAMPAIGN_KIND = "campaign"  # campaign.toml in the folder of flights


@dataclass(frozen=True)
class Campaign:
    """Flights that are to show limits.

    confidence : of all limits together
    flights    : a number that is fixed beforehand: one look at its end; None: looks as `certificates.bounds.schedule`
                 says
    uncertain  : whether each flight draws the numbers of its world from the intervals that the scenario file holds
    """

    scenario: Scenario
    limits: tuple[EventLimit, ...]
    confidence: float = 0.95
    bits: int = 32
    flights: int | None = None
    flies_intervals: bool = False
    device: str = "cpu"

    @cached_property
    def hash(self) -> str:
        """Identity of the scenario, which fixes the seeds."""
        return seeds.scenario_identity(self.scenario)

    @cached_property
    def flown(self) -> Scenario:
        """The scenario as it is measured."""
        return with_distance_metrics(self.scenario, self.limits)

    @property
    def alpha(self) -> float:
        """What may go wrong for one limit: the limits share it."""
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
        """The campaign as plain values: what campaign.toml holds, and what a resumed campaign is compared with."""
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
            "scenario": {key: value for key, value in self.scenario.document.items() if key != "published"},
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
