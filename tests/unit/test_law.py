"""The law of rules and the contract: what is refused, with the file, the line and the reason."""

import math
import random
import re
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from airflock.core import law, maths
from airflock.core.contract import argument_names
from airflock.core.metric import METRIC
from airflock.core.model import model
from airflock.core.vocabulary import VOCABULARY
from airflock.engine.text.generate import DriverSource
from airflock.engine.text.probe import probe_model
from airflock.parts import BODIES, METRICS
from airflock.scenarios.named_code import MODELS
from airflock.support.errors import RuleError

RULES = ("reach", "sight", "neighbour", "boundary", "decide", "preferred_speed", "interaction_range")


def lawful(dx, r):
    return dx / max(r, 1.0) ** 2


def integer(dx):
    return 2 * dx


def comprehension(dx):
    return sum([dx for _ in range(3)])


def raises(r):
    if r < 0.0:
        raise ValueError(r)
    return r


def foreign(dx):
    return maths.norm(dx, 0.0, 0.0)


def shadowed(dx, r):
    least = dx
    return min(least, r)


def doubled(dx):
    real = 2.0 * dx
    return real


def extreme(dx, r):
    return max((dx, r))


def walrus(dx):
    return (far := dx * dx) + far


COUNT = 0.0
NEVER = math.inf


def counting(dx):
    global COUNT
    COUNT += dx
    return COUNT


def nested(dx):
    def twice(x):
        return 2.0 * x

    return twice(dx)


def endless(r):
    return 1.0 if r < math.inf else 0.0


def guarded(r):
    return 0.0 if math.isnan(r) else r


def named(r):
    return 1.0 if r < NEVER else 0.0


def listed(dx, r):
    both = [dx, r]
    return both[0]


def drawn(dx):
    return dx * random.gauss(0.0, 1.0)


def worded(dx, *, r):
    return dx * r


def any_number(*given):
    return given[0]


def named_like_indices(k, n, e, m, row, word, p):
    return 2 * k + (n - 1) / 3 + e * 2 + (m + 1) * row - 1 + 2 * word


def element(table, k):
    return table[k][0]


def halved(m):
    return (m + 1) // 2


def indices(x, work, first, last, size, p):
    total = 0.0
    at = 0
    other = at + 3
    for k in range(size - 1):
        total += x[2 * k + 1] + element(work, first - 1) * float(3 * other - 1) + float(k + 1)
    for e in range(first + 1, 2 * last):
        total += float(halved(4 * e) - 1)
    return total


def test_a_lawful_rule_passes():
    assert law.rule_errors(lawful) == []


def test_a_float_is_a_float_whatever_its_name():
    """A name that is used as no index makes of an integer beside it a double in a kernel of single precision."""
    said = law.rule_errors(named_like_indices)
    assert [line.partition("integer ")[2].split()[0] for line in sorted(said)] == ["1", "1", "1", "2", "2", "2", "3"]


def test_what_counts_or_points_is_an_integer_whatever_its_name():
    assert law.rule_errors(indices) == law.rule_errors(halved) == []


@pytest.mark.parametrize(
    ("rule", "said"),
    [
        (integer, "integer 2 in float arithmetic; write 2.0"),
        (comprehension, "ListComp is not allowed"),
        (raises, "Raise is not allowed"),
        (foreign, "maths.norm: only math may be used"),
        (shadowed, "least is what the engine calls here"),
        (doubled, "real is what the engine calls here"),
        (extreme, "max of fewer than two numbers; write max(a, b)"),
        (walrus, "NamedExpr is not allowed"),
        (counting, "sets COUNT outside; what an agent keeps between decisions is its Memory"),
        (nested, "twice is defined inside; write it beside the rule"),
        (listed, "List is not allowed in a rule; write a tuple, or a name for each number"),
        (endless, "math.inf: compiled, every number counts as finite; write 1e30"),
        (guarded, "math.isnan: compiled, every number counts as finite"),
        (named, "NEVER is not finite; write 1e30"),
        (drawn, "random.gauss: only math may be used through a module name; write percept.normal(0)"),
        (worded, "has * in its arguments"),
        (any_number, "has * in its arguments"),
    ],
)
def test_a_fault_names_file_line_and_reason(rule, said):
    (line, *_) = law.rule_errors(rule)
    file, number, text = line.split(":", 2)
    assert file == __file__ and said in text
    with open(file, encoding="utf-8") as source:
        written = source.read().splitlines()
    start = rule.__code__.co_firstlineno
    assert start <= int(number) <= start + 3 and written[start - 1].startswith(f"def {rule.__name__}")


@pytest.mark.parametrize("name", MODELS)
def test_every_shipped_model_is_lawful(name):
    module = import_module(f"airflock.parts.laws.{name}")
    for kind in RULES:
        if hasattr(module, kind):
            assert law.rule_errors(getattr(module, kind)) == []


def test_every_shipped_body_and_order_parameter_is_lawful():
    for body in BODIES.values():
        assert law.rule_errors(body.move) == []
    for metric in METRICS.values():
        for kind in METRIC:
            if getattr(metric, kind) is not None:
                assert law.rule_errors(getattr(metric, kind)) == [], (metric.name, kind)


def test_an_unknown_name_is_refused_with_the_nearest_known_one():
    def neighbour(dx, distnce, p):
        return dx

    with pytest.raises(RuleError, match="asks for 'distnce'") as caught:
        argument_names(neighbour, "neighbour", "mine")
    assert all(name in str(caught.value) for name in VOCABULARY["neighbour"])


class Parameters:
    pass


class Gain:
    gain = 1.0


class Sums(NamedTuple):
    x: float


def decide(own, p):
    return own.vx, own.vy, own.vz


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ({}, "lacks Parameters (a record of its numbers, derived from airflock.Parameters), COMMAND (what"),
        ({"Parameters": Parameters, "COMMAND": "velocity"}, "lacks decide (the rule itself)"),
        ({"Parameters": Parameters, "COMMAND": "thrust", "decide": decide}, "'thrust' is none of velocity"),
        (
            {"Parameters": Parameters, "COMMAND": "velocity", "decide": decide, "neighbour": lambda dx: dx},
            "neighbour but no Sums",
        ),
        (
            {"Parameters": Parameters, "COMMAND": "velocity", "decide": decide, "Sums": Sums, "REDUCE": {"y": "min"}},
            "REDUCE['y']",
        ),
    ],
)
def test_a_model_with_a_part_missing_is_refused(parts, said):
    with pytest.raises(RuleError) as caught:
        model(SimpleNamespace(**parts), "mine")
    assert said in str(caught.value) and "mine" in str(caught.value)


def test_rules_of_a_model_are_plain_python():
    module = import_module("airflock.parts.laws.vasarhelyi_2018")
    p = module.Parameters()
    sums = module.neighbour(**{name: 1.0 for name in argument_names(module.neighbour, "neighbour") if name != "p"}, p=p)
    assert all(isinstance(value, float) and math.isfinite(value) for value in sums)


def test_what_the_compiler_refuses_is_one_line():
    from airflock.engine import score_flight
    from airflock.parts.laws import viragh_2014
    from airflock.scenarios.files import load

    def decide(own, p):
        return own.vx.as_integer_ratio()[0] * 1.0, own.vy, 0.0

    law_ = {"Parameters": viragh_2014.Parameters, "COMMAND": "velocity", "decide": decide, "__name__": "mine"}
    found = load("viragh_2014/4ms", {"duration": 1.0}, law=law_)
    with pytest.raises(RuleError) as fault:
        score_flight(found, 0)
    assert "does not compile" in str(fault.value) and "as_integer_ratio" in str(fault.value)
    assert "\n" not in str(fault.value)


def test_what_a_rule_brings_beside_itself_is_told():
    parts = {"Parameters": Parameters, "COMMAND": "velocity", "decide": decide, "neighbour": lambda dx: dx}
    with pytest.raises(RuleError, match="no Sums .a NamedTuple of this name with what neighbour returns"):
        model(SimpleNamespace(**parts), "mine")


def plain_tuple(dx):
    return (dx,)


def of_numpy(dx):
    return Sums(np.exp(dx))


@pytest.mark.parametrize(("rule", "said"), [
    (plain_tuple, r"mine.neighbour must return Sums\("), (of_numpy, "np.exp: only math .* write math.exp"),
])  # fmt: skip
def test_what_to_write_instead_is_told_of_the_rule_that_is_wrong(rule, said):
    parts = {"Parameters": Parameters, "COMMAND": "velocity", "decide": decide, "neighbour": rule, "Sums": Sums}
    with pytest.raises(RuleError, match=said):
        probe_model(model(SimpleNamespace(**parts), "mine"), Parameters())


def misspelt(dx, p):
    return Sums(dx * p.gian)


def unknown(dx):
    return Sums(math.sqr(dx))


@pytest.mark.parametrize(("rule", "meant"), [
    (misspelt, "'gian'; did you mean gain?"), (unknown, "'sqr'; did you mean sqrt?"),
])  # fmt: skip
def test_an_attribute_that_is_misspelt_names_the_near_one_and_its_line(rule, meant):
    parts = {"Parameters": Gain, "COMMAND": "velocity", "decide": decide, "neighbour": rule, "Sums": Sums}
    line = rule.__code__.co_firstlineno + 1
    with pytest.raises(RuleError, match=rf"test_law.py:{line}: .* has no attribute {re.escape(meant)}$"):
        probe_model(model(SimpleNamespace(**parts), "mine"), Gain())


def rounded(dx):
    return float(f"{dx:.2f}")


@cache
def kept(dx):
    return Sums(dx)


@dataclass(frozen=True)
class Fixed:
    gain: float = 1.0


@dataclass
class Plain:
    x: float


def of_dataclass(dx):
    return Plain(dx)


def sets_a_number(dx, p):
    p.gain = 2.0
    return Sums(dx * p.gain)


@pytest.mark.parametrize(("rule", "record", "line", "said"), [
    (kept, Sums, 0, "rule kept has a decorator; a rule is a plain function"),
    (of_dataclass, Plain, 0, "mine: Plain must be a NamedTuple"),
    (sets_a_number, Sums, 1, "FrozenInstanceError: cannot assign to field 'gain'"),
])  # fmt: skip
def test_what_is_no_rule_or_no_record_is_told_with_its_line(rule, record, line, said):
    """Each ended as a fault of the program, or was told of the text that a dataclass writes for itself."""
    parts = {"Parameters": Fixed, "COMMAND": "velocity", "decide": decide, "neighbour": rule, "Sums": record}
    first = getattr(rule, "__wrapped__", rule).__code__.co_firstlineno
    with pytest.raises(RuleError, match=rf"test_law.py:{first + line}: .*{re.escape(said)}"):
        probe_model(model(SimpleNamespace(**parts), "mine"), Fixed())


@pytest.mark.parametrize(("name", "stands_for", "said"), [
    ("gauss", [0.5], "nor a NamedTuple"), ("sqrt", np.sqrt, "nor a NamedTuple; write math.sqrt"),
])  # fmt: skip
def test_a_name_that_no_driver_has_is_told_with_its_line(name, stands_for, said, tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(f"def rule(dx):\n    first = dx\n    return first * {name}(dx)\n", encoding="utf-8")
    space = {name: stands_for}
    exec(compile(file.read_text(encoding="utf-8"), str(file), "exec"), space)
    with pytest.raises(RuleError, match=f"mine.py:3: rule rule uses {name}, .*{said}$"):
        DriverSource("", {}).name(space["rule"])


def test_a_text_that_a_rule_makes_is_for_plain_python_alone():
    """Numba knows no format of a number: it ended as a fault of the program."""
    with pytest.raises(RuleError, match=rf"test_law.py:{rounded.__code__.co_firstlineno + 1}: .* makes a text"):
        DriverSource("", {}).name(rounded)
    lenient = DriverSource("", {})
    lenient.allow_builtins = True
    lenient.name(rounded)
    space = {"real": float}
    exec("\n".join(lenient.blocks), space)
    assert space[lenient.name(rounded)](3.14159) == 3.14
