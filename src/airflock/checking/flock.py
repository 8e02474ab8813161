"""Rules of the whole flock, on lists of floats."""

from collections.abc import Callable, Sequence
from inspect import signature
from typing import Any

from airflock.core.agent import State, answer
from airflock.core.contract import Metric
from airflock.scenarios.scenario import Scenario

Survey = Callable[[Sequence[State]], list[Any]]  # states of all agents → what the rule found for each


def of_model(scenario: Scenario) -> Survey | None:
    """The flock rule of a scenario's model, with scratch that lasts for one flight; None if it has none."""
    model = scenario.model
    if model.flock is None or model.workspace is None:
        return None
    given = {"p": scenario.parameters, "wing": scenario.wing, "aero": scenario.aero}
    shapes = shapes_of(model.workspace, scenario.agents, given)
    return _solver(model.flock, "flock", model.Shared, shapes, given, model.name)


def of_metric(metric: Metric, agents: int, q: Any, wing: Any) -> Survey | None:
    """The survey of a metric, likewise."""
    if metric.survey is None or metric.workspace is None:
        return None
    shapes = shapes_of(metric.workspace, agents, {"q": q, "wing": wing})
    return _solver(metric.survey, "survey", metric.Shared, shapes, {"q": q, "wing": wing}, metric.name)


def shapes_of(workspace: Callable[..., Any], agents: int, records: dict[str, Any]) -> Any:
    """Shapes of the scratch: what `workspace` returns for n and the records that it asks for."""
    given = {**records, "n": agents}
    return workspace(*(given[name] for name in signature(workspace).parameters))


def _solver(
    rule: Callable[..., None], kind: str, record: Any, shapes: Any, given: dict[str, Any], owner: str
) -> Survey:
    work = type(shapes)(*[[[0.0] * columns for _ in range(rows)] for rows, columns in shapes])

    def solve(flock: Sequence[State]) -> list[Any]:
        shared = record(*[[0.0] * len(flock) for _ in record._fields])
        columns = dict(zip(State._fields, (list(column) for column in zip(*flock, strict=True)), strict=True))
        answer(rule, kind, {**given, **columns, "n": len(flock), "work": work, "shared": shared}, owner)
        return [record(*values) for values in zip(*shared, strict=True)]

    return solve
