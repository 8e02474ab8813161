"""Devices are picked by the size of the work, and what is missing is said in one line."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from airflock.engine import pick_device, plan_of, score_flights
from airflock.scenarios import cost
from airflock.scenarios.files import load
from airflock.support import gpu as gpu
from airflock.support.errors import DeviceError, FlightError, ScenarioError
from flocks import scenario
from gpus import forget_gpu, replace_gpu
from inside import MOST_THREADS, Flown, Shape, shape_of, simulate

SMALL = scenario(agents=3, duration=0.2, world__side=60.0, world__walls="nearest_per_axis")  # others have its driver


@pytest.fixture
def present(monkeypatch):
    replace_gpu(monkeypatch, free=140e9)
    yield
    forget_gpu()


@pytest.fixture
def absent(monkeypatch):
    replace_gpu(monkeypatch, available=False, fault="no driver")
    yield
    forget_gpu()


def test_unknown_devices_are_refused():
    with pytest.raises(ScenarioError, match="'gpu' is none of auto, cpu, cuda, python"):
        pick_device([SMALL], "gpu")


def test_a_missing_gpu_is_an_error_where_it_is_named_and_a_note_where_not(absent):
    with pytest.raises(DeviceError, match="device = cuda: no GPU can be used: no driver; choose device = cpu or auto"):
        score_flights([SMALL], [0], device="cuda")
    said = []
    assert pick_device([SMALL], "auto", notify=said.append) == "cpu"
    assert said == ["device auto: cpu, no GPU can be used: no driver"]


def test_auto_leaves_small_work_to_the_cpu_and_large_to_a_gpu(present, monkeypatch):
    monkeypatch.setattr("airflock.engine.closed_flights.available_cores", lambda: 2)
    said = []
    assert pick_device([SMALL], "auto", notify=said.append) == "cpu"
    many = scenario(agents=100, duration=600.0)
    assert pick_device([many] * 1000, "auto", notify=said.append) == "cuda"
    assert "s of work" in said[0]
    assert said[1].startswith("device auto: cuda")


def test_auto_leaves_to_many_cores_what_one_thread_of_a_gpu_would_solve(present, monkeypatch):
    many, said = [load("dimock_2003/physical")] * 10_000, []
    monkeypatch.setattr("airflock.engine.closed_flights.available_cores", lambda: 16)
    assert pick_device(many, "auto", notify=said.append) == "cpu"
    assert said == ["device auto: cpu, about 19 s of work on 16 cores, where the GPU would take 1.1e+02 s"]
    monkeypatch.setattr("airflock.engine.closed_flights.available_cores", lambda: 1)
    assert pick_device(many, "auto") == "cuda"


def test_one_long_flight_is_no_work_for_a_gpu(present, monkeypatch):
    monkeypatch.setattr("airflock.engine.closed_flights.available_cores", lambda: 1)
    long = load("zapotecatl_2016/best", {"duration": 2e4})
    assert cost.estimated_seconds(long) > 50.0
    assert pick_device([long], "auto") == "cpu"
    assert pick_device([long] * 1000, "auto") == "cuda"


def test_a_big_flock_has_all_of_a_gpu_to_itself(present, monkeypatch):
    monkeypatch.setattr("airflock.engine.closed_flights.available_cores", lambda: 16)
    keys = {"agents": 100_000, "world.edges": "periodic", "world.arena": "square", "world.side": 46.0,
            "world.height": 46.0, "start.separation": 0.0, "metrics.kind": "order", "dt": 0.02}  # fmt: skip
    assert pick_device([load("zapotecatl_2016/literal", {**keys, "duration": 400.0})], "auto") == "cuda"


def test_work_grows_with_flights_agents_and_time():
    base = cost.estimated_seconds(scenario(agents=100, duration=100.0))
    assert cost.estimated_seconds(scenario(agents=100, duration=200.0)) == pytest.approx(2.0 * base, rel=0.02)
    assert cost.estimated_seconds(scenario(agents=200, duration=100.0)) > 2.5 * base


def test_the_cpu_is_never_asked_about_a_gpu(monkeypatch):
    monkeypatch.setattr(gpu, "import_module", lambda name: pytest.fail("asked"))
    assert pick_device([SMALL], "cpu") == "cpu"


def test_plain_python_scores_like_the_compiled_flight(seed):
    plain = score_flights([SMALL], [seed], device="python")[0]
    compiled = score_flights([SMALL], [seed], precision=64)[0]
    assert {k: v for k, v in plain.items()} == pytest.approx(compiled, rel=1e-9, abs=1e-9)


def test_a_table_has_one_thread_for_an_agent_or_all_of_the_block():
    whole = Shape(128, 32, 32, registers=False)
    with pytest.raises(AssertionError):  # shuffles within a loop whose turns differ: the threads wait for ever
        replace(whole, per_agent=4, threads=128)


@pytest.mark.parametrize("agents", [1, 2, 31, 32, 33, 100, 128, 129, 500, 1000, 1024, 1025, 5000])
@pytest.mark.parametrize("flocks", [1, 10, 100, 1000, 15_000])
def test_every_flock_fits_on_the_threads_of_its_block(agents, flocks):
    shape = shape_of(agents, flocks)
    assert shape.lanes >= agents
    assert shape.lanes % 32 == 0
    assert shape.threads <= MOST_THREADS
    assert shape.threads % 32 == 0
    if shape.registers:
        assert shape.threads == shape.lanes * shape.per_agent
    assert shape_of(agents, 15_000).per_agent == 1  # full GPUs share nothing


@pytest.mark.parametrize("name", ["vasarhelyi_2018/4ms", "kidger/city", "zapotecatl_2016/best", "dimock_2003/physical"])
def test_all_rules_of_a_kernel_are_the_rules_of_the_cpu(name):
    """No rule is written twice: every rule and record of a CPU driver stands in the kernel with the same text."""
    from inside import driver_stages as stages, kernel_text as kernel

    plan = plan_of(load(name), grid=False)
    rules = [block for block in stages(plan).source.blocks if "def " in block]
    assert len(rules) > 20
    text = kernel(plan, shape_of(5, 1000))
    assert [block for block in rules if block not in text] == []


@pytest.mark.parametrize("wrong", [1, 2, 13, 19, 20])
def test_the_step_at_which_a_closed_flight_left_the_finite_numbers_is_found(wrong, monkeypatch):
    """A GPU flies closed flights: shorter ones tell from which step on agent 1 is nowhere."""
    steps = round(SMALL.flight.duration / SMALL.flight.dt)
    flown = []

    def fly_one(scenario, *_):
        flown.append(round(scenario.flight.duration / scenario.flight.dt))
        state = np.zeros((4, 3))
        state[:, 1] = np.nan if flown[-1] >= wrong else 0.0
        return Flown({}, None, state, 0)

    monkeypatch.setattr(simulate, "fly_one", fly_one)
    with pytest.raises(FlightError, match=f"agent 1 left the finite numbers at step {wrong} "):
        simulate.check_result(SMALL, 0, fly_one(SMALL), "cuda")
    assert steps == 20
    assert len(flown) <= 1 + 5  # by halves


def test_the_command_ends_with_one_line_and_status_2_without_a_gpu():
    code = "import sys; sys.argv = ['airflock', 'run', 'vasarhelyi_2018/4ms', '--device', 'cuda']\n"
    code += "from airflock.support import gpu\ngpu.unavailable_reason = lambda: 'no driver'\n"
    code += "from airflock.cli import main\nmain()\n"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.strip() == "airflock: device = cuda: no driver; choose device = cpu or auto"


def test_a_numba_that_compiles_nothing_is_named_and_plain_python_flies_on():
    words = [sys.executable, "-m", "airflock", "run", "vasarhelyi_2018/4ms", "--agents", "3", "--duration", "0.1"]
    told = "airflock: NUMBA_DISABLE_JIT is set, so Numba compiles nothing: unset it, or fly with --device python"
    for more, status in (([], 2), (["--device", "python"], 0)):
        environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
        done = subprocess.run([*words, *more], capture_output=True, text=True, env=environment, check=False)
        assert done.returncode == status and done.stderr.startswith(told if status else ""), done.stderr
        assert done.stderr.count("\n") == (1 if status else 0)
