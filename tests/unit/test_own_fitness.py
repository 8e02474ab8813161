"""Fitness functions of the user's own: a fault in one is a line that names its place, before a generation is flown."""

import pytest

import airflock
import toys
from airflock.search.study import load_study
from airflock.support.errors import ScenarioError, StudyError
from processes import called

pytestmark = pytest.mark.usefixtures("undrawn")


def study_file(folder, law, objective):
    (folder / "obj.py").write_text(law)
    (folder / "study.toml").write_text(
        'scenario = "vasarhelyi_2018/4ms"\n[set]\nduration = 1.0\nagents = 5\n'
        f'[objective]\nown = "obj.py"\n{objective}\n[space.model]\np_rep = {{ low = 0.1, high = 0.2 }}\n'
    )
    return folder / "study.toml"


@pytest.mark.parametrize(
    ("law", "line", "said"),
    [
        ("def mine(values):\n    return values['phi_velx']\n", 2, "KeyError: 'phi_velx'"),
        ("def mine(values):\n    return None\n", 1, "TypeError: float"),
        ("import math\ndef mine(values):\n    return math.sqrt(-1.0)\n", 3, "ValueError: "),
    ],
)
def test_a_fault_in_ones_own_function_is_one_line_at_the_first_flight(tmp_path, law, line, said):
    flights = []
    path = study_file(tmp_path, law, 'maximise = "mine"')
    with pytest.raises(StudyError) as fault:
        airflock.evolve(path, tmp_path / "a", population=30, generations=1, threads=1, watch=flights.append, trust=True)
    text = str(fault.value)
    assert text.startswith(f"objective mine: {tmp_path / 'obj.py'}:{line}: {said}") and "\n" not in text
    assert not flights


def test_a_file_of_functions_that_no_objective_names_is_refused(tmp_path):
    law = "from math import sqrt\ndef quick(values):\n    return 1.0\ndef slow(values):\n    return 0.0\n"
    for objective in ("", 'maximise = "phi_vel"'):
        with pytest.raises(ScenarioError) as fault:
            load_study(study_file(tmp_path, law, objective), trust=True)
        (said,) = fault.value.errors
        assert "objective.own = 'obj.py': no objective names a function of this file" in said
        assert said.endswith("write objective.maximise = 'quick' (it holds quick, slow)")
    with pytest.raises(ScenarioError, match="it holds no function"):
        load_study(study_file(tmp_path, "x = 1\n", ""), trust=True)
    usual = load_study(study_file(tmp_path, "def fitness(values):\n    return 1.0\n", ""), trust=True)
    assert usual.objectives[0].own is not None


@pytest.mark.parametrize("timeout", [-1.0, 0.0, float("nan")])
def test_a_time_limit_in_which_nothing_can_fly_is_refused_before_the_folder_is_made(tmp_path, timeout):
    with pytest.raises(StudyError, match=f"timeout = {timeout:g} s must be above 0"):
        airflock.evolve(toys.study(), tmp_path / "a", timeout=timeout)
    done = called("evolve", "vasarhelyi_2018/4ms", "--timeout", timeout, "--out", tmp_path / "a")
    assert done.returncode == 2 and done.stderr == f"airflock: timeout = {timeout:g} s must be above 0\n"
    assert not (tmp_path / "a").exists()
