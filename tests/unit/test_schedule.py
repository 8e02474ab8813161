"""The order of a step is one: every driver keeps it, whole or in parts, and each stage runs when its event is due."""

import ast
from random import Random
from types import SimpleNamespace

import numpy as np
import pytest

from airflock.engine import plan_of
from airflock.scenarios.files import load
from inside import (
    ORDER,
    Itself,
    columns,
    cuda_cells as cells,
    cuda_kernel as kernel,
    in_turn,
    measured,
    order,
    passes_driver as driver,
    shape_of,
    stages_flight as flight,
)

IN_TURNS = "zapotecatl_2016/best"
PRESETS = (
    "vasarhelyi_2018/4ms", "vicsek_1995/ordered", "kidger/city", IN_TURNS, "couzin_2002/swarm",
    "viragh_2014/4ms",
)  # fmt: skip


def calls(text, function, names):
    """Calls of these names in a function of a driver, as they stand in its text."""
    (node,) = (n for n in ast.parse(text).body if isinstance(n, ast.FunctionDef) and n.name == function)
    loops = (n for n in ast.walk(node) if isinstance(n, (ast.For, ast.While)))
    over = (
        ("i in",) if function == "turns" else ("step", "while True")
    )  # a kernel ends its loop in the middle of a step
    (first, *_) = (n for n in loops if any(words in ast.unparse(n)[:12] for words in over))
    found = [n for n in ast.walk(first) if isinstance(n, ast.Call)]
    found.sort(key=lambda n: (n.lineno, n.col_offset))
    return [name for n in found if (name := getattr(n.func, "id", "").removesuffix("_of")) in names]


def due(plan):
    return [stage for event in order(plan).values() for stage in event]


STUCK = {"faults": [{"kind": "stuck", "agents": [0], "at": 1.0}]}


@pytest.mark.parametrize(("name", "keys"), [*((name, {}) for name in PRESETS), (IN_TURNS, STUCK), (PRESETS[0], STUCK)])
def test_a_driver_calls_its_stages_in_the_order_of_a_step(name, keys):
    plan = plan_of(load(name, keys), precision=32).built(grid=False)
    assert bool(keys) == ("overrule" in order(plan)["decide"])
    text = driver.flight_driver_text(plan)
    expected = due(plan)
    if plan.sequential:
        assert calls(text, "turns", in_turn(plan)) == list(in_turn(plan))
        expected = [stage for stage in expected if stage not in (*ORDER["decide"].stages, "move")]
    assert calls(text, "advance", expected) == expected


@pytest.mark.parametrize("name", [name for name in PRESETS if name not in (IN_TURNS, "vicsek_1995/ordered")])
def test_a_kernel_calls_them_in_the_same_order(name):
    one = load(name)
    plan = plan_of(one, precision=32).built(grid=False)
    text = kernel.flight_text(plan, shape_of(one.agents, 1, whole_flock=bool(plan.model.flock)))
    assert calls(text, "fly", due(plan)) == due(plan)


def test_so_do_kernels_of_one_big_flock():
    plan = plan_of(load("couzin_2002/swarm"), precision=32).built(grid=True)
    expected = [stage for event in ("decide", "move") for stage in order(plan)[event]]
    text = cells.large_flock_text(plan)
    node = next(n for n in ast.parse(text).body if isinstance(n, ast.FunctionDef) and n.name == "advance")
    found = [n.func.id for n in ast.walk(node) if isinstance(n, ast.Call) and getattr(n.func, "id", "") in expected]
    assert sorted(found, key=expected.index) == [stage for stage in expected if stage in found]
    assert {"neighbours", "decide", "move"} <= set(found)


class Flown:
    """The order of a step run as it stands, with stages that only note when they were called."""

    def __init__(self, name):
        self.plan = plan_of(load(name), precision=64)
        self.log = []
        self.whole = SimpleNamespace(
            delay=3, decide_every=4, sample_every=5, collide_every=2, ring=2, steps=40, agents=3
        )
        self.numbers = SimpleNamespace(c=SimpleNamespace(dt=0.1), q=SimpleNamespace(r_coll=1.0, r_body=1.0))
        self.held = np.array([0.0, -1.0, 0.0, 0.0, 0.0])
        count = len(columns(self.plan.metrics))
        self.sums, self.values = np.zeros(count + 2), np.zeros(count)
        self.stages = {stage: self.noting(stage) for stage in due(self.plan)}
        self.stages |= {"begin": lambda: 0, "snapshot": lambda slot: self.log.append(("snapshot", slot))}
        self.stages |= {"move": self.moved}

    def noting(self, stage):
        def note(time):
            self.log.append((stage, round(time / 0.1)))
            return 0.0  # a pair may be near: nothing is skipped

        return note

    def moved(self, step):
        self.log.append(("move", step))
        return 0.0

    def to(self, first, last, half=0):
        """Advance; returns the next step."""
        plan = self.plan
        return flight.advance(
            first, last, half, self.held, SimpleNamespace(number=Itself()), self.numbers, self.whole, 3, 3, None,
            np.zeros((9, 3)), self.values, self.sums, np.zeros((0, 6, 3)), plan=plan, stages=self.stages,
            order=order(plan), sampled=driver._sampled(plan), watched=measured(plan, "collision"),
            drifts=False, foretold=False, collided=0, slots=False,
        )  # fmt: skip


def test_each_stage_runs_when_its_event_is_due():
    flown = Flown("vasarhelyi_2018/4ms")
    assert flown.to(0, 41) == 41
    for event, every in (("decide", 4), ("watch", 2), ("sample", 5), ("move", 1)):
        for stage in order(flown.plan)[event]:
            steps = [step for name, step in flown.log if name == stage]
            assert steps == list(range(0, 41 if event != "move" else 40, every)), stage
    slots = [slot for name, slot in flown.log if name == "snapshot"]
    assert slots == [0, 1] + [(step + 3) // 4 % 2 for step in range(41) if (step + 3) % 4 == 0]
    assert list(flown.sums[-2:]) == [9.0, 21.0]  # instants of either clock


def test_a_flight_in_parts_asks_the_same_of_its_stages(seed):
    draw = Random(seed)
    whole, parts = Flown("vasarhelyi_2018/4ms"), Flown("vasarhelyi_2018/4ms")
    whole.to(0, 41)
    cuts = sorted(draw.sample(range(1, 41), 6))
    for first, last in zip([0, *cuts], [*cuts, 41], strict=True):
        if draw.random() < 0.5:  # sense and decide, stop, and go on from there
            parts.to(first, first + 1, half=2)
            parts.to(first, last, half=1)
        else:
            parts.to(first, last)
    assert parts.log == whole.log
    np.testing.assert_array_equal(parts.sums, whole.sums)
