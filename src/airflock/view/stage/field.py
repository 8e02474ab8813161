"""What stands in the world of a flight card: walls of the law, fence, obstacles, buildings; heights from the site."""

import numpy as np

from airflock.drones.onboard.card import Card
from airflock.drones.onboard.fields import frozen
from airflock.scenarios.geometry import ground_plan
from airflock.view.stage.scene import ARENA, OBSTACLE, Lines, Stage, drawn, frame, prism, scenery
from airflock.world import arena

FENCE = (204, 121, 167)


def field_of(card: Card) -> Stage:
    """What stands in the world of a card, m from its site."""
    world = arena.Parameters(**frozen(card.document["world"]))
    rows = np.array(card.document["shapes"].get("shapes", []), float).reshape(-1, 18)
    lift = 0.0 if len(rows) else card.height
    bottom, top = (0.0, 0.0) if card.flat else arena.heights_of(world)
    fence = np.array(card.document["fence"]["corners"], float)[:, :2]
    lines = [Lines("fence", frame(np.vstack([fence, fence[:1]]), card.low, card.high), FENCE)]
    plan = ground_plan(world)
    if plan is not None:
        lines.append(Lines("arena", frame(np.array(plan.exterior.coords), lift + bottom, lift + top), ARENA))
    solids = []
    for number, outline in enumerate(world.obstacles):
        low, high = world.heights[number] if world.heights else (bottom, top)
        foot, roof = (0.0, card.high) if card.flat else (lift + low, lift + high)
        solids.append(prism(f"obstacle_{number}", np.array(outline)[:, :2], foot, roof, OBSTACLE))
    solids += scenery(drawn(rows), None)
    ends = np.array([fence.min(axis=0), fence.max(axis=0)])
    middle = np.array([*ends.mean(axis=0), 0.5 * card.height])
    return Stage(solids, lines, 0.55 * float(np.ptp(ends, axis=0).max()), middle, (0.0, card.high))
