"""What stands in the world of a flight card: walls of the law, fence, obstacles, buildings; heights from the site."""

import numpy as np

from airflock.drones import FlightCard, to_tuples
from airflock.scenarios import ground_plan
from airflock.view.stage.scene import (
    ARENA_COLOUR,
    OBSTACLE_COLOUR,
    SceneGeometry,
    SceneLines,
    prism_edges,
    prism_solid,
    scenery_solids,
    shapes_by_kind,
)
from airflock.world import arena

FENCE_COLOUR = (204, 121, 167)


def card_scene(card: FlightCard) -> SceneGeometry:
    """What stands in the world of a card, m from its site."""
    world = arena.Parameters(**to_tuples(card.document["world"]))
    rows = np.array(card.document["shapes"].get("shapes", []), float).reshape(-1, 18)
    lift = 0.0 if len(rows) else card.height
    bottom, top = (0.0, 0.0) if card.flat else arena.heights_of(world)
    fence = np.array(card.document["fence"]["corners"], float)[:, :2]
    lines = [SceneLines("fence", prism_edges(np.vstack([fence, fence[:1]]), card.low, card.high), FENCE_COLOUR)]
    plan = ground_plan(world)
    if plan is not None:
        lines.append(
            SceneLines("arena", prism_edges(np.array(plan.exterior.coords), lift + bottom, lift + top), ARENA_COLOUR)
        )
    solids = []
    for number, outline in enumerate(world.obstacles):
        low, high = world.heights[number] if world.heights else (bottom, top)
        foot, roof = (0.0, card.high) if card.flat else (lift + low, lift + high)
        solids.append(prism_solid(f"obstacle_{number}", np.array(outline)[:, :2], foot, roof, OBSTACLE_COLOUR))
    solids += scenery_solids(shapes_by_kind(rows), None)
    ends = np.array([fence.min(axis=0), fence.max(axis=0)])
    middle = np.array([*ends.mean(axis=0), 0.5 * card.height])
    return SceneGeometry(solids, lines, 0.55 * float(np.ptp(ends, axis=0).max()), middle, (0.0, card.high))
