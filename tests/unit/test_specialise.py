"""A specialised stage is its own text with what is known put in place, and nothing that nobody reads."""

import pytest

from airflock.engine import plan_of
from airflock.scenarios.files import load
from inside import ZERO, Builder, StageError, argument, ask, most, repeat, specialise, stages_start as start, vector


def made(stage, name="vasarhelyi_2018/4ms", **known):
    return specialise(Builder(plan_of(load(name), precision=32)), stage, **known)


def bound_once(flock, i, *, plan):
    count = 2 * plan.dimensions
    row = flock.position[0]
    row[i] = count


def bound_twice(agents, flock, *, plan):
    kept = ZERO
    fastest = ZERO
    for i in agents:
        fastest = most(fastest, flock.velocity[0][i] + kept)
    return fastest


def unrolled(flock, i, *, plan):
    v = vector()
    unread = flock.command[0][i]
    for a in range(plan.dimensions):
        v[a] = flock.velocity[a][i]
    if plan.dimensions == 3:
        unread = v[2]
    return sum(v[a] * v[a] for a in range(3)) + unread * 0.0 if plan.sequential else v[2] + v[0]


def asking(flock, i, *, rule):
    flock.position[0][i] = ask(rule, near=flock.clock[i], far=flock.rays[i])


def far_only(far):
    return far


def undefined(flock, i):
    flock.position[0][i] = nowhere  # noqa: F821


def unknown(flock, i):
    with i:
        i = i - 1


def sought(flock, i, *, plan):
    if plan.dimensions == 3:
        return 7
    for attempt in repeat(1000):
        while flock.clock[i] > ZERO:
            if plan.sequential:
                break
            flock.clock[i] = flock.clock[i] - attempt
        if flock.rays[i] > ZERO:
            return attempt
    return -1


def left(i, *, plan):
    for a in range(plan.dimensions):
        i = i + a
        break


def test_what_is_bound_once_and_known_vanishes():
    assert made(bound_once).lines == ["x = work[0]", "x[i] = 4"]


def test_first_values_of_a_loop_over_agents_belong_to_it():
    found = made(bound_twice)
    assert found.body == ["fastest = ZERO", "for i in range(n):", "    fastest = most(fastest, vx[i] + ZERO)"]
    assert found.once == ["vx = work[0]"]
    assert found.answer == "fastest"


def test_in_turn_a_loop_over_agents_is_its_body():
    found = made(bound_twice, "zapotecatl_2016/best")
    assert found.body == ["fastest = ZERO", "fastest = most(fastest, vx[i] + ZERO)"]


def test_axes_are_unrolled_and_what_nobody_reads_is_dropped():
    found = made(unrolled)
    assert found.lines == ["vx = work[0]", "v_x = vx[i]"]
    assert found.answer == "ZERO + v_x"  # no component of a vector in a plane


def test_a_rule_is_given_what_it_asks_for_and_nothing_else_is_bound():
    found = made(asking, rule=far_only)
    assert found.lines[-1].endswith("far_only(rays_[i])")
    assert not any(line.startswith("clock") for line in found.lines)


FAULTS = (
    (undefined, "nowhere is not defined"),
    (left, "a loop that is unrolled is left"),
    (unknown, "With is not specialised"),
)


@pytest.mark.parametrize(("stage", "said"), FAULTS, ids=[said for _, said in FAULTS])
def test_a_fault_names_file_line_and_stage(stage, said):
    line = stage.__code__.co_firstlineno + 1
    with pytest.raises(StageError, match=rf"test_specialise.py:{line}: {stage.__name__}: {said}"):
        made(stage)


def test_loops_that_search_stay_loops_and_may_be_left():
    found = made(sought)
    assert found.lines == [
        "clock = work[-1]", "rays_ = work[0]", "for attempt in range(1000):", "    while clock[i] > ZERO:",
        "        clock[i] = clock[i] - attempt", "    if rays_[i] > ZERO:", "        return attempt",
    ]  # fmt: skip
    assert found.answer == "-1"


def test_a_return_that_the_plan_chooses_ends_the_stage():
    assert made(sought, "kidger/city").answer == "7"


def test_a_helper_of_several_statements_stands_in_place_of_its_call():
    found = made(start.begin, excursion=argument("excursion"))
    asked = "free = excursion(s_x, s_y, ZERO, w, edges, spans, corners, obstacles, scene) <= -w.wall_clearance"
    assert any(line.strip() == asked for line in found.lines)
