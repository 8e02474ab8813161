"""The kernels of a GPU, run by Numba's CUDA simulator, fly as plain Python does; random integers are the same bits."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import covering
from needed import needed

needed("numba_cuda")

HERE = Path(__file__).resolve().parents[1] / "gpu"
CASES = (
    *covering.PLANS, "split", "torus", "table", "couzin", "vicsek", "groups", "together", "city", "herd", "stop",
    "display", "wings", "vee", "echelon", "weights", "jitter", "species", "in turn", "lonely", "leavers", "collided",
    "replaced", "replaced, in tables",
    "herd leaves", "display fails", "wing fails", "in turn, fewer", "pair 51",  # laws that remember several numbers
)  # fmt: skip


def simulated(script, *arguments):
    """Output of a script in a process that simulates CUDA."""
    environment = os.environ | {"NUMBA_ENABLE_CUDASIM": "1"}
    done = subprocess.run(
        [sys.executable, str(HERE / script), *map(str, arguments)], capture_output=True, text=True, env=environment
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def flights(request):
    return simulated("simulated.py", request.config.getoption("--seed"), *CASES)


@pytest.mark.parametrize("name", CASES)
def test_simulated_kernel_flies_as_plain_python(flights, name, seed):
    found = flights[name]
    assert found["moved"] > 0.01  # something happens
    assert found["frames"] < 1e-9
    assert found["values"] < 1e-9


def test_cases_cover_collisions_split_flocks_and_lone_agents(flights):
    assert max(found["known"].get("n_coll", 0.0) for found in flights.values()) >= 1.0
    assert flights["split"]["known"]["n_min"] < 3.0
    assert flights["groups"]["known"]["n_groups"] > 0.0
    assert flights["groups"]["known"]["share_alone"] > 0.0
    assert flights["city"]["known"]["avoiding"] > 0.0


@pytest.fixture(scope="module")
def crowds(request):
    return simulated("crowded.py", request.config.getoption("--seed"))


@pytest.mark.parametrize("name", ["periodic", "few cells", "walls", "open", "plane", "gusts"])
def test_one_big_flock_by_cells_flies_as_plain_python(crowds, name, seed):
    found = crowds[name]
    assert found["moved"] > 0.01
    assert max(found["state"], found["frames"], found["values"]) < 1e-9
    assert found["same bits"]  # agents have an order within their cell
    assert found["cells"] > (0 if name == "few cells" else 8)


def test_random_integers_of_a_kernel_are_those_of_plain_python(seed):
    found = simulated("random_words.py", seed)
    assert found["counters"] == 200
    assert found["wrong_words"] == 0
    assert found["wrong_uniforms"] == 0
    assert found["normals"] < 1e-12


def test_threads_that_ask_for_a_shared_array_at_once_get_the_same_one():
    """Numba's simulator gave each of them its own: a kernel then read what nobody had written, once in some runs."""
    assert simulated("shared_arrays.py") == 0


def test_threads_wait_for_all_that_still_fly_and_one_that_fails_ends_the_launch():
    """Each thread in turn adds one between two barriers: all see the same count. Those who have ended keep nobody."""
    found = simulated("barriers.py")
    whole = found["whole"]
    assert whole == [[turn + 1] * len(whole[0]) for turn in range(len(whole))]
    for turn, row in enumerate(found["early"]):
        assert row == [turn + 1 if thread >= turn else 0 for thread in range(len(row))]
    assert "tid=[3, 0, 0]" in found["said"] and "as asked" in found["said"] and found["past"] == 0
