"""An earlier hand-written evaluation (flock.c, given by its path): the reference against it on the same physics."""

import ctypes
from pathlib import Path

import numpy as np
from c_reference import build, flags

from airflock.scenarios.scenario import Scenario

EVERY_STEP, RESCALE = 1, 4  # flags of its function `simulate`


class Trial:
    """flock.c in float32, built with the flags of the reference."""

    def __init__(self, source: Path, scenario: Scenario, folder: Path, vector_bits: int):
        options = [flag for flag in flags(vector_bits) if not flag.startswith("-D")]
        self.library = ctypes.CDLL(str(build(source, folder / "trial.so", options)))
        p, body, sensors, measured = (
            scenario.parameters,
            scenario.body.numbers,
            scenario.sensors.numbers,
            scenario.resolved_metrics(),
        )
        spring = (2.0 * sensors.damping * sensors.noise) ** 0.5 / sensors.scale
        numbers = (
            p.r0_rep, p.p_rep, p.r0_frict, p.c_frict, p.v_frict, p.p_frict, p.a_frict, p.r0_shill, p.v_shill,
            p.p_shill, p.a_shill, p.v_flock, p.v_max, scenario.world.side, scenario.radio.range, body.tau, body.a_max,
            body.noise, sensors.noise, sensors.damping, spring, measured.r_coll, measured.r_cluster,
        )  # fmt: skip
        self.parameters = np.array(numbers, np.float32)
        self.agents = scenario.agents
        self.decisions = round(scenario.flight.duration / sensors.period)
        self.out = np.zeros(8, np.float32)

    def evaluate(self, seed: int, every_step: bool) -> dict[str, float]:
        """Mean speed and correlation of one flight."""
        chosen = RESCALE + (EVERY_STEP if every_step else 0)
        row, out = (a.ctypes.data_as(ctypes.c_void_p) for a in (self.parameters, self.out))
        self.library.simulate(row, self.agents, self.decisions, 0, seed, 0, chosen, out, None)
        return {"phi_vel": float(self.out[0]), "phi_corr": float(self.out[1])}
