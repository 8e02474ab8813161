"""Sensing: one agent's sensor, measurement after measurement, in plain Python with the random numbers of a flight."""

from collections.abc import Callable
from typing import Any

from airflock.core import random
from airflock.core.agent import State, answer
from airflock.core.sensor import FIRST, Sensor

Words = Callable[[int, int], tuple[int, int, int, int]]


class Sensing:
    """What one agent's sensor makes of true states.

    sensor, s   : kind of sensor and its numbers
    seed, agent : by which its random numbers are drawn, those of the same agent in a flight of this seed
    flat        : whether the agent flies in a plane, where nothing is wrong along the third axis
    words       : four random words by the numbers of a measurement and a draw, where somebody has them already
    """

    def __init__(self, sensor: Sensor, s: Any, seed: int, agent: int, *, flat: bool, words: Words | None = None):
        self.sensor, self.s, self.seed, self.agent, self.flat = sensor, s, seed, agent, flat
        self._words: Words = words or (lambda number, draw: random.words(seed, random.SENSOR, 0, number, agent, draw))
        self.off = State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._memory = sensor.Memory() if sensor.Memory is not None else None

    def measure(self, number: int, true: State, period: float) -> State:
        """Measurement `number`: what is believed minus the true state, m and m/s, until the next one."""
        if self.sensor.is_exact(self.s):
            return self.off
        found = self._added(number, period) if self.sensor.error is not None else self._measured(number, true, period)
        x, v = found
        self.off = State(x[0], x[1], 0.0 if self.flat else x[2], v[0], v[1], 0.0 if self.flat else v[2])
        return self.off

    def _added(self, number: int, period: float) -> tuple[list[float], list[float]]:
        """Errors that are added along each axis."""
        assert self.sensor.error is not None
        low, high = (self._words(number, draw) for draw in (0, 1))
        normal = (*random.normal_pair(low[0], low[1]), random.normal_pair(high[0], high[1])[0])
        steps = [
            answer(self.sensor.error, "error", {"dx": dx, "dv": dv, "g": g, "period": period, "s": self.s})
            for dx, dv, g in zip(self.off[:3], self.off[3:], normal, strict=True)
        ]
        return [dx for dx, _ in steps], [dv for _, dv in steps]

    def _measured(self, number: int, true: State, period: float) -> tuple[list[float], list[float]]:
        """What `measure` believes, minus the true state."""
        assert self.sensor.measure is not None
        given = true._asdict() | drawn(self.seed, number, self.agent)
        given |= {"memory": self._memory, "time": number * period, "period": period, "s": self.s}
        found = answer(self.sensor.measure, "measure", given, self.sensor.name)
        if self.sensor.Memory is not None:
            self._memory = found[6]
        off = [float(a - b) for a, b in zip(found[:6], true, strict=True)]
        return off[:3], off[3:]


def drawn(seed: int, number: int, agent: int, world: int = 0) -> dict[str, float]:
    """Random numbers that a rule `measure` may ask for at one measurement of one agent, by name."""
    found: dict[str, float] = {}
    for block in range(3):
        words = random.words(seed, random.SENSOR, world, number, agent, FIRST + block)
        pairs = (*random.normal_pair(words[0], words[1]), *random.normal_pair(words[2], words[3]))
        found |= {f"g{4 * block + c}": value for c, value in enumerate(pairs)}
    words = random.words(seed, random.SENSOR, world, number, agent, FIRST + 3)
    return found | {f"u{c}": random.uniform(word) for c, word in enumerate(words)}
