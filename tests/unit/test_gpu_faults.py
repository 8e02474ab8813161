"""What is missing on a GPU, or too much for it, is said in one line with status 2; `auto` then flies on the CPU."""

import gc
import re
import sys
from types import SimpleNamespace

import pytest

from airflock.cli import main
from airflock.engine import pick_device, plan_of
from airflock.scenarios.files import load
from airflock.support.errors import DeviceError
from flocks import scenario
from gpus import forget_gpu, replace_gpu
from inside import no_room
from needed import needed

needed("numba_cuda")


@pytest.fixture
def machine(monkeypatch):
    """Function that puts such a machine in the place of this one."""

    def put(**properties):
        monkeypatch.delenv("NUMBA_ENABLE_CUDASIM", raising=False)
        replace_gpu(monkeypatch, **properties)

    yield put
    forget_gpu()


def ended(monkeypatch, capsys, *arguments):
    """Status and standard error of the command."""
    monkeypatch.setattr(sys, "argv", ["airflock", *map(str, arguments)])
    with pytest.raises(SystemExit) as end:
        main()
    return end.value.code, capsys.readouterr().err


MISSING = {
    "no driver": (
        {"available": False, "fault": "\nCUDA driver library cannot be found.\nCheck ..."},
        "library cannot be",
    ),
    "no device": ({"available": False}, "no GPU can be used: no device found"),
    "broken": (
        {"device": RuntimeError("[100] CUDA_ERROR_NO_DEVICE\nmore")},
        "cannot be used: [100] CUDA_ERROR_NO_DEVICE",
    ),
}


@pytest.mark.parametrize("name", MISSING)
def test_a_missing_gpu_ends_the_command_and_auto_flies_on_the_cpu(name, machine, monkeypatch, capsys):
    properties, words = MISSING[name]
    machine(**properties)
    status, line = ended(monkeypatch, capsys, "run", "vasarhelyi_2018/4ms", "--device", "cuda")
    assert status == 2
    assert line.startswith("airflock: device = cuda: ") and line.count("\n") == 1
    assert words in line and "choose device = cpu or auto" in line
    said = []
    assert pick_device([scenario(agents=3, duration=0.2)], "auto", notify=said.append) == "cpu"
    assert len(said) == 1 and words in said[0] and "\n" not in said[0]


def test_without_numba_cuda_the_line_says_what_to_install(machine, monkeypatch):
    machine()
    monkeypatch.setitem(sys.modules, "numba_cuda", None)
    with pytest.raises(DeviceError, match=r"numba-cuda.*pip install 'airflock\[cuda\]'|import of numba_cuda halted"):
        pick_device([scenario(agents=3)], "cuda")


LINKED = {"world.side": 1e5, "radio.kind": "links", "start.separation": 0.0, "duration": 600.0}
BOIDS = {
    "update": "synchronous", "metrics.kind": "order", "start.kind": "arena", "start.separation": 0.0,
    "world.arena": "square", "world.edges": "periodic", "world.side": 100.0, "world.height": 100.0,
}  # fmt: skip
NEEDS = r"needs ([\d.]+) GB .* ([\d.]+) GB are free; about (\d+) agents fit"
PAIRED = BOIDS | {"metrics.kind": "zapotecatl"}
# preset, its keys, agents, free GB; what is said
TOO_MUCH = {
    "memory": ("vasarhelyi_2018/4ms", LINKED, 20_000, 4.0, NEEDS),
    "memory of cells": ("zapotecatl_2016/literal", BOIDS, 9_000_000, 1.0, NEEDS),
    "size": ("vasarhelyi_2018/4ms", LINKED, 20_001, 140.0, "20001 agents are more than one block flies .* cells need"),
    "order parameters": ("zapotecatl_2016/literal", PAIRED, 30_000, 140.0, "choose metrics.kind = order"),
}


@pytest.mark.parametrize("name", TOO_MUCH)
def test_what_is_too_much_for_a_gpu_is_said_before_anything_flies(name, machine, monkeypatch, capsys):
    preset, keys, agents, free, words = TOO_MUCH[name]
    machine(free=int(free * 1e9))
    sets = [text for key, value in keys.items() for text in ("--set", f"{key}={value}")]
    status, line = ended(monkeypatch, capsys, "run", preset, "--agents", agents, "--device", "cuda", *sets)
    *notes, fault = line.splitlines()
    assert status == 2
    assert all(note.startswith("note: ") for note in notes)
    assert fault.startswith("airflock: device = cuda: ") and re.search(words, fault), fault
    said = []
    assert pick_device([load(preset, {**keys, "agents": agents})] * 50, "auto", notify=said.append) == "cpu"
    assert re.search(words, said[0]) and "\n" not in said[0]


@pytest.mark.parametrize("name", ["memory", "memory of cells"])
def test_as_many_agents_fit_as_are_said_to(name, machine):
    preset, keys, agents, free, words = TOO_MUCH[name]
    machine(free=int(free * 1e9))

    def line(n):
        found = load(preset, {**keys, "agents": n})
        return no_room(found, plan_of(found))

    fit = int(re.search(words, line(agents))[3])
    assert 1000 < fit < agents
    assert line(fit) is None
    assert line(fit + 33) is not None  # agents lie in groups of 32
    need, room = (float(text) for text in re.search(words, line(agents)).groups()[:2])
    assert need > room == pytest.approx(0.9 * free)


def test_few_flocks_are_no_warning_of_numbas(monkeypatch):
    from numba.cuda.core import config

    from inside import configured

    class Kernel:
        def __getitem__(self, grid):
            return grid, config.CUDA_LOW_OCCUPANCY_WARNINGS

    monkeypatch.delenv("NUMBA_ENABLE_CUDASIM", raising=False)
    monkeypatch.setattr(config, "CUDA_LOW_OCCUPANCY_WARNINGS", 1)
    assert configured(Kernel(), 1, 128) == ((1, 128), 0)
    assert config.CUDA_LOW_OCCUPANCY_WARNINGS == 1  # a user's own kernels are warned of as before


def test_garbage_is_collected_seldom_while_the_first_launch_of_a_kernel_compiles_it():
    from inside import at_first

    before, usual = gc.get_threshold(), (700, 10, 10)
    gc.set_threshold(*usual)
    try:
        for overloads, seldom in (({}, True), ({"signature": "kernel"}, False)):
            with at_first(SimpleNamespace(overloads=overloads)):
                assert (gc.get_threshold()[0] > usual[0]) is seldom
            assert gc.get_threshold() == usual
    finally:
        gc.set_threshold(*before)
