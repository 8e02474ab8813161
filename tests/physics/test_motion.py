"""Bodies, sensors and wind against closed forms."""

import math

import numpy as np
import pytest

import airflock
from airflock.core import random
from airflock.parts import BODIES
from airflock.parts.bodies import autopilot, jostled, motion, wind
from airflock.parts.sensors import langevin
from airflock.scenarios.files import load
from airflock.scenarios.flight_world import FlightWorld
from airflock.scenarios.scenario_builder import build_scenario
from airflock.world import start
from flocks import flown, from_start, ideal, scenario
from reference.begin import begin


def error_statistics(h, **settings):
    """Stationary covariance of (q, u) of the sensor error: the rule is linear, so its moments are known exactly."""
    s = langevin.Parameters(**settings)
    columns = [langevin.error(1.0, 0.0, 0.0, h, s), langevin.error(0.0, 1.0, 0.0, h, s)]
    step = np.array(columns).T
    push = np.array(langevin.error(0.0, 0.0, 1.0, h, s))
    # C = A C Aᵀ + b bᵀ, solved as linear equations
    return np.linalg.solve(np.eye(4) - np.kron(step, step), np.outer(push, push).ravel()).reshape(2, 2)


@pytest.mark.parametrize("settings", [{}, {"noise": 0.08}, {"damping": 0.3}, {"scale": 1.0, "noise": 0.02}])
def test_sensor_error_has_its_stationary_deviations(settings):
    """SD(u) = sqrt(S) and SD(q) = sqrt(S / D) with D = sqrt(2 damping S) / scale, as the period goes to zero."""
    s = langevin.Parameters(**settings)
    spring = math.sqrt(2.0 * s.damping * s.noise) / s.scale
    for h, margin in ((0.2, 0.12), (0.002, 0.0012)):
        found = error_statistics(h, **settings)
        assert math.sqrt(found[1, 1]) == pytest.approx(math.sqrt(s.noise), rel=margin)
        assert math.sqrt(found[0, 0]) == pytest.approx(math.sqrt(s.noise / spring), rel=margin)
    assert error_statistics(0.2)[0, 0] ** 0.5 == pytest.approx(0.69, abs=0.05)  # m, reference of the authors' program


def test_sensor_error_in_random_numbers(seed):
    """The exact covariance is what random numbers give: 400 errors, 10 decay times after they began at zero."""
    s, h = langevin.Parameters(damping=1.0), 0.2
    ends = []
    for agent in range(400):
        q = u = 0.0
        for step in range(100):
            g, _ = random.normal_pair(*random.random_words(seed, random.SENSOR, 0, step, agent)[:2])
            q, u = langevin.error(q, u, g, h, s)
        ends.append((q, u))
    expected = error_statistics(h, damping=1.0)
    np.testing.assert_allclose(
        np.cov(np.array(ends).T).diagonal(), expected.diagonal(), rtol=5.0 * math.sqrt(2.0 / 400)
    )


def test_outer_noise_diffuses(seed):
    """The variance of each velocity component grows as 2 sigma t: 1,000 agents, control all but switched off."""
    keys = {"agents": 1000, "duration": 2.0, "world__side": 1e5, "world__walls": "nearest_per_axis"}
    found = scenario(**keys, body__tau=60.0, body__a_max=0.01, body__noise=0.3)
    frames = flown(found, seed, precision=32).frames
    velocity = frames[:, 2:4].astype(float)
    times = 0.2 * np.arange(len(frames))
    error = 5.0 * math.sqrt(2.0 / 2000)  # of a variance from 2,000 components
    np.testing.assert_allclose(velocity.var(axis=(1, 2))[1:], 2.0 * 0.3 * times[1:], rtol=error)
    assert np.corrcoef(velocity[5].ravel(), (velocity[10] - velocity[5]).ravel())[0, 1] == pytest.approx(0.0, abs=0.12)


def test_gusts_keep_their_deviation_and_forget_with_their_time(seed):
    a, dt = wind.Parameters(gust=2.5, gust_time=4.0), 0.1
    keep, push = wind.gusting(1.0, 0.0, dt, a), wind.gusting(0.0, 1.0, dt, a)
    assert keep == math.exp(-dt / 4.0)  # exact correlation after dt
    assert push * push / (1.0 - keep * keep) == pytest.approx(2.5**2, rel=1e-12)  # exact stationary variance
    w, course = 0.0, []
    for step in range(20_000):
        w = wind.gusting(w, random.normal_pair(*random.random_words(seed, random.GUST, 0, step, 0)[:2])[0], dt, a)
        course.append(w)
    course = np.array(course[400:])
    assert course.std() == pytest.approx(2.5, rel=0.12)  # about 250 independent gusts
    later = np.corrcoef(course[:-40], course[40:])[0, 1]
    assert later == pytest.approx(math.exp(-1.0), abs=0.15)


def test_a_lone_agent_reaches_its_speed_with_time_constant_tau():
    """v(t) = v_flock + (v0 - v_flock) exp(-t / tau); explicit Euler makes the power (1 - dt / tau)^n of it, exactly."""
    tau = 1.5
    found = ideal(duration=6.0, world__side=1e4, body__tau=tau)
    frames = from_start(found, (0.0, 0.0, 0.6, 0.8)).frames
    speed = np.hypot(frames[:, 2, 0], frames[:, 3, 0])
    steps = 20 * np.arange(len(speed))
    np.testing.assert_allclose(speed, 4.0 - 3.0 * (1.0 - 0.01 / tau) ** steps, rtol=1e-9)
    np.testing.assert_allclose(speed, 4.0 - 3.0 * np.exp(-0.01 * steps / tau), rtol=5e-3)
    np.testing.assert_allclose(frames[:, 3, 0] / frames[:, 2, 0], 0.8 / 0.6, rtol=1e-9)  # it flies straight


def test_acceleration_saturates_with_its_direction_kept():
    b = motion.Parameters(a_max=2.0, noise=0.0)
    vx, vy, vz = motion.move(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 30.0, 40.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.1, b)
    assert (vx, vy, vz) == pytest.approx((0.12, 0.16, 0.0))


def test_noise_comes_after_the_saturation():
    b = motion.Parameters(a_max=0.01, noise=2.0)
    vx, _, _ = motion.move(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 30.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.01, b)
    assert vx == pytest.approx(0.01 * 0.01 + math.sqrt(2.0 * 2.0 * 0.01))


def test_wind_carries_a_flock_that_does_not_resist():
    """Steady wind pushes with drag times its velocity: dv = drag · w · t on an agent without control."""
    b = motion.Parameters(a_max=0.01, noise=0.0, drag=0.2)
    v = (1.0, 0.0, 0.0)
    for _ in range(100):
        v = motion.move(*v, *v, *v, 0.0, 0.0, 0.0, 5.0, -3.0, 1.0, 0.01, b)
    assert v == pytest.approx((2.0, -0.6, 0.2))


@pytest.mark.parametrize("tau", [1.0])
def test_halving_the_step_halves_the_error(tau):
    """Order 1: three flights of two interacting agents at dt, dt/2, dt/4; decisions at the same times."""
    ends = []
    for dt in (0.02, 0.01, 0.005):
        found = ideal(duration=4.0, dt=dt, world__side=1e4, body__tau=tau)
        ends.append(from_start(found, (0.0, 0.0, 1.0, 0.0), (9.0, 3.0, 0.0, 1.0)).state)
    first, second = np.abs(ends[0] - ends[1]).max(), np.abs(ends[1] - ends[2]).max()
    assert 1e-4 < first < 0.2
    assert first / second == pytest.approx(2.0, rel=0.1)


def test_turbulence_makes_a_jostled_body_walk_at_random_about_its_command(seed):
    b, dt, steps = jostled.Parameters(noise=0.003), 0.1, 20_000
    draws = np.random.default_rng(seed).standard_normal((steps, 3))
    moved = np.array([jostled.move(1.0, -2.0, 0.5, *map(float, g), dt, b) for g in draws]) * dt
    drift = moved - np.array([1.0, -2.0, 0.5]) * dt
    assert np.abs(drift.mean(axis=0)).max() < 5.0 * math.sqrt(2.0 * b.noise * dt / steps)
    spread = drift.reshape(-1, 50, 3).sum(axis=1)  # over 5 s
    np.testing.assert_allclose(spread.var(axis=0), 2.0 * b.noise * 50 * dt, rtol=0.35)
    still = jostled.Parameters(noise=0.0, speed_max=1.0)
    command = jostled.move(3.0, 4.0, 0.0, 1.0, 1.0, 1.0, dt, still)
    assert command == pytest.approx((0.6, 0.8, 0.0))


def test_a_formation_starts_straight_ahead_at_the_speed_of_the_start():
    found = load("vasarhelyi_2018/fixed_wing", {"duration": 0.0, "start.speed": 7.0})
    states = begin(found, 0, FlightWorld(found))
    assert [(s.vx, s.vy, s.vz) for s in states] == [(7.0, 0.0, 0.0)] * 7


def test_all_directions_are_equally_likely_at_the_start(seed):
    rng = np.random.default_rng(seed)
    n = 20_000
    v = np.array([start.heading_off(*g, 3.0) for g in rng.normal(0.0, 1.0, (n, 3))])
    np.testing.assert_allclose(np.linalg.norm(v, axis=1), 3.0, rtol=1e-9)
    share = np.sort((v / 3.0 + 1.0) / 2.0, axis=0)  # a coordinate of a point on a sphere is uniform (Archimedes)
    assert np.abs(share - (np.arange(n)[:, None] + 0.5) / n).max() < 2.2 / math.sqrt(n)  # Kolmogorov: p below 1e-4


OWN_BODY = """ACCEPTS, INTEGRATION = "velocity", "new"


def move(vx, vy, vz, cx, cy, cz, dt):
    k = 2.0 * dt
    return vx + k * (cx - vx), vy + k * (cy - vy), vz + k * (cz - vz)
"""
STILL = {
    "agents": 2, "sensors.noise": 0.0, "radio.delay": 0.0, "start.speed": 0.0, "start.separation": 20.0, "dt": 0.02,
    "world.side": 1000.0, "duration": 6.0, "metrics.period": 0.02,
}  # fmt: skip
LAWS = {"velocity": "vasarhelyi_2018", "acceleration": "reynolds_1987", "heading": "vicsek_1995"}


def commanded(kind, delay, every, commands):
    """Velocities at every step (step, component, agent) of agents that are commanded so, one row a decision."""
    law = LAWS[BODIES[kind].accepts] if kind in BODIES else LAWS["velocity"]
    quiet = {"body.noise": 0.0} if kind in ("multirotor", "jostled", "autopilot") else {}
    keys = STILL | quiet | {"body.kind": kind, "body.delay": delay * 0.02, "sensors.period": every * 0.02}
    keys |= {"start.speed": 15.0, "model.v_flock": 15.0} if kind == "fixed_wing" else {}
    found = build_scenario({"model": {"kind": law}}, "waiting", keys, trust=True)
    flight = airflock.open(found, 1, device="python", precision=64, record=True)
    for command in commands:
        flight.command([0, 1], command).advance(steps=every)
    return flight.frames[:, 2:4]


@pytest.mark.parametrize("kind", [*BODIES, "own"])
def test_commands_that_wait_move_any_body_as_they_would_have_moved_it_earlier(kind, seed, tmp_path):
    """Of commands that do not depend on the motion: the flight, by a dead time of any number of steps later."""
    if kind == "own":
        kind = str(tmp_path / "mine.py")
        (tmp_path / "mine.py").write_text(OWN_BODY)
    rng = np.random.default_rng(seed)
    speed = 15.0 if kind == "fixed_wing" else 4.0
    turns = np.cumsum(rng.uniform(-0.3, 0.3, (30, 2)), axis=0)
    commands = np.stack([np.cos(turns), np.sin(turns)], axis=2)
    commands *= 1.0 if kind in BODIES and BODIES[kind].accepts == "heading" else speed
    for _ in range(3):
        delay, every = int(rng.integers(1, 12)), int(rng.integers(1, 5))
        at_once, late = commanded(kind, 0, every, commands), commanded(kind, delay, every, commands)
        if kind == "fixed_wing":  # which flies on as it started meanwhile, and so is elsewhere in its own dynamics
            steady = commanded(kind, 0, every, np.repeat(late[0].T[None], 30, axis=0))
            np.testing.assert_allclose(late[: delay + 1], steady[: delay + 1], atol=1e-12)
        else:
            np.testing.assert_allclose(late[: delay + 1], np.broadcast_to(late[0], late[: delay + 1].shape), atol=1e-12)
            np.testing.assert_allclose(late[delay:], at_once[:-delay], rtol=0.0, atol=1e-12)
        assert np.abs(late[delay + 1 :] - late[0]).max() > 0.01


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.3, 0.4])
def test_a_step_command_arrives_after_exactly_the_dead_time(delay):
    moved = commanded("direct", round(delay / 0.02), 5, np.full((8, 2, 2), 3.0))[:, 0, 0]
    np.testing.assert_array_equal(moved, np.where(np.arange(len(moved)) > round(delay / 0.02), 3.0, 0.0))


def test_an_autopilot_answers_a_step_within_its_acceleration_and_its_jerk_and_then_with_its_lag(seed):
    """From rest: a ramp of the acceleration, its limit, and an exponential with tau."""
    rng, dt = np.random.default_rng(seed), 0.005
    for _ in range(5):
        tau, a_max, jerk = rng.uniform(0.4, 1.5), rng.uniform(1.0, 5.0), rng.uniform(5.0, 30.0)
        b = autopilot.Parameters(tau=tau, a_max=a_max, jerk=jerk, noise=0.0)
        c = rng.normal(size=3)
        c *= (2.0 * a_max * tau + a_max**2 / jerk) / np.linalg.norm(c)  # far beyond the limit of the acceleration
        v, memory, speeds, pushes = np.zeros(3), autopilot.Memory(), [0.0], [np.zeros(3)]
        for _ in range(round(10.0 * tau / dt)):
            *v, memory = autopilot.move(*v, *v, *c, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, memory, dt, b)
            speeds.append(float(np.linalg.norm(v)))
            pushes.append(np.array(memory))
        felt = np.linalg.norm(pushes, axis=1)
        assert felt.max() == pytest.approx(a_max, rel=1e-9)
        assert np.linalg.norm(np.diff(pushes, axis=0), axis=1).max() <= jerk * dt * (1.0 + 1e-9)
        ramp = round(a_max / jerk / dt) - 1  # v = jerk t² / 2
        assert speeds[ramp] == pytest.approx(0.5 * jerk * (ramp * dt) ** 2, rel=0.1)
        gap = np.linalg.norm(c) - np.array(speeds)
        late = int(np.argmax(gap < 0.3 * a_max * tau))
        assert gap[late + round(tau / dt)] / gap[late] == pytest.approx(math.exp(-1.0), rel=0.02)
        assert np.diff(speeds).min() >= -1e-12  # it does not overshoot
