"""Cells: whether neighbours are found by cells, as wide as the law's reach, instead of among all pairs.

And whether order parameters look at pairs by cells.
"""

from dataclasses import replace

from airflock.scenarios.scenario import Scenario
from airflock.scenarios.timing import clock
from airflock.world.place import half_sizes

GRID_FROM = 1000  # agents; below, all pairs on one core are as fast, and flights side by side use the cores

# Agents from which order parameters look at pairs by cells: below, all pairs in vectors are as fast. A pair costs four
# times as much where its offset goes to the nearest image (benchmarks/RESULTS-boids.md).
NEAR_FROM, NEAR_FROM_IN_A_BOX = 6000, 2000


def takes_all_cores(scenario: Scenario) -> bool:
    """Whether one flight of a scenario uses all cores by itself, so that several side by side gain nothing.

    Its neighbours are found by cells: many agents, a model of finite reach, perception as things are.
    """
    perfect = not scenario.errs and clock(scenario)["delay"] == 0 and scenario.radio.loss == 0.0
    return (
        scenario.agents >= GRID_FROM
        and scenario.model.reach is not None
        and scenario.model.neighbour is not None
        and perfect
        and by_cells(scenario)
        and not scenario.transceiver.keeps
        and scenario.silence.rule == "fly_on"
        and scenario.flight.update == "synchronous"
        and not any({"sense", "tell", "radio", "clock"} & set(kind.rules) for kind in scenario.fault_kinds)
        and has_room(scenario)
    )


def group_notes(scenario: Scenario) -> list[str]:
    """A note where only the groups keep a large flock from being flown by cells."""
    if not scenario.groups or scenario.agents < GRID_FROM or takes_all_cores(scenario):
        return []
    if not takes_all_cores(replace(scenario, groups=())):
        return []
    what = "laws" if len(scenario.laws) > 1 else "numbers of the law"
    return [
        f"groups: where {what} differ, each of {scenario.agents} agents looks at all others, on one core, and not at "
        "those in the cells around it, on all cores"
    ]


def by_cells(scenario: Scenario) -> bool:
    """Whether cells as wide as the law's reach hold all who decide whom an agent meets; all agents have that reach."""
    if len(scenario.laws) > 1 or (scenario.groups and scenario.laws[0].asks_for_groups):
        return False
    if any(letter == "p" for letter, _ in scenario.varied):
        return False
    kind = scenario.meets
    walls = scenario.scene.kind != "none" or bool(scenario.world.obstacles)
    return kind is None or (kind.near and not (walls and kind.asks("hidden")))


def has_room(scenario: Scenario) -> bool:
    """Whether a periodic box is two reaches wide, so that a neighbour is in reach at one image only."""
    if scenario.world.edges != "periodic" or scenario.model.reach is None:
        return True
    halves = half_sizes(scenario.world)[: scenario.dimensions]
    return min(halves) >= float(scenario.model.reach(scenario.parameters))


def measured_by_cells(scenario: Scenario) -> bool:
    """Whether order parameters look at pairs by cells, too, where neighbours are found so."""
    periodic = scenario.world.edges == "periodic"
    return bool(scenario.agents >= (NEAR_FROM_IN_A_BOX if periodic else NEAR_FROM))
