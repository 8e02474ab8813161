"""From rules to text: a choice that a rule hands on to what it calls is made in the text, at every depth."""

import ast

import pytest

from airflock.engine.generate import Source


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
    source = Source("", {"p": {"form": form}})
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
    source = Source("", {})
    assert source.name(shape, {"form": "square"}) != source.name(shape, {"form": "cube"}) != source.name(shape)
    assert source.name(shape, {"form": "a b"}) != source.name(shape, {"form": "a c"})  # no names, numbered instead
    assert source.name(shape, {"form": "square"}) == source.name(shape, {"form": "square"})
