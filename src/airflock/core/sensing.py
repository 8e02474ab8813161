"""Sensing: one agent's sensor, measurement after measurement, in plain Python with the random numbers of a flight."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from airflock.core import random
from airflock.core.agent import State
from airflock.core.sensor import FIRST_DRAW, Sensor
from airflock.core.vocabulary import call_rule

Words = Callable[[int, int], tuple[int, int, int, int]]


class SensorState:
    """What one agent's sensor makes of true states.

    sensor, s   : kind of sensor and its numbers
    seed, agent : by which its random numbers are drawn, those of the same agent in a flight of this seed
    flat        : whether the agent flies in a plane, where nothing is wrong along the third axis
    words       : four random words by the numbers of a measurement and a draw, where somebody has them already
    """

    def __init__(self, sensor: Sensor, s: Any, seed: int, agent: int, *, flat: bool, words: Words | None = None):
        self.sensor, self.s, self.seed, self.agent, self.flat = sensor, s, seed, agent, flat
        self._words: Words = words or (
            lambda number, draw: random.random_words(seed, random.SENSOR, 0, number, agent, draw)
        )
        self.off = State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._memory = sensor.Memory() if sensor.Memory is not None else None

    def measure(self, number: int, true: State, period: float) -> State:
        """Measurement `number`: what is believed minus the true state, m and m/s, until the next one."""
        if self.sensor.is_exact(self.s):
            return self.off
        x, v = self._errors(number, true, period)
        self.off = State(x[0], x[1], 0.0 if self.flat else x[2], v[0], v[1], 0.0 if self.flat else v[2])
        return self.off

    def _errors(self, number: int, true: State, period: float) -> tuple[Sequence[float], Sequence[float]]:
        """Errors of position (m) and velocity (m/s), all three axes."""
        if self.sensor.error is not None:
            low, high = (self._words(number, draw) for draw in (0, 1))
            normal = (*random.normal_pair(low[0], low[1]), random.normal_pair(high[0], high[1])[0])
            off = add_errors(self.sensor, self.s, self.off, normal, period)
            return off[:3], off[3:]
        draws = draw_numbers(self.seed, number, self.agent)
        time = number * period
        found, self._memory = call_measure(self.sensor, self.s, true, self._memory, time, period, draws)
        apart = [float(a - b) for a, b in zip(found, true, strict=True)]
        return apart[:3], apart[3:]


def add_errors(sensor: Sensor, s: Any, errors: State, normal: Sequence[float], period: float) -> State:
    """Errors (m, m/s) that a sensor adds along each axis, after `off` by the normal numbers of three axes."""
    assert sensor.error is not None
    steps = [
        call_rule(sensor.error, "error", {"dx": dx, "dv": dv, "g": g, "period": period, "s": s})
        for dx, dv, g in zip(errors[:3], errors[3:], normal, strict=True)
    ]
    return State(*(dx for dx, _ in steps), *(dv for _, dv in steps))


def call_measure(
    sensor: Sensor, s: Any, true: Sequence[float], memory: Any, time: float, period: float, draws: Mapping[str, float]
) -> tuple[State, Any]:
    """What the rule `measure` of a sensor believes of a true state (m, m/s), and what it then remembers."""
    assert sensor.measure is not None
    given = {**State(*true)._asdict(), **draws, "memory": memory, "time": time, "period": period, "s": s}
    found = call_rule(sensor.measure, "measure", given, sensor.name)
    return State(*found[:6]), found[6] if sensor.Memory is not None else None


def draw_numbers(seed: int, number: int, agent: int, world: int = 0) -> dict[str, float]:
    """Random numbers that a rule `measure` may ask for at one measurement of one agent, by name."""
    found: dict[str, float] = {}
    for block in range(3):
        words = random.random_words(seed, random.SENSOR, world, number, agent, FIRST_DRAW + block)
        pairs = (*random.normal_pair(words[0], words[1]), *random.normal_pair(words[2], words[3]))
        found |= {f"g{4 * block + c}": value for c, value in enumerate(pairs)}
    words = random.random_words(seed, random.SENSOR, world, number, agent, FIRST_DRAW + 3)
    return found | {f"u{c}": random.uniform(word) for c, word in enumerate(words)}
