"""Rules of the whole flock, on lists of floats."""

from collections.abc import Callable, Sequence
from typing import Any

from airflock.core import State, call_rule
from airflock.engine import scratch_shapes
from airflock.scenarios import Scenario

FlockSolver = Callable[[Sequence[State]], list[Any]]  # states of all agents → what the rule found for each


def flock_solver(scenario: Scenario) -> FlockSolver | None:
    """The flock rule of a scenario's model, with scratch that lasts for one flight; None if it has none."""
    model = scenario.model
    if model.flock is None or model.workspace is None:
        return None
    given = {"p": scenario.parameters, "wing": scenario.wing, "aero": scenario.aero}
    shapes = scratch_shapes(model.workspace, scenario.agents, given)
    return rule_solver(model.flock, "flock", model.Shared, shapes, given, model.name)


def rule_solver(
    rule: Callable[..., None], kind: str, record: Any, shapes: Any, arguments: dict[str, Any], owner: str
) -> FlockSolver:
    """A rule of the whole flock with scratch of these shapes; record : the columns that it fills."""
    work = type(shapes)(*[[[0.0] * columns for _ in range(rows)] for rows, columns in shapes])

    def solve(flock: Sequence[State]) -> list[Any]:
        shared = record(*[[0.0] * len(flock) for _ in record._fields])
        columns = dict(zip(State._fields, (list(column) for column in zip(*flock, strict=True)), strict=True))
        call_rule(rule, kind, {**arguments, **columns, "n": len(flock), "work": work, "shared": shared}, owner)
        return [record(*values) for values in zip(*shared, strict=True)]

    return solve
