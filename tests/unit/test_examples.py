"""Examples and the start page's scenario file run as they stand; every publication named is in references.bib."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from airflock.parts.laws import formation
from airflock.scenarios.files import load
from airflock.scenarios.named_code import MODELS
from flocks import interpreted
from reference.flight import fly_plainly

ROOT = Path(__file__).parents[2]
NEEDS = {"gym_env": "gymnasium", "real_fish": "trajectorytools"}  # examples that need what we do not install


@pytest.mark.parametrize("path", sorted((ROOT / "examples").glob("*.py")), ids=lambda path: path.stem)
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


def test_the_environment_of_reinforcement_learning_keeps_the_rules_of_gymnasium(monkeypatch, seed):
    checker = pytest.importorskip("gymnasium.utils.env_checker")
    monkeypatch.syspath_prepend(ROOT / "examples")
    import gym_env

    small = {"agents": 12, "duration": 4.0, "world.side": 120.0}
    checker.check_env(gym_env.FlockMember(settings=small), skip_render_check=True)
    env = gym_env.FlockMember(settings=small)
    seen, _ = env.reset(seed=seed)
    assert seen[:2] == pytest.approx(0.0, abs=2.0)  # at rest, but for the error of its receiver
    for count in range(1, 21):
        seen, _, hit, over, _ = env.step(np.array([0.5, -0.25]))
        assert not hit and over == (count == 20)
    east, north = env.flight.state[2:, 0]  # 4 s of a body that relaxes within 1 s to what was commanded
    assert (east, north) == pytest.approx((4.0, -2.0), abs=0.8) and (seen[2:] != 0.0).any()


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
