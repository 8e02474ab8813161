"""Kernels compile for GPUs that are not there: PTX of every shipped model, single precision without double."""

import re
from dataclasses import replace

import pytest

from airflock.engine.simulate import plan_of
from airflock.scenarios.files import load, presets

pytest.importorskip("numba_cuda", reason="needs numba-cuda: pip install 'airflock[cuda]'")

CAPABILITIES = ((8, 0), (9, 0))
# One preset per kernel: the others of a publication differ in numbers only (test_presets_share_these_kernels).
KERNELS = {
    "vasarhelyi_2018/4ms": {},
    "vasarhelyi_2018/real_4ms": {},
    "viragh_2014/4ms": {},
    "couzin_2002/torus": {},
    "vicsek_1995/ordered": {},
    "zapotecatl_2016/best": {},
    "kidger/city": {},
}


def driver_of(name, bits=32, **layout):
    from airflock.engine.cuda.launch import flight_driver
    from airflock.engine.cuda.shape import shape_of

    found = load(name)
    plan = replace(plan_of(found, precision=bits), grid=False)
    shape = shape_of(found.agents, 1000, sequential=plan.sequential)
    return flight_driver(plan, replace(shape, **layout)), plan


def doubles(text):
    return re.findall(r"\S+\.f64\S*", text)


@pytest.mark.parametrize("name", KERNELS)
def test_ptx_of_every_model(name):
    from airflock.engine.cuda.compiled import ptx

    driver, plan = driver_of(name)
    for (major, minor), text in ptx(driver, plan.bits, CAPABILITIES).items():
        assert f".target sm_{major}{minor}" in text
        assert ".entry" in text
        assert doubles(text) == []  # one double literal would cost a GPU half its speed
        assert "call.uni" not in text  # everything is inlined


@pytest.mark.parametrize("name", ["vasarhelyi_2018/4ms"])
def test_ptx_pair_loop_reads_whole_vectors(name):
    """A neighbour as heard is one load of four numbers, not four loads."""
    from airflock.engine.cuda.compiled import ptx

    driver, plan = driver_of(name, per_agent=4, threads=512)
    text = ptx(driver, plan.bits, ((9, 0),))[9, 0]
    assert "ld.shared.v4.f32" in text
    assert doubles(text) == []


def test_every_shipped_model_has_a_kernel_here():
    assert {load(name).model.name for name in presets()} == {load(name).model.name for name in KERNELS}
