"""From rules to text: a choice that a rule hands on to what it calls is made in the text, at every depth."""

import ast

import pytest

from airflock.engine.text.generate import DriverSource
from airflock.support.errors import RuleError


def shape(form, x):
    if form == "square":
        return x * x
    if form == "cube":
        return x * x * x
    return x


def both(x, form):
    return shape(form, x) + shape("cube", x)


def rule(x, p):
    return both(x, p.form)


def flown(form, x):
    """The rule as a driver has it, run as plain Python, and the text of the driver."""
    source = DriverSource("", {"p": {"form": form}})
    name = source.name(rule)
    text = "\n".join(source.blocks)
    space = {"real": float}
    exec(text, space)
    return space[name](x, None), text, space


@pytest.mark.parametrize("form", ["square", "cube", "line"])
def test_a_choice_handed_on_is_made_before_compiling(form):
    found, text, space = flown(form, 3.0)
    assert found == both(3.0, form)
    assert form not in [node.value for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Constant)]
    assert not any(isinstance(node, (ast.Compare, ast.If)) for node in ast.walk(ast.parse(text)))
    shapes = [name for name in space if "shape" in name]
    assert len(shapes) == (1 if form == "cube" else 2)  # a text for each choice, and one for the same choice


def test_names_of_texts_stay_apart():
    source = DriverSource("", {})
    assert source.name(shape, {"form": "square"}) != source.name(shape, {"form": "cube"}) != source.name(shape)
    assert source.name(shape, {"form": "a b"}) != source.name(shape, {"form": "a c"})  # no names, numbered instead
    assert source.name(shape, {"form": "square"}) == source.name(shape, {"form": "square"})


ROUND = True


def nested(x, p):
    if p.form == "a":
        x = x + 1.0
        if p.kind == "b":
            total = 0.0
            for _ in range(3):
                total = total + x
            return total
    return x * p.unused


def scaled(x, by=2.0):
    return by * x if ROUND else x


def usual(x):
    return scaled(x) + scaled(x, 3.0)


def unknown(x):
    return x * wieght  # noqa: F821


def tells(x):
    hash(x)
    return x


def rebound(form, x):
    form = 1.0  # noqa: F841
    return x


def rebinds(x, p):
    return rebound(p.form, x)


def test_choices_within_choices_leave_nothing_unreachable_and_loops_are_seen():
    source = DriverSource("@njit(**JIT)", {"p": {"form": "a", "kind": "b"}})
    source.name(nested)
    assert "unused" not in source.blocks[0]
    assert source.blocks[0].startswith('@njit(inline="always"')


def test_defaults_and_truths_reach_a_driver():
    source = DriverSource("", {})
    name = source.name(usual)
    space = {"real": float}
    exec("\n".join(source.blocks), space)
    assert space[name](4.0) == usual(4.0) == 20.0


@pytest.mark.parametrize(
    ("rule", "said"),
    [
        (unknown, "uses wieght, which is neither a number, a plain function nor a NamedTuple; it is not defined"),
        (tells, "uses hash, which is neither a number, a plain function nor a NamedTuple; it does not compile; the"),
        (rebinds, "rule rebound sets form, a choice that it is handed"),
    ],
)
def test_what_no_driver_can_hold_is_one_line(rule, said):
    with pytest.raises(RuleError) as found:
        DriverSource("", {"p": {"form": "square"}}).name(rule)
    assert said in str(found.value) and "\n" not in str(found.value)


STEP = 2.0


def stepped(x):
    return x + STEP


def twice(x, p):
    return stepped(stepped(x)) if p.form == "on" else x


def text_of(form):
    """All that a driver holds of the rule."""
    source = DriverSource("", {"p": {"form": form}})
    source.name(twice)
    return "\n".join(source.blocks)


def test_a_text_written_before_is_that_of_now(monkeypatch):
    """What it depended on is asked again: choices, what names stand for, and what comes along."""
    first = text_of("on")
    assert "def test_generate_stepped" in first and "2.0" in first
    assert text_of("off") != first == text_of("on")
    monkeypatch.setitem(globals(), "STEP", 3.0)
    assert "3.0" in text_of("on") and "2.0" not in text_of("on")
    monkeypatch.setitem(globals(), "stepped", other_step)
    assert "def test_generate_other_step" in text_of("on") and "stepped" not in text_of("on")
    monkeypatch.undo()
    assert text_of("on") == first


def other_step(x):
    return 4.0 * x
