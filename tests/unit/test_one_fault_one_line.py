"""One mistake is one line: what a section of an unknown kind holds is not judged by the keys of another kind."""

import pytest

import airflock
from airflock.search.study import load_study
from airflock.support.errors import ScenarioError

OWN = "def error(g, s):\n    return g, 0.0\n"


def faults(tmp_path, text):
    (tmp_path / "own.py").write_text(OWN)
    file = tmp_path / "mine.toml"
    file.write_text('extends = "vasarhelyi_2018/4ms"\n' + text)
    with pytest.raises(ScenarioError) as told:
        airflock.load(file)
    return [line.removeprefix(f"{file}: ") for line in told.value.errors]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('[sensors]\nkind = "own.py"\noff = 0.1', "sensors.kind = 'own.py': would run the code"),
        ('[sensors]\nkind = "none.py"\noff = 0.1', "sensors.kind = 'none.py': no such file"),
        ('[sensors]\nkind = "gps"\nsd = 1.5', "sensors.kind = 'gps': unknown sensor; did you mean gnss?"),
        ('[body]\nkind = "own.py"\nwheels = 4', "body.kind = 'own.py': would run the code"),
        ('[body]\nkind = "quadroto"\nwheels = 4', "body.kind = 'quadroto': unknown body; did you mean quadrotor?"),
    ],
)
def test_keys_of_a_kind_that_cannot_be_had_are_not_judged(tmp_path, text, line):
    (found,) = faults(tmp_path, text)
    assert found.startswith(line)


def test_a_law_by_its_bare_name_is_one_line(tmp_path):
    table = "model = 'vicsek_1995' is not a table; write model.kind = 'vicsek_1995'"
    assert faults(tmp_path, 'model = "vicsek_1995"') == [table]


def test_a_key_of_the_top_that_stands_in_a_section_is_told_its_place(tmp_path):
    assert faults(tmp_path, "[flight]\ndt = 0.01") == ["flight.dt: unknown key; did you mean dt?"]


def test_what_the_kind_that_cannot_be_had_shares_with_all_is_judged(tmp_path):
    assert faults(tmp_path, '[sensors]\nkind = "gps"\nperiod = 99.0\nsd = 1.5') == [
        "sensors.kind = 'gps': unknown sensor; did you mean gnss?",
        "sensors.period = 99 s lies outside [0, 60] s",
    ]


def test_a_wrong_key_of_a_fault_names_the_right_ones(tmp_path):
    (found,) = faults(tmp_path, '[[faults]]\nkind = "radio_silent"\nat = 1.0\nagent = 1')
    assert found == "faults[0].agent: unknown key; did you mean faults[0].agents?"
    (found,) = faults(tmp_path, '[[faults]]\nkind = "radio_silent"\nat = 1.0\nxyzzy = 1')
    assert found.startswith("faults[0].xyzzy: unknown key; known: kind, at, until, lasts, per_hour, agents")


@pytest.mark.parametrize(
    ("settings", "note"),
    [
        ({"topology.k": 7}, "topology.kind = 'range' does not read topology.k: agents meet all that they hear"),
        ({"topology.kind": "nearest", "topology.k": 99}, "topology.k = 99: each of 100 agents meets all that it hears"),
        ({"topology.kind": "nearest", "topology.k": 98}, ""),
        ({"topology.kind": "voronoi", "topology.k": 500}, ""),
        ({}, ""),
    ],
)
def test_numbers_by_which_everybody_is_met_are_told(settings, note):
    told = [line for line in airflock.load("vasarhelyi_2018/4ms", settings).notes if "topology" in line]
    assert bool(told) == bool(note) and all(line.startswith(note) for line in told)


def test_a_key_of_the_search_that_stands_at_the_top_of_a_study_is_told_its_place(tmp_path):
    file = tmp_path / "study.toml"
    file.write_text('scenario = "vasarhelyi_2018/4ms"\ngenerations = 3\ntitel = "mine"\n')
    with pytest.raises(ScenarioError) as told:
        load_study(file)
    assert str(told.value).splitlines() == [
        f"{file}: generations: unknown key; did you mean search.generations?",
        f"{file}: titel: unknown key; did you mean title?",
    ]


def test_a_file_without_a_law_says_what_to_write(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("agents = 5\n[world]\narena = 'square'\n")
    with pytest.raises(ScenarioError) as told:
        airflock.load(file)
    (line,) = told.value.errors
    written = 'write a law under [model], for instance kind = "vasarhelyi_2018", or begin the file with extends ='
    assert f"model.kind is missing; {written}" in line and "couzin_2002" in line and "None" not in line


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("fish.csv", "is a table, not a scenario; airflock import makes a recording of it"),
        ("log.ulg", "is a flight log, not a scenario; airflock import"),
        ("mission.json", "is JSON, not a scenario (TOML); airflock watch"),
        ("tracks.npy", "is arrays, not a scenario; airflock import"),
        ("mine.toml", "is not a scenario file (TOML): Expected '='"),
        ("mine.txt", "is not a scenario file (TOML): Expected '='"),
    ],
)
def test_what_is_no_scenario_says_what_takes_it(tmp_path, name, line):
    (tmp_path / name).write_text("frame,fish,x,y\n0,1,2.5,3.5\n")
    for take in (airflock.load, airflock.validate):
        with pytest.raises(ScenarioError) as told:
            take(tmp_path / name)
        assert told.value.errors[0].startswith(f"{tmp_path / name}: {line}") and len(told.value.errors) == 1
