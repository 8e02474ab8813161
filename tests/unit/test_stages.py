"""Stages are code: no text in them is a statement, and each runs as it stands, as the driver made of it does."""

import ast
import math
import types
from collections import namedtuple
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from airflock.core import random
from airflock.core.contract import CLOCKS
from airflock.engine import plan_of
from flocks import ISLANDS, NOTCHED, scenario
from inside import (
    WHOLE,
    FlightView,
    Flock,
    Itself,
    Surroundings,
    clusters_of,
    passes_decide as decide,
    passes_driver as driver,
    passes_measure as measure,
    passes_perceive as perceive,
    stages,
    stages_approach as approach,
    stages_decide as deciding,
    stages_gusts as gusts,
    stages_measure as judging,
    stages_meet as meet,
    stages_move as motion,
    stages_neighbours as neighbours,
    stages_noise as noise,
    stages_perceive as measuring,
    stages_receive as receive,
    stages_start as start,
    stages_surfaces as surfaces,
    stages_words as words,
    tables,
)

FILES = sorted(Path(stages.__file__).parent.glob("*.py"))


def strings(tree):
    """String constants of a file that are no docstrings."""
    documented = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documented:
            yield node


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_no_text_in_a_stage_is_code(path):
    """A name, at most (of a row, of a field, of a constant with its sign): never a statement or an expression."""
    for node in strings(ast.parse(path.read_text())):
        assert not node.value or node.value.lstrip("-").isidentifier(), f"{path.name}:{node.lineno}: {node.value!r}"


SILENT = {"sensors__noise": 0.0, "body__noise": 0.0}
CASES = {
    "paper": ("vasarhelyi_2018", {}),
    "dryden, quadrotor, polygon, 3-D": (
        "vasarhelyi_2018",
        {
            "wind__kind": "dryden",
            "wind__north": 3.0,
            "body__kind": "quadrotor",
            "world__arena": "polygon",
            "world__corners": NOTCHED,
            "world__dimensions": "3",
            "world__floor": 3.0,
        },
    ),
    "loss, gusts, obstacles": ("viragh_2014", {"radio__loss": 0.5, "wind__gust": 2.0, "world__obstacles": ISLANDS}),
    "links, 3-D": ("vasarhelyi_2018", {"world__dimensions": "3", "radio__kind": "links", "radio__near": 5.0}),
    "periodic, late": ("vasarhelyi_2018", SILENT | {"world__edges": "periodic"}),
    "nearest": ("vasarhelyi_2018", {"topology__kind": "nearest", "topology__k": 2}),
    "voronoi, periodic": ("vasarhelyi_2018", {"topology__kind": "voronoi", "world__edges": "periodic"}),
    "visible, obstacles": (
        "vasarhelyi_2018",
        {"topology__kind": "visible", "topology__radius": 3.0, "world__obstacles": ISLANDS},
    ),
    "strongest, links": ("viragh_2014", {"topology__kind": "strongest", "topology__k": 2, "radio__kind": "links"}),
    "at once": ("vasarhelyi_2018", SILENT | {"radio__delay": 0.0, "world__walls": "nearest_per_axis"}),
}


class World:
    """Rows with random numbers in them, and the numbers of a scenario, for stages of one plan."""

    def __init__(self, name, seed):
        kind, keys = CASES[name]
        found = scenario(kind, agents=6, world__side=60.0, world__height=50.0, start__separation=4.0, **keys)
        self.plan = plan_of(found, precision=64)
        self.tables = tables(found, self.plan, seed)
        self.build = driver.flight_stages(self.plan)
        rng, n = np.random.default_rng(seed), 6
        dims = self.plan.dimensions
        self.state = {
            "work": rng.uniform(-12.0, 12.0, (len(self.build.rows), n)),
            "ring": rng.uniform(-12.0, 12.0, (2, 2 * dims, n)),
            "words": np.zeros((4, n), np.uint32).astype(object),
            "store": np.concatenate([rng.uniform(-9.0, 9.0, (2 * dims, n, n)), np.full((1, n, n), -1e9)]),
            "gust": np.array([0.3, -0.2, 0.1, 0.5, -0.4])[: 5 if self.plan.dryden else 3],
            "held": rng.uniform(-2.0, 2.0, approach.HELD_SIZE),
        }  # fmt: skip
        whole = dict(zip(WHOLE, self.tables.whole.tolist(), strict=True))
        self.whole, self.row = types.SimpleNamespace(**whole), self.tables.row.tolist()
        self.rest = {name: getattr(self.tables, name) for name in ("faces", "edges", "spans")}
        self.rest["scene"] = types.SimpleNamespace()

    def text(self):
        """The driver's functions as plain Python."""
        held = {name: getattr(words, name) for name in ("real", "integer", "least", "most", "choose")}
        held |= {name: float(getattr(words, name)) for name in ("ZERO", "HALF", "ONE", "TINY", "FAR", "LIMIT", "AWAY")}
        held |= {name: getattr(random, name) for name in random.PRIMITIVES}
        held |= {"math": math, "np": np, "namedtuple": namedtuple, "JIT": {}, "ONCE": {}}
        held |= {name: lambda: None for name in ("wide_vectors", "alone", "apart")}
        held |= {"apart": lambda: None, "u64": int}
        held["njit"] = lambda *_, **__: lambda function: function
        exec("\n\n".join([*self.build.source.blocks, *self.build.functions]), held)
        return held

    def by_text(self, step):
        """One decision and one motion step by the text of the driver."""
        made, state, n = self.text(), {name: array.copy() for name, array in self.state.items()}, 6
        common = self.row, self.tables.whole.tolist(), state["work"]
        made["snapshot"](1, n, state["work"], state["ring"])
        made["perceive"](step, 0, n, *common, state["ring"], state["words"])
        around = (self.rest[name] for name in perceive.world_arguments(self.plan))
        made["neighbours"](step, n, n, 0.7, 0.2, *common, state["store"], state["words"], *around)
        made["boundaries"](n, *common, *self.rest.values())
        made["decide"](step, n, 0.7, *common, None, *list(self.rest.values())[1:])
        state["fastest"] = made["move"](step, n, n, state["held"], *common, state["words"], state["gust"])
        return state

    def directly(self, step):
        """The same by the stages as they stand."""
        state, n, plan, model = (
            {name: array.copy() for name, array in self.state.items()},
            6,
            self.plan,
            self.plan.model,
        )
        whole, numbers = self.whole, self.numbers()

        flock = self.flock(**state)
        measuring.snapshot(flock, 1, n, state["ring"], plan=plan)
        measuring.perceive(flock, numbers, whole, step, 0, n, state["ring"], plan=plan)

        def draw(i):
            receive.draw(range(n), flock, whole, i, step, n, plan=plan)

        fields = decide._asked(self.build, words.nonzero_fields(model.Sums, plan.dimensions))
        sums = tuple((c, model.reduce.get(model.Sums._fields[c], "sum")) for c in fields)
        around = self.around()
        flight = FlightView(plan, model, flock, numbers, whole, around)

        def pick(i):
            meet.meet(flight, i, range(n), n, n, step)

        neighbours.neighbours(
            range(n), range(n), flight, n, step, 0.7, 0.2, state["words"], draw, None, pick, sums=sums,
            images=plan.periodic,
        )  # fmt: skip
        surfaces.boundaries(range(n), flight, self.rest["faces"])
        deciding.decide(
            range(n), flight, step, 0.7, None, None, summed=fields,
            walled=words.nonzero_fields(model.Walls, plan.dimensions),
        )  # fmt: skip
        state["fastest"] = motion.move(
            range(n), range(n), flight, step, n,
            lambda: noise.noise(flock, whole, step, n, plan=plan),
            lambda: gusts.gusts(numbers, whole, step, state["gust"], plan=plan), state["held"],
            0, 0, watched=True, drifts=True, kept=False,  # nobody suffers
        )  # fmt: skip
        return state

    def flock(self, work, words=None, store=None, **_):
        """Rows of these tables by what they hold."""

        def take(name):
            if name[0] == "u" and name[1:].isdigit():
                return words[int(name[1:])]
            if name.startswith("packet"):
                return store[int(name[len("packet") :])]
            # a row that no driver has holds what nobody asks for
            return work[self.build.row(name)] if self.build.row(name) < len(work) else np.zeros(work.shape[1])

        return Flock(take, self.plan.dimensions, Itself())

    def around(self):
        """What stands in the world."""
        return Surroundings(*(self.rest[name] for name in ("edges", "spans", "scene")))

    def numbers(self):
        """Records of numbers as a stage reads them."""
        found, at = types.SimpleNamespace(wing=None, aero=None), 0
        for letter, fields in self.plan.records.items():
            values = dict(zip(fields, self.row[at : at + len(fields)], strict=True))
            setattr(found, letter, types.SimpleNamespace(**values | self.plan.constants.get(letter, {})))
            at += len(fields)
        return found

    def places(self):
        """Rows with where agents begin: by the text of the driver, and by the stage as it stands."""
        n, rest = 6, list(self.rest.values())[1:]
        text, direct = (np.zeros_like(self.state["work"]) for _ in range(2))
        ended = [self.text()["begin"](n, n, self.row, self.tables.whole.tolist(), text, *rest[:2], None, rest[2])]
        flock = self.flock(direct)
        far = partial(start.excursion, plan=self.plan)
        ended += [start.begin(flock, self.numbers(), self.whole, self.around(), n, n, None, far, plan=self.plan)]
        return ended, text, direct

    def samples(self, clock):
        """Values of one instant, rows and memories: by the text of the driver, and by the stage as it stands."""
        n, found = 6, []
        edges, spans, scene = list(self.rest.values())[1:]
        whole = self.tables.whole.tolist()
        for text in (True, False):
            work, values, memory = self.state["work"].copy(), np.zeros(40), np.ones((9, n))
            parts = (memory, np.zeros((2, n), int), values)
            if text:
                least = self.text()[f"measure_{clock}"](0.7, n, n, self.row, whole, work, edges, spans, scene, *parts)
            else:
                metrics = judging.measured_metrics(self.plan, clock)
                least = judging.measure(
                    FlightView(self.plan, self.plan.model, self.flock(work), self.numbers(), self.whole, self.around()),
                    0.7, n, n, *parts,
                    partial(start.excursion, plan=self.plan), {}, {one.metric.name: clusters_of for one in metrics},
                    metrics=metrics, nearest=clock == "collision", over=None, abreast=True,
                    headed=measure.needs_headings(metrics), summed="xvh",
                )  # fmt: skip
            found.append((least, values, memory, work))
        return found


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("name", CASES)
def test_order_parameters_as_they_stand_are_those_of_the_driver_made_of_them(name, clock, seed):
    text, direct = World(name, seed).samples(clock)
    for expected, value in zip(text, direct, strict=True):
        np.testing.assert_allclose(value, expected, rtol=1e-12, atol=1e-12)
    assert np.any(text[1]) or (clock == "collision" and 0.0 < text[0] < 100.0)


@pytest.mark.parametrize("name", CASES)
def test_the_least_distance_as_it_stands_is_that_of_the_driver_made_of_it(name, seed):
    world = World(name, seed)
    work, n = world.state["work"], 6
    found = approach.nearest(range(n), world.flock(work), world.numbers(), n, n, plan=world.plan)
    assert found == world.text()["nearest"](n, n, world.row, world.tables.whole.tolist(), work)
    assert 0.0 < found < 40.0


@pytest.mark.parametrize("name", CASES)
def test_the_start_as_it_stands_is_that_of_the_driver_made_of_it(name, seed):
    (text_ended, ended), text, direct = World(name, seed).places()
    assert ended == text_ended == 0
    np.testing.assert_array_equal(direct, text)
    assert len(np.unique(text[:2], axis=1).T) == 6


@pytest.mark.parametrize("name", CASES)
def test_stages_as_they_stand_do_what_the_driver_made_of_them_does(name, seed):
    world = World(name, seed)
    for step in (2, 3):  # an even step draws the outer noise of the odd one after it
        direct, text = world.directly(step), world.by_text(step)
        assert not np.array_equal(text["work"], world.state["work"])  # something happens
        for part, expected in text.items():
            np.testing.assert_allclose(
                np.asarray(direct[part], float), np.asarray(expected, float), rtol=1e-12, atol=1e-12, err_msg=part
            )
