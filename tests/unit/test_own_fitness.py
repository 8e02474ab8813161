"""Fitness functions of the user's own: a fault in one is a line that names its place, before a generation is flown."""

import random

import pytest

import airflock
import toys
from airflock.search.evolution import _text_of
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


SHORT = {"population": 6, "generations": 9, "seeds": 1, "final_seeds": 3, "pool": 3, "top": 2, "threads": 1}
RISKY = "def mine(values):\n    return values['phi_corr'] / (values['phi_vel'] > {:.3f})\n"
SAFE = "def mine(values):\n    return values['phi_corr'] if values['phi_vel'] > {:.3f} else 0.0\n"


def test_a_flight_for_which_fitness_fails_is_a_failed_one_and_a_mended_file_goes_on(tmp_path, seed):
    """As if it had been mended from the beginning: the same result as that of a search that knew it all the time."""
    rng = random.Random(seed)
    for number in range(3):
        folder, limit = tmp_path / str(number), rng.uniform(0.9, 1.1)
        folder.mkdir()
        path = study_file(folder, RISKY.format(limit), 'maximise = "mine"')
        result = airflock.evolve(path, folder / "a", trust=True, **SHORT, seed=number)
        (line, count), *more = [*result.reasons.items(), ("", 0)]
        assert count == result.failed and not any(k for _, k in more)
        assert not count or line == f"objective mine: {folder / 'obj.py'}:2: ZeroDivisionError: float division by zero"
        study_file(folder, SAFE.format(limit), 'maximise = "mine"')
        mended = airflock.evolve(path, folder / "a", trust=True, **SHORT, seed=number, resume=True)
        fresh = airflock.evolve(path, folder / "b", trust=True, **SHORT, seed=number)
        assert {**mended.document()} == {**fresh.document()} and not mended.reasons


def test_a_fitness_that_leaves_python_is_one_line(tmp_path):
    path = study_file(tmp_path, "def mine(values):\n    raise SystemExit(3)\n", 'maximise = "mine"')
    with pytest.raises(StudyError, match="obj.py:2: SystemExit: 3"):
        airflock.evolve(path, tmp_path / "a", trust=True, **SHORT)


def test_another_fitness_is_named_where_it_differs_and_goes_on_only_with_resume(tmp_path):
    path = study_file(tmp_path, SAFE.format(1.0), 'maximise = "mine"')
    airflock.evolve(path, tmp_path / "a", trust=True, **SHORT | {"generations": 1})
    study_file(tmp_path, SAFE.format(2.0), 'maximise = "mine"')
    with pytest.raises(StudyError, match=r"objective\[0\].own = [0-9a-f]{12} there, [0-9a-f]{12} now"):
        airflock.evolve(path, tmp_path / "a", trust=True, **SHORT | {"generations": 1})
    with pytest.raises(StudyError, match="search.seed = 0 there, 1 now"):  # and nothing else may differ
        airflock.evolve(path, tmp_path / "a", trust=True, **SHORT | {"generations": 1}, seed=1, resume=True)


@pytest.mark.parametrize(
    ("value", "word"),
    [("3.0", "flat, 3"), *((f"float('{word}')", "nan or inf, no finite number,") for word in ("nan", "inf", "-inf"))],
)
def test_a_fitness_that_tells_no_candidate_from_another_ends_the_search(tmp_path, value, word):
    """Also of small generations, of which three are too few to say so."""
    path = study_file(tmp_path, f"def mine(values):\n    return {value}\n", 'maximise = "mine"')
    flights = []
    with pytest.raises(StudyError, match=f"mine is {word} for all of 42 candidates"):
        airflock.evolve(path, tmp_path / "a", trust=True, watch=flights.append, **SHORT | {"generations": 30})
    assert len(flights) < 60
    path = study_file(tmp_path, "def mine(values):\n    return 1 / 0\n", 'maximise = "mine"')
    with pytest.raises(StudyError, match="every candidate failed; the first one: objective mine: .*obj.py:2: ZeroDiv"):
        airflock.evolve(path, tmp_path / "b", trust=True, **SHORT | {"generations": 2})


FACTOR = 1.0


def test_a_function_of_python_is_another_one_when_what_it_reads_has_changed(monkeypatch):
    def helper(values):
        return values["phi_vel"]

    def fitness(values):
        return FACTOR * helper(values)

    before = _text_of(fitness)
    assert before == _text_of(fitness)
    monkeypatch.setitem(globals(), "FACTOR", 2.0)
    changed = _text_of(fitness)
    helper.__code__ = (lambda values: values["phi_corr"]).__code__
    assert len({before, changed, _text_of(fitness)}) == 3
