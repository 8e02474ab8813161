"""Rules of the whole flock, on lists of floats."""

from collections.abc import Callable, Sequence
from typing import Any

from airflock.core.agent import State
from airflock.core.vocabulary import answer
from airflock.engine import shapes_of
from airflock.scenarios.scenario import Scenario

Survey = Callable[[Sequence[State]], list[Any]]  # states of all agents → what the rule found for each


def of_model(scenario: Scenario) -> Survey | None:
    """The flock rule of a scenario's model, with scratch that lasts for one flight; None if it has none."""
    model = scenario.model
    if model.flock is None or model.workspace is None:
        return None
    given = {"p": scenario.parameters, "wing": scenario.wing, "aero": scenario.aero}
    shapes = shapes_of(model.workspace, scenario.agents, given)
    return solver(model.flock, "flock", model.Shared, shapes, given, model.name)


def solver(rule: Callable[..., None], kind: str, record: Any, shapes: Any, given: dict[str, Any], owner: str) -> Survey:
    """A rule of the whole flock with scratch of these shapes; record : the columns that it fills."""
    work = type(shapes)(*[[[0.0] * columns for _ in range(rows)] for rows, columns in shapes])

    def solve(flock: Sequence[State]) -> list[Any]:
        shared = record(*[[0.0] * len(flock) for _ in record._fields])
        columns = dict(zip(State._fields, (list(column) for column in zip(*flock, strict=True)), strict=True))
        answer(rule, kind, {**given, **columns, "n": len(flock), "work": work, "shared": shared}, owner)
        return [record(*values) for values in zip(*shared, strict=True)]

    return solve
