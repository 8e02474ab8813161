"""A GPU flies what the CPU flies. Skipped without a GPU; set AIRFLOCK_NEED_GPU where there must be one."""

from dataclasses import replace

import numpy as np
import pytest

from airflock.engine import plan_of, score_flights
from airflock.scenarios.files import load
from airflock.support.errors import DeviceError
from flocks import scenario
from inside import cpu, tables

pytestmark = pytest.mark.gpu


def both(found, seeds, precision=64, **layout):
    """Flights of the CPU and of the GPU."""
    from inside import fly_many, layout_of

    plan = plan_of(found, precision=precision, record=True, grid=False)
    jobs = [tables(found, plan, seed) for seed in seeds]
    shape = replace(layout_of(plan, found.agents, len(jobs)), **layout) if layout else None
    return [cpu.fly_on_cpu(plan, job) for job in jobs], fly_many(plan, jobs, shape=shape)


CASES = {
    "paper": ("vasarhelyi_2018/4ms", {"duration": 10.0}, {}),
    "shared pairs": ("vasarhelyi_2018/4ms", {"duration": 10.0}, {"per_agent": 4, "threads": 512}),
    "three hundred": ("vasarhelyi_2018/4ms", {"agents": 300, "world.side": 450.0, "duration": 4.0}, {}),
    "a table": ("vasarhelyi_2018/4ms", {"duration": 4.0}, {"registers": False, "per_agent": 1, "threads": 128}),
    "obstacles": ("vasarhelyi_2018/obstacles", {"duration": 10.0}, {}),
    "links": ("vasarhelyi_2018/4ms", {"duration": 6.0, "agents": 30, "radio.kind": "links", "radio.loss": 0.3}, {}),
    "in turn": ("zapotecatl_2016/best", {"duration": 0.2}, {}),
    "city": ("kidger/city", {"duration": 2.0}, {}),
    "wings": ("dimock_2003/physical", {"duration": 3.0}, {}),
}


@pytest.mark.parametrize("name", CASES)
def test_double_precision_flies_the_same_to_rounding(name, seed):
    preset, keys, layout = CASES[name]
    for known, found in zip(*both(load(preset, keys), [seed, seed + 1, seed + 2], **layout), strict=True):
        assert found.status == known.status == 0
        np.testing.assert_allclose(found.frames, known.frames, rtol=0.0, atol=1e-9)
        for key, value in known.values.items():
            np.testing.assert_allclose(found.values[key], value, rtol=1e-9, atol=1e-9)


def test_single_precision_agrees_over_the_first_seconds(seed):
    found = load("vasarhelyi_2018/4ms", {"duration": 4.0})
    for known, flown in zip(*both(found, [seed, seed + 1], 32), strict=True):
        np.testing.assert_allclose(flown.frames[:, :2], known.frames[:, :2], rtol=0.0, atol=5e-3)


def test_split_flocks_have_the_same_clusters(seed):
    found = scenario(agents=60, world__side=600.0, duration=3.0, metrics__r_cluster=40.0, start__speed=4.0)
    for known, flown in zip(*both(found, [seed]), strict=True):
        assert known.values["n_min"] < 3.0
        assert flown.values["n_min"] == pytest.approx(known.values["n_min"], abs=1e-9)
        assert flown.values["phi_corr"] == pytest.approx(known.values["phi_corr"], abs=1e-9)


def test_order_parameters_agree_within_standard_errors(seed):
    found = load("vasarhelyi_2018/4ms", {"duration": 60.0})
    seeds = list(range(seed, seed + 200))
    cpus = score_flights([found] * 200, seeds)
    gpus = score_flights([found] * 200, [s + 10_000 for s in seeds], device="cuda")  # flights of their own
    for key in ("phi_vel", "phi_corr", "r_min_mean", "n_disc", "phi_wall", "phi_coll"):
        a, b = (np.array([row[key] for row in rows]) for rows in (cpus, gpus))
        error = np.hypot(a.std(ddof=1), b.std(ddof=1)) / np.sqrt(len(a))
        assert abs(a.mean() - b.mean()) <= 4.0 * error + 1e-12, key


def test_a_flock_beyond_the_free_memory_is_refused_in_one_line(seed):
    from numba import cuda

    found = scenario(agents=15_000, world__side=1e5, radio__kind="links", start__separation=0.0, duration=0.1)
    spare = int(cuda.current_context().get_memory_info().free) - 10**9
    held = cuda.device_array(spare, np.uint8)  # one gigabyte is left, and what pairs remember takes four
    with pytest.raises(DeviceError, match=r"needs .* GB .* free; about \d+ agents fit"):
        score_flights([found], [seed], device="cuda")
    del held
