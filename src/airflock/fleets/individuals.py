"""What single drones of a fleet differ in: numbers of their groups."""

from dataclasses import replace
from typing import Any

from airflock.scenarios import Scenario
from airflock.support import ScenarioError


def agent_records(scenario: Scenario, count: int, seed: int | None) -> list[tuple[Any, Any]]:
    """Numbers of law and body of each of the first `count` agents.

    seed : with tolerances of manufacture as this seed draws them; None: without, for real drones have their own

    Raises ScenarioError where groups are of fewer agents.
    """
    if not scenario.varied and len(scenario.laws) == 1:
        return [(scenario.parameters, scenario.body)] * count
    if count > scenario.agents:
        raise ScenarioError(
            [f"groups are of {scenario.agents} agents, and {count} drones are to fly; set agents = {count}"]
        )
    groups = tuple(replace(group, spread={}) for group in scenario.groups) if seed is None else scenario.groups
    told = replace(scenario, groups=groups)
    varied = dict.fromkeys([*told.varied, *(each for law in told.laws for each in law.varied)])
    columns = {(of, name): told.agent_values(of, name, seed or 0) for of, name in varied}

    def own(agent: int) -> tuple[Any, Any]:
        law = told.law_of(agent)
        p = {name: columns["p", name][agent] for _, name in law.varied}
        b = {name: column[agent] for (of, name), column in columns.items() if of == "b"}
        return replace(law.parameters, **p), replace(scenario.body, **b)

    return [own(agent) for agent in range(count)]


def agent_sensors(scenario: Scenario, count: int, seed: int) -> list[Any]:
    """Numbers of the sensor of each of the first `count` agents, with tolerances as a seed draws them."""
    columns = {name: scenario.agent_values("s", name, seed) for of, name in scenario.varied if of == "s"}
    own = [{name: column[agent] for name, column in columns.items()} for agent in range(count)]
    return [replace(scenario.sensors, **numbers) for numbers in own]
