"""Laws of one line, whose likelihood is known everywhere: on them the searches of `infer` are tried."""

from copy import copy
from types import SimpleNamespace

import numpy as np

from airflock.estimate.inference.innovation_filter import FitModel
from airflock.estimate.inference.law_candidates import FitParameter

STEPS, NOISE = 400, 0.05


class Line(FitModel):
    """A law of one line: what is seen is a function of the numbers' places and of a known input, with noise."""

    def __init__(self, law, names, truth, defaults=None, usual_numbers=(), log=()):
        defaults = defaults or dict.fromkeys(names, 0.5)
        self.numbers = [
            FitParameter(f"model.{name}", -1, "1", 1.0, 10.0, True, 10.0 ** defaults[name]) if name in log
            else FitParameter(f"model.{name}", -1, "m", 0.0, 1.0, False, defaults[name])
            for name in names
        ]  # fmt: skip
        self.named, self.speed_index, self.axes, self.spans = len(names), None, 2, [(0, 0)]
        self.soft = False
        self.own_speed, self.tracks, self.scale = True, (), None
        flags = {name: defaults[name] for name in usual_numbers}
        scenario = SimpleNamespace(model=SimpleNamespace(usual=flags))
        self.law = SimpleNamespace(numbers=tuple(self.numbers), scenario=scenario)
        generator = np.random.default_rng(4)
        self.input = generator.uniform(0.0, 1.0, STEPS)
        self.rule, self.noise = law, generator.normal(0.0, NOISE, (STEPS, 2))
        self.seen = law(self.input, *truth)

    def with_parameters(self, numbers):
        chosen, whole = list(numbers), self.whole

        def rule(x, *places):
            given = dict(zip(chosen, places, strict=True))
            return whole.rule(x, *(given.get(n, n.place(n.default)) for n in whole.numbers))

        twin = copy(self)
        twin.numbers, twin.named, twin.rule, twin.origin = chosen, len(chosen), rule, whole
        twin.law = SimpleNamespace(numbers=tuple(chosen), scenario=self.law.scenario)
        return twin

    @property
    def whole(self):
        """The law with all its numbers."""
        return getattr(self, "origin", self)

    def innovations(self, u, spans=None):
        e = self.noise.copy()
        e[:, 0] += self.seen - self.rule(self.input, *u)
        return e, np.zeros(STEPS, np.int64)

    def few(self, frames=0):
        return [0]

    def start(self):
        return np.array([n.place(n.default) for n in self.numbers])


def quietly():
    """Nobody is told anything."""
