"""Scenario files: every fault in one line, all at once, whatever is in the file."""

import copy
import json
import tomllib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

import airflock
from airflock.recordings.flown_scenario import scenario_of_recording
from airflock.runs.executors import rebuild_scenario
from airflock.runs.folder import write_toml_file
from airflock.scenarios import formats
from airflock.scenarios.files import load, presets, scenario_variant
from airflock.scenarios.scenario_builder import build_scenario, with_settings
from airflock.search.study import load_study
from airflock.support.errors import AirflockError, ScenarioError

DOCUMENTS = {name: tomllib.loads(path.read_text(encoding="utf-8")) for name, path in presets().items()}
SQUARE = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]]
numbers = st.one_of(
    st.floats(), st.integers(-(10**12), 10**12), st.sampled_from([0, -1, 1e308, -0.0, float("nan"), float("inf")])
)
points = st.lists(st.lists(st.floats(-500.0, 500.0), min_size=0, max_size=3), max_size=6)
values = st.one_of(
    numbers,
    st.booleans(),
    st.none(),
    st.text(max_size=8),
    points,
    st.lists(points, max_size=3),
    st.dictionaries(st.sampled_from(["value", "unit", "source", "kind", ""]), st.one_of(numbers, st.text(max_size=3))),
)


def places(document):
    """Paths to everything in a document: (section,), (section, key)."""
    found = [(key,) for key in document]
    return found + [(key, inner) for key, table in document.items() if isinstance(table, dict) for inner in table]


@st.composite
def mutated(draw):
    """A preset's document after one to four blows: values replaced, keys misspelt, removed, doubled or moved."""
    document = copy.deepcopy(DOCUMENTS[draw(st.sampled_from(sorted(DOCUMENTS)))])
    for _ in range(draw(st.integers(1, 4))):
        path = draw(st.sampled_from(places(document)))
        table = document if len(path) == 1 else document[path[0]]
        how = draw(st.sampled_from(["value", "value", "value", "misspell", "remove", "add", "move"]))
        if how == "value":
            table[path[-1]] = draw(values)
        elif how == "misspell":
            at = draw(st.integers(0, len(path[-1])))
            table[path[-1][:at] + draw(st.characters(codec="ascii")) + path[-1][at:]] = table.pop(path[-1])
        elif how == "remove":
            del table[path[-1]]
        elif how == "add":
            table[draw(st.text(max_size=6))] = draw(values)
        else:
            document[draw(st.sampled_from(["model", "world", "body", "sensors", "metrics", "agents"]))] = table[
                path[-1]
            ]
        if not document:
            break
    return document


@given(mutated())
@settings(max_examples=3000, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_a_mutated_scenario_loads_or_is_refused_in_lines_that_name_it(document):
    try:
        found = build_scenario(document, "mutant.toml")
    except AirflockError as fault:
        lines = str(fault).splitlines()
        assert lines and all(line.startswith("mutant.toml: ") for line in lines)
        assert len(lines) == len(set(lines))
    else:
        assert found.agents >= 1 and found.separation() >= 0.0


@given(st.sampled_from(sorted(DOCUMENTS)), st.integers(0, 10**6), st.binary(min_size=0, max_size=4))
@settings(max_examples=300, deadline=None)
def test_a_damaged_file_is_refused_or_loads(tmp_path_factory, name, at, junk):
    text = presets()[name].read_bytes()
    file = tmp_path_factory.getbasetemp() / "damaged.toml"
    file.write_bytes(text[: at % len(text)] + junk + text[at % len(text) + len(junk) :])
    try:
        load(file)
    except AirflockError as fault:
        assert str(fault).startswith(str(file))


def faults_of(settings, base="vasarhelyi_2018/4ms"):
    with pytest.raises(ScenarioError) as caught:
        load(base, settings)
    return str(caught.value).splitlines()


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("model.p_rop", 0.1, "did you mean model.p_rep?"),
        ("model.p_rep", "fast", "model.p_rep = 'fast' is not a number; give [0, 10] 1/s"),
        ("model.v_flock", -3.0, "model.v_flock = -3 m/s lies outside ["),
        ("radio.delay", {"value": 1.0, "unit": "kg"}, "radio.delay = 1.0 kg: the unit is s, or one of us, ms, min, h"),
        ("world.arena", "sqare", "did you mean square?"),
        ("agents", 2.5, "agents = 2.5 is not a whole number"),
        ("agents", 100000, "do not fit at start.separation"),
        (
            "world.obstacles",
            [[[0, 0], [10, 10], [10, 0], [0, 20]]],
            "world.obstacles[0] crosses or touches itself near",
        ),
        ("world.obstacles", [[[0, 0], [0, 0], [10, 0], [0, 20]]], "corner [0, 0] twice in succession"),
        ("world.heights", [[0.0, 5.0]], "world.heights: a plane has no heights; set world.dimensions = '3'"),
        ("world.floor", 3.0, "world.floor: a plane has no heights"),
        ("world.obstacles", [[[500, 0], [510, 0], [505, 8]]], "world.obstacles[0] reaches outside the arena"),
        ("sensors.period", 0.001, "sensors.period = 0.001 s is shorter than dt = 0.01 s"),
        ("wrld", {}, "wrld: unknown key; did you mean world?"),
    ],
)
def test_a_fault_names_key_value_unit_and_range(key, value, said):
    (line,) = faults_of({key: value})
    assert line.startswith("vasarhelyi_2018/4ms: ") and said in line


@pytest.mark.parametrize(
    ("keys", "size"),
    [
        ({"agents": 100000}, "world.side"),
        ({"start.kind": "ball", "start.separation": 8.0}, "start.radius"),
        ({"start.kind": "box", "start.separation": 8.0}, "start.side"),
        ({"agents": 100000, "world.arena": "circle", "world.walls": "every_edge"}, "world.radius"),
    ],
)
def test_a_crowd_without_room_is_told_what_to_enlarge(keys, size):
    (line,) = faults_of(keys)
    assert f"enlarge {size}, or lower agents" in line


def test_all_faults_are_reported_together():
    lines = faults_of({"model.p_rep": -1.0, "radio.range": "far", "world.sid": 3.0, "body.tau": -2.0, "dt": 0.0})
    assert len(lines) == 5
    for key in ("model.p_rep", "radio.range", "world.sid", "body.tau", "dt"):
        assert sum(key in line for line in lines) == 1


STAR = [[0, 50], [10, 10], [50, 0], [10, -10], [0, -50], [-10, -10], [-50, 0], [-10, 10]]


def test_a_polygon_arena_may_be_concave_but_does_not_cross_itself():
    few = {"agents": 5.0, "world.arena": "polygon", "world.walls": "every_edge"}
    assert load("vasarhelyi_2018/4ms", few | {"world.corners": STAR}).world.corners[1] == (10.0, 10.0)
    (line,) = faults_of(few | {"world.corners": [STAR[0], STAR[4], STAR[2], *STAR[5:]]})
    assert "world.corners crosses or touches itself near" in line


def test_heights_are_checked_together():
    space = {"world.dimensions": "3", "agents": 5.0, "world.walls": "every_edge"}
    house = {"world.obstacles": [[[0, 0], [10, 0], [10, 10]]]}
    lines = faults_of(space | house | {
        "world.floor": 60.0, "world.ceiling": 20.0, "world.heights": [[5.0, 2.0], [0.0, 9.0]],
    })  # fmt: skip
    assert len(lines) == 3
    said = ("does not lie below world.ceiling = 20 m", "2 pairs for 1 obst", "[5, 2] m")
    for line, word in zip(lines, said, strict=True):
        assert word in line
    (line,) = faults_of(space | {"world.floor": 0.0, "world.edges": "bounce"})
    assert "give world.height instead" in line


def test_what_cannot_flock_flies_with_a_warning():
    base = load("vasarhelyi_2018/4ms")
    assert not base.notes
    p = base.parameters
    short = load(
        "vasarhelyi_2018/4ms", {"model.r0_frict": 0.0, "model.r0_rep": 10.0 * p.r0_rep, "start.separation": 5.0}
    )
    assert short.notes
    late = load("vasarhelyi_2018/4ms", {"radio.delay": 0.27, "sensors.period": 0.2})
    assert any("radio.delay" in note for note in late.notes)


@pytest.mark.parametrize("name", sorted(DOCUMENTS))
def test_presets_are_sound_and_every_number_has_a_source(name):
    found = load(name)
    assert found.agents >= 1
    for section, table in DOCUMENTS[name].items():
        for key, value in table.items() if isinstance(table, dict) else [(section, table)]:
            if isinstance(value, dict) and section != "published":
                assert value.get("source"), f"{name}: {section}.{key} has no source"


def test_a_battery_that_does_not_last_is_told():
    """150 W for 48 s: who flew in space for two minutes with 2 Wh fell by kilometres without a word."""
    keys = {"body.kind": "quadrotor", "body.battery": "lithium", "body.capacity": "2 Wh", "body.hover_power": 150.0}
    notes = {
        t: [n for n in load("vasarhelyi_2018/4ms", {**keys, "duration": t}).notes if "hovering" in n] for t in (40, 120)
    }
    assert notes[40] == [] and len(notes[120]) == 1 and "lasts about 48 s of hovering" in notes[120][0]


@pytest.mark.parametrize("name", presets())
def test_another_kind_takes_the_place_of_one_that_is_written_with_its_source(name):
    """Also where the preset says `kind = { value = "links", source = ... }`; the kind of today leaves all as it is."""
    plain = load(name)
    now = {"radio.kind": plain.radio.rule.name, "sensors.kind": plain.sensors.rule.name}
    again = load(name, now)
    assert again.radio.numbers == plain.radio.numbers and again.sensors.numbers == plain.sensors.numbers
    other = load(name, {"radio.kind": "constant", "sensors.kind": "perfect"})
    assert (other.radio.rule.name, other.radio.delay, other.sensors.rule.name) == (
        "constant",
        plain.radio.delay,
        "perfect",
    )
    assert not any("{" in note for note in other.notes)


@pytest.mark.parametrize("entry", [[3.78, 0.1], {"mean": 3.78, "sd": 0.1}, 3.78, [3.78], {"mean": 3.78}])
def test_what_a_paper_reports_is_shown_however_it_is_written(entry):
    """Only tables were read; numbers and pairs, which `airflock keys top` offers, were dropped without a word."""
    mean, sd = load("vasarhelyi_2018/4ms", {"published": {"phi_vel": entry}}).published["phi_vel"]
    assert mean == 3.78 and sd == (0.1 if "0.1" in str(entry) else None)


@pytest.mark.parametrize("entry", ["3 m/s", [], [1.0, 2.0, 3.0], {"sd": 0.1}, {"meen": 3.0}, float("nan"), True])
def test_what_a_paper_cannot_report_is_refused(entry):
    (line,) = faults_of({"published": {"phi_vel": entry}})
    assert line.startswith("vasarhelyi_2018/4ms: published.phi_vel = ") and "give a number, [mean, sd]" in line


def test_another_law_begins_from_its_own_numbers():
    """As another body, sensor or radio does, and as `law=` and `extends` do: r0_frict is no number of Algorithm A."""
    given, named = (
        load("vasarhelyi_2018/4ms", law="viragh_2014"),
        load("vasarhelyi_2018/4ms", {"model.kind": "viragh_2014"}),
    )
    assert named.parameters == given.parameters and not named.published
    assert "model.kind = 'viragh_2014': the numbers of the file's vasarhelyi_2018 are left out" in named.notes
    same = load("vasarhelyi_2018/4ms", {"model.kind": "vasarhelyi_2018"})
    assert same.parameters == load("vasarhelyi_2018/4ms").parameters and same.published
    assert load("vasarhelyi_2018/4ms", {"model.kind": "viragh_2014", "model.v_flock": 3.0}).parameters.v_flock == 3.0
    assert scenario_variant(named, {"model.kind": "vicsek_1995", "body.kind": "heading"}).model.name == "vicsek_1995"


def test_numbers_of_numpy_are_numbers_and_texts_and_truth_values_are_not():
    found = load("vasarhelyi_2018/4ms", {
        "agents": np.int64(3), "model.v_flock": np.float32(5), "world.arena": "polygon", "world.walls": "every_edge",
        "world.corners": np.array([[0.0, 0.0], [200.0, 0.0], [0.0, 200.0]]),
    })  # fmt: skip
    assert (found.agents, found.parameters.v_flock, type(found.parameters.v_flock)) == (3, 5.0, float)
    assert found.world.corners == ((0.0, 0.0), (200.0, 0.0), (0.0, 200.0))
    for key, value in {"model.v_flock": np.True_, "agents": True, "model.p_rep": "1", "body.tau": 10**400}.items():
        assert len(faults_of({key: value})) == 1, key
    texts = {
        "world.arena": "polygon",
        "world.walls": "every_edge",
        "world.corners": [[0.0, 0.0], [200.0, 0.0], ["2", 1.0]],
    }
    assert "world.corners is not a list of points [east, north] in m" in faults_of(texts)[0]


def test_a_step_between_two_formats_reads_each_file_once_on_every_way(tmp_path, monkeypatch):
    """A step is planted that adds a cross to the title: one that doubled a speed would do so in silence."""
    (tmp_path / "base.toml").write_text('agents = 2\nduration = 2.0\n[model]\nkind = "vasarhelyi_2018"\n')
    (tmp_path / "own.toml").write_text('extends = "base.toml"\ntitle = "own"\n')
    old = airflock.simulate(load(str(tmp_path / "own.toml")), 1, precision=64, device="python")
    airflock.save(old, tmp_path / "old.nc")
    step = lambda old: {**old, "title": f"{old.get('title', '')}+"}  # noqa: E731
    monkeypatch.setattr(formats, "MIGRATIONS", (step,))
    monkeypatch.setattr(formats, "FORMAT", 2)
    scenario = load(str(tmp_path / "own.toml"))
    write_toml_file(tmp_path / "again.toml", scenario.document)
    flown = airflock.simulate(scenario, 1, precision=64, device="python")
    airflock.save(flown, tmp_path / "new.nc")
    flight = airflock.open(scenario, 1, precision=64, device="python")
    flight.change({"model.p_rep": 0.3})
    study = load_study(str(tmp_path / "own.toml"))
    found = {
        "file": scenario,
        "file that was written": load(str(tmp_path / "again.toml")),
        "changed": with_settings(scenario, {"model.p_rep": 0.2}),
        "changed twice": with_settings(with_settings(scenario, {"model.p_rep": 0.2}), {"model.p_rep": 0.1}),
        "changed in flight": flight.scenario,
        "of a study": build_scenario(study.document()["scenario"], "study"),
        "on a worker": rebuild_scenario(json.dumps(scenario.document), "worker"),
        "recorded before": scenario_of_recording(airflock.load_recording(tmp_path / "old.nc")),
        "recorded after": scenario_of_recording(airflock.load_recording(tmp_path / "new.nc")),
    }
    assert {way: one.document["title"] for way, one in found.items()} == dict.fromkeys(found, "own+")
    (tmp_path / "newer.toml").write_text('format = 3\nextends = "base.toml"\n')
    with pytest.raises(ScenarioError, match="format = 3 is newer than this Airflock, which reads up to 2"):
        load(str(tmp_path / "newer.toml"))
