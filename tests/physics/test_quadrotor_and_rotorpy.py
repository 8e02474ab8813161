"""The quadrotor beside rotorpy's: same mass, inertia, motors and gains, our velocity controller around its `cmd_acc`.

A job of its own (`pip install rotorpy`, tests only): skipped without it.
"""

import math

import numpy as np
import pytest

from airflock.parts.bodies.quadrotor import Memory, Parameters, move, tilted, wanted

multirotor = pytest.importorskip("rotorpy.vehicles.multirotor")
hummingbird = pytest.importorskip("rotorpy.vehicles.hummingbird_params")

DT, SECONDS = 0.01, 3.0


def both(command, v, gust):
    """Velocities and tilts (rad) of the two, from level flight at v, told to fly at `command`, gust(t) as the wind."""
    given = hummingbird.quad_params | {"k_z": 0.0, "k_h": 0.0, "tau_m": 0.02, "kp_att": 150.0, "kd_att": 22.0}
    given |= {"c_Dx": 5e-3, "c_Dy": 5e-3, "c_Dz": 5e-3}
    mass, gravity = given["mass"], 9.81
    hover = math.sqrt(mass * gravity / (4.0 * given["k_eta"]))
    b = Parameters(
        motor=given["tau_m"], stiffness=150.0, damping=22.0, alpha=1e4, gravity=gravity, thrust_min=0.0,
        thrust_max=20.0, rotor_drag=4.0 * given["k_d"] * hover / mass, drag=given["c_Dx"] / mass,
    )  # fmt: skip
    state = {
        "x": np.array([0.0, 0.0, 50.0]), "v": np.array(v), "q": np.array([0.0, 0.0, 0.0, 1.0]), "w": np.zeros(3),
        "wind": np.zeros(3), "rotor_speeds": np.full(4, hover),
    }  # fmt: skip
    theirs = multirotor.Multirotor(given, {key: np.copy(value) for key, value in state.items()}, "cmd_acc")
    integral, memory, speed, found = np.zeros(3), Memory(), tuple(v), []
    for step in range(round(SECONDS / DT)):
        wind = gust(step * DT)
        e = np.array(command) - state["v"]
        *a, free = wanted(*e, *integral, b)
        integral = integral + b.integral * DT * free * e
        state["wind"] = np.array(wind)
        state = theirs.step(state, {"cmd_acc": np.array(tilted(*a, b))}, DT)
        *speed, memory = move(*speed, *speed, *command, *wind, memory, DT, b)
        x, y, z, w = state["q"]
        lean = math.acos(min(1.0 - 2.0 * (x * x + y * y), 1.0))
        found.append((*state["v"], lean, *speed, math.acos(min(memory.nz, 1.0))))
    return np.array(found)


@pytest.mark.parametrize(
    ("command", "v"),
    [((4.0, 0.0, 0.0), (0.0, 0.0, 0.0)), ((-2.0, 3.0, 0.5), (0.0, 0.0, 0.0)), ((0.0, 0.0, 0.0), (4.0, 0.0, 0.0)),
     ((0.0, 4.0, 0.0), (4.0, 0.0, 0.0))],
)  # fmt: skip
@pytest.mark.parametrize("gust", [0.0, 3.0])
def test_it_flies_as_rotorpy_does(command, v, gust):
    """Tilt within 2 degrees, velocity within 5 % of the step, for 3 s from hover and from 4 m/s, also in a gust."""
    rows = both(command, v, lambda t: (0.0, gust if 1.0 <= t < 2.0 else 0.0, 0.0))
    step = np.linalg.norm(np.subtract(command, v))
    assert np.abs(rows[:, 3] - rows[:, 7]).max() < math.radians(2.0)
    assert np.linalg.norm(rows[:, 0:3] - rows[:, 4:7], axis=1).max() < 0.05 * step
