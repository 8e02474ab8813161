"""A replacement in generated text that finds nothing to replace is an error that names the text."""

import ast
from types import SimpleNamespace

import pytest

from airflock.engine import plan_of
from airflock.scenarios.files import load
from inside import Across, CudaBuilder, ReplacementError, cuda_cells as cells, must_replace

LARGE = "couzin_2002/swarm"  # flown by cells where it is large


def test_every_occurrence_is_replaced_in_text_and_in_lines():
    assert must_replace("a b a", "a", "c") == "c b c"
    assert must_replace("a b a", "a", "c", 1) == "c b a"
    assert must_replace(["a b", "b", "a"], "a", "c") == ["c b", "b", "c"]


@pytest.mark.parametrize("text", ["x = y[i]", ["x = y[i]", "z = 1"], "", []])
def test_a_replacement_without_a_match_names_what_it_looked_for_and_the_text(text):
    with pytest.raises(ReplacementError, match=r"'y\[j\]' was to become 'h\[j\]'") as found:
        must_replace(text, "y[j]", "h[j]")
    assert all(line in str(found.value) for line in ([text] if isinstance(text, str) else text))


def respelled(lines):
    """Lines in which a candidate is named in another way."""
    return [line.replace("integer(j)", "whole(j)") for line in lines]


def test_a_stage_in_another_spelling_is_refused_where_a_kernel_takes_it(monkeypatch):
    """The kernel of a large flock looks for spellings of `neighbours`; none may be missed in silence."""
    plan = plan_of(load(LARGE), precision=32).built(grid=True)
    cells.large_flock_text(plan)
    add = CudaBuilder.function
    monkeypatch.setattr(
        CudaBuilder,
        "function",
        lambda build, head, *bodies: add(
            build, head, *[body if isinstance(body, str) else respelled(body) for body in bodies]
        ),
    )
    with pytest.raises(ReplacementError, match=r"integer\(j\)"):
        cells.large_flock_text(plan)


def test_a_variable_that_is_called_as_a_row_over_the_others_is_refused():
    rows = Across(SimpleNamespace(across={"square": 3}))
    assert ast.unparse(rows.visit(ast.parse("near = square[j] + far"))) == "near = across[3, i, j] + far"
    with pytest.raises(ReplacementError, match="square: a variable of a stage has the name of a row"):
        rows.visit(ast.parse("square = x * x"))
