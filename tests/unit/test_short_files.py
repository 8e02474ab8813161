"""Short scenario files: extends, keys by their last word, notes on what is hardly meant, and the list of all keys."""

import math
import random
import re
import tomllib

import pytest

import airflock
from airflock.core import ENTRY_KEYS
from airflock.core.parameters import Quantity, declarations
from airflock.parts import BODIES, FAULTS as KINDS, SENSORS
from airflock.scenarios import groups, keys
from airflock.scenarios.files import load, presets
from airflock.scenarios.named_code import MODELS, find_law
from airflock.scenarios.scenario_builder import build_scenario
from airflock.scenarios.schema import unit_names
from airflock.scenarios.sections import SECTIONS
from airflock.scenarios.settings import TOP_LEVEL_KEYS
from airflock.support.errors import ScenarioError

NAME = "vasarhelyi_2018/real_6ms"


def written(tmp_path, text, name="mine.toml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_that_only_extends_flies_what_it_extends(tmp_path):
    mine, base = load(written(tmp_path, f'extends = "{NAME}"\n')), load(NAME)
    for section in ("parameters", "body", "sensors", "radio", "wind", "world", "start", "metrics", "flight", "scene"):
        assert getattr(mine, section) == getattr(base, section), section
    assert not mine.published and not {"extends", "title"} & set(mine.document)  # its title tells of other drones
    assert mine.notes[0].startswith(f"extends {NAME}")


def test_given_keys_go_before_those_of_the_file_and_others_stay(tmp_path):
    mine = load(written(tmp_path, f'extends = "{NAME}"\nagents = 12\n[radio]\ndelay = "400 ms"\n'))
    base = load(NAME)
    assert (mine.agents, mine.radio.delay, mine.radio.range) == (12, 0.4, base.radio.range)


def test_files_extend_files_beside_them_and_their_own_files_are_found(tmp_path):
    (tmp_path / "base").mkdir()
    law = "base/law.py"
    written(
        tmp_path,
        "import airflock\nfrom dataclasses import dataclass\nCOMMAND = 'velocity'\n"
        "@dataclass(frozen=True, kw_only=True)\n"
        "class Parameters(airflock.Parameters):\n    v: float = airflock.quantity(1.0, 'm/s', low=0.0, high=9.0, "
        "meaning='speed')\ndef decide(own, p):\n    return p.v * own.hx, p.v * own.hy, p.v * own.hz\n",
        law,
    )
    written(tmp_path, 'agents = 7\n[model]\nkind = "law.py"\nv = 2.0\n', "base/first.toml")
    written(tmp_path, 'extends = "base/first.toml"\n[model]\nv = 3.0\n', "second.toml")
    name = written(tmp_path, 'extends = "second.toml"\nduration = 5.0\n', "third.toml")
    with pytest.raises(ScenarioError, match=r"third.toml: model.kind = .*law.py': would run the code in .*--trust"):
        load(name)  # consent to the code of an extended file is asked for, too
    third = load(name, trust=True)
    assert (third.agents, third.parameters.v, third.model.name, third.flight.duration) == (7, 3.0, "law", 5.0)


def test_another_kind_of_law_keeps_none_of_the_other_law_s_keys(tmp_path):
    mine = load(written(tmp_path, f'extends = "{NAME}"\n[model]\nkind = "viragh_2014"\n'))
    assert mine.parameters == type(mine.parameters)()


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ('extends = "vasarhelyi_2018/real_6m"', "did you mean vasarhelyi_2018/real_6ms?"),
        ("extends = 4", "extends = 4 is not a name"),
        ('extends = "mine.toml"', "leads back to itself"),
        (f'extends = "{NAME}"\n[radio]\ndelai = 1.0', "radio.delai: unknown key; did you mean radio.delay?"),
    ],
)
def test_what_cannot_be_extended_is_told_with_the_file_s_name(tmp_path, monkeypatch, text, fault):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, text)
    with pytest.raises(ScenarioError) as caught:
        load("mine.toml")
    assert len(caught.value.errors) == 1 and "mine.toml" in caught.value.errors[0] and fault in caught.value.errors[0]


def test_a_last_word_that_one_section_has_is_that_key():
    mine = load(NAME, {"delay": 0.4, "v_flock": 5.0})
    assert mine.radio.delay == 0.4 and mine.parameters.v_flock == 5.0 and mine.metrics.v_flock is None
    assert mine.body.delay == 0.0
    assert {"delay is read as radio.delay", "v_flock is read as model.v_flock"} <= set(mine.notes)


@pytest.mark.parametrize(
    ("key", "fault"),
    [
        (
            "noise",
            "noise is several keys; write body.noise (diffusion constant of the outer noise) or "
            "sensors.noise (variance of the velocity error)",
        ),
        ("delai", "delai: unknown key; did you mean radio.delay?"),
        ("extends", "extends: only a file has it; name the preset or file that it extends in place of this one"),
        ("format", "format: only a file has it; leave it out"),
        ("agnets", "agnets: unknown key; did you mean agents?"),
    ],
)
def test_a_last_word_of_several_sections_or_none_is_refused(key, fault):
    with pytest.raises(ScenarioError, match=re.escape(fault)):
        load(NAME, {key: 1.0})


def test_a_key_of_another_kind_is_told_its_kind():
    with pytest.raises(ScenarioError, match="sensors.sd: unknown key; it belongs to sensors.kind = 'gnss'"):
        load(NAME, {"sensors.sd": 1.5})
    with pytest.raises(ScenarioError, match="body.motor: unknown key; it belongs to body.kind = 'quadrotor'"):
        load(NAME, {"body.motor": 0.1})


def test_a_key_may_not_be_given_whole_and_by_its_last_word():
    with pytest.raises(ScenarioError, match="radio.delay is given twice"):
        load(NAME, {"radio.delay": 1.0, "delay": 0.4})


def test_notes_tell_what_is_hardly_meant_and_presets_have_none_of_them(tmp_path):
    fast = load(written(tmp_path, '[model]\nkind = "vasarhelyi_2018"\nv_flock = 6.0\n'))
    assert any("other 12 numbers of vasarhelyi_2018 are its set for 4 m/s" in note for note in fast.notes)
    plain = {"body": {}, "sensors": {}, "radio": {}}
    blind = load("vasarhelyi_2018/4ms", plain, law="vicsek_1995")
    assert any("has no rule for walls" in note for note in blind.notes)
    assert any("a factor of 354" in note for note in blind.notes)
    held = load("vasarhelyi_2018/4ms", {**plain, "world.edges": "periodic", "world.side": 10.0}, law="vicsek_1995")
    assert not any("walls" in note or "factor" in note for note in held.notes)
    field = {
        "world.walls": "every_edge",
        "world.arena": "polygon",
        "world.corners": [[0, 0], [300, 0], [300, 150], [150, 150], [150, 300], [0, 300]],
    }
    beside = load("vasarhelyi_2018/4ms", {**field, "agents": 12})
    assert any(
        note.startswith("phi_lap measures the rotation about (0, 0) m, which does not lie") for note in beside.notes
    )
    about = load("vasarhelyi_2018/4ms", {**field, "agents": 12, "metrics.centre_x": 75.0, "metrics.centre_y": 75.0})
    assert not any("phi_lap" in note for note in about.notes)
    words = ("no rule for walls", "probably wrong", "are its set", "phi_lap")
    for name in presets():
        assert not any(word in note for note in load(name).notes for word in words), name


def test_the_list_of_keys_is_that_of_the_declarations_and_of_a_loaded_scenario():
    for name in ("vasarhelyi_2018/4ms", "couzin_2002/torus", "kidger/city"):
        scenario = load(name)
        for record, section in (
            (scenario.parameters, "model"),
            (scenario.body.numbers, "body"),
            (scenario.radio.numbers, "radio"),
        ):
            for key, how, _ in declarations(record):
                (found,) = [
                    k
                    for k in keys.keys(f"{section}.{key}")
                    if k.of in ("", scenario.model.name, scenario.body.rule.name)
                ]
                value = getattr(record, key)
                inside = found.low <= value <= found.high if isinstance(how, Quantity) else value in found.options
                assert inside and found.meaning == how.meaning


def test_every_name_that_a_file_may_hold_is_among_the_keys():
    every = airflock.keys()
    names = {key.name for key in every}
    assert {name.partition(".")[0] for name in names} == {*TOP_LEVEL_KEYS, "extends"}
    for of, known in (("faults", ENTRY_KEYS), ("groups", groups.KEYS)):
        assert {key.name for key in keys.sections()[of].keys} == {f"{of}.{name}" for name in known}
    records = {**BODIES, **SENSORS, **KINDS} | {name: find_law(name) for name in MODELS}
    for name, found in records.items():
        declared = {key for key, _, _ in declarations(found.Parameters)}
        assert {key.name.partition(".")[2] for key in keys.sections()[name].keys} == declared, name
    for name, record in SECTIONS.items():
        assert {f"{name}.{key}" for key, _, _ in declarations(record)} <= names, name


def test_the_keys_of_a_kind_of_fault_are_its_numbers_and_those_of_every_entry():
    names = [key.name for key in keys.keys("motor")]
    assert names[0] == "faults.share" and {"faults.at", "faults.per_hour", "faults.agents", "body.motor"} <= set(names)
    assert {key.name for key in keys.keys("gnss_frozen")} == {f"faults.{name}" for name in ENTRY_KEYS}


def test_an_unknown_section_of_keys_is_told_with_the_nearest():
    with pytest.raises(ScenarioError, match="did you mean radio.delay"):
        keys.keys("dely")


def test_a_number_that_is_refused_or_rounded_is_shown_with_the_digits_that_say_why(seed):
    """5000000.5 was told as 5e+06, which is a whole number; a duration was rounded without a word."""
    rng = random.Random(seed)
    for _ in range(50):
        whole = rng.randint(1, 10 ** rng.randint(1, 7))
        agents = whole + rng.choice([0.5, 0.25, 1e-3])
        with pytest.raises(ScenarioError) as caught:
            load(NAME, {"agents": agents})
        (said,) = [line for line in caught.value.errors if line.endswith("is not a whole number")]
        assert float(said.split()[3]) != round(float(said.split()[3])), said
        loss = 1.0 + 10.0 ** -rng.randint(1, 15)
        with pytest.raises(ScenarioError, match="radio.loss = ") as caught:
            load(NAME, {"radio.loss": loss})
        assert float(str(caught.value).split("radio.loss = ")[1].split()[0]) > 1.0
        steps = rng.randint(1, 10**6)
        duration = 0.01 * (steps + rng.choice([0.0, rng.uniform(0.01, 0.49)]))
        (note,) = [note for note in load(NAME, {"duration": duration}).notes if note.startswith("duration")] or [""]
        rounded = abs(duration - 0.01 * steps) > 1e-9
        assert bool(note) is rounded, (duration, note)
        if note:
            shown, to = (float(note.split(" s")[0].split()[-1]), float(note.split("rounded to ")[1].split()[0]))
            assert shown != to and to == pytest.approx(0.01 * steps, rel=1e-5)


@pytest.mark.parametrize("key", ["world.corners", "world.obstacles"])
def test_a_polygon_of_very_many_corners_is_refused_before_anything_is_made_of_it(key):
    turns = [2.0 * math.pi * k / 10_001 for k in range(10_001)]
    ring = [[90.0 * math.cos(a), 90.0 * math.sin(a)] for a in turns]
    shape = {"world.arena": "polygon", key: ring} if key == "world.corners" else {key: [ring]}
    with pytest.raises(ScenarioError) as caught:
        load(NAME, {**shape, "world.walls": "every_edge", "agents": 4})
    assert [line.partition(": ")[2] for line in caught.value.errors] == [
        "world.corners and world.obstacles have 10001 corners, more than 10000"
    ]


# --- The schema by which editors complete keys ---


@pytest.fixture(scope="module")
def validator():
    jsonschema = pytest.importorskip("jsonschema")
    schema = keys.json_schema()
    jsonschema.Draft7Validator.check_schema(schema)
    return jsonschema.Draft7Validator(schema)


def document_of(name):
    return tomllib.loads(presets()[name].read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", presets())
def test_the_schema_takes_every_preset_and_what_may_be_written_in_its_place(validator, name, seed):
    """Units as text and in tables, digits of choices without quotes, vectors as lists, tolerances of groups."""
    document, rng = document_of(name), random.Random(seed)
    for section, key, declared in numbers_of(name):
        low, high = max(declared.low, -1e3), min(declared.high, 1e3)
        number = rng.choice([low, high]) if declared.whole else rng.uniform(low, high)
        unit = rng.choice(sorted(unit_names(declared.unit) or {""}))
        place = document.setdefault(section, {}) if section else document
        place[key] = rng.choice([number, f"{number} {unit}" if unit else number, {"value": number, "unit": unit}])
    document["world"] = {**document.get("world", {}), "dimensions": rng.choice([2, "3"])}
    document["groups"] = [{"name": "a", "agents": "20 %", "body": {"delay": {"spread": "10 %"}}}, {"model": {}}]
    document["faults"] = [{"kind": "mine.py", "own": 1}, {"kind": "motor", "at": "1 min", "share": 0.5}]
    assert not [error.message for error in validator.iter_errors(document)]


def numbers_of(name):
    """Section, key and declaration of each number that a preset's file may hold."""
    every = [(section, *of) for section, record in load(name).records.items() for of in declarations(record)]
    return [(section, key, declared) for section, key, declared, _ in every if isinstance(declared, Quantity)]


BROKEN = {  # what is wrong → what stands in place of a number
    "type": lambda rng, of: rng.choice([True, [[1.0]], "much", {"unit": "m"}, {"value": False}]),
    "range": lambda rng, of: rng.choice([of.high * 2.0 + 1.0, {"value": of.low - abs(of.low) - 1.0}]),
    "unit": lambda rng, of: rng.choice(["5 furlong", {"value": of.low, "unit": "dBm"}, "0,5 s"]),
    "interval": lambda rng, of: {"value": of.low, "sauce": "Table 1"},
}


def test_the_schema_finds_in_two_hundred_broken_files_what_one_key_alone_says(validator, seed, tmp_path):
    """Each is refused by the loader, too; the same file without the change is not."""
    rng = random.Random(seed)
    for number in range(200):
        name = rng.choice([*presets()])
        document = document_of(name)
        what = rng.choice([*BROKEN, "key", "section", "choice", "kind", "fault"])
        section, key, declared = rng.choice(numbers_of(name))
        place = document.setdefault(section, {}) if section else document
        if what in BROKEN:
            place[key] = BROKEN[what](rng, declared)
        elif what == "key":
            place[f"{key}x"] = declared.low
        elif what == "section":
            document[f"{section or 'top'}s2"] = {}
        elif what == "choice":
            document["world"] = {**document.get("world", {}), "edges": rng.choice(["opened", 1, ["open"]])}
        elif what == "kind":
            document[rng.choice(["model", "body", "sensors", "radio", "topology"])] = {"kind": "vasarhelyi"}
        else:
            wrong = rng.choice([{"kind": "motors"}, {"kind": "motor", "shares": 1}, {"kind": "motor", "share": 7}])
            document["faults"] = [{"at": 1.0, **wrong}]
        assert not validator.is_valid(document), (number, name, what, key)
        with pytest.raises(ScenarioError):
            build_scenario(document, folder=presets()[name].parent)
