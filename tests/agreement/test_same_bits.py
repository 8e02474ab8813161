"""Same seed, same bits; a new source of noise shifts no other; skipped collision checks change nothing."""

import hashlib
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from airflock.engine import fly_world, plan_of
from airflock.support.threads import run_in_threads
from flocks import flown, interpreted, scenario
from inside import cpu, flight_driver, tables

PAPER = {
    "agents": 30, "duration": 20.0, "world__side": 120.0, "world__walls": "nearest_per_axis", "start__separation": 6.0,
}  # fmt: skip
FRESH = """
import hashlib
from airflock.engine import fly_world as fly
from airflock.scenarios.scenario_builder import build_scenario
settings = {settings!r}
found = build_scenario({{"model": {{"kind": "vasarhelyi_2018"}}}}, "test", settings)
print(hashlib.sha256(fly(found, {seed}, record=True).frames.tobytes()).hexdigest())
"""


def digest(frames):
    return hashlib.sha256(frames.tobytes()).hexdigest()


@pytest.mark.parametrize("threads", [1, 2, 7])
def test_the_number_of_threads_changes_no_bit(threads, seed):
    found = scenario(**PAPER)
    jobs = [lambda s=s: digest(fly_world(found, seed + s, record=True).frames) for s in range(8)]
    alone = [job() for job in jobs]
    assert list(run_in_threads(jobs, threads)) == alone
    assert len(set(alone)) == len(alone)  # seeds differ


def test_a_fresh_process_gives_the_same_bits(seed):
    settings = {key.replace("__", "."): value for key, value in PAPER.items()}
    code = FRESH.format(settings=settings, seed=seed)
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == digest(flown(scenario(**PAPER), seed, precision=32).frames)


SMALL = {"agents": 5, "duration": 3.0, "world__side": 60.0}


@pytest.mark.parametrize(
    "settings",
    [
        {"wind__gust": 5.0, "body__drag": 0.0},  # gusts blow, but push nobody
        {"radio__loss": 1e-12},  # packets may be lost, but none is
        {"metrics__collision_period": 0.05},
    ],
)
def test_a_new_source_of_noise_shifts_no_other(settings, seed):
    """By the text of the drivers, of which each has the lines for its own noise only."""
    plain, more = interpreted(scenario(**SMALL), seed), interpreted(scenario(**SMALL, **settings), seed)
    np.testing.assert_array_equal(plain.frames, more.frames)


def test_agents_keep_their_noise_when_others_join(seed):
    """Far apart, deaf and blown only by noise of their own, the first agents fly the same in a larger flock."""
    keys = {"duration": 3.0, "world__side": 1e5, "radio__range": 1.0}
    three, five = (interpreted(scenario(**keys, agents=n), seed).frames for n in (3, 5))
    np.testing.assert_array_equal(three, five[:, :, :3])


def test_recording_a_flight_changes_nothing_and_takes_no_driver_of_its_own(seed):
    found = scenario(**SMALL)
    plain, recorded = (plan_of(found, precision=64, record=record) for record in (False, True))
    assert flight_driver(plain) is flight_driver(recorded)
    alone, kept = (cpu.fly_on_cpu(plan, tables(found, plan, seed), device="python") for plan in (plain, recorded))
    assert alone.frames is None and kept.frames is not None
    np.testing.assert_array_equal(alone.state, kept.state)
    np.testing.assert_array_equal(alone.state, kept.frames[-1][: len(alone.state)])
    assert alone.values == kept.values


def test_skipped_collision_checks_change_nothing(seed):
    """Against a driver that looks at all pairs at every step."""
    plan = plan_of(scenario(**PAPER), record=True)
    watchful = replace(plan, metrics=tuple(replace(metric, within=None) for metric in plan.metrics))
    events = []
    for s in range(12):
        r_coll = (4.0, 6.0, 12.0)[s % 3]
        table = tables(scenario(**PAPER | {"duration": 60.0, "metrics__r_coll": r_coll}), plan, seed + s)
        skipping, looking = cpu.fly_on_cpu(plan, table), cpu.fly_on_cpu(watchful, table)
        np.testing.assert_array_equal(skipping.frames, looking.frames)
        assert skipping.values["n_coll"] == looking.values["n_coll"]
        assert skipping.values["phi_coll"] == looking.values["phi_coll"]
        events.append(looking.values["n_coll"])
    assert min(events[2::3]) > 0.0  # there was something to miss
