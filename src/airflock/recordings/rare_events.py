"""Bounds of the probability of rare events from a number of flights, and the worst flight."""

from collections.abc import Mapping, Sequence
from typing import Any

CONFIDENCE = 0.95


def upper_probability_bound(events: int, flights: int, confidence: float = CONFIDENCE) -> float:
    """Return the largest probability per flight that so few events allow (Clopper and Pearson 1934, one-sided).

    events : flights in which it happened, out of `flights`. Returns 0 to 1; for no event 1 - (1 -
             confidence)^(1/n).
    """
    from scipy.special import betaincinv  # not on top, nor scipy.stats: the first table of a flight waits for imports

    return 1.0 if events >= flights else float(betaincinv(events + 1, flights - events, confidence))


def rare_event_notes(scores: Sequence[Mapping[str, Any]], seeds: Sequence[int]) -> list[str]:
    """Return notes on several flights: the upper bound of the share with collisions, and the worst seed."""
    if len(scores) < 2:
        return []
    said = []
    # No collision in ten flights is weak evidence: the bound says how weak.
    if all("n_coll" in row for row in scores):
        hit = sum(row["n_coll"] > 0.0 for row in scores)
        bound = upper_probability_bound(hit, len(scores))
        said.append(
            f"collisions in {hit} of {len(scores)} flights: with {100.0 * CONFIDENCE:g} % confidence, at most "
            f"{100.0 * bound:.2g} % of such flights have a collision"
        )
    if all("fitness" in row for row in scores):
        worst, row = min(zip(seeds, scores, strict=True), key=lambda pair: pair[1]["fitness"])
        said.append(
            f"worst flight: seed {worst}, fitness {row['fitness']:.4g}; draw it with airflock plot ... --seed {worst}"
        )
    return said
