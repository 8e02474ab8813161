"""Formations that stand still: what the model's numbers can mean, and the benchmarks that the paper lacks.

Dense solutions of any number of segments, by the rules of `parts.aero.filaments`; powers in W per bird.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.parts.aero import influences, wing as wings
from airflock.scenarios import load
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.dimock_2003.units import FOOT, FT_LBF, HORSEPOWER, both
from airflock_papers.flights import Flights

Places = NDArray[np.float64]
ROUNDS = 40  # in which each bird may move by one cell


@dataclass(frozen=True)
class Air:
    """Plain filaments of the paper's wing: m segments, h their pitch (m), and the wing they belong to."""

    wing: wings.Parameters
    m: int = 10

    @property
    def h(self) -> float:
        """Pitch, m: the paper's grid."""
        return self.wing.span / self.m

    def block(self, offset: tuple[float, ...]) -> NDArray[np.float64]:
        """Influence of a wing on one that lies at `offset` from it (control point, segment)."""
        row = [[0.0] * (self.m + wings.lanes(self.m))]
        dx, dy, dz = offset
        influences(row, 0, dx, dy, dz, self.m, self.h, 0.0)
        k, e = np.indices((self.m, self.m))
        return np.asarray(np.array(row[0])[k - e + wings.shift(self.m)])

    def influence(self, places: Places) -> NDArray[np.float64]:
        """Influence of all on all (n m, n m); offsets are rounded so that equal ones are computed once."""
        known: dict[Any, Any] = {}
        for a in places:
            for b in places:
                d = tuple(np.round(a - b, 9))
                if d not in known:
                    known[d] = self.block(d)
        return np.block([[known[tuple(np.round(a - b, 9))] for b in places] for a in places])

    def powers(self, places: Places) -> NDArray[np.float64]:
        """Induced power of each bird, W, with lift equal to weight on each."""
        n, w = len(places), self.wing
        a = self.influence(places)
        ones = np.kron(np.eye(n), np.ones((1, self.m)))
        size = n * self.m
        system = np.block([[np.eye(size) / wings.stiffness(w) + a / w.speed, -ones.T], [ones, np.zeros((n, n))]])
        total = w.weight / (w.density * w.speed * self.h)
        load_ = np.linalg.solve(system, np.concatenate([np.zeros(size), np.full(n, total)]))[:size]
        return np.asarray(w.speed * w.density * self.h * (load_ * (a @ load_)).reshape(n, self.m).sum(1))

    def munk(self, places: Places) -> float:
        """Least mean power at these places, W, if each bird's lift distribution could be chosen (Munk)."""
        n, w = len(places), self.wing
        a = self.influence(places)
        form = 0.5 * (a + a.T)
        ones = np.kron(np.eye(n), np.ones((1, self.m)))
        size = n * self.m
        total = w.weight / (w.density * w.speed * self.h)
        system = np.block([[2.0 * form, -ones.T], [ones, np.zeros((n, n))]])
        load_ = np.linalg.solve(system, np.concatenate([np.zeros(size), np.full(n, total)]))[:size]
        return float(w.speed * w.density * self.h * load_ @ form @ load_ / n)


def vee(n: int, sx: float, sy: float) -> Places:
    """A V of n birds; spacings in m."""
    rank = np.array([(i + 1) // 2 for i in range(n)], float)
    side = np.array([0.0, *(1.0 if i % 2 else -1.0 for i in range(1, n))])
    return np.column_stack([-rank * sx, side * rank * sy, np.zeros(n)])


def column(n: int, sx: float, sy: float) -> Places:
    """A line of n birds, one behind the other; spacings in m."""
    rank = np.arange(n, dtype=float)
    return np.column_stack([-rank * sx, rank * sy, np.zeros(n)])


def descent(air: Air, places: Places, selfish: bool, rounds: int = ROUNDS) -> tuple[Places, float]:
    """Birds in turn move by one cell while that saves them 0.01 W (selfish) or everybody on average."""
    x = np.round(places / air.h) * air.h
    steps = [np.array(step) * air.h for step in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0))]

    def cost(at: Places, i: int) -> float:
        found = air.powers(at)
        return float(found[i] if selfish else found.mean())

    for _ in range(rounds):
        moved = False
        for i in range(len(x)):
            now = cost(x, i)
            for step in steps:
                trial = x.copy()
                trial[i] += step
                apart = np.linalg.norm(trial - trial[i], axis=1)
                apart[i] = np.inf
                if apart.min() < 2.0 * air.h:  # beyond the paper's collision distance
                    continue
                there = cost(trial, i)
                if there < now - 0.01:
                    x, now, moved = trial, there, True
        if not moved:
            break
    return x, float(air.powers(x).mean())


def measure(flights: Flights) -> dict[str, float]:
    """All static numbers, W per bird; birds that save for themselves start as the scenario does, and need K_d."""
    scenario = flights.as_changed(load("dimock_2003/published"))
    wing, aside = scenario.wing, scenario.start.spacing_y
    formation = column if scenario.start.kind == "echelon" else vee
    rounds = ROUNDS if scenario.parameters.k_d > 0.0 else 0
    air = Air(wing)
    five = {m: Air(wing, m) for m in (1, 5, 9, 10)}
    alone = np.zeros((1, 3))
    tips = vee(5, 0.0, wing.span)
    deep = vee(5, 5.0 * FOOT, wing.span)
    found = {f"solo.{m}": float(a.powers(alone)[0]) for m, a in five.items()}
    found |= {f"deep.{m}": float(a.powers(deep).mean()) for m, a in five.items()}
    found |= {"abreast": float(air.powers(tips).mean()), "munk": air.munk(tips)}
    starts = [tips, deep, vee(5, 2.5 * FOOT, wing.span), vee(5, 0.5 * FOOT, 5.5 * FOOT)]
    found["best"] = min(descent(air, start, selfish=False)[1] for start in starts)
    selfish = [descent(air, formation(5, sx * FOOT, aside), True, rounds)[1] for sx in (2.5, 5.0, 7.5)]
    found["selfish"] = float(np.median(selfish))
    # one horseshoe a wing, off the grid: a control point may come as near to a filament as it likes
    row = np.array([(-2.5 * FOOT * i, 0.52 * wing.span * i, 0.0) for i in range(5)])
    for m in (1, 10):
        snapped = np.round(row / five[m].h) * five[m].h if m > 1 else row
        found[f"row.{m}"] = float(five[m].powers(snapped).mean())
    return found


def measured(found: dict[str, float]) -> list[Measured]:
    """Bounds of formations that stand still, in ft lbf/s per bird, and the horseshoe."""
    at = {
        "solo": ("a bird alone", "solo.10"),
        "deep": ("deep V tip to tip", "deep.10"),
        "munk": ("Munk's bound tip to tip", "munk"),
        "best": ("best formation found on the grid", "best"),
    }
    printed, solo = 9.8 * HORSEPOWER, found["solo.10"]
    unit = f"{solo / HORSEPOWER:.3f} HP: 9.8 HP ({printed:.0f} W) a bird, or for the flock, is impossible"
    return [
        *(
            Measured(
                f"static.{name}", "power", words, statistics.one(found[key] / FT_LBF), unit if name == "solo" else ""
            )
            for name, (words, key) in at.items()
        ),
        Measured(
            "static.selfish",
            "share saved",
            "birds in turn save for themselves, against a bird alone",
            statistics.one(1.0 - found["selfish"] / solo, 3),
            f"{both(found['selfish'])}, median of three starts",
        ),
        Measured("static.anarchy", "power", "selfish over best", statistics.one(found["selfish"] / found["best"])),
        Measured(
            "static.horseshoe",
            "power",
            "five birds in a row, one horseshoe over ten segments",
            statistics.one(found["row.1"] / found["row.10"]),
            f"{both(found['row.1'])} against {both(found['row.10'])}",
        ),
    ]
