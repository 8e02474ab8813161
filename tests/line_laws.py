"""Laws of one line, whose likelihood is known everywhere: on them the searches of `infer` are tried."""

from types import SimpleNamespace

import numpy as np

from airflock.infer.candidates import Number
from airflock.infer.likelihood import Model

STEPS, NOISE = 400, 0.05


class Line(Model):
    """A law of one line: what is seen is a function of the numbers' places and of a known input, with noise."""

    def __init__(self, law, names, truth, defaults=None, usual_numbers=()):
        defaults = defaults or dict.fromkeys(names, 0.5)
        self.numbers = [Number(f"model.{name}", -1, "m", 0.0, 1.0, False, defaults[name]) for name in names]
        self.named, self.usual, self.axes, self.spans, self.held = len(names), None, 2, [(0, 0)], frozenset()
        flags = {name: defaults[name] for name in usual_numbers}
        self.law = SimpleNamespace(scenario=SimpleNamespace(model=SimpleNamespace(usual=flags)))
        generator = np.random.default_rng(4)
        self.input = generator.uniform(0.0, 1.0, STEPS)
        self.rule, self.noise = law, generator.normal(0.0, NOISE, (STEPS, 2))
        self.seen = law(self.input, *truth)

    def differences(self, u, spans=None):
        u = [n.place(n.default) if k in self.held else x for k, (n, x) in enumerate(zip(self.numbers, u, strict=True))]
        e = self.noise.copy()
        e[:, 0] += self.seen - self.rule(self.input, *u)
        return e, np.zeros(STEPS, np.int64)

    def few(self, frames=0):
        return [0]

    def start(self):
        return np.array([n.default for n in self.numbers])


def quietly():
    """Nobody is told anything."""
