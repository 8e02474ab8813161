"""Limits of a search: candidates that keep them come before all that do not, whatever their fitness (Deb 2000).

Of two candidates that keep all limits the fitter is better; of two that do not, the one that breaks
them less. By how much is counted in standard deviations that are missing to the reliability index
of the limit, so that limits of any score add up.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.certificates import EventLimit, ScoreRow, estimated_probability, reliability_index, reliability_indices
from airflock.runs import CandidateBatch, FlightStore
from airflock.scenarios import Scenario
from airflock.search.study import Study

TIE = 1e-6  # weight by which fitness orders candidates that break limits equally
FARTHEST = 1e6  # standard deviations; equal flights have no standard deviation


def allowed_probability(limit: EventLimit, scenario: Scenario, duration_share: float = 1.0) -> float:
    """Return the probability per flight that a limit with a rate allows, for a share of the duration."""
    found = limit.probability(duration_share * scenario.flight.duration / 3600.0, scenario.agents)
    assert found is not None, "limits without a rate are refused where they are read"
    return found


def limit_excess(
    limits: Sequence[EventLimit],
    scenario: Scenario,
    flights: Sequence[Sequence[ScoreRow]],
    reserve: float,
    duration_share: float = 1.0,
) -> NDArray[np.float64]:
    """Return how far candidates are from keeping all limits (candidate,): standard deviations, added up.

    flights : of each candidate in the scenario; reserve : how many times rarer than allowed an
              event has to look
    """
    found = np.zeros(len(flights))
    for limit in limits:
        short = reliability_index(allowed_probability(limit, scenario, duration_share) / reserve) - reliability_indices(
            limit, flights
        )
        # Without spread the index is infinite: a finite bound keeps sums and ranks of excesses
        # defined.
        found += np.clip(short, 0.0, FARTHEST)
    return found


def batch_excess(
    study: Study, store: FlightStore, batch: CandidateBatch, duration_share: float = 1.0
) -> NDArray[np.float64]:
    """Return the excess (candidate,) of a batch that has flown, added up over the study's scenarios."""
    flown: dict[int, dict[int, ScoreRow]] = {}
    for (candidate, repeat), row in store.flown(batch).items():
        flown.setdefault(candidate, {})[repeat] = row
    n, total = len(study.scenarios), np.zeros(len(flown))
    for place, scenario in enumerate(study.scenarios):
        flights = [[flown[i][r] for r in sorted(flown[i]) if r % n == place] for i in sorted(flown)]
        total += limit_excess(study.limits, scenario, flights, study.search.reserve, duration_share)
    return total


def rank_by_excess(losses: NDArray[np.float64], excess: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return losses (candidate, objective) by which candidates that break limits rank after all that keep them."""
    # Ranks, not penalties: CMA-ES is invariant to the scale of fitness, and a weight is a number
    # that nobody can know. The augmented Lagrangian ended between 2e-6 and 1e-2 where 1.7e-3 was
    # allowed.
    worst = losses.max(axis=0)
    broken = worst + excess[:, None] + TIE * (losses - worst) / np.maximum(np.ptp(losses, axis=0), TIE)
    return np.where(excess[:, None] > 0.0, broken, losses)


def limit_reports(study: Study, flights: Sequence[ScoreRow]) -> list[dict[str, Any]]:
    """Report each limit in the flights of one candidate: one entry a limit and scenario, as plain values."""
    n = len(study.scenarios)
    found = []
    for place, (label, scenario) in enumerate(zip(study.labels, study.scenarios, strict=True)):
        rows = flights[place::n]
        for limit in study.limits:
            events = sum(row is None or limit.has_happened(row) for row in rows)
            likely, most = estimated_probability(limit, rows), allowed_probability(limit, scenario)
            found.append(
                {
                    **({"scenario": label} if n > 1 else {}),
                    "limit": limit.text, "events": events, "flights": len(rows), "estimated": likely,
                    "allowed": most, "keeps": likely <= most,
                }
            )  # fmt: skip
    return found


def limit_report_line(entry: Mapping[str, Any]) -> str:
    """Format one entry of `limit_reports` as a sentence."""
    where = f" in {entry['scenario']}" if "scenario" in entry else ""
    verdict = "looks kept" if entry["keeps"] else "looks broken"
    near = ", by how near they came" if entry["estimated"] > entry["events"] / entry["flights"] else ""
    return (
        f"{entry['limit']}{where}: {verdict}: {entry['events']} events in {entry['flights']} fresh flights, about "
        f"{entry['estimated']:.2g} per flight{near}; allowed are {entry['allowed']:.2g}"
    )


def flights_per_event(limits: Sequence[EventLimit], scenario: Scenario) -> int:
    """Return the number of flights in which one event of the rarest limit is expected if it is just kept; 1 of none."""
    return math.ceil(1.0 / min((allowed_probability(limit, scenario) for limit in limits), default=1.0))
