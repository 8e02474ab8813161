"""Types of rules: typed copies change nothing but annotations, ours hold, a misspelled name is told by its line."""

import ast
import re
from pathlib import Path
from typing import get_type_hints

import pytest

import airflock
from airflock.checking.annotations import typed_copy
from airflock.checking.rule_types import FAULT, RECORDS, SPECIAL
from airflock.checking.types import PACKAGE, check_types, scalar, shipped
from airflock.core.vocabulary import VOCABULARY
from airflock.errors import RuleError

EXAMPLE = Path(__file__).parents[2] / "examples" / "own_rule.py"
RULES = [path for path in shipped() if typed_copy(path.read_text(), scalar(path)).rules]
NAMES = [path.relative_to(PACKAGE).as_posix() for path in RULES]

LAW = '''"""A law with a fault in each of its rules."""

from dataclasses import dataclass
from typing import NamedTuple

import airflock

COMMAND = "velocity"


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    p_rep: float = airflock.quantity(1.0, "1/s", low=0.0, high=9.0, meaning="gain")
    reach: float | None = airflock.quantity(None, "m", low=0.0, high=9.0, meaning="from the scenario")
    limit: str = airflock.choice("cap", ("cap", "rescale"), meaning="how")


class Sums(NamedTuple):
    x: float
    y: float


def neighbour(dx, dy, dvxx, p):
    k = p.prep * p.reach
    return Sums(k * dx)


def helper(p, sums):
    return p.prepp * sums.w


def decide(
    own,
    sums,  # what neighbours say
    p,
):
    k = 1.0 if p.limit == "cup" else helper(p, sums)
    return k * own.h, sums.x
'''


def bare(tree: ast.Module) -> str:
    """A module without annotations of functions and types of fields, and without what was added for them."""
    added = {"Own", "Percept", "Mean", "Wing", "Descent", "Measured", "Any", "Literal", "Mapping", "MutableSequence"}
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            node.returns = None
        if isinstance(node, ast.arg):
            node.annotation = None
        if isinstance(node, ast.AnnAssign):
            node.annotation = ast.Name("kind")
    tree.body = [
        item
        for item in tree.body
        if not (isinstance(item, ast.ImportFrom) and {name.name for name in item.names} <= added | {"Parameters"})
        and not (isinstance(item, ast.ImportFrom) and item.module == "typing")
        and getattr(item, "name", "") != "SharedColumns"
    ]
    return ast.unparse(tree)


@pytest.mark.parametrize("path", [*RULES, EXAMPLE], ids=[*NAMES, "example"])
def test_a_typed_copy_is_the_same_text_but_for_its_types(path):
    text = path.read_text()
    copy = typed_copy(text, path in RULES and scalar(path))
    assert bare(ast.parse(copy.text)) == bare(ast.parse(text))
    lines, copied = text.splitlines(), copy.text.splitlines()
    for number, line in enumerate(copied, 1):
        if "->" not in line and "Literal" not in line and not (copy.after < number <= copy.after + copy.added):
            assert line == lines[copy.line(number) - 1] or ": " in line


def test_every_word_of_the_vocabulary_has_a_type():
    """Those that are described as records or columns are no numbers."""
    records = re.compile(
        r"what `|what this|[\w ']*parameters|this metric's|columns|scratch|true positions|[A-Z]\w+[: ]"
    )
    for kind, words in VOCABULARY.items():
        text = f"def {kind}({', '.join(words)}): pass\n"
        text += "".join(
            f"class {name}: pass\n" for name in ("Sums", "Walls", "Memory", "Shared", "Pair", "Agent", "Packet")
        )
        text += "class Member: pass\nclass Cluster: pass\nclass Parameters: pass\n"
        beside = {"limits": ["move"], "endures": ["move"], "exact": ["measure"], "bounds": ["measure"]}
        beside |= dict.fromkeys(("decide", "meet", "move", "sample", "measure", "error", *FAULT), [])
        beside |= {"missed": [], "receive": [], "late": [], "missed_few": ["missed"], "carry": ["late"]}
        beside |= {"see": [], "lasts": ["see"]}
        text += "".join(f"def {name}(): pass\n" for name in beside.get(kind, ["decide", "sample"]))
        (rule,) = [
            node
            for node in ast.parse(typed_copy(text).text).body
            if isinstance(node, ast.FunctionDef) and node.name == kind
        ]
        for argument in rule.args.args:
            assert argument.annotation is not None, (kind, argument.arg)
            if ast.unparse(argument.annotation) == "float":
                assert argument.arg not in RECORDS and argument.arg not in SPECIAL.get(kind, {})
                assert not records.match(words[argument.arg])


def test_our_rules_hold():
    assert check_types(RULES).faults == ()


def test_a_misspelled_parameter_is_told_in_every_rule_of_ours(tmp_path):
    """Every p., q. and b. is misspelled at once; each line that has one must be told, in every file."""
    wanted = {}
    for path, name in zip(RULES, NAMES, strict=True):
        text = path.read_text()
        tree = ast.parse(text)
        typed = ast.parse(typed_copy(text, scalar(path)).text)
        names = {
            node.name
            for node in typed.body
            if isinstance(node, ast.FunctionDef)
            and any(argument.annotation is not None and argument.arg in "pqbf" for argument in node.args.args)
        }
        rules = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name in names]
        found = [
            (node.end_lineno, node.end_col_offset)
            for rule in rules
            for node in ast.walk(rule)
            if isinstance(node, ast.Attribute)
            and isinstance(node.value, ast.Name)
            and node.value.id in ("p", "q", "b", "f")
        ]
        lines = text.splitlines()
        for line, column in sorted(found, reverse=True):
            lines[line - 1] = lines[line - 1][:column] + "_x" + lines[line - 1][column:]
        copy = tmp_path / name.replace("/", "_")
        copy.write_text("\n".join(lines))
        wanted[str(copy)] = {line for line, _ in found}
    told = check_types(list(wanted)).faults
    missed = {file: sorted(lines - {f.line for f in told if f.file == file}) for file, lines in wanted.items()}
    assert sum(map(len, wanted.values())) > 150
    assert not any(missed.values()), missed


def test_a_users_law_is_told_its_faults_by_its_own_lines(tmp_path):
    path = tmp_path / "my-law.py"
    path.write_text(LAW)
    told = {(fault.line, fault.text) for fault in check_types(path).faults}
    lines = LAW.splitlines()

    def at(part):
        return next(number for number, line in enumerate(lines, 1) if part in line)

    assert {line for line, _ in told} == {
        at("dvxx"), at("p.prep *"), at("Sums(k"), at("p.prepp"), at('"cup"'), at("own.h,")
    }  # fmt: skip
    assert (at("dvxx"), "neighbour(dx, dy, dvxx, p) asks for 'dvxx'; did you mean dvx?") in told
    assert (at("p.prep *"), '"Parameters" has no attribute "prep"; maybe "p_rep"?') in told
    assert (at('"cup"'), "never holds: 'cup' is none of 'cap', 'rescale'") in told
    assert any("Sums" in text and '"w"' in text for line, text in told if line == at("p.prepp"))


def test_a_typed_copy_is_a_law_that_flies_to_the_same_bits(tmp_path):
    assert check_types(EXAMPLE, out=tmp_path).faults == ()
    keys = {"agents": 3, "duration": 2.0}
    flown = [
        airflock.simulate(airflock.load("vasarhelyi_2018/4ms", keys, law=str(path), trust=True), device="python")
        for path in (EXAMPLE, tmp_path / EXAMPLE.name)
    ]
    assert flown[0].position.equals(flown[1].position)
    assert "own: Own" in (tmp_path / EXAMPLE.name).read_text()


def test_annotations_of_a_users_own_stay():
    text = "from numbers import Real\ndef decide(own: object, p: Real) -> tuple:\n    return own\n"
    assert typed_copy(text).text == text


def test_a_scenario_is_told_what_checks_it(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('extends = "vasarhelyi_2018/4ms"\n')
    with pytest.raises(RuleError, match=f"airflock validate {re.escape(str(path))} checks it"):
        check_types(path)


@pytest.mark.parametrize(
    "text, fault",
    [
        ("def decide(own:\n", "mine.py:1: '(' was never closed"),
        ("x = 1\n", "holds no rule; a law has decide"),
        (None, "no such file"),
    ],
)
def test_what_is_no_rule_file_is_one_line(tmp_path, text, fault):
    path = tmp_path / "mine.py"
    if text is not None:
        path.write_text(text)
    with pytest.raises(RuleError) as raised:
        check_types(path)
    assert fault in str(raised.value) and len(str(raised.value).splitlines()) == 1


def test_no_original_is_written_over(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(LAW)
    with pytest.raises(RuleError, match="would replace it; give another folder"):
        check_types(path, out=tmp_path)
    assert path.read_text() == LAW
    assert get_type_hints(check_types)["return"].__name__ == "TypeReport"
