"""Locals of helpers that stand in a stage overwrite nothing: a stage's text computes what the stage does in Python."""

import pytest
from hypothesis import given, strategies as st

from airflock.engine import plan_of
from airflock.scenarios.files import load
from inside import Builder, StageError, least, most, repeat, specialise, stages_words, vector

STAGES = stages_words.__name__.rpartition(".")[0]


def summed(x, y):
    near = x * x
    far = y * y
    return near + far


def capped(near, most_of):
    if near > most_of:
        near = most_of
    return near


def doubled(x):
    near = x + x
    far = summed(near, x)
    return near * far


def grown(total, x):
    for _ in repeat(3):
        total = total + x
    return total


def pair(x, y):
    o = vector()
    o[0] = x
    o[1] = y
    return o


for function in (summed, capped, doubled, grown, pair):  # a stage calls helpers of modules of stages
    function.__module__ = f"{STAGES}.of_a_test"


def kept(x, y):
    near = x + y
    both = summed(x, y)
    return near * both


def through_a_loop(x, y):
    near = x
    both = y
    for _ in repeat(3):
        more = summed(x, near)
        both = both + more
        near = near + y
    return near * both


def handed_on(x, y):
    near = x - y
    both = summed(near, y)
    return both - near


def of_one_branch(x, y):
    near = x
    if x > y:
        near = capped(near, y)
    far = capped(y, x)
    return near + far


def helpers_in_helpers(x, y):
    far = y * x
    near = doubled(x)
    other = doubled(y)
    return near + far * other


def rebound(x, y):
    total = x
    more = grown(y, x)
    again = grown(total, y)
    return total + more * again


def left_early(x, y):
    near = x
    for turn in repeat(4):
        far = summed(near, y)
        if far > y:
            break
        near = near + turn
    return near


SOUND = (kept, through_a_loop, handed_on, of_one_branch, helpers_in_helpers, rebound, left_early)
NUMBERS = st.floats(-9.0, 9.0, allow_subnormal=False).map(lambda x: round(x, 3))


def made(stage):
    return specialise(Builder(plan_of(load("vasarhelyi_2018/4ms"))), stage)


def as_function(stage):
    """The stage by its text in a driver."""
    found = made(stage)
    text = "\n    ".join(["def driver(x, y):", *found.lines, f"return {found.answer}"])
    space = {"least": least, "most": most, "real": float}
    exec(compile(text, "driver", "exec"), space)
    return space["driver"]


@pytest.mark.parametrize("stage", SOUND, ids=lambda stage: stage.__name__)
@given(x=NUMBERS, y=NUMBERS)
def test_a_stage_computes_in_a_driver_what_it_does_in_python(stage, x, y):
    assert as_function(stage)(x, y) == stage(x, y)


def test_a_local_has_its_own_name_where_that_is_free_and_its_helper_s_where_it_is_not():
    assert made(kept).lines[:2] == ["near = x + y", "near_summed = x * x"]
    assert made(of_one_branch).lines[2:4] == [
        "    if near > y:",
        "        near = y",
    ]


def two_vectors(x, y):
    a = pair(x, y)
    b = pair(y, x)
    return a[0] * b[1] + a[1]


def a_table(x, y):
    work = x * y
    return work + x


def test_what_cannot_be_kept_apart_is_refused_with_its_line():
    line = two_vectors.__code__.co_firstlineno + 2
    with pytest.raises(StageError, match=rf"test_apart.py:{line}: two_vectors: pair returns its vector to b"):
        made(two_vectors)
    with pytest.raises(StageError, match="a_table: work is what the driver itself calls here"):
        made(a_table)
