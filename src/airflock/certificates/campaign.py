"""Campaign: what is to be shown about a scenario and how; everything that decides the result, but not the time."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from airflock import __version__
from airflock.certificates import seeds
from airflock.certificates.flights import measured
from airflock.certificates.limit import Limit
from airflock.runs.folder import fingerprint
from airflock.scenarios.scenario import Scenario

LAYOUT = 1  # of the folder; raised whenever an older folder could not be continued
FOLDER = "campaign"  # campaign.toml in the folder of flights


@dataclass(frozen=True)
class Campaign:
    """Flights that are to show limits.

    confidence : of all limits together
    flights    : a number that is fixed beforehand: one look at its end; None: looks as `certificates.bounds.schedule`
                 says
    uncertain  : whether each flight draws the numbers of its world from the intervals that the scenario file holds
    """

    scenario: Scenario
    limits: tuple[Limit, ...]
    confidence: float = 0.95
    precision: int = 32
    flights: int | None = None
    uncertain: bool = False
    device: str = "cpu"

    @cached_property
    def hash(self) -> str:
        """Identity of the scenario, which fixes the seeds."""
        return seeds.identity(self.scenario)

    @cached_property
    def flown(self) -> Scenario:
        """The scenario as it is measured."""
        return measured(self.scenario, self.limits)

    @property
    def alpha(self) -> float:
        """What may go wrong for one limit: the limits share it."""
        return (1.0 - self.confidence) / len(self.limits)

    @property
    def hours(self) -> float:
        """Duration of a flight, h."""
        return self.scenario.flight.duration / 3600.0

    def probability(self, limit: Limit) -> float | None:
        """A limit as a probability per flight."""
        return limit.probability(self.hours, self.scenario.agents)

    def in_own_unit(self, limit: Limit, probability: float) -> float:
        """A probability per flight in the unit of a limit."""
        return limit.in_own_unit(probability, self.hours, self.scenario.agents)

    @cached_property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """Key → interval of every number that the scenario's file is not sure of."""
        return intervals(self.scenario.document) if self.uncertain else {}

    def parameters(self, seed: int) -> dict[str, float]:
        """Numbers of the world of one flight, uniform in their intervals; the seed alone decides them."""
        if not self.intervals:
            return {}
        drawn = np.random.default_rng(seed).random(len(self.intervals)).tolist()  # plain numbers, for what is printed
        return {
            key: low + (high - low) * x for (key, (low, high)), x in zip(self.intervals.items(), drawn, strict=True)
        }

    def document(self) -> dict[str, Any]:
        """The campaign as plain values: what campaign.toml holds, and what a resumed campaign is compared with."""
        return {
            "layout": LAYOUT,
            "airflock": __version__,
            "rules": fingerprint(self.flown, self.precision),
            "device": self.device,
            "precision": self.precision,
            "name": self.scenario.name,
            "identity": self.hash,
            "confidence": self.confidence,
            "limits": [limit.text for limit in self.limits],
            "flights": self.flights,
            "uncertain": self.uncertain,
            "scenario": {key: value for key, value in self.scenario.document.items() if key != "published"},
        }


def intervals(document: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Key → interval of the numbers of a scenario's document that have one, as `airflock identify` writes them."""
    found = {}
    for section, table in document.items():
        entries = table.items() if isinstance(table, Mapping) and "value" not in table else ((None, table),)
        for name, entry in entries:
            if isinstance(entry, Mapping) and isinstance(entry.get("interval"), list):
                low, high = entry["interval"]
                found[f"{section}.{name}" if name else section] = (float(low), float(high))
    return found
