"""The stages of a driver are the trees on record: whoever changes what a driver computes sees it here first.

Recorded from the drivers whose passes were written as text (`tests/trees.py` says what is normalised). After a change
that is meant: python tests/agreement/test_trees.py
"""

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from airflock.engine import plan_of
from airflock.scenarios.files import load, presets
from flocks import ISLANDS, NOTCHED, SILENT, scenario
from inside import (
    CudaBuilder,
    cuda_cells as cells,
    cuda_kernel as kernel,
    no_cuda,
    passes_build as building,
    passes_driver as driver,
    shape_of,
    specialise_values as values,
    stages_clusters as clusters,
    stages_decide as decide,
    stages_measure as measure,
    stages_move as move,
    stages_noise as noise,
    stages_pair as pair,
    stages_perceive as perceive,
    stages_receive as receive,
    stages_scene as scene,
    stages_start as start,
    stages_surfaces as surfaces,
)
from trees import digests

RECORD = Path(__file__).with_suffix(".json")
OTHERS = {
    "3-D": ("vasarhelyi_2018", {"world__dimensions": "3"}),
    "links": ("vasarhelyi_2018", {"radio__kind": "links", "radio__near": 5.0, "radio__far": 20.0}),
    "links, loss, late, 3-D": ("vasarhelyi_2018", {
        "radio__kind": "links", "radio__loss": 0.5, "radio__delay": 0.2, "world__dimensions": "3",
    }),
    "loss, gusts": ("viragh_2014", {"radio__loss": 0.7, "wind__gust": 2.0}),
    "quiet": ("vasarhelyi_2018", SILENT),
    "quiet, at once": ("vasarhelyi_2018", SILENT | {"radio__delay": 0.0}),
    "periodic, loss": ("vasarhelyi_2018", {"world__edges": "periodic", "radio__loss": 0.3}),
    "bounce": ("vasarhelyi_2018", {"world__edges": "bounce"}),
    "silo, islands": ("viragh_2014", {
        "world__dimensions": "3", "world__arena": "circle", "world__obstacles": ISLANDS,
    }),
    "polygon": ("vasarhelyi_2018", {"world__arena": "polygon", "world__corners": NOTCHED}),
}  # fmt: skip


def scenarios():
    """One preset of each plan, and other plans, by name."""
    found, seen = {}, set()
    for name in presets():
        one = load(name)
        if (plan := plan_of(one, precision=32)) not in seen:
            seen.add(plan)
            found[name] = one
    common = {"agents": 6, "world__side": 60.0, "world__height": 40.0, "start__separation": 5.0}
    kinds = {name: {key.replace(".", "__"): value for key, value in keys.items()} for name, (_, keys) in OTHERS.items()}
    return found | {name: scenario(OTHERS[name][0], **common, **keys) for name, keys in kinds.items()}


SCENARIOS = scenarios()


def trees_of(make, *given, builder=building.Builder):
    """Digests of the stages in a driver's text."""
    made = []
    first = builder.__init__

    def remembered(self, *arguments, **named):
        first(self, *arguments, **named)
        made.append(self)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(builder, "__init__", remembered)
        text = make(*given)
    return digests(text, made[0].rows)


def found_of(name):
    """Digests of the drivers of a scenario: in single precision, in double with a recording, of a GPU, by cells."""
    one = SCENARIOS[name]
    plan = plan_of(one, precision=32).built(grid=False)
    shape = shape_of(one.agents, 1, sequential=plan.sequential, whole_flock=bool(plan.model.flock))
    found = {
        "32": trees_of(driver.flight_driver_text, plan),
        "64": trees_of(driver.flight_driver_text, plan.built(bits=64, record=True)),
    }
    if found["64"] == found["32"]:
        del found["64"]
    if no_cuda(plan, one.agents) is None:
        found["kernel"] = trees_of(kernel.flight_text, plan, shape, builder=CudaBuilder)
    alone = not (
        plan.has_sensor_error
        or plan.delayed
        or plan.lossy
        or plan.radio.keeps_packets
        or plan.sequential
        or plan.varies("p")
    )
    if alone and plan.model.neighbour is not None and plan.model.reach is not None:
        found["grid"] = trees_of(driver.flight_driver_text, plan.built(grid=True))
        found["near"] = trees_of(driver.flight_driver_text, plan.built(grid=True, near=True))
        if found["near"] == found["grid"]:
            del found["near"]
        if plan.start in ("arena", "ball") and not plan.model.flock:
            found["cells"] = trees_of(cells.large_flock_text, plan.built(grid=True), builder=CudaBuilder)
    return found


@pytest.mark.parametrize("name", SCENARIOS)
def test_stages_are_the_trees_on_record(name):
    assert found_of(name) == json.loads(RECORD.read_text())[name]


CHANGES = (
    (receive, "real(decision), rate", "real(decision + 1), rate", "links"),
    (pair, "return integer(q) != me.ii", "return integer(q) == me.ii", "quiet"),
    (pair, "if flight.plan.periodic:", "if flight.plan.delayed:", "quiet"),
    (surfaces, "flock.walls[c][i] += t[c]", "flock.walls[c][i] += t[0]", "polygon"),
    (move, "x[a][i] += v[a][i] * numbers.c.dt", "x[a][i] += v[a][i] * numbers.c.period", "quiet"),
    (perceive, "place[i] = x[i] + q[i]", "place[i] = x[i] + u[i]", "3-D"),
    (decide, "flock.command[a][i] = o[a]", "flock.command[a][i] = o[0]", "quiet"),
    (measure, "(integer(j) < nn)", "(integer(j) <= nn)", "quiet"),
    (clusters, "if done + size == n", "if size == n", "quiet"),
    (start, "return -(i + 1)", "return -i", "quiet"),
    (scene, "later[r, 6] <= time", "later[r, 6] >= time", "kidger/city"),
    (noise, "step % 2 == 0", "step % 2 == 1", "links"),
)


@pytest.mark.parametrize(("module", "old", "new", "name"), CHANGES, ids=[f"{c[0].__name__}-{c[1]}" for c in CHANGES])
def test_one_changed_word_of_a_stage_is_seen(module, old, new, name, monkeypatch):
    text = Path(module.__file__).read_text()
    assert old in text
    changed = {module.__file__: text.replace(old, new)}
    lines = SimpleNamespace(getlines=lambda path: [changed.get(path) or Path(path).read_text()])
    monkeypatch.setattr(values, "linecache", lines)
    values._module.cache_clear()
    values.function_syntax.cache_clear()
    try:
        plan = plan_of(SCENARIOS[name], precision=32).built(grid=False)
        assert trees_of(driver.flight_driver_text, plan) != json.loads(RECORD.read_text())[name]["32"]
    finally:
        values._module.cache_clear()
        values.function_syntax.cache_clear()


if __name__ == "__main__":
    RECORD.write_text(json.dumps({name: found_of(name) for name in SCENARIOS}, indent=0) + "\n")
