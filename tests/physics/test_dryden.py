"""Dryden turbulence: variance, length scale and spectrum of the specification, whatever the time step."""

import math

import numpy as np
import pytest
from scipy.signal import welch

from airflock.engine import fly_world
from airflock.parts.bodies import dryden, wind
from airflock.scenarios.files import load
from reference.flight import fly_plainly

AIR = dryden.numbers_of(wind.Parameters(kind="dryden", height=50.0, at_6m=7.7, airspeed=10.0, east=3.0, north=4.0))


def series(dt, count, rng, length, sigma, axis):
    """Gusts (m/s) of `count` steps."""
    g, h = rng.normal(size=(2, count))
    found = np.empty(count)
    u = p = q = 0.0
    for k in range(count):
        if axis == "along":
            u = dryden.along(u, g[k], dt, length, sigma, AIR.airspeed)
            found[k] = u
        else:
            p, q = dryden.across(p, q, g[k], h[k], dt, length, AIR.airspeed)
            found[k] = dryden.gust_of(p, q, sigma)
    return found


def test_lengths_and_strengths_are_those_of_the_specification():
    """At 100 ft in light turbulence (15 kn at 20 ft), computed by hand in feet."""
    found = dryden.numbers_of(wind.Parameters(kind="dryden", height=100 * 0.3048, at_6m=15 * 0.514444))
    k = 0.177 + 0.000823 * 100.0
    assert found.length_up == pytest.approx(30.48) and found.length == pytest.approx(100.0 / k**1.2 * 0.3048)
    assert found.sigma_up == pytest.approx(1.5 * 0.514444) and found.sigma == pytest.approx(1.5 * 0.514444 / k**0.4)
    high = dryden.numbers_of(wind.Parameters(height=304.8))  # 1000 ft: all lengths alike
    assert high.length == pytest.approx(304.8, rel=1e-3)
    assert (AIR.east, AIR.north) == pytest.approx((0.6, 0.8))


@pytest.mark.parametrize("r", [1e-3, 0.05, 1.0, 20.0])
def test_a_step_keeps_the_covariance_of_its_states_exactly(r):
    """P = F P Fᵀ + Q with P = [[1, 1/2], [1/2, 1/2]], of which gust_of makes sigma²."""

    def step(p, q, g, h):
        return np.array(dryden.across(p, q, g, h, r, 1.0, 1.0))

    f = np.column_stack([step(1.0, 0.0, 0.0, 0.0), step(0.0, 1.0, 0.0, 0.0)])
    b = np.column_stack([step(0.0, 0.0, 1.0, 0.0), step(0.0, 0.0, 0.0, 1.0)])
    kept = np.array([[1.0, 0.5], [0.5, 0.5]])
    np.testing.assert_allclose(f @ kept @ f.T + b @ b.T, kept, atol=1e-9)
    of = np.array([dryden.gust_of(1.0, 0.0, 2.0), dryden.gust_of(0.0, 1.0, 2.0)])
    assert of @ kept @ of == pytest.approx(4.0)


@pytest.mark.parametrize("axis", ["along", "across"])
def test_the_spectrum_is_drydens(axis, seed):
    """Welch's estimate against the printed spectrum, and the variance of a long series."""
    rng, dt, length, sigma = np.random.default_rng(seed), 0.1, AIR.length_up, AIR.sigma_up
    found = series(dt, 200_000, rng, length, sigma, axis)
    assert found.std() == pytest.approx(sigma, rel=0.05)
    f, measured = welch(found, 1.0 / dt, nperseg=2048)
    x = (2.0 * math.pi * f * length / AIR.airspeed) ** 2
    shape = 2.0 / (1.0 + x) if axis == "along" else (1.0 + 3.0 * x) / (1.0 + x) ** 2
    printed = sigma**2 * length / (math.pi * AIR.airspeed) * shape * 2.0 * math.pi  # one-sided, per Hz
    low = (f > 0.01) & (f < 1.0)  # where neither the window nor sampling shows
    assert np.median(measured[low] / printed[low]) == pytest.approx(1.0, abs=0.05)
    for band in np.array_split(np.flatnonzero(low), 5):
        assert (measured[band] / printed[band]).mean() == pytest.approx(1.0, abs=0.12)


@pytest.mark.parametrize("axis", ["along", "across"])
def test_the_length_scale_is_the_integral_of_the_correlation(axis, seed):
    """∫ R(τ) V dτ / σ² = L along the wind, L / 2 across it."""
    rng, dt, length = np.random.default_rng(seed), 0.2, 20.0
    found = series(dt, 200_000, rng, length, 1.0, axis)
    lags = int(4.0 * length / AIR.airspeed / dt)
    correlation = [np.mean(found[: found.size - k] * found[k:]) / found.var() for k in range(lags)]
    whole = (np.sum(correlation) - 0.5) * dt * AIR.airspeed
    assert whole == pytest.approx(length if axis == "along" else 0.5 * length, rel=0.1)


@pytest.mark.parametrize("dims", ["2", "3"])
@pytest.mark.parametrize("body", ["multirotor", "quadrotor"])
def test_a_flock_in_turbulence_flies_as_the_reference_does(dims, body, seed):
    keys = {"wind.kind": "dryden", "wind.east": 4.0, "wind.at_6m": 15.0, "world.dimensions": dims, "agents": 3,
            "body.kind": body, "duration": 4.0, "start.separation": 5.0, "dt": 0.02}  # fmt: skip
    scenario = load("vasarhelyi_2018/4ms", keys)
    frames = fly_world(scenario, seed, precision=64, record=True, device="python").frames
    np.testing.assert_allclose(frames, fly_plainly(scenario, seed).frames, rtol=0.0, atol=1e-10)
