"""Verdicts on the robust controller: collisions on held-out flights, power beside the winner's, the front."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import fisher_exact

from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.dimock_2003.flights import Flight
from airflock_papers.dimock_2003.robust import Comparison, rates
from airflock_papers.dimock_2003.units import FT_LBF, both


def measured(found: Comparison) -> list[Measured]:
    """Collisions, power and rest of the robust controller on held-out flights, beside the others'."""
    flights = found.flights
    winners = [flight for name in found.winners for flight in flights[name]]
    shares = {name: float(np.mean([flight.values["stable"] for flight in every])) for name, every in flights.items()}
    at = "held-out starts, 60 s"
    return [
        *(
            Measured(
                f"robust.{name}",
                "collided",
                f"{at}, robust",
                _share(flights["robust"]),
                f"{_rate(theirs)} of theirs",
                less(flights["robust"], theirs),
                (rates(theirs)[0], None),
            )
            for name, theirs in (("published", flights["published"]), ("winner", winners))
        ),
        _power(found),
        Measured(
            "robust.stable",
            "share settled",
            at,
            statistics.one(shares["robust"], len(flights["robust"])),
            ", ".join(f"{name} {share:.0%}" for name, share in shares.items()),
        ),
        _front(found),
    ]


def brittle(flights: Sequence[Flight]) -> list[Measured]:
    """Collisions of the published gains on held-out starts."""
    return [Measured("robust.brittle", "collided", "held-out starts, 60 s, published gains", _share(flights))]


def less(ours: Sequence[Flight], theirs: Sequence[Flight]) -> float:
    """Probability of so few collisions of ours, if both collided alike (Fisher's exact test, one-sided)."""
    a, b = (sum(flight.collided for flight in flights) for flights in (ours, theirs))
    return float(fisher_exact([[a, len(ours) - a], [b, len(theirs) - b]], alternative="less").pvalue)


def _share(flights: Sequence[Flight]) -> statistics.Estimate:
    rate, low, high = rates(flights)
    return statistics.Estimate(rate, None, low, high, len(flights))


def _rate(flights: Sequence[Flight]) -> str:
    rate, low, high = rates(flights)
    return f"{rate:.1%} ({low:.1%} to {high:.1%})"


def _power(found: Comparison) -> Measured:
    robust, lines, ratios = found.flights["robust"], [], []
    for name in found.winners:
        pairs = [
            (a.power, b.power)
            for a, b in zip(robust, found.flights[name], strict=True)
            if not (a.collided or b.collided)
        ]
        ours, theirs = (float(np.mean([pair[c] for pair in pairs])) if pairs else float("nan") for c in (0, 1))
        ratios.append(ours / theirs)
        lines.append(f"{both(ours)} against {both(theirs)} on {len(pairs)} flights")
    worst = statistics.Estimate(max(ratios), None, min(ratios), max(ratios), len(robust))
    note = f"{'; '.join(lines)}; gains: {found.gains.text()}"
    return Measured("robust.power", "power", "robust over each winner, flights that both survive", worst, note)


def _front(found: Comparison) -> Measured:
    points = ", ".join(f"{c.crowding:.3g} at {c.power / FT_LBF:.3g} ({c.rate:.0%} collide)" for c in found.front)
    points += "; one candidate was cheapest and safest at once, there is no trade-off" if len(found.front) == 1 else ""
    size = statistics.one(len(found.front), len(found.tried))
    return Measured(
        "robust.front", "candidates", "on the front of power and crowding", size, f"crowding at power: {points}"
    )
