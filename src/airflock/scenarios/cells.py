"""Cells: whether neighbours are found by cells, as wide as a law's reach, instead of among all pairs.

And whether order parameters look at pairs by cells.
"""

import math
from dataclasses import replace

from airflock.core import fields_read
from airflock.scenarios.group_laws import FlownLaw
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.timing import step_counts
from airflock.world import half_sizes

GRID_FROM = 1000  # agents; below, all pairs on one core are as fast, and flights side by side use the cores

# Agents from which order parameters look at pairs by cells: below, all pairs in vectors are as fast. A pair costs four
# times as much where its offset goes to the nearest image. Measured: one sample of `zapotecatl` on one thread, of 1,000
# to 8,000 agents.
NEAR_FROM, NEAR_FROM_IN_A_BOX = 6000, 2000


def uses_all_cores(scenario: Scenario) -> bool:
    """Whether one flight of a scenario uses all cores by itself, so that several side by side gain nothing.

    Its neighbours are found by cells: many agents, laws of finite reach, perception as things are.
    """
    perfect = not scenario.has_sensor_error and step_counts(scenario)["delay"] == 0 and scenario.radio.loss == 0.0
    return (
        scenario.agents >= GRID_FROM
        and perfect
        and uses_cells(scenario)
        and not scenario.transceiver.keeps_packets
        and scenario.silence.rule == "fly_on"
        and scenario.flight.update == "synchronous"
        and not any({"sense", "tell", "radio", "clock"} & set(kind.rules) for kind in scenario.fault_kinds)
        and box_fits_cells(scenario)
    )


def cell_notes(scenario: Scenario) -> list[str]:
    """A note where only the laws of groups keep a large flock from being flown by cells."""
    if not scenario.groups or uses_all_cores(scenario) or not uses_all_cores(replace(scenario, groups=())):
        return []
    if not uses_cells(scenario):
        endless = next(law.model.name for law in scenario.laws if not _within_reach(law))
        why = f"{endless} sees without limit (it has no reach)"
    else:
        drawn = any(_widest_reach(scenario, law) == math.inf for law in scenario.laws)
        why = "their reach is drawn, in a periodic box" if drawn else "the box is less than two of their reaches wide"
    return [
        f"groups: {why}, so each of {scenario.agents} agents looks at all others, on one core, instead of at those "
        "in the cells around it, on all cores"
    ]


def uses_cells(scenario: Scenario) -> bool:
    """Whether cells as wide as a law's reach hold all who decide whom an agent of it meets."""
    if not any(law.model.neighbour for law in scenario.laws) or not all(map(_within_reach, scenario.laws)):
        return False
    kind = scenario.topology_rule
    walls = scenario.scene.kind != "none" or bool(scenario.world.obstacles)
    return kind is None or (kind.near and not (walls and kind.asks_for("hidden")))


def _within_reach(law: FlownLaw) -> bool:
    """Whether a law looks at nobody beyond a reach that it tells."""
    return law.model.neighbour is None or law.model.reach is not None


def box_fits_cells(scenario: Scenario) -> bool:
    """Whether a periodic box is two reaches wide, so that a neighbour is in reach at one image only."""
    if scenario.world.edges != "periodic":
        return True
    halves = half_sizes(scenario.world)[: scenario.dimensions]
    return min(halves) >= max(_widest_reach(scenario, law) for law in scenario.laws)


def _widest_reach(scenario: Scenario, law: FlownLaw) -> float:
    """The widest reach of those who fly by a law, m; without end where it is a matter of chance."""
    if law.model.reach is None or law.model.neighbour is None:
        return 0.0
    read = fields_read(law.model.reach, "p")
    found = [float(law.model.reach(law.parameters))]
    for group in scenario.groups:
        if group.agents and set(group.agents) <= set(law.agents):
            if any(letter == "p" and (read is None or name in read) for letter, name in group.spread):
                return math.inf
            own = {name: value for (letter, name), value in group.numbers.items() if letter == "p"}
            found.append(float(law.model.reach(replace(law.parameters, **own))))
    return max(found)


def metrics_use_cells(scenario: Scenario) -> bool:
    """Whether order parameters look at pairs by cells, too, where neighbours are found so."""
    periodic = scenario.world.edges == "periodic"
    return bool(scenario.agents >= (NEAR_FROM_IN_A_BOX if periodic else NEAR_FROM))
