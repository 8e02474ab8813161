"""Where tuning starts: the scenario, with those numbers of its law scaled to its speed that its file does not give."""

import tomllib
from collections.abc import Mapping
from typing import Any

from airflock.scenarios.change import remade
from airflock.scenarios.scaling import starting_set
from airflock.scenarios.scenario import Scenario

SCALES = "vasarhelyi_2018"  # the law whose scaling with the speed is published


def start_of(scenario: Scenario) -> tuple[Scenario, list[str]]:
    """The scenario to start from, and what was set, for a person to read.

    Only numbers that the scenario's document does not give are set; every other value stays.
    """
    if scenario.model.name != SCALES:
        return scenario, [
            f"{scenario.model.name}: no scaling with the speed is published; its own values are the start"
        ]
    speed = float(scenario.parameters.v_flock)
    scaled: Mapping[str, Any] = tomllib.loads(starting_set(speed))["model"]
    given = scenario.document.get("model", {})
    values = {
        f"model.{name}": entry["value"]
        for name, entry in scaled.items()
        if isinstance(entry, dict) and name not in given and name != "v_max"
    }
    if not values:
        return scenario, ["all numbers of the law are given; they are the start"]
    told = f"{len(values)} numbers of the law scaled to {speed:g} m/s, as Tables S1 and S3 of {SCALES} say"
    return remade(scenario, values), [told]
