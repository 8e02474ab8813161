"""Sensors against closed forms: standard deviations, autocorrelations, rates, times; and in flight."""

import math

import numpy as np
import pytest

import airflock
from airflock.core.contract import State
from airflock.core.sensor import SensorState
from airflock.parts import SENSORS

PERIOD = 0.2
REST = State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def errors(kind, agents, steps, seed=5, period=PERIOD, **numbers):
    """What agents at rest measure: (measurement, component, agent), m and m/s."""
    sensor = SENSORS[kind]
    s = sensor.Parameters(**numbers)
    sensing = [SensorState(sensor, s, seed, agent, flat=False) for agent in range(agents)]
    return np.array([[one.measure(k, REST, period) for one in sensing] for k in range(steps)]).transpose(0, 2, 1)


def test_gnss_has_the_standard_deviations_that_are_asked_for():
    """At the first measurement as at any later one: the process begins as it goes on."""
    found = errors("gnss", 2000, 3, sd=1.5, sd_up=4.0, drift_time=10.0, bias=2.0, white=0.5, sd_velocity=0.1)
    for k in (1, 2):  # white noise begins with the second
        sd = found[k].std(axis=1)
        level = math.sqrt(1.5**2 + 2.0**2 + 0.5**2), math.sqrt(4.0**2 + 2.0**2 + 0.5**2)
        assert sd[[0, 1]] == pytest.approx([level[0]] * 2, rel=0.06)  # 4 SD of an SD of 2000 numbers: 6.3 %
        assert sd[2] == pytest.approx(level[1], rel=0.06)
        assert sd[3:] == pytest.approx([0.1] * 3, rel=0.06)
    assert found[0, :2].std() == pytest.approx(math.hypot(1.5, 2.0), rel=0.06)


@pytest.mark.parametrize("period", [0.1, 0.4])
def test_the_wandering_error_of_gnss_forgets_exponentially_whatever_the_period(period):
    lag = 1.2
    steps = round(lag / period) + 1
    found = errors("gnss", 3000, steps, period=period, sd=1.0, drift_time=2.0, sd_velocity=0.0)
    together = (found[0, 0] * found[-1, 0]).mean(), (found[0, 1] * found[-1, 1]).mean()
    assert np.mean(together) == pytest.approx(math.exp(-lag / 2.0), abs=0.06)


def test_multipath_and_outages_come_at_their_rates_and_last_their_times():
    rate, lasts, steps, agents = 0.1, 2.0, 1500, 30
    still = {"sd": 0.0, "sd_up": 0.0, "sd_velocity": 0.0}
    jumps = errors("gnss", agents, steps, jump_rate=rate, jump_time=lasts, jump_sd=3.0, **still)
    off = jumps[:, 0] != 0.0
    # a renewal process: sound for 1/rate on average, then off for `lasts`; a new one may follow at once
    chance = 1.0 - math.exp(-rate * PERIOD)
    share = lasts / (lasts + PERIOD * (1.0 - chance) / chance)
    begun = np.sum(np.diff(jumps[:, 0], axis=0) != 0.0) - np.sum(off[:-1] & ~off[1:])
    expected = steps * agents * PERIOD * share / lasts
    assert off.mean() == pytest.approx(share, abs=4.0 * math.sqrt(share / expected))
    assert begun == pytest.approx(expected, abs=4.0 * math.sqrt(expected))
    sizes = jumps[:, 0][off]  # some 1,600 draws, each held for ten measurements
    assert sizes.std() == pytest.approx(3.0, rel=0.15)

    out = errors("gnss", agents, steps, outage_rate=rate, outage_time=lasts, coasting=0.4, **still)
    moving = out[:, 3] != 0.0
    assert moving.mean() == pytest.approx(share, abs=4.0 * math.sqrt(share / expected))
    # in an outage the error grows by its own velocity error, and is gone with the fix
    grows = moving[1:] & moving[:-1]
    np.testing.assert_allclose((out[1:, 0] - out[:-1, 0])[grows], (PERIOD * out[1:, 3])[grows], atol=1e-12)
    assert (out[:, 0][~moving] == 0.0).all()


def test_the_langevin_error_has_its_stationary_standard_deviations():
    """Of a long run: sqrt(noise), and sqrt(scale · sqrt(noise / (2 damping))); the program's steps add 10 %."""
    found = errors("langevin", 40, 3000, noise=0.02, damping=0.5, scale=2.0)[300:]
    assert found[:, 3:].std() == pytest.approx(math.sqrt(0.02), rel=0.1)
    assert found[:, :3].std() == pytest.approx(math.sqrt(2.0 * math.sqrt(0.02 / 1.0)), rel=0.1)


@pytest.mark.parametrize("delay", [0.1, 0.2, 0.34, 0.8])
def test_a_delayed_state_is_that_of_so_long_ago(delay):
    """Exact for any cubic of time: positions and velocities between two measurements are interpolated."""
    sensor = SENSORS["delayed"]
    sensing = SensorState(sensor, sensor.Parameters(lag=delay), 0, 0, flat=False)

    def true(t):
        return State(
            1.0 + 2.0 * t - t**2 + 0.5 * t**3, -3.0 * t**3, 4.0 * t, 2.0 - 2.0 * t + 1.5 * t**2, -9.0 * t**2, 4.0
        )

    for k in range(12):
        off = sensing.measure(k, true(k * PERIOD), PERIOD)
        believed = np.array(true(k * PERIOD)) + off
        if k * PERIOD >= delay:
            np.testing.assert_allclose(believed, true(k * PERIOD - delay), atol=1e-9)
        else:  # the oldest state that there is
            np.testing.assert_allclose(believed, true(0.0), atol=1e-9)


SMALL = {"agents": 4, "duration": 3.0, "world.side": 60.0, "start.separation": 5.0}
NOTHING = {
    "gnss": {"sensors.sd": 0.0, "sensors.sd_up": 0.0, "sensors.sd_velocity": 0.0},
    "langevin": {"sensors.noise": 0.0}, "delayed": {"sensors.lag": 0.0}, "perfect": {},
}  # fmt: skip


@pytest.mark.parametrize("kind", SENSORS)
def test_a_sensor_whose_errors_are_zero_flies_the_bits_of_the_perfect_one(kind):
    def flown(**keys):
        scenario = airflock.load("vasarhelyi_2018/4ms", SMALL | keys)
        return airflock.simulate(scenario, 3, device="python")["position"].values

    np.testing.assert_array_equal(
        flown(**{"sensors.kind": kind}, **NOTHING[kind]), flown(**{"sensors.kind": "perfect"})
    )


def test_a_gnss_of_which_only_the_rate_of_nothing_is_left_tells_the_truth():
    """The rule itself, asked: multipath of no size gives the true state to the bit."""
    found = errors("gnss", 20, 50, sd=0.0, sd_up=0.0, sd_velocity=0.0, jump_rate=1.0, jump_sd=0.0, outage_rate=1.0,
                   coasting=0.0)  # fmt: skip
    assert (found == 0.0).all()


def test_what_is_measured_in_flight_has_the_standard_deviation_that_was_asked_for():
    keys = SMALL | {"agents": 20, "world.side": 200.0, "duration": 8.0, "sensors.kind": "gnss", "sensors.sd": 1.5,
                    "sensors.drift_time": 0.3}  # fmt: skip
    kept = airflock.simulate(
        airflock.load("vasarhelyi_2018/4ms", keys | {"metrics.period": 0.2}), 2, device="python", keep=("measured",)
    )
    kept = kept.isel(time=slice(None, -1))  # nothing is measured any more at the end
    off = (kept["measured_position"] - kept["position"]).values
    assert off.std() == pytest.approx(1.5, rel=0.12)  # 20 agents, 2 axes, some 14 independent times: 4 SD are 12 %
    assert (kept["measured_velocity"] - kept["velocity"]).values.std() == pytest.approx(0.05, rel=0.06)
