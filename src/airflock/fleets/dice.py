"""Random numbers of a fleet, drawn for many steps at once: those of the simulated agents."""

import numpy as np

from airflock.core import random

STEPS_PER_BLOCK = 256  # motion steps that are drawn together
PERIODS_PER_BLOCK = 16  # periods of the radio that are drawn together
NormalTriple = tuple[float, float, float]


class MotionNoise:
    """Normal random numbers of every drone at every motion step, to be asked in the order of time.

    seed : of the flight; count: of drones; three: in space, where a draw serves one step; in a plane it serves two
    first : of the drones that are asked for, where not all are
    """

    def __init__(self, seed: int, count: int, in_space: bool, first_drone: int = 0):
        self._seed, self._count, self._in_space, self._drone = seed, count, in_space, first_drone
        self._first_step = -STEPS_PER_BLOCK
        self._numbers: tuple[list[float], list[float]] = ([], [])  # first and second half of each draw, flat

    def __call__(self, step: int, drone: int) -> NormalTriple:
        """Three numbers N(0, 1) of a drone at a step; in a plane the third is zero."""
        if not self._first_step <= step < self._first_step + STEPS_PER_BLOCK:
            self._first_step = step - step % STEPS_PER_BLOCK
            self._numbers = self._drawn(self._first_step)
        place, column, (one, two) = step - self._first_step, drone - self._drone, self._numbers
        if self._in_space:
            at = 2 * (place * self._count + column)
            return one[at], one[at + 1], two[at]
        at = 2 * ((place >> 1) * self._count + column)
        numbers = two if place & 1 else one
        return numbers[at], numbers[at + 1], 0.0

    def _drawn(self, first: int) -> tuple[list[float], list[float]]:
        """Numbers of BLOCK steps; the words come as arrays, what is made of them by the function of one pair."""
        steps = np.arange(first, first + STEPS_PER_BLOCK, 1 if self._in_space else 2, dtype=np.uint64)
        if not self._in_space:
            steps //= np.uint64(2)
        drones = np.arange(self._drone, self._drone + self._count, dtype=np.uint64)
        drawn = random.random_words(self._seed, random.OUTER, 0, steps[:, None], drones[None, :])
        a, b, c, d = (np.broadcast_to(words, (len(steps), self._count)).ravel().tolist() for words in drawn)
        one = [number for pair in map(random.normal_pair, a, b) for number in pair]
        two = [number for pair in map(random.normal_pair, c, d) for number in pair]
        return one, two


class SensorWords:
    """Random words of the errors of every drone's navigation, to be asked in the order of time.

    seed : of the flight; count: of drones
    """

    def __init__(self, seed: int, count: int):
        self._seed, self._count = seed, count
        self._first_measurement, self._tables = -PERIODS_PER_BLOCK, {}  # type: ignore[var-annotated]

    def __call__(self, measurement: int, draw: int, drone: int) -> tuple[int, int, int, int]:
        """Four words of a measurement, a draw and a drone."""
        if not self._first_measurement <= measurement < self._first_measurement + PERIODS_PER_BLOCK:
            self._first_measurement, self._tables = measurement - measurement % PERIODS_PER_BLOCK, {}
        if draw not in self._tables:
            numbers = np.arange(self._first_measurement, self._first_measurement + PERIODS_PER_BLOCK, dtype=np.uint64)[
                :, None
            ]
            drones = np.arange(self._count, dtype=np.uint64)[None, :]
            drawn = random.random_words(self._seed, random.SENSOR, 0, numbers, drones, draw)
            self._tables[draw] = np.stack(drawn, axis=-1).tolist()
        a, b, c, d = self._tables[draw][measurement - self._first_measurement][drone]
        return a, b, c, d


class PacketNumbers:
    """Uniform random numbers by which packets are lost, of every pair in every period, to be asked in order of time.

    seed : of the flight; count: of drones
    """

    def __init__(self, seed: int, count: int):
        self._seed, self._count = seed, count
        self._first_period, self._tables = -PERIODS_PER_BLOCK, []  # type: ignore[var-annotated]

    def __call__(self, period: int, receiver: int, sender: int) -> float:
        """Number between 0 and 1 of a period, a receiver and a sender, by their places among the drones."""
        if not self._first_period <= period < self._first_period + PERIODS_PER_BLOCK:
            self._first_period = period - period % PERIODS_PER_BLOCK
            self._tables = self._drawn(self._first_period)
        drawn: float = self._tables[period - self._first_period][receiver][sender]
        return drawn

    def _drawn(self, first: int) -> list[list[list[float]]]:
        """A table of receivers and senders for each of PERIODS periods."""
        periods = np.arange(first, first + PERIODS_PER_BLOCK, dtype=np.uint64)[:, None, None]
        to = np.arange(0, self._count, 4, dtype=np.uint64)[None, :, None]  # four receivers share their words
        who = np.arange(self._count, dtype=np.uint64)[None, None, :]
        words = random.random_words(self._seed, random.PACKET, 0, periods, random.pair_number(to, who, self._count))
        table = random.uniform(np.stack(words, axis=2)).reshape(PERIODS_PER_BLOCK, -1, self._count)
        found: list[list[list[float]]] = table[:, : self._count].tolist()
        return found
