"""Where tuning starts: the scenario, with those numbers of its law scaled to its speed that its file does not give."""

import tomllib
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from airflock.parts.metrics import scalar_names
from airflock.scenarios import Scenario, rebuilt, starting_set
from airflock.support import ScenarioError

SCALES = "vasarhelyi_2018"  # the law whose scaling with the speed is published


def prepare_start(scenario: Scenario) -> tuple[Scenario, list[str]]:
    """The scenario to start from, and what was set, for a person to read.

    Only numbers that the scenario's document does not give are set; every other value stays.
    """
    values, told = _scaled(scenario)
    start = rebuilt(scenario, values) if values else scenario
    for room in _off_the_walls(scenario):
        with suppress(ScenarioError):  # they have no place so far from the walls
            why = f"no agent starts nearer than {room:g} m to walls and obstacles"
            away = rebuilt(start, {"start.wall_clearance": room})
            return away, [*told, f"{why} (start.wall_clearance, which is not given)"]
    return start, told


def measures_walls(scenario: Scenario) -> bool:
    """Whether its order parameters tell how near agents come to walls and obstacles, and some stand there."""
    stand = scenario.world.arena != "none" or bool(scenario.world.obstacles)
    return stand and "clearance" in scalar_names(scenario.measures, scenario.metrics)


def _scaled(scenario: Scenario) -> tuple[dict[str, Any], list[str]]:
    """Numbers of the law, scaled to the speed of the scenario."""
    if scenario.model.name != SCALES:
        return {}, [
            f"{scenario.model.name}: no scaling with the speed is published; the search starts from its own values"
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
        return {}, ["all numbers of the law are given; the search starts from them"]
    return values, [f"{len(values)} numbers of the law scaled to {speed:g} m/s, as Tables S1 and S3 of {SCALES} say"]


def _off_the_walls(scenario: Scenario) -> list[float]:
    """Room at walls and obstacles when a flight begins, m, where the document gives none; less where that is too much.

    Half of what agents have between them, or r_coll. Without it the nearest that most flights come to a wall is where
    somebody was put at the start, whatever the law does.
    """
    drawn = scenario.start.kind in ("arena", "ball", "box")
    if not (measures_walls(scenario) and drawn) or "wall_clearance" in scenario.document.get("start", {}):
        return []
    least = float(scenario.metrics.r_coll)
    return sorted({max(least, 0.5 * scenario.separation()), least}, reverse=True)
