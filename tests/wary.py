"""A law for tests that asks for groups, remembers, draws and chooses."""

from dataclasses import dataclass
from typing import NamedTuple

import airflock

COMMAND = "velocity"


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    style: str = airflock.choice("flee", ("flee", "chase"), meaning="what strangers are to it")
    k: float = airflock.quantity(1.0, "m/s", low=0.0, high=50.0, meaning="speed")


class Sums(NamedTuple):
    x: float
    y: float
    third: float


class Memory(NamedTuple):
    met: float = 7.0


def neighbour(dx, dy, r, kin, group, p):
    k = (1.0 - kin) / r * (-1.0 if p.style == "flee" else 1.0)
    return Sums(k * dx, k * dy, 1.0 if group == 2.0 else 0.0)


def decide(own, sums, memory, percept, p):
    k = p.k * (1.0 + 0.1 * percept.normal(0))
    x = 0.5 * own.vx + k * sums.x + 0.01 * memory.met
    return x, 0.5 * own.vy + k * sums.y, 0.0, Memory(memory.met + sums.third)
