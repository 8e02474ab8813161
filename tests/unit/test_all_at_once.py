"""Whatever is wrong with a command is told at once: an option is judged although another one is wrong."""

import shlex

import pytest
from typer.testing import CliRunner

from airflock.cli.main import app
from airflock.support.errors import INVALID, AirflockError, CardError, ErrorCollector, ScenarioError, value_or_default

SET = "vasarhelyi_2018/4ms"
LIMIT = "--limit 'r_mim<3 at 1%'"
ASKED = [
    (f"tune {SET} --out new", ["--budget soon", LIMIT, "--confidence 2", "--threads 0"]),
    (f"certify {SET}", [
        "--budget soon", LIMIT, "--confidence 2", "--flights -1", "--out lost.nc", "--tolerance-of radio.dely",
        "--map radio.dely=0:1:2", "--timeout -1", "--precision 16", "--device tpu", "--threads 0",
    ]),
    (f"evolve {SET} --out new", [
        "--population 1", "--generations x", LIMIT, "--sensitivity sobul", "--timeout -1", "--device tpu",
        "--threads 0",
    ]),
    (f"harden {SET} --out new.toml", ["--out lost.nc", "--seeds 1", "--cost nan", LIMIT, "--threads 0"]),
    (f"sweep {SET} --over radio.delay=0:1:2", [
        "--seeds 0", "--over radio.range", "--show fitnes", "--table lost.nc", "--precision 16", "--device tpu",
    ]),
    (f"run {SET}", ["--seeds 0", "--set model.p_rep=-1", "--save lost.csv", "--precision 16", "--device tpu"]),
    ("run unknown", ["--agents x", "--duration soon", "--plot lost.nc"]),
    (f"run {SET}", ["--agents x", "--duration soon", "--set model", "--first-seed -1", "--plot lost.nc"]),
    (f"fleet {SET} --agents 3 --duration 1", [
        "--seeds 0", "--vehicle naza", "--mode task", "--body quad", "--join 1", "--save lost.csv", "--card lost.txt",
        "--faults none.toml", "--against x", "--set radio.delay=-1",
    ]),
    ("fly prepare vasarhelyi_2018/real_4ms --site 47.5,19.04,120 --members 1-3", [
        "--site 1;2", "--members a-3", "--limit brake=900", "--margin -1", "--hours 0", "--autopilot naza",
        "--out lost.txt",
    ]),
    ("fly order none.json strat", ["--radio nonsense", "--point here"]),
]  # fmt: skip


def refused(words):
    """Lines of the refusal."""
    done = CliRunner().invoke(app, shlex.split(words))
    assert isinstance(done.exception, AirflockError), (words, done.exception, done.output)
    return str(done.exception).splitlines()


def told(option, lines):
    """Whether a line names what was given to an option, by its name or by its value."""
    name, value = shlex.split(option)
    value = value.partition("<")[0] if name == "--limit" else value.partition("=")[0] if name == "--set" else value
    return any(name in line or value.partition("=")[0] in line for line in lines)


@pytest.mark.parametrize(("words", "wrong"), ASKED, ids=[" ".join(words.split()[:2]) for words, _ in ASKED])
def test_every_wrong_option_is_told_beside_all_others(words, wrong, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given = [option for option in wrong if option != "--set model.p_rep=-1"]
    lines = refused(" ".join([words, *given]))
    assert [option for option in given if not told(option, lines)] == [], lines
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("words", "wrong"), ASKED, ids=[" ".join(words.split()[:2]) for words, _ in ASKED])
def test_of_two_wrong_options_both_are_told(words, wrong, tmp_path, monkeypatch):
    """Every pair; but what is judged by a scenario is left out where the scenario itself is wrong."""
    monkeypatch.chdir(tmp_path)
    for i, first in enumerate(wrong):
        for second in wrong[i + 1 :]:
            lines = refused(" ".join([words, first, second]))
            of_scenario = [option for option in (first, second) if option.split()[0] == "--limit"]
            expected = [first, second]
            if any(option.startswith("--set") for option in expected):
                expected = [option for option in expected if option not in of_scenario]
            assert [option for option in expected if not told(option, lines)] == [], (first, second, lines)
    assert list(tmp_path.iterdir()) == []


def test_a_part_is_left_out_only_where_what_it_is_made_of_is_wrong():
    def positive(x):
        if not x > 0.0:
            raise CardError([f"{x} is not above 0"])
        return x

    asked = ErrorCollector(["--seeds 0 lies outside [1, 9]"])
    good, bad = asked.read(positive, 2.0), asked.read(positive, -1.0)
    assert good == 2.0 and bad is INVALID and value_or_default(bad, 3.0) == 3.0 and value_or_default(good, 3.0) == 2.0
    assert asked.read(lambda a, b: a + b, good, 1.0) == 3.0
    assert asked.read(lambda a, b: a + b, good, b=bad) is INVALID
    assert (
        asked.collect_each(positive, [1.0, 2.0]) == [1.0, 2.0]
        and asked.collect_each(positive, [1.0, -2.0, -3.0]) is INVALID
    )
    assert asked.collect_each(positive, None) == []
    with pytest.raises(ScenarioError) as fault:
        asked.raise_errors()
    told = ["--seeds 0 lies outside [1, 9]", *(f"{x} is not above 0" for x in (-1.0, -2.0, -3.0))]
    assert str(fault.value).splitlines() == told


def test_a_single_fault_stays_the_error_that_it_was():
    asked = ErrorCollector()
    asked.raise_errors()
    only = CardError(["no such card"])

    def fails():
        raise only

    asked.read(fails)
    with pytest.raises(CardError) as fault:
        asked.raise_errors()
    assert fault.value is only


def test_a_name_that_is_none_is_told_beside_changes_that_are_none():
    for verb in (
        "run",
        "certify --limit 'r_min<3 at 1%'",
        "tune --out new",
        "evolve --out new",
        "harden --out new.toml",
    ):
        lines = refused(f"{verb} vasarhelyi_2018/4m --set p_rep --duration soon")
        assert [line.split(":")[0] for line in lines] == ["--set p_rep", "--duration soon", "vasarhelyi_2018/4m"], lines
