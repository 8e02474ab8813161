"""Identify: truths that come back, and what logs cannot say is refused with the reason."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import airflock
from airflock.core import random
from airflock.core.parameters import Quantity, declarations
from airflock.estimate.identification import (
    body_and_sensor as body,
    body_and_sensor as standing,
    log_check as synthetic,
    radio_links as hills,
    radio_links as packets,
    vehicle_logs as periods,
)
from airflock.estimate.identification.radio_links import CURVE_PARAMETERS
from airflock.estimate.identification.vehicle_identification import (
    HARDER,
    KEY_UNITS,
    IdentifiedParameter,
    _on_one_clock,
    flight_card,
    identify,
    read_heard,
)
from airflock.estimate.identification.vehicle_logs import FlightLogs, logs_from_recording
from airflock.parts.radios import links
from airflock.parts.sensors import langevin
from airflock.support.errors import RecordingError, ScenarioError
from processes import called

STEP = 0.05


def fly(tau, a_max, noise, white, *, drones=4, seconds=150.0, size=6.0, hold=2.0, seed=1):
    """Logs of bodies that follow random steps, stepped finely by their equation of motion; no engine, no filter."""
    g = np.random.default_rng(seed)
    count, fine = round(seconds / STEP), 10
    dt = STEP / fine
    every = round(hold / STEP)
    wishes = g.uniform(-size, size, (count // every + 1, 2, drones)).repeat(every, axis=0)[:count]
    v, seen = np.zeros((2, drones)), np.zeros((count, 2, drones))
    for k in range(count):
        seen[k] = v + g.normal(0.0, white, v.shape)
        for _ in range(fine):
            pull = (wishes[k] - v) / tau
            pull *= np.minimum(1.0, a_max / np.maximum(np.linalg.norm(pull, axis=0), 1e-12))
            v = v + pull * dt + g.normal(0.0, np.sqrt(2.0 * noise * dt), v.shape)
    time = np.tile(np.arange(count) * STEP, drones)
    who = np.repeat(np.arange(drones), count)
    flat = [x.transpose(2, 0, 1).reshape(-1, 2) for x in (seen, wishes)]
    new = np.concatenate([[True], np.diff(who) != 0])
    return FlightLogs(
        time, 0.0 * flat[0], *flat, who, new, [f"d{i}" for i in range(drones)], np.zeros(len(time), bool)
    ), dt


@pytest.mark.parametrize("tau, a_max, noise, white", [(0.4, 3.0, 0.05, 0.1), (1.2, 2.5, 0.3, 0.02)])
def test_the_body_comes_back_through_the_noise_of_the_log(tau, a_max, noise, white):
    logs, dt = fly(tau, a_max, noise, white)
    found = body.fit_body(logs, dt)
    for name, truth in {"tau": tau, "a_max": a_max, "noise": noise, "white": white}.items():
        low, high = found.intervals[name]
        assert low - (high - low) < truth < high + (high - low), name  # three standard errors and a bit
        assert high / low < 1.25 or name == "white", name
    assert not found.refused
    assert found.second_tau == pytest.approx(tau, rel=0.15)


def test_an_acceleration_that_was_never_reached_is_a_bound_only():
    logs, dt = fly(0.8, 30.0, 0.05, 0.1, size=1.0)
    found = body.fit_body(logs, dt)
    assert "at least" in found.refused["a_max"] and "fly larger steps" in found.refused["a_max"]
    assert "tau" not in found.refused


@pytest.mark.parametrize("size", [2.9, 3.2])
def test_a_limit_that_hides_behind_a_longer_lag_is_no_lower_bound_above_itself(size):
    """Few rows at the limit look like a longer lag without one: a descent stays there, and asks for more than flies."""
    logs, dt = fly(1.3, 3.5, 0.3, 0.1, size=size, seed=2)
    found = body.fit_body(logs, dt)
    assert "at least" in found.refused["a_max"]
    assert 2.0 < found.seen < 3.5
    low, high = found.intervals["tau"]
    assert low < 1.3 < high


@pytest.mark.parametrize(("follows", "off"), [(0.95, 0.1), (-2.0, 0.08)])
def test_commands_computed_from_the_own_velocity_bend_the_lag_by_less(follows, off):
    """Each fourth row a command takes up what the log knows with noise: the lag is told 0.14 shorter, or 0.12 longer,
    where all rows count."""
    rng, tau, n, drones = np.random.default_rng(5), 1.0, 4000, 10
    speed, command = np.zeros((n, drones, 2)), np.zeros((n, drones, 2))
    keep = np.exp(-STEP / tau)
    for k in range(n - 1):
        command[k] = follows * speed[k] + rng.normal(0.0, 0.4, (drones, 2)) if k % 4 == 0 else command[k - 1]
        push = rng.normal(0.0, np.sqrt(0.1 * tau * (1.0 - keep**2)), (drones, 2))
        speed[k + 1] = command[k] + (speed[k] - command[k]) * keep + push
    measured = speed + rng.normal(0.0, 0.1, speed.shape)
    time, who = np.tile(STEP * np.arange(n - 1), drones), np.repeat(np.arange(drones), n - 1)
    flat = [x[:-1].transpose(1, 0, 2).reshape(-1, 2) for x in (measured, command)]
    names, new = [f"d{i}" for i in range(drones)], np.diff(who, prepend=-1) != 0
    logs = FlightLogs(time, np.zeros_like(flat[0]), *flat, who, new, names, np.zeros(len(time), bool))
    assert body.fit_body(logs).value["tau"] == pytest.approx(tau, abs=off)


def test_commands_that_the_vehicle_runs_ahead_of_are_no_lag():
    """Feed-forward: the vehicle is where the set-point is, whatever its own lag."""
    g = np.random.default_rng(3)
    time = np.arange(4000) * STEP
    path = sum(g.normal(0, 1.0, 2) * np.sin(w * time[:, None] + g.uniform(0, 6, 2)) for w in (0.3, 0.7, 1.3, 2.1))
    seen = path + g.normal(0.0, 0.05, path.shape)
    new = np.arange(4000) == 0
    logs = FlightLogs(time, 0 * path, seen, path, np.zeros(4000, int), new, ["d"], np.zeros(4000, bool))
    found = body.fit_body(logs)
    assert set(found.refused) >= {"tau", "a_max", "noise"}


def late(logs, rows):
    """The same logs if each command had been given some rows earlier: the body follows it so much later."""
    command = logs.command.copy()
    for who in range(logs.drones):
        own = logs.of(who)
        command[own[:-rows]] = logs.command[own[rows:]]
    return replace(logs, command=command)


@pytest.mark.parametrize(
    ("tau", "delay", "a_max"), [(1.2, 0.4, 1e4), (1.2, 0.4, 2.5), (0.5, 0.3, 4.0), (0.4, 1.0, 6.0)]
)
def test_delay_and_lag_of_a_body_come_back_apart(tau, delay, a_max):
    """Of the response that was measured on ArduCopter, 0.40 s before a lag of 1.20 s, and of others."""
    logs, dt = fly(tau, a_max, 0.05, 0.05, drones=2)
    found = body.fit_body(late(logs, round(delay / STEP)), dt)
    low, high = found.intervals["delay"]
    assert found.value["delay"] == pytest.approx(delay, abs=0.02) and low - 0.01 < delay < high + 0.01
    assert found.value["tau"] == pytest.approx(tau, rel=0.05)
    assert not {"delay", "tau"} & set(found.refused)


def test_delay_of_a_log_with_many_gaps_comes_back_or_is_refused():
    """Stretches of 1.5 s know the command of 0.4 s ago; shorter ones do not, and nothing is made up."""
    logs, dt = fly(0.6, 4.0, 0.05, 0.05)
    shifted = late(logs, 8)
    for rows in (30, 12, 9, 6):
        gap = np.arange(len(logs.time)) % (rows + 3) < 3
        found = body.fit_body(shifted.select_rows(~gap), dt)
        if rows == 30:
            assert found.value["delay"] == pytest.approx(0.4, abs=0.03) and "delay" not in found.refused
        else:
            assert "log every row" in found.refused["delay"] and "tau" in found.refused


@pytest.mark.parametrize("size", [3.0, 8.0])
def test_commands_that_act_at_once_have_no_delay_and_leave_the_lag_as_it_was(size):
    logs, dt = fly(0.8, 4.0, 0.1, 0.1, size=size)
    found = body.fit_body(logs, dt)
    assert found.value["delay"] == 0.0 and 0.0 <= found.intervals["delay"][1] < 2.0 * STEP
    assert found.value["tau"] == pytest.approx(0.8, rel=0.1)


def test_measured_response_of_arducopter_is_that_of_its_limits_of_acceleration_and_jerk():
    """40 s of a flock in GUIDED mode at the defaults, WPNAV_ACCEL 2.5 m/s^2 and PSC_JERK_XY 5 m/s^3.

    Its controller turns the gap into an acceleration by jerk / accel, 2 1/s, so that a lag of 0.5 s is no surprise; the
    same velocities as one lag without limits would be a second late, and more than twice as far off.
    """
    table = pd.read_csv(Path(__file__).parents[1] / "arducopter_guided.csv", comment="#").to_numpy() * 1e-3
    time, seen, wish = table[:, 0], table[:, 1:3], table[:, 3:5]
    new = np.arange(len(time)) == 0
    logs = FlightLogs(time, 0.0 * seen, seen, wish, np.zeros(len(time), int), new, ["d"], np.zeros(len(time), bool))
    found = body.fit_body(logs)
    assert 0.05 < found.value["delay"] < 0.25 and 0.4 < found.value["tau"] < 0.55
    assert "at least 2.3" in found.refused["a_max"] and 2.0 < found.value["a_max"] < 2.6

    def flown(delay, tau, a_max, jerk, dt=0.01):
        speed, pull, off = seen[0].copy(), np.zeros(2), []
        for k in range(1, len(time)):
            for t in np.arange(time[k - 1], time[k] - 1e-9, dt):
                gap = (wish[max(np.searchsorted(time, t - delay, side="right") - 1, 0)] - speed) / tau
                gap *= min(1.0, a_max / max(np.linalg.norm(gap), 1e-9))
                change = gap - pull
                pull = pull + change * min(1.0, jerk * dt / max(np.linalg.norm(change), 1e-9))
                speed = speed + pull * dt
            off.append(speed - seen[k])
        return float(np.sqrt((np.array(off) ** 2).sum(axis=1).mean()))

    free = 1e9
    limited, lag = (
        flown(0.1, 0.5, 2.5, 5.0),
        min(flown(d, tau, free, free) for d in (0.2, 0.4) for tau in (0.8, 1.0, 1.2)),
    )
    assert limited < 0.15 and lag > 2.0 * limited


@pytest.mark.parametrize("seed", range(4))
def test_delay_is_refused_or_right_where_a_flight_in_gusts_has_no_steps(seed):
    """Of a body that turns once a minute or two, gusts tell the lag, but nothing tells the delay."""
    g, tau, rows = np.random.default_rng(seed), 1.2, 8
    time = STEP * np.arange(6000)
    wish = 4.0 * np.stack([np.cos(0.05 * time), np.sin(0.05 * time)], axis=1)
    speed = wish.copy()
    for k in range(len(time) - 1):
        pull = (wish[max(k - rows, 0)] - speed[k]) / tau
        speed[k + 1] = speed[k] + STEP * pull + g.normal(0.0, np.sqrt(2.0 * 0.3 * STEP), 2)
    seen = speed + g.normal(0.0, 0.1, speed.shape)
    new = np.arange(len(time)) == 0
    logs = FlightLogs(time, 0.0 * seen, seen, wish, np.zeros(len(time), int), new, ["d"], np.zeros(len(time), bool))
    found = body.fit_body(logs)
    low, high = found.intervals["delay"]
    assert "fly velocity steps" in found.refused.get("delay", "") or low < rows * STEP < high
    low, high = found.intervals["tau"]
    assert "tau" in found.refused or low - 0.1 < tau < high + 0.1


def test_words_of_arrays_are_the_words_of_the_engine():
    agents = np.arange(7)
    many = synthetic.agent_words(2**40 + 5, random.SENSOR, 9, agents)
    for agent in range(7):
        one = random.random_words(2**40 + 5, random.SENSOR, 0, 9, agent)
        assert [int(w[agent]) for w in many] == list(one)
        first = synthetic.normal_pair(many[0], many[1])
        np.testing.assert_allclose([x[agent] for x in first], random.normal_pair(one[0], one[1]), rtol=1e-12)


def test_the_error_of_navigation_comes_back_from_drones_that_stand():
    truth = langevin.Parameters(noise=0.02, damping=0.15, scale=4.0)
    g = np.random.default_rng(5)
    logs = synthetic.standing_logs(11, 10, 300.0, truth, synthetic.LogDisturbance(white=0.05), g)
    found = standing.fit_sensors(logs, truth.period)
    assert not found.refused
    for name in ("noise", "damping", "scale"):
        low, high = found.intervals[name]
        assert low - (high - low) < getattr(truth, name) < high + (high - low)
    assert found.value["white"] == pytest.approx(0.05, rel=0.15)
    short = standing.fit_sensors(
        synthetic.standing_logs(11, 2, 10.0, truth, synthetic.LogDisturbance(), g), truth.period
    )
    assert "stand still" in short.refused["noise"]


def differences_loss(q, u, h, noise, damping, scale, white, grain):
    """Negative log-likelihood of what does not depend on the place: differences of positions, and velocities."""
    spring = np.sqrt(2.0 * damping * noise) / scale
    step = np.array([[1.0 - h * h * spring, h * (1.0 - damping * h)], [-h * spring, 1.0 - damping * h]])
    push = 2.0 * damping * h * noise * np.array([[h * h, h], [h, 1.0]])
    n, p = len(q), np.diag([scale * np.sqrt(noise / (2.0 * damping)), noise])
    blocks = np.zeros((n, n, 2, 2))
    for k in range(n):
        blocks[k, k], later = p, p
        for j in range(k + 1, n):
            later = step @ later
            blocks[j, k], blocks[k, j] = later, later.T
        p = step @ p @ step.T + push
    covariance = blocks.transpose(0, 2, 1, 3).reshape(2 * n, 2 * n)
    covariance += np.diag(np.tile([grain**2, white**2 + 1e-12], n))
    contrasts = np.zeros((2 * n - 1, 2 * n))
    for k in range(n - 1):
        contrasts[k, [2 * k, 2 * k + 2]] = -1.0, 1.0
    contrasts[np.arange(n - 1, 2 * n - 1), 2 * np.arange(n) + 1] = 1.0
    y, c = contrasts @ np.stack([q, u], axis=1).ravel(), contrasts @ covariance @ contrasts.T
    return 0.5 * np.linalg.slogdet(c)[1] + 0.5 * y @ np.linalg.solve(c, y)


def test_where_a_drone_stands_says_nothing_of_its_sensor():
    g = np.random.default_rng(3)
    q, u = 7.0 + np.cumsum(g.normal(0.0, 0.02, 40)), g.normal(0.0, 0.1, 40)
    first = np.arange(40) == 0
    here, there = (0.004, 0.1, 3.0, 0.05), (0.02, 0.2, 2.0, 0.1)
    ours = [standing._sensor_kernel()(q, u, first, 0.2, *numbers, 0.01) for numbers in (here, there)]
    truth = [differences_loss(q, u, 0.2, *numbers, 0.01) for numbers in (here, there)]
    assert ours[0] - ours[1] == pytest.approx(truth[0] - truth[1], abs=1e-3)


def hill(numbers, widths):
    """Loss of a normal likelihood of near, far and the two shares."""
    return lambda z: 0.5 * float((((np.array(hills.unpack(z)) - numbers) / widths) ** 2).sum())


def test_the_highest_of_two_hills_of_a_radio_is_found_though_the_other_is_wider():
    low = hill(np.array([28.0, 75.0, 0.91, 0.33]), np.array([3.0, 12.0, 0.03, 0.1]))
    high = hill(np.array([26.0, 58.0, 0.91, 0.45]), np.array([3.0, 3.0, 0.03, 0.1]))
    best, *others = hills.best_mode(lambda z: min(low(z) + 5.0, high(z)), 300.0)
    assert hills.unpack(best) == pytest.approx((26.0, 58.0, 0.91, 0.45), rel=0.01)
    assert not others  # the lower one is not nearly as likely


def test_a_higher_hill_between_two_lengths_that_are_tried_is_found_and_both_are_told():
    widths = np.array([0.4, 1.0, 0.003, 0.02])
    low = hill(np.array([29.2, 41.8, 0.98, 0.69]), widths)
    high = hill(np.array([29.3, 51.3, 0.98, 0.46]), widths * (1.0, 1.4, 1.0, 1.0))
    found = hills.best_mode(lambda z: min(low(z) + 1.2, high(z)), 268.0)
    fars = [hills.unpack(z)[1] for z in found]
    assert fars == pytest.approx([51.3, 41.8], rel=0.01)


def test_intervals_follow_a_bent_ridge_to_its_ends():
    # far by itself is known to 6 m, far squared times the share there to 1 %
    def loss(z):
        near, far, high, low = hills.unpack(z)
        rest = ((near - 25.0) / 1.0) ** 2 + ((high - 0.9) / 0.01) ** 2
        return 0.5 * (rest + ((far - 60.0) / 6.0) ** 2 + (np.log(far * far * low / 1080.0) / 0.01) ** 2)

    found = hills.profile_intervals(loss, hills.pack(25.0, 60.0, 0.9, 0.3))
    assert found["far"] == pytest.approx((60.0 - 11.76, 60.0 + 11.76), abs=0.4)
    assert found["received_far"] == pytest.approx((1080.0 / 71.76**2, 1080.0 / 48.24**2), rel=0.03)


def test_intervals_are_those_of_the_profile():
    numbers, widths = np.array([25.0, 60.0, 0.9, 0.3]), np.array([1.0, 2.0, 0.01, 0.03])
    top = hills.pack_at_far(60.0, [np.log(25.0 / 35.0), np.log(0.9 / 0.1), np.log((0.3 / 0.9) / (1.0 - 0.3 / 0.9))])
    assert hills.unpack(top) == pytest.approx(numbers)
    for (low, high), value, width in zip(
        hills.profile_intervals(hill(numbers, widths), top).values(), numbers, widths, strict=True
    ):
        assert (low, high) == pytest.approx((value - 1.96 * width, value + 1.96 * width), abs=0.05 * width)

    # all of 100 packets came: a share p says log(p) each, so that 100 log(p) = -1.92 at the lower end
    def all_came(z):
        near, far, share, other = hills.unpack(z)
        return -100.0 * np.log(share) + hill(numbers, np.array([1.0, 2.0, np.inf, 0.03]))(z)

    certain = np.array([*top[:2], 9.0, np.log(0.3 / 0.7)])
    low, high = hills.profile_intervals(all_came, certain)["received_near"]
    assert low == pytest.approx(np.exp(-0.0192), abs=2e-3) and high > 0.9995


def heard_by(k, count=60_000, delay=0.4, jitter=0.02, seed=2, drones=6):
    """Packets by the reception law itself, with clocks that differ by seconds."""
    g = np.random.default_rng(seed)
    ahead = g.normal(0.0, 3.0, drones)
    i = g.integers(0, drones, count)
    j = (i + g.integers(1, drones, count)) % drones
    d = g.uniform(0.0, 150.0, count)
    fast = np.array([links.received(x, 0.0, k) for x in d])
    slow = np.array([links.received(x, 1.0, k) for x in d])
    missed = (1.0 - fast) ** 2 * np.where(g.random(count) < 0.2, 1.0 - slow, 1.0)
    sent = g.uniform(0.0, 300.0, count)
    t = sent + delay + ahead[i] + g.normal(0.0, jitter, count)
    return pd.DataFrame({"receiver": i, "sender": j, "t": t, "stamp": sent + ahead[j], "distance": d,
                         "got": (g.random(count) >= missed).astype(int)}), ahead  # fmt: skip


def test_delay_and_clocks_come_back_from_packets_of_both_directions():
    heard, ahead = heard_by(links.Parameters(kind="links"))
    found = packets.fit_delay(heard)
    assert found.value == pytest.approx(0.4, rel=0.02) and found.interval[0] < 0.4 < found.interval[1]
    assert found.scatter == pytest.approx(0.02, rel=0.1)
    for name, offset in found.ahead.items():
        assert offset == pytest.approx(ahead[int(name)] - ahead.mean(), abs=0.005)
    one_way = heard[heard["receiver"] < heard["sender"]]
    assert "one direction only" in packets.fit_delay(one_way).reason


def test_what_is_wrong_with_a_table_of_packets_is_told_by_column_and_row(tmp_path):
    """Words, nan and inf ended in a fault of the program; microseconds were taken for seconds."""
    heard = heard_by(links.Parameters(kind="links"), count=3000)[0]
    wrong = heard.astype({"t": object, "got": int})
    wrong.loc[10, "t"] = "soon"
    wrong.loc[11, "distance"] = np.inf
    wrong.loc[12, "got"] = 3
    wrong.loc[10, "got"] = 1
    wrong.to_csv(tmp_path / "heard.csv", index=False)
    with pytest.raises(RecordingError) as fault:
        read_heard(tmp_path / "heard.csv")
    assert str(fault.value).splitlines() == [
        f"{tmp_path}/heard.csv: column t, row 12: soon is not a number",
        f"{tmp_path}/heard.csv: column distance, row 13: inf is not a number",
        f"{tmp_path}/heard.csv: column got, row 14: 3 is not 0 or 1",
    ]
    with pytest.raises(RecordingError, match="give t and stamp in s: divide them by 1e6"):
        packets.check_packets(heard.assign(t=1e6 * heard["t"], stamp=1e6 * heard["stamp"]))
    unheard = heard.assign(stamp=heard["stamp"].where(heard["got"] > 0))  # what never came has no stamp
    assert len(packets.check_packets(unheard)) == len(heard)
    heard.to_csv(tmp_path / "comma.csv", index=False, sep=";", decimal=",")
    with pytest.raises(RecordingError, match="has ; between its columns"):
        read_heard(tmp_path / "comma.csv")
    with pytest.raises(RecordingError, match="none.csv: no such file"):
        read_heard(tmp_path / "none.csv")


def test_the_curve_of_reception_comes_back():
    k = links.Parameters(kind="links", near=22.0, far=55.0, received_near=0.95, received_far=0.35)
    found = packets.fit_links(heard_by(k)[0], 0.2, k)
    assert not found.refused
    for name in CURVE_PARAMETERS:
        low, high = found.intervals[name]
        assert low - (high - low) < getattr(k, name) < high + (high - low)
    near = heard_by(k)[0]
    near = near[near["distance"] < 40.0]
    assert {"far", "received_far"} <= set(packets.fit_links(near, 0.2, k).refused)  # both lie beyond what was flown


def pairs_by_sequence(seed, k, drones=3, rate=10.0, seconds=600.0):
    """Logs of drones that swing apart and together, and the packets that came: rx, tx, seq and two times."""
    g = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 0.1)
    swing = [0.5 * (d - 1) * (70.0 + 65.0 * np.sin(0.05 * time)) for d in range(drones)]
    names = [f"d{d}" for d in range(drones)]
    place = np.concatenate([np.stack([x, np.zeros_like(x)], axis=1) for x in swing])
    who = np.repeat(np.arange(drones), len(time))
    none = np.full_like(place, np.nan)
    logs = FlightLogs(np.tile(time, drones), place, none, none, who, np.tile(time == 0.0, drones), names, who < 0)
    ahead, rows, every = g.normal(0.0, 2.0, drones), [], []
    for sender in range(drones):
        sent = np.arange(0.5, seconds - 1.0, 1.0 / rate)
        for receiver in (d for d in range(drones) if d != sender):
            apart = np.abs(np.interp(sent, time, swing[sender]) - np.interp(sent, time, swing[receiver]))
            came = g.random(len(sent)) < [links.received(d, 0.0, k) for d in apart]
            every.append(pd.DataFrame({"distance": apart, "got": came.astype(float), "fast": 1.0, "slow": 0.0}))
            part = {"rx": names[receiver], "tx": names[sender], "seq": np.arange(len(sent)) % 4096,
                    "t_rx": sent + 0.05 + ahead[receiver], "t_tx": sent + ahead[sender]}  # fmt: skip
            rows.append(pd.DataFrame(part)[came])
    logs = replace(logs, time=logs.time + ahead[who])
    return logs, pd.concat(rows, ignore_index=True), pd.concat(every, ignore_index=True)


@pytest.mark.parametrize("seed", range(3))
def test_gaps_of_a_counter_are_losses_and_distances_come_from_the_positions(seed):
    k = links.Parameters(kind="links", near=25.0, far=70.0, received_near=0.95, received_far=0.4)
    logs, came, every = pairs_by_sequence(seed, k)
    heard = packets.check_packets(came)
    aligned, comparable = _on_one_clock(logs, heard)
    found, notes = packets.lost_by_sequence(heard, aligned, comparable)
    assert "losses from gaps of seq" in notes[0] and "seq starts again" in notes[1]  # the counter ends at 4096
    # what is lost before the first and after the last packet that came, and where the counter starts again, is unknown
    assert 0.99 * len(every) <= len(found) <= len(every)
    assert found["got"].sum() == every["got"].sum() and found["distance"].max() < every["distance"].max() + 0.1
    for low in range(0, 130, 10):  # by distance, the same shares as were drawn
        own, truth = (t["got"][(t["distance"] >= low) & (t["distance"] < low + 10)] for t in (found, every))
        assert own.mean() == pytest.approx(truth.mean(), abs=0.02), (seed, low)
    curve = packets.fit_links(found, 0.1, k)
    assert abs(curve.value["far"] / 70.0 - 1.0) < 0.15, (seed, curve.value)


def test_clocks_of_their_own_are_noted_and_agreeing_ones_are_not():
    logs, came, _ = pairs_by_sequence(1, links.Parameters(kind="links"))
    assert packets.clocks_apart(packets.fit_delay(packets.check_packets(came))) > 0.1
    agreeing = came.assign(t_tx=came["seq"] / 10.0, t_rx=came["seq"] / 10.0 + 0.05)
    assert packets.clocks_apart(packets.fit_delay(packets.check_packets(agreeing))) == 0.0


@pytest.mark.parametrize("error", [0.0, 3.0])
def test_the_end_of_the_range_is_not_taken_for_the_curve(error):
    """Nothing is heard beyond 80 m: `far` came out at 82 ± 1 m instead of 50, without a word."""
    k = links.Parameters(kind="links", near=20.0, far=50.0, received_near=0.95, received_far=0.4)
    heard = heard_by(k)[0]
    heard.loc[heard["distance"] > 80.0, "got"] = 0
    heard["distance"] = np.abs(heard["distance"] + np.random.default_rng(1).normal(0.0, error, len(heard)))
    found = packets.fit_links(heard, 0.2, k)
    assert found.notes[0].startswith("no packet from beyond")
    for name in set(CURVE_PARAMETERS) - set(found.refused):
        assert found.value[name] == pytest.approx(getattr(k, name), rel=0.12), name
    assert not packets.fit_links(heard_by(k)[0], 0.2, k).notes  # no range, and none is made up
    assert not packets.fit_links(heard[heard["distance"] < 70.0], 0.2, k).notes


def test_entries_of_a_table_come_back_within_their_intervals():
    """Of 40 tables' 320 entries about one in twenty lies outside; an entry without packets has no error."""
    rng, outside = np.random.default_rng(4), 0
    shares = np.linspace(0.95, 0.2, 8)
    for _ in range(40):
        distance = rng.uniform(0.0, 70.0, 4000)
        got = (rng.random(4000) < np.interp(distance / 10.0, np.arange(8), shares)).astype(int)
        found, errors = packets.fit_table(pd.DataFrame({"distance": distance, "got": got}), 10.0)
        assert np.isnan(errors[8:]).all() and found[15] == found[7]
        outside += int((np.abs(found[:8] - shares) > 1.96 * errors[:8]).sum())
    assert 5 <= outside <= 32


def test_identify_writes_a_table_where_the_radio_is_one():
    """Told is what pairs flew; what is farther stays as --like has it."""
    truth = airflock.load("vasarhelyi_2018/real_6ms", {"radio.kind": "links", "radio.range": 250.0})
    logs, _ = fly(0.6, 4.0, 0.05, 0.1, seconds=60.0)  # few: the radio alone matters here
    like = airflock.load("vasarhelyi_2018/real_6ms", {"radio.kind": "table", "radio.spacing": 20.0})
    heard, _ = heard_by(truth.radio)
    found = identify(logs, like, heard=heard)
    told = {key: number for key, number in found.numbers.items() if key.startswith("radio.received_")}
    known = packets.table_entries(heard, 20.0)
    assert list(told) == [f"radio.received_{n}" for n in range(16)] and "radio.near" not in found.numbers
    assert [n for n in range(16) if told[f"radio.received_{n}"].told] == list(range(9))  # up to 150 m
    assert all(told[f"radio.received_{n}"].value == known[f"received_{n}"] for n in range(9))
    assert "no pair flew within 20 m of 300 m apart" in told["radio.received_15"].reason
    flown = found.scenario().radio
    assert flown.received_3 == known["received_3"] and flown.received_15 == like.radio.received_15
    entry = found.document(uncertain=True)["radio"]["received_3"]
    assert entry["interval"][0] < entry["value"] < entry["interval"][1]
    assert found.scenario(0.9).radio.received_3 < flown.received_3  # the pessimistic end hears less


def test_the_period_of_decisions_comes_back():
    logs, _ = fly(0.6, 4.0, 0.05, 0.1, hold=0.2, seconds=60.0)
    period, (low, high), reason = periods.decision_period(logs)
    assert not reason and period == pytest.approx(0.2, rel=1e-3) and low <= 0.2 + 1e-9 and high >= 0.2 - 1e-9
    every_row, _ = fly(0.6, 4.0, 0.05, 0.1, hold=STEP, seconds=60.0)
    assert "no faster than decisions" in periods.decision_period(every_row)[2]
    limited = logs.command.copy()  # by a node that limits accelerations at each tick: 2 of 10 rows have nothing new
    for k in range(1, len(limited)):
        limited[k] = limited[k - 1] if k % 5 == 0 else limited[k - 1] + np.clip(limited[k] - limited[k - 1], -0.1, 0.1)
    assert "no faster than decisions" in periods.decision_period(replace(logs, command=limited))[2]


def test_largest_speed_of_a_law_in_the_plane_is_without_the_climb_that_keeps_its_height():
    logs, _ = fly(0.6, 4.0, 0.05, 0.1, seconds=60.0)
    angle = 0.3 * logs.time
    climb = np.where(logs.time < 20.0, 2.0, 0.0)
    command = np.stack([6.0 * np.cos(angle), 6.0 * np.sin(angle), climb], axis=1)
    whole = replace(logs, command=command, velocity=np.zeros_like(command))
    assert periods.largest_command(whole, axes=2) == (pytest.approx(6.0), "")
    assert periods.largest_command(whole)[0] == pytest.approx(np.hypot(6.0, 2.0))


@pytest.fixture(scope="module")
def fleet():
    """One fleet, flown by the engine and logged with noise, lost rows and wrong clocks."""
    numbers = {"body.tau": 0.6, "body.a_max": 4.0, "body.noise": 0.1, "radio.delay": 0.4, "radio.kind": "links"}
    extra = {"agents": 10, "duration": 150.0, "radio.range": 250.0, "metrics.period": STEP}
    truth = airflock.load("vasarhelyi_2018/real_6ms", {**extra, **numbers})
    logger = synthetic.LogDisturbance(white=0.1, stamp_jitter=0.02)
    with pytest.MonkeyPatch.context() as precisely:  # by the driver of the tests against hand-written C
        precisely.setattr(synthetic, "simulate", partial(synthetic.simulate, precision=64))
        logs, heard, recording = synthetic.fly_logs(truth, 3, logger, np.random.default_rng(3))
    like = airflock.load("vasarhelyi_2018/real_6ms", {"radio.kind": "links", "radio.range": 250.0})
    return truth, identify(logs, like, heard=heard), recording


def test_a_fleet_is_identified_from_its_logs(fleet):
    truth, found, _ = fleet
    bounds = {"body.tau": 0.05, "body.a_max": 0.15, "body.noise": 0.2, "radio.delay": 0.02, "sensors.period": 0.01,
              "radio.near": 0.3}  # fmt: skip
    for key, bound in bounds.items():
        section, name = key.split(".")
        assert found.numbers[key].told or key == "radio.near", found.numbers[key].reason
        assert found.numbers[key].value == pytest.approx(getattr(getattr(truth, section), name), rel=bound), key
    far = found.numbers["radio.far"]  # hardly a pair flew so far apart: told or refused, its interval holds the truth
    assert far.low < truth.radio.far < far.high and (far.told or "fly more" in far.reason)
    curve = [found.numbers[f"radio.{name}"] for name in CURVE_PARAMETERS]  # with a default for one, three are wrong
    assert len({each.told for each in curve}) == 1 and all(each.told or each.reason for each in curve)
    assert found.log_noise == pytest.approx(0.1, rel=0.1)
    assert "on the ground" in found.numbers["sensors.noise"].reason
    assert "preferred speed" in found.numbers["model.v_max"].reason or not found.numbers["model.v_max"].told
    assert found.has_one_clock and any("packets" in note for note in found.notes)


def test_the_file_that_identify_writes_flies_with_those_numbers(fleet, tmp_path):
    import tomlkit

    _, found, _ = fleet
    (tmp_path / "mine.toml").write_text(tomlkit.dumps(found.document(uncertain=True)))
    back = airflock.load(str(tmp_path / "mine.toml"))
    assert back.body.tau == pytest.approx(found.numbers["body.tau"].value, rel=1e-3)
    low, high = back.document["body"]["tau"]["interval"]
    assert low < back.body.tau < high and back.document["body"]["tau"]["unit"] == "s"
    assert not back.published
    text = tomlkit.dumps(found.document(uncertain=True)).replace(f"interval = [{low}", "interval = [99.0")
    (tmp_path / "odd.toml").write_text(text)
    with pytest.raises(ScenarioError, match=r"body.tau: interval = \[99.0, .*\] is not \[low, high\]"):
        airflock.load(str(tmp_path / "odd.toml"))


def test_every_number_that_identify_tells_has_the_unit_of_the_scenario(fleet, tmp_path):
    """A file with `sensors.scale`, in m, could be written and not flown."""
    import tomlkit

    truth, found, _ = fleet
    for key, unit in KEY_UNITS.items():
        section, name = key.split(".")
        record = truth.records[section]
        declared = {name: one.unit for name, one, _ in declarations(record) if isinstance(one, Quantity)}
        assert unit == declared.get(name, unit), key
    numbers = {key: replace(one, reason="", value=known) for key, one in found.numbers.items() if (known := one.like)}
    numbers = {key: replace(one, low=0.9 * one.value, high=1.1 * one.value) for key, one in numbers.items()}
    whole = replace(found, numbers=numbers)
    (tmp_path / "whole.toml").write_text(tomlkit.dumps(whole.document(uncertain=True)))
    back = airflock.load(str(tmp_path / "whole.toml"))
    assert "sensors.scale" in numbers and back.sensors.scale == pytest.approx(truth.sensors.scale)


def test_conservative_numbers_make_a_flight_harder(fleet):
    _, found, _ = fleet
    plain, hard, harder = found.settings(), found.settings(0.95), found.settings(0.999)
    for key in plain:
        sign = 1.0 if HARDER[key] else -1.0
        assert sign * plain[key] <= sign * hard[key] + 1e-12 <= sign * harder[key] + 2e-12, key
    assert set(HARDER) == set(KEY_UNITS)
    assert IdentifiedParameter("radio.received_near", 0.98, 0.97, 0.99, 0.9, "").pessimistic_end(0.95) == pytest.approx(
        0.97
    )


def test_recordings_can_be_identified_and_need_commands(fleet):
    _, _, recording = fleet
    logs = logs_from_recording(recording)
    assert logs.drones == 10 and logs.is_new.sum() == 10 and logs.step == pytest.approx(STEP)
    with pytest.raises(RecordingError, match="no command"):
        logs_from_recording(recording.drop_vars("command"))


def test_the_flight_card_lists_every_number_and_takes_ten_minutes():
    card = flight_card(airflock.load("vasarhelyi_2018/real_6ms"))
    tabled = flight_card(airflock.load("vasarhelyi_2018/real_6ms", {"radio.kind": "table"}))
    told, told_of_table = ({key for part in each for key in part.keys} for each in (card, tabled))
    assert told | told_of_table == set(KEY_UNITS) and told_of_table - told == set(packets.TABLE_KEYS)
    assert sum(part.seconds for part in card) < 660.0


def test_all_faults_of_the_command_are_told_at_once(tmp_path):
    (tmp_path / "a.csv").write_text("t,x,y\n0,1,2\n1,2,3\n")
    command = ["identify", tmp_path / "a.csv"]
    wrong = ["--like", "vasarhelyi_2018/real_5ms", "--standing", "5", "--conservative", "2", "--out", "mine.txt"]
    done = called(*command, *wrong)
    lines = done.stderr.splitlines()
    assert done.returncode == 2 and len(lines) == 4 and all(line.startswith("airflock: ") for line in lines)
    assert any("did you mean vasarhelyi_2018/real_" in line for line in lines)
    done = called(*command, "--like", "vasarhelyi_2018/real_6ms")
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1
    assert "a.csv: a has no velocity" in done.stderr


def test_logs_without_commands_say_so_and_write_nothing(tmp_path):
    t = np.arange(0.0, 30.0, 0.05)
    columns = {"t": t, "x": np.sin(t), "y": np.cos(t), "vx": np.cos(t), "vy": -np.sin(t)}
    pd.DataFrame(columns).to_csv(tmp_path / "log.csv", index=False)
    out = tmp_path / "mine.toml"
    done = called("identify", tmp_path / "log.csv", "--like", "vasarhelyi_2018/real_6ms", "--out", out)
    lines = done.stderr.splitlines()
    assert done.returncode == 2 and not out.exists() and "no number can be identified" in done.stderr
    assert len({line.partition(": ")[2].partition(": ")[2] for line in lines}) == len(lines)  # each reason once
    body = [line for line in lines if "body.tau, body.a_max, body.noise: " in line]
    assert len(body) == 1 and "--map cx:=COLUMN" in body[0]


def test_the_table_says_where_each_number_is_from(capsys):
    from airflock.cli.terminal import print_result

    logs, _ = fly(0.5, 4.0, 0.05, 0.05, drones=2)
    print_result(identify(logs, "vasarhelyi_2018/real_6ms"))
    told = capsys.readouterr().out
    assert "from" in told and " rows, " in told and "radio.delay, radio.near" in told


def test_the_command_prints_one_json_object(tmp_path):
    logs, _ = fly(0.5, 4.0, 0.05, 0.05, drones=2)
    columns = {"t": logs.time, "x": np.cumsum(logs.velocity[:, 0]) * STEP, "y": np.cumsum(logs.velocity[:, 1]) * STEP}
    for axis, name in enumerate("xy"):
        columns |= {f"v{name}": logs.velocity[:, axis], f"c{name}": logs.command[:, axis]}
    pd.DataFrame(columns).assign(id=logs.who).to_csv(tmp_path / "log.csv", index=False)
    arguments = ["--like", "vasarhelyi_2018/real_6ms", "--check", "0", "--json", "--accept", "jumps"]
    done = called("identify", tmp_path / "log.csv", *arguments)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["numbers"]["body.tau"]["value"] == pytest.approx(0.5, rel=0.1)
    assert found["numbers"]["radio.delay"]["value"] is None and "--heard" in found["numbers"]["radio.delay"]["reason"]
