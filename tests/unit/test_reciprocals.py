"""Rules that take reciprocals instead of dividing compute what the rules themselves compute."""

import ast
import math
from types import SimpleNamespace

import numpy as np
import pytest

from airflock.core import maths
from airflock.engine import plan_of
from airflock.engine.text.generate import DriverSource
from airflock.parts.laws import vasarhelyi_2018
from airflock.scenarios.files import load
from inside import Forms, cuda_kernel as kernel, shape_of, spelled, with_reciprocals

NAMES = {
    "math": math, "real": float, "least": min, "most": max, "ONE": 1.0, "inverse_root": lambda a: 1.0 / math.sqrt(a),
    "namedtuple": lambda name, fields: lambda *values: values,
}  # fmt: skip


def forms_of(rule):
    """Second forms of a rule and of all that it calls, and everything compiled as plain Python, by name."""
    source = DriverSource("", {})
    name = source.name(rule)
    forms = Forms(source.blocks, "")
    keys = forms.keys(name)
    found = dict(NAMES)
    exec("\n\n".join([*source.blocks, *forms.made]), found)
    return name, keys, found


RULES = {
    maths.braking_curve: (7.0, 3.0, 2.0),
    maths.braking_distance: (7.0, 3.0, 2.0),
    maths.excess: (4.0, 1.5),
    maths.unit: (1.0, -2.0, 0.5),
    maths.shorten: (1.0, -2.0, 0.5, 1.2),
}


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_second_forms_agree_to_rounding(rule):
    name, keys, found = forms_of(rule)
    assert keys is not None
    given = dict(zip(rule.__code__.co_varnames, RULES[rule], strict=False))
    wanted = rule(*RULES[rule])
    assert found[f"{name}_per"](*RULES[rule], *(1.0 / given[key] for key in keys)) == pytest.approx(wanted, rel=1e-14)


def test_a_model_takes_the_reciprocals_of_distance_speed_and_gain(seed):
    name, keys, found = forms_of(vasarhelyi_2018.neighbour)
    assert sorted(keys) == ["dv", "p.p_frict", "r"]
    draw = np.random.default_rng(seed)
    p = vasarhelyi_2018.Parameters()
    q = SimpleNamespace(**{k: getattr(p, k) for k in p.__dataclass_fields__})
    for _ in range(20):
        dx, dy, dvx, dvy = draw.uniform(-20.0, 20.0, 4)
        r, dv = math.hypot(dx, dy), math.hypot(dvx, dvy)
        at_hand = {"r": 1.0 / r, "dv": 1.0 / dv, "p.p_frict": 1.0 / p.p_frict}
        given = dict(dx=dx, dy=dy, dz=0.0, r=r, dvx=dvx, dvy=dvy, dvz=0.0, dv=dv, p=q)
        arguments = [given[a] for a in vasarhelyi_2018.neighbour.__code__.co_varnames[: len(given)] if a in given]
        wanted = vasarhelyi_2018.neighbour(*arguments)
        assert found[f"{name}_per"](*arguments, *(at_hand[key] for key in keys)) == pytest.approx(wanted, rel=1e-12)


def test_a_stage_takes_a_root_and_its_reciprocal_at_once():
    source = DriverSource("", {})
    name = source.name(maths.excess)
    lines = f"r2 = x * x + TINY\nr = math.sqrt(r2)\ns = {name}(r, q.v)\nt = s / q.v\nu = s / t"
    body, numbers = with_reciprocals(Forms(source.blocks, ""), ast.parse(lines).body, {"q"})
    text = "\n".join(ast.unparse(statement) for statement in body)
    assert numbers == [("q", "v")]
    assert spelled("q.v") == "per_q_v"
    assert f"s = {name}_per(r, q.v, per_r)" in text
    assert "per_r = inverse_root(square_r)" in text and "r = square_r * per_r" in text
    assert "t = s * per_q_v" in text and "u = s / t" in text  # nothing is known of t


@pytest.mark.parametrize("name", ["vasarhelyi_2018/4ms", "vasarhelyi_2018/real_gnss", "dimock_2003/physical"])
def test_second_forms_are_called_where_they_stand_and_handed_to_nobody(name):
    """A function that is handed to another one as an argument is one that Numba warns of."""
    one = load(name)
    plan = plan_of(one, precision=32).built(grid=False)
    shape = shape_of(one.agents, 1, whole_flock=bool(plan.model.flock))
    tree = ast.parse(kernel.flight_text(plan, shape))
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    forms = {node.name for node in functions if node.name.endswith("_per")}
    assert forms
    assert not forms & {argument.arg for node in functions for argument in node.args.args}
