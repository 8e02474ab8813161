"""Examples and the start page's scenario file run as they stand; every publication named is in references.bib."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from airflock import open_many
from airflock.parts.laws import formation
from airflock.scenarios.files import load
from airflock.scenarios.named_code import MODELS
from flocks import interpreted
from reference.flight import fly_plainly

ROOT = Path(__file__).parents[2]
NEEDS = {"gym_env": "gymnasium", "real_fish": "trajectorytools"}  # examples that need what we do not install

LONG = {"gym_env"}  # examples that take minutes


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, id=path.stem, marks=[pytest.mark.nightly] * (path.stem in LONG))
        for path in sorted((ROOT / "examples").glob("*.py"))
    ],
)
def test_example_runs(path, tmp_path):
    if path.stem in NEEDS:
        pytest.importorskip(NEEDS[path.stem])
    done = subprocess.run([sys.executable, str(path)], capture_output=True, text=True, cwd=tmp_path, timeout=300)
    assert done.returncode == 0, done.stderr
    assert "phi_vel" in done.stdout


def test_plugin_is_built_installed_and_passes_its_own_tests_and_its_law_flies_by_name(tmp_path):
    source, site = tmp_path / "plugin", tmp_path / "site"
    shutil.copytree(ROOT / "examples" / "plugin", source)  # a build leaves files beside its source
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation"]
    path = os.pathsep.join([str(site), *sys.path])
    env = {**os.environ, "PYTHONPATH": path, "COLUMNS": "120"}
    fly = [sys.executable, "-m", "airflock", "run", "vasarhelyi_2018/4ms", "--law", "springs", "--device", "python"]
    commands = (
        [*pip, "--target", str(site), str(source)],
        [sys.executable, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", str(source / "tests")],
        [*fly, "--agents", "3", "--duration", "4", "--set", "model.rest=12"],
    )
    for command in commands:
        done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=300, env=env)
        assert done.returncode == 0, done.stdout + done.stderr
    assert "phi_vel" in done.stdout


def test_own_rule_flies_the_same_in_plain_python(seed):
    sys.path.insert(0, str(ROOT / "examples"))
    try:
        import own_rule
    finally:
        sys.path.pop(0)
    p = own_rule.Parameters()
    alone = own_rule.neighbour(0.0, 100.0, 0.0, 100.0, 0.0, 0.0, 0.0, p)
    assert alone == (0.0, 0.0, 0.0)
    near = own_rule.neighbour(3.0, 4.0, 0.0, 5.0, 0.0, 0.0, 0.0, p)
    assert near == pytest.approx((-p.push * 10.0 * 0.6, -p.push * 10.0 * 0.8, 0.0))
    found = load("vasarhelyi_2018/4ms", {"agents": 5, "duration": 4.0, "world.side": 60.0}, law=own_rule)
    known, text = fly_plainly(found, seed), interpreted(found, seed)
    assert np.abs(np.diff(known.frames[:, 2:4], axis=0)).max() > 0.1  # they act on each other
    np.testing.assert_allclose(text.frames, known.frames, atol=1e-9)


@pytest.fixture
def gym_env(monkeypatch):
    """The example that learns to flock."""
    pytest.importorskip("gymnasium")
    monkeypatch.syspath_prepend(ROOT / "examples")
    import gym_env

    return gym_env


def test_the_network_of_the_example_turns_with_the_world(gym_env, seed):
    rng = np.random.default_rng(seed)
    draw = {"velocity": (3, 5, 2), "offset": (3, 5, 7, 2), "closing": (3, 5, 7, 2), "free": (3, 5, 8)}
    seen = {name: rng.normal(0.0, 10.0, shape) for name, shape in draw.items()}
    quarter = np.array([[0.0, -1.0], [1.0, 0.0]])  # a turn of 90 degrees moves two of eight rays
    turned = {name: np.roll(a, 2, axis=-1) if name == "free" else a @ quarter.T for name, a in seen.items()}
    heard, weights = np.ones((3, 5, 7)), rng.normal(0.0, 0.5, (3, gym_env.SIZE))
    one, other = (gym_env.act(weights, SimpleNamespace(**a, heard=heard)) for a in (seen, turned))
    assert other == pytest.approx(one @ quarter.T, abs=1e-9) and np.abs(one).max() > 0.1


def test_the_network_of_the_example_is_the_law_network(gym_env, seed):
    weights = np.random.default_rng(seed).normal(gym_env.AHEAD, 0.5, gym_env.SIZE)
    settings = {**gym_env.SCENARIO, "agents": 6, "world.side": 200.0, "model.weights": gym_env.as_law(weights)}
    scenario = load("vasarhelyi_2018/4ms", settings, law="network")
    flights = open_many(scenario, [seed], neighbours=5, device="python")
    for _ in range(5):  # 1 s, in which nobody flies beyond a wall, where rays end and the law goes on to feel it
        assert flights.commands == pytest.approx(gym_env.act(weights[None], flights.percepts), abs=1e-9)
        flights.advance()


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(1, 11))
def test_what_the_example_has_learnt_beats_random_networks(gym_env, seed):
    best = gym_env.train(seed=seed)
    envs = gym_env.airflock.learn.make_vec("vasarhelyi_2018/4ms", 10, settings=gym_env.SCENARIO)
    draws = np.random.default_rng(seed).normal(gym_env.AHEAD, 0.5, (10, gym_env.SIZE))
    learnt, random = (gym_env.fly(envs, np.broadcast_to(w, draws.shape), 10**6).mean() for w in (best, draws))
    assert learnt > random + 0.1


def test_scenario_file_of_the_start_page_is_valid(tmp_path):
    block = re.search(r"```toml\n(.*?)```", (ROOT / "docs/start.md").read_text(encoding="utf-8"), re.S)
    assert block
    file = tmp_path / "mine.toml"
    file.write_text(block[1], encoding="utf-8")
    assert load(file).agents == 12


def test_every_model_file_is_named_after_a_publication_in_the_bibliography():
    keys = set(re.findall(r"@\w+\{(\w+),", (ROOT / "references.bib").read_text(encoding="utf-8")))
    ours = {name for name, law in MODELS.items() if "Ours." in law.doc}  # not published: its file says so
    folders = {path.parent.name for path in (ROOT / "src/airflock/parts/laws").glob("*/law.py")} - ours
    assert folders == set(MODELS) - ours
    for name in folders:
        assert name in keys, f"{name} is not in references.bib"
    assert "Ours." in formation.__doc__
