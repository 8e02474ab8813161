"""Kernels compile for GPUs that are not there: PTX of every shipped model, single precision without double."""

import re
from dataclasses import replace
from typing import NamedTuple

import pytest

from airflock.core.metric import metric
from airflock.engine import plan_of
from airflock.scenarios.files import load, presets
from needed import needed

needed("numba_cuda")

CAPABILITIES = ((8, 0), (9, 0))  # their texts differ only where they name them
# One preset per publication: the others differ in numbers or in which perturbations are on. Threads of one of them.
KERNELS = {
    "vasarhelyi_2018/4ms": {"per_agent": 4, "threads": 512},
    "viragh_2014/4ms": {},
    "couzin_2002/torus": {},
    "vicsek_1995/ordered": {},
    "zapotecatl_2016/best": {},
    "kidger/city": {},
    "dimock_2003/physical": {},
    "vasarhelyi_2018/fixed_wing": {},
    "chen_2014/hunt": {},
    "olfati_saber_2006/lattice": {},
    "cucker_smale_2007/flock": {},
    "reynolds_1999/drones": {},
    "potential_field/drones": {},
    "network/drones": {},
}


def driver_of(name, bits=32, **layout):
    from inside import kernel_driver as flight_driver, layout_of

    found = load(name)
    plan = plan_of(found, precision=bits)
    plan = replace(
        plan.built(grid=False), has_mesh=plan.scene
    )  # as if the buildings came from a mesh: more of the rules
    return flight_driver(plan, replace(layout_of(plan, found.agents, 1000), **layout)), plan


def doubles(text):
    return re.findall(r"\S+\.f64\S*", text)


def checked(text, capability):
    """PTX of a kernel as any must be, without the name of what it is for."""
    target = ".target sm_{}{}\n".format(*capability)
    assert target in text
    assert ".entry" in text
    assert doubles(text) == []  # one double literal would cost a GPU half its speed
    return text.replace(target, "")


@pytest.mark.parametrize("name", KERNELS)
def test_ptx_of_every_model(name):
    from inside import ptx, signature

    driver, plan = driver_of(name, **KERNELS[name])
    found = ptx(driver, signature(plan.bits), CAPABILITIES)
    text, other = (checked(found[each], each) for each in CAPABILITIES)
    assert other == text
    assert "call.uni" not in text  # everything is inlined
    if name == "vasarhelyi_2018/4ms":
        assert "ld.shared.v4.f32" in text  # a neighbour as heard is one load of four numbers


def test_every_shipped_model_has_a_kernel_here():
    from inside import no_cuda

    shipped = list(map(load, presets()))
    kernels = {found.model.name for found in shipped if not no_cuda(plan_of(found), found.agents)}
    assert kernels == {found.model.name for found in shipped}
    compiled = {load(name).model.name for name in KERNELS}
    assert kernels - compiled == {"couzin_2005"}  # whose groups differ in numbers alone


def test_ptx_of_one_big_flock():
    from inside import crowd_driver, ptx, signatures

    keys = {"agents": 100_000, "world.edges": "periodic", "world.arena": "square", "metrics.kind": "order"}
    plan = plan_of(load("zapotecatl_2016/literal", keys))
    assert plan.grid
    driver = crowd_driver(plan, False)
    for kernel, types in signatures(32).items():
        for (major, minor), text in ptx(driver, types, CAPABILITIES, kernel).items():
            assert f".target sm_{major}{minor}" in text
            assert doubles(text) == []
            if kernel == "advance":
                assert "ld.global.nc.v4.f32" in text  # a candidate is two loads of four numbers


class Centre(NamedTuple):
    centre_x: float


def renamed(mean):
    found = mean
    return Centre(found.x)


def test_a_mean_that_no_rule_reads_is_not_exchanged_between_threads():
    """A shuffle counts as being read, so that no compiler drops the sum behind it."""
    from inside import kernel_text, shape_of

    def sums(metrics):
        found = load("vicsek_1995/ordered", metrics=metrics)
        text = kernel_text(plan_of(found, precision=32), shape_of(found.agents, 1))
        return {row for row in ("x", "v", "h") if f"s{row}_x = warp_sum(s{row}_x, tid)" in text}

    assert sums(["milling"]) == {"x"}
    assert sums(["polarisation"]) == {"h"}
    assert sums(["rotation"]) == {"x", "v"}
    assert sums(["speed"]) == set()
    assert sums([metric({"Sample": Centre, "sample": renamed}, "own")]) == {"x", "v", "h"}  # its text does not tell
