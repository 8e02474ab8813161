"""Change: a scenario with some of its keys set anew, as a flight in the air takes it."""

from collections.abc import Mapping
from typing import Any

from airflock.errors import ScenarioError
from airflock.scenarios.files import MODELS, make
from airflock.scenarios.scenario import Scenario

LASTING = {"agents": "the number of agents", "dt": "the motion step"}  # keys at the top that a flight cannot change


def changed(scenario: Scenario, settings: Mapping[str, Any]) -> Scenario:
    """The scenario with keys like "model.p_rep" set anew, checked as a whole as if it came from a file.

    A flight can take everything that a scenario file says but the number of agents, the dimensions, the motion step and
    the start. Raises ScenarioError with one line per fault.
    """
    document = {**scenario.document}
    if scenario.scene.kind == "mesh":  # which was looked for beside the scenario file
        document["scene"] = {**document.get("scene", {}), "file": scenario.scene.file}
    shipped = document.get("model", {}).get("kind") in MODELS
    if not shipped and scenario.descends:
        raise ScenarioError(["aero: a law of one's own with drag descent cannot be changed in flight"])
    new = make(document, scenario.name, settings, law=None if shipped else scenario.model)
    faults = [
        f"{key} = {getattr(new.flight, key):g}: {what} cannot change in flight; open another flight"
        for key, what in LASTING.items()
        if getattr(new.flight, key) != getattr(scenario.flight, key)
    ]
    if new.dimensions != scenario.dimensions:
        faults.append(f"world.dimensions = {new.dimensions}: cannot change in flight; open another flight")
    if new.start != scenario.start:
        faults.append("start: the flight has started; open another flight")
    if faults:
        raise ScenarioError([f"{scenario.name}: {fault}" for fault in faults])
    return new
