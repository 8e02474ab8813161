"""The door for text: what is beyond bounds is refused before it is parsed, and what is within is read as it is."""

import tomllib

import pytest
from hypothesis import given, strategies as st

import airflock
from airflock.search.study import load_study
from airflock.support import untrusted
from airflock.support.errors import AirflockError, ScenarioError, shortened


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a" + ".a" * 60_000 + " = 1", "a key of more than 16 parts"),  # the parser would take half a minute and 6 GB
        ('"a"' + ' . "a"' * 60_000 + " = 1", "a key of more than 16 parts"),
        ("[" + "a." * 50_000 + "a]", "a key of more than 16 parts"),
        ("x = 1\na = " + "[" * 2000 + "]" * 2000, "line 2: nested more than 32 deep"),
        ("a = " + "{a = " * 2000 + "1" + "}" * 2000, "nested more than 32 deep"),
        ("a = " + "1" * 5000, "more than 400 letters"),
        ("a = 0x" + "f" * 5000, "more than 400 letters"),
        ("a = 0b" + "1" * 300, "beyond 2^64"),
        ("a = 1" + "0" * 30, "(hexadecimal) is beyond 2^64"),
        ("\n".join(f"k{i} = 1" for i in range(20_000)), "more than 10000 keys"),
        ("k" * 300 + " = 1", "has 300 letters, more than 200"),
        ("a = [" + "1," * 1_100_000 + "]", "more than 1000000 values"),
        ("#" * 6_000_000, "is larger than 5 MB"),
    ],
)
def test_text_beyond_bounds_is_refused(text, words):
    with pytest.raises(untrusted.TextError) as fault:
        untrusted.parse_toml(text)
    assert words in str(fault.value) and len(str(fault.value)) < 300


@pytest.mark.parametrize("text", ["[" * 100_000, '{"a":' * 5000, "1" * 5000, "[1", "5e", None, b"{}", '{"a": 1e'])
def test_json_beyond_bounds_or_damaged_is_refused(text):
    with pytest.raises(untrusted.TextError):
        untrusted.parse_json_object(text)


@given(st.text(alphabet="ab.=[]{}\"'#\\\n 01_,", max_size=80))
def test_within_bounds_the_door_reads_what_the_standard_parser_reads(text):
    try:
        wanted = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        with pytest.raises(untrusted.FormatError):
            untrusted.parse_toml(text)
    else:
        assert untrusted.parse_toml(text) == wanted


def test_brackets_dots_and_digits_inside_strings_and_comments_do_not_count():
    text = f'a = "{"[" * 99}{"." * 99}"  # {"{" * 99} {"1" * 999}\nb = """{"[" * 99}\n{"9" * 999}"""\n' + "c = '[[.'\n"
    assert untrusted.parse_toml(text)["c"] == "[[."


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[space.model]\np_rep = { above = [1] }\n", "space.model.p_rep.above = [1] is not a number"),
        ("search = 1.5\n", "search = 1.5 is not a table of keys"),
        ("[objective]\nover_seeds = [[]]\n", "objective.over_seeds = [[]] is none of mean, worst, quantile"),
        ("[set]\nagents = 1" + "0" * 500 + "\n", "more than 400 letters"),
    ],
)
def test_what_the_fuzz_found_in_studies_is_one_line(tmp_path, text, words):
    (tmp_path / "a.toml").write_text('scenario = "vasarhelyi_2018/4ms"\n' + text)
    with pytest.raises(ScenarioError) as fault:
        load_study(tmp_path / "a.toml")
    assert len(fault.value.errors) == 1 and words in fault.value.errors[0]


@pytest.mark.parametrize(
    "published",
    ['{ mean = 1.0, sd = "x" }', "{ mean = 1.0, sd = [1] }", "{ mean = 1.0, sd = 2018-07-18 }", "{ mean = true }"],
)
def test_a_published_number_that_is_none_is_one_line(tmp_path, published):
    text = f"[published]\nphi_vel = {published}\n[model]\nkind = 'vicsek_1995'\n"
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(ScenarioError) as fault:
        airflock.load(tmp_path / "a.toml")
    assert len(fault.value.errors) == 1 and "published.phi_vel" in fault.value.errors[0]


def test_a_byte_order_mark_is_read(tmp_path):
    (tmp_path / "a.toml").write_bytes(b"\xef\xbb\xbfagents = 5\n[model]\nkind = 'vicsek_1995'\n")
    assert airflock.load(tmp_path / "a.toml").agents == 5


def test_a_flood_of_faults_is_bounded(tmp_path):
    (tmp_path / "a.toml").write_text("\n".join(f"{'k' * 150}{i} = 1" for i in range(9000)))
    with pytest.raises(ScenarioError) as fault:
        airflock.load(tmp_path / "a.toml")
    assert len(fault.value.errors) == 51 and "more errors" in fault.value.errors[-1]
    assert shortened("x" * 5000, 100) == "x" * 50 + " ... (4900 letters) ... " + "x" * 50


@pytest.mark.parametrize("name", ["a" * 300 + ".toml", "a\0b.toml", "/dev/zero", ".", "/proc/self/mem", ""])
def test_names_that_are_no_files_are_one_line(name):
    for door in (airflock.load, airflock.load_recording, load_study):
        with pytest.raises(AirflockError) as fault:
            door(name)
        assert "\n" not in str(fault.value)


def test_a_format_that_is_newer_is_refused_and_one_that_is_none_too(tmp_path):
    for text, words in (
        ("2", "is newer than this Airflock"),
        ("0", "is not a number of a format"),
        ("'a'", "is not a number"),
    ):
        (tmp_path / "a.toml").write_text(f"format = {text}\n[model]\nkind = 'vicsek_1995'\n")
        with pytest.raises(ScenarioError, match=f"format = {text}.* {words}"):
            airflock.load(tmp_path / "a.toml")
    (tmp_path / "a.toml").write_text("format = 1\n[model]\nkind = 'vicsek_1995'\n")
    assert "format" not in airflock.load(tmp_path / "a.toml").document
