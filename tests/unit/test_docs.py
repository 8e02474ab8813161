"""The documentation: words are those of the glossary, every model and order parameter has its page."""

import ast
import re
import sys
from pathlib import Path

import pytest

import airflock
from airflock.parts import METRICS, SETS, TOPOLOGIES
from airflock.parts.metrics import metric_sets as registry
from airflock.scenarios.named_code import MODELS

DOCS = Path(__file__).parents[2] / "docs"
sys.path.insert(0, str(DOCS))
import links  # noqa: E402
import words  # noqa: E402


def test_no_page_breaks_the_rules_of_words():
    assert [error for path in words.pages() for error in words.errors_of(path)] == []


def test_the_changelog_is_read_and_the_paper_has_no_blank():
    assert {"CHANGELOG.md", "paper.md"} <= {path.name for path in words.pages()}
    (paper,) = [path for path in words.pages() if path.name == "paper.md"]
    assert "to be filled" not in paper.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("name", "text", "error"),
    [
        ("a.md", "The neighbor flies.\n", "a.md:1: 'neighbor': write neighbour"),
        ("a.md", "| head | more |\n|---|---|\n| a | ruleset |\n", "a.md:3: 'ruleset': write law"),
        ("a.py", '"""\nTitle\n=====\n\nIts color.\n"""\n', "a.py:5: 'color': write colour"),
        ("a.py", '"""Title"""\nx = 1\n# %%\n# Our behavior.\n', "a.py:4: 'behavior': write behaviour"),
    ],
)
def test_the_check_of_words_finds_what_is_wrong(tmp_path, monkeypatch, name, text, error):
    monkeypatch.setattr(words, "DOCS", tmp_path)
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    (found,) = words.errors_of(path)
    assert found == error


def test_decisions_and_the_front_pages_are_held_to_the_words_too():
    names = {path.name for path in words.pages()}
    assert {"README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md", "paper.md", "glossary.md"} <= names
    assert {path.name for path in (DOCS / "decisions").glob("*.md")} <= names


def test_decision_records_have_one_format_and_are_numbered_in_order():
    records = sorted((DOCS / "decisions").glob("*.md"))
    assert [path.name[:5] for path in records] == [f"{number:04d}-" for number in range(1, len(records) + 1)]
    for path in records:
        heads = re.findall(r"^#+ .*$", path.read_text(encoding="utf-8"), re.M)
        assert heads[0].startswith("# ") and heads[1:] == ["## Context", "## Decision", "## Consequence"], path.name


def test_the_map_shows_every_package_and_module_at_the_top():
    told = (DOCS.parent / "ARCHITECTURE.md").read_text(encoding="utf-8").split("```")[1]
    top = [path for path in (DOCS.parent / "src/airflock").iterdir() if not path.name.startswith(("_", "."))]
    names = [f"{path.name}/" if path.is_dir() else path.name for path in top if path.suffix in ("", ".py")]
    assert len(names) > 15 and [name for name in names if not re.search(rf"(?<![\w/]){re.escape(name)}", told)] == []


def test_code_and_equations_are_no_words(tmp_path, monkeypatch):
    monkeypatch.setattr(words, "DOCS", tmp_path)
    path = tmp_path / "a.md"
    path.write_text("```python\nneighbor = 1  # behavior\n```\n\nSee `color` and $center$.\n", encoding="utf-8")
    assert list(words.errors_of(path)) == []


def test_every_model_has_its_equations_beside_functions_that_exist():
    for name in MODELS:
        folder = DOCS.parent / "src" / "airflock" / "parts" / "laws" / name
        written = re.findall(r"^## (\w+)$", (folder / "equations.md").read_text(encoding="utf-8"), re.M)
        source = (folder / "law.py").read_text(encoding="utf-8")
        functions = {node.name for node in ast.parse(source).body if isinstance(node, ast.FunctionDef)}
        assert "decide" in written and set(written) <= functions


def test_every_order_parameter_has_formula_and_range():
    for metric in registry.METRICS.values():
        assert set(metric.formulas) == set(metric.reports), metric.name
    for kind, found in registry.SETS.items():
        known = registry.formulas(found)
        assert set(known) == set(registry.reported_values(found)), kind
        assert all(len(about) in (2, 3) and all(about) for about in known.values()), kind


def test_every_order_parameter_is_shown_by_two_flocks_that_differ_in_it(monkeypatch, scored_plainly):
    pytest.importorskip("sphinx")
    monkeypatch.syspath_prepend(str(DOCS / "_ext"))
    from pictures import LOW_AND_HIGH, of_model, pairs

    found = pairs()
    assert set(found) == {name for kind in registry.SETS.values() for name in registry.reported_values(kind)}
    examples = {name: of_model(name) for name in MODELS}
    assert all(examples.values())
    assert all((DOCS / "gallery" / f"{example}.py").is_file() for example in examples.values())
    source = (DOCS / "gallery" / f"{LOW_AND_HIGH[0]}.py").read_text(encoding="utf-8")
    example = {}
    exec(source.partition("def drawn(")[0], example)  # the flocks and how they are measured; nothing is drawn
    for names, *flocks in example["PAIRS"]:
        one, other = (example["measured"](*flock) for flock in flocks)
        assert [name for name in names if f"{one[name]:.3g}" == f"{other[name]:.3g}"] == []


def test_a_tour_takes_less_than_thirty_lines_of_the_user_s_own():
    for path in (DOCS / "tours").glob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        lines = {line for node in tree.body[1:] for line in range(node.lineno, node.end_lineno + 1)}
        assert len(lines) <= 30, path.name


def test_the_glossary_has_each_term_once_in_order_and_the_words_of_the_papers():
    text = (DOCS / "glossary.md").read_text(encoding="utf-8")
    terms = re.findall(r"^(\w[\w ]*)\n  \S", text, re.M)
    assert terms == sorted(set(terms), key=lambda term: term.replace("_", " "))
    # words of the papers, and of the commands that a user types
    assert {"shill agent", "friction", "phi_lap", "braking curve", "percept", "fault", "fleet", "certificate"} <= set(
        terms
    )
    assert not any(re.fullmatch(wrong, term) for wrong in words.SPELLINGS for term in terms)


def test_terms_are_found_at_the_head_of_a_sentence_and_in_the_plural_but_not_in_keys(monkeypatch):
    pytest.importorskip("sphinx")
    monkeypatch.syspath_prepend(str(DOCS / "_ext"))
    from terms import pattern_of, term_of

    known = {"agent", "shill agent", "radio", "v_flock"}
    text = "Agents turn to a shill agent. A radio, not radio.delay, and v_flock; reagent and V_flocked are none."
    found = [term_of(match[1], known) for match in pattern_of(known).finditer(text)]
    assert found == ["agent", "shill agent", "radio", "v_flock"]


def test_a_link_that_leads_nowhere_is_told(tmp_path):
    (tmp_path / "a.html").write_text(
        '<h2 id="one">1</h2><a href="b.html#two"><a href="#one"><a href="https://x.org/y">'
    )
    (tmp_path / "b.html").write_text('<a href="a.html#one"><a href="a.html#two"><img src="c.png">')
    assert links.faults(tmp_path) == [
        "a.html: b.html#two leads to no heading",
        "b.html: a.html#two leads to no heading",
        "b.html: c.png leads to no file",
    ]


def test_an_output_that_differs_at_each_build_is_told(tmp_path):
    (tmp_path / "a.html").write_text("<pre>&lt;Legend object at 0x7f21a8a66ed0&gt;</pre>", encoding="utf-8")
    assert links.faults(tmp_path) == ["a.html: an output holds an address in memory"]


def test_meanings_of_names_become_a_list_and_sections_stay(monkeypatch):
    pytest.importorskip("sphinx")
    monkeypatch.syspath_prepend(str(DOCS / "_ext"))
    from docstrings import listed

    lines = [
        "Lines.",
        "",
        "width    : of a bin, m: a tenth,",
        "or less",
        "far, near : m,",
        "            or",
        "nan where none.",
        "",
    ]
    section = ["Parameters", "----------", "name : str", "    A name."]
    listed(lines)
    kept = list(section)
    listed(kept)
    assert lines == [
        "Lines.", "", "* ``width``: of a bin, m: a tenth,", "  or less",
        "* ``far, near``: m,", "  or", "", "nan where none.", "",
    ]  # fmt: skip
    assert kept == section
    goes_on = ["Lines.", "", "width : of a bin,", "        m", ""]
    listed(goes_on)
    assert goes_on == ["Lines.", "", "* ``width``: of a bin,", "  m", ""]


@pytest.mark.parametrize("folder", ["gallery", "notebooks", "tours"])
def test_a_notebook_shows_each_picture_in_the_cell_that_draws_it(folder):
    """Jupyter shows what a cell ends with, and figures of pyplot."""
    for path in sorted((DOCS / folder).glob("*.py")):
        for cell in path.read_text(encoding="utf-8").split("\n# %%\n"):
            *_, last = ast.parse(cell).body or [ast.Pass()]
            assert "matplotlib.figure" not in cell, f"{path.name}: Jupyter shows no bare Figure"
            if "= airflock.plot" in cell:
                assert isinstance(last, ast.Expr) and isinstance(last.value, ast.Name), f"{path.name}: {cell[:60]}"


def test_names_of_ours_beside_those_of_other_programs_exist():
    reports = {name for one in METRICS.values() for name in one.reports} | {"fitness"}
    partial = {name for one in SETS.values() for name in getattr(one, "reports", ())}
    keys = airflock.keys()
    words_of = {key.name for key in keys} | reports | partial | set(airflock.presets()) | set(TOPOLOGIES)
    rows = re.findall(r"^\| .+ \| (.+) \|$", (DOCS / "coming_from.md").read_text(encoding="utf-8"), re.M)
    named = [name for row in rows for name in re.findall(r"`([a-z_0-9]+(?:[./][a-z_0-9]+)*)`", row)]
    ours = {name for name in named if not name.startswith("airflock.")}
    assert len(ours) > 60
    fields = {"periodic", "city", "position", "confidence", "seeds", "percept.ray"}
    assert ours - words_of - fields == set()
    assert all(hasattr(airflock, name.split(".")[1]) for name in named if name.startswith("airflock."))
    text = (DOCS / "coming_from.md").read_text(encoding="utf-8")
    for preset in re.findall(r"`airflock run (\S+)`", text):
        assert preset in airflock.presets()
