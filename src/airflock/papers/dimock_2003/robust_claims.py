"""Verdicts on the robust controller: collisions on held-out flights, power beside the winner's, the front."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import fisher_exact

from airflock.papers.claims import Claim, judged
from airflock.papers.dimock_2003.flights import Flight
from airflock.papers.dimock_2003.robust import Comparison, rates
from airflock.papers.dimock_2003.units import FT_LBF, both

SURE = 0.05  # largest p of a one-sided exact test


def claims(found: Comparison) -> list[Claim]:
    """Is the robust controller safer than both, at nearly the same power?"""
    winners = [flight for name in found.winners for flight in found.flights[name]]
    each = "; ".join(
        f"{name}: {_rate(found.flights[name])}, p = {less(found.flights['robust'], found.flights[name]):.2g}"
        for name in found.winners
    )
    return [
        _safer("published", "the published controller", found, found.flights["published"], ""),
        _safer("winner", "winners of the GA on the paper's fitness, all seeds", found, winners, f"; {each}"),
        _power(found),
        _stable(found),
        _front(found),
    ]


def less(ours: Sequence[Flight], theirs: Sequence[Flight]) -> float:
    """Probability of so few collisions of ours, if both collided alike (Fisher's exact test, one-sided)."""
    a, b = (sum(flight.collided for flight in flights) for flights in (ours, theirs))
    return float(fisher_exact([[a, len(ours) - a], [b, len(theirs) - b]], alternative="less").pvalue)


def _rate(flights: Sequence[Flight]) -> str:
    rate, low, high = rates(flights)
    return f"{rate:.1%} ({low:.1%} to {high:.1%})"


def _safer(name: str, words: str, found: Comparison, theirs: Sequence[Flight], more: str) -> Claim:
    robust = found.flights["robust"]
    rate, low, high = rates(robust)
    p = less(robust, theirs)
    return Claim(
        id=f"robust.{name}", statement=f"fewer collisions than {words}, held-out starts, 60 s, noise in flight",
        source="our target", test=f"one-sided exact test, p < {SURE}", published=rates(theirs)[0], ours=rate, low=low,
        high=high, runs=len(robust),
        **judged(p < SURE, f"{_rate(robust)} against {_rate(theirs)} of {len(theirs)} flights, p = {p:.2g}{more}"),
    )  # fmt: skip


def _power(found: Comparison) -> Claim:
    robust, lines, ratios = found.flights["robust"], [], []
    for name in found.winners:
        pairs = [(a.power, b.power) for a, b in zip(robust, found.flights[name], strict=True)
                 if not (a.collided or b.collided)]  # fmt: skip
        ours, theirs = (float(np.mean([pair[c] for pair in pairs])) if pairs else float("nan") for c in (0, 1))
        ratios.append(ours / theirs)
        lines.append(f"{both(ours)} against {both(theirs)} on {len(pairs)} flights")
    return Claim(
        id="robust.power", statement="power on flights that both survive, over that of each winner",
        source="our target", test="at most 1.05 for every winner", ours=max(ratios), low=min(ratios),
        high=max(ratios), runs=len(robust),
        **judged(all(ratio <= 1.05 for ratio in ratios), f"{'; '.join(lines)}; gains: {found.gains.text()}"),
    )  # fmt: skip


def _stable(found: Comparison) -> Claim:
    shares = {
        name: float(np.mean([flight.values["stable"] for flight in flights])) for name, flights in found.flights.items()
    }
    return Claim(
        id="robust.stable", statement="a formation that has settled after half of the time",
        source="the paper's future work", test="no published value; share of held-out flights", verdict="finding",
        ours=shares["robust"], runs=len(found.flights["robust"]),
        reason=", ".join(f"{name} {share:.0%}" for name, share in shares.items()),
    )  # fmt: skip


def _front(found: Comparison) -> Claim:
    points = ", ".join(f"{c.crowding:.3g} at {c.power / FT_LBF:.3g} ({c.rate:.0%} collide)" for c in found.front)
    points += "; one candidate was cheapest and safest at once, there is no trade-off" if len(found.front) == 1 else ""
    return Claim(
        id="robust.front", statement="Pareto front of power and crowding", source="computed here",
        test="no published value; candidates that nobody beat in training, flown again on held-out starts",
        verdict="finding", runs=len(found.tried), reason=f"crowding at power in ft lbf/s: {points}",
    )  # fmt: skip
