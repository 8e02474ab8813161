"""Checks of a scenario against what stands in its scene: the scene itself, goals inside it, starts inside it."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.scenarios.scenario import Scenario
from airflock.support import SceneError
from airflock.world import Scene, clearance, half_sizes, in_mesh, scene_of, scenery, start, wrap

CROWDED = 0.9  # share of a start region inside obstacles that is worth a word; less is redrawn in silence
DRAWN = 64  # positions at which a start region is looked at
MOST = 2000  # the same where none is free


def scene_errors(scenario: Scenario, started: bool = False) -> list[str]:
    """What is wrong with a scene, with goals and, unless it has started, with the region of starts; one line each."""
    given = scenario.goals
    if given.kind == "own" and len(given.points) != scenario.agents:
        return [
            f"goals.kind = 'own': {len(given.points)} goals.points are not one for each of {scenario.agents} agents"
        ]
    if given.kind == "points" and not given.points:
        return ["goals.kind = 'points' needs goals.points, [[east, north, up], ...] in m"]
    if scenario.scene.draw == "flight" and scenario.scene.kind not in ("city", "forest"):
        return [f"scene.draw = 'flight' with scene.kind = {scenario.scene.kind!r}: only a city or a forest is drawn"]
    if scenario.scene.kind == "mesh" and not scenario.scene.file:
        return ["scene.kind = 'mesh' needs scene.file, a glTF, OBJ or STL file"]
    turned = [k for k, row in enumerate(scenario.scene.boxes) if any(row[c] >= row[c + 3] for c in range(3))]
    if turned:
        return [f"scene.boxes[{k}]: its first corner does not lie below its second in x, y and z" for k in turned]
    try:
        place = scenario.stands()
        points = scenario.waypoints()
    except SceneError as fault:
        return str(fault).splitlines()
    found = []
    for number, point in enumerate(points):
        depth = _depth(place, point)
        if depth > 0.0:
            where = ", ".join(f"{c:g}" for c in point[: scenario.dimensions])
            found.append(
                f"goals.points[{number}] = [{where}] m lies {depth:.3g} m inside what stands in the scene; move it out"
            )
    if not started and _blocked(scenario) == 1.0:
        found.append(
            "start: the whole region in which agents start lies inside what stands in the scene, or nearer to it than "
            f"start.clearance = {scenario.start.clearance:g} m; enlarge the region or lower scene.density"
        )
    return found


def scene_notes(scenario: Scenario) -> list[str]:
    """What was adjusted, for a person to read."""
    notes = list(scenario.stands().notes)
    share = _blocked(scenario)
    if share > CROWDED:
        notes.append(
            f"start: {share:.0%} of the region lies inside the scene or nearer to it than start.clearance = "
            f"{scenario.start.clearance:g} m; agents start only in the rest"
        )
    if scenario.goals.role == "herd" and not getattr(scenario.parameters, "s_goal", -1.0) < 0.0:
        notes.append("goals.role = 'herd': a flock with model.s_goal >= 0 follows the shepherd instead of fleeing it")
    return notes


def wrap_start(scenario: Scenario, start: NDArray[Any]) -> NDArray[Any]:
    """A given start (component, agent), its places (m) put back into a periodic box: they are the same places there."""
    if scenario.world.edges != "periodic":
        return start
    put = start.copy()
    for axis, half in enumerate(half_sizes(scenario.world)[: scenario.dimensions]):
        for agent in np.flatnonzero(np.abs(start[axis]) > half):
            put[axis, agent], _ = wrap(float(start[axis, agent]), 0.0, half)
    return put


def start_error(scenario: Scenario, start: NDArray[Any]) -> str:
    """What is wrong with a given start (component, agent), as a sentence; empty if nothing is."""
    fault = position_error(scenario, start, range(np.shape(start)[1]))
    return f"start: {fault}" if fault else ""


def position_error(scenario: Scenario, positions: NDArray[Any], agents: Sequence[int]) -> str:
    """What is wrong with places (component, agent) at which these agents are to be; empty if nothing is."""
    dims = scenario.dimensions
    if scenario.world.edges == "bounce":  # which would move an agent beyond a face onto it, farther than it flies
        beyond = np.abs(np.asarray(positions, float)[:dims]) - np.array(half_sizes(scenario.world)[:dims])[:, None]
        if beyond.max() > 0.0:
            agent = agents[int(beyond.max(axis=0).argmax())]
            return (
                f"agent {agent} lies {beyond.max():.3g} m outside the arena, from whose faces agents bounce; "
                "move it in or enlarge world.side"
            )
    place = scenario.stands()
    columns = np.asarray(positions, float)[:dims].T if len(place.shapes) else ()
    for agent, column in zip(agents, columns, strict=False):
        depth = _depth(place, np.append(column, [0.0] * (3 - dims)))
        if depth > 0.0:
            return f"agent {agent} lies {depth:.3g} m inside what stands in the scene"
    return ""


def _depth(place: Scene, point: NDArray[np.float64]) -> float:
    """How deep a position lies inside a solid or a closed mesh, m; 0 outside."""
    if not len(place.shapes):
        return 0.0
    gap = clearance(place, point)
    if gap <= 0.0:
        return max(-gap, 1e-9)
    return gap if in_mesh(place, point) else 0.0


def _blocked(scenario: Scenario) -> float:
    """Share of the region of starts in which nobody can start."""
    if scenario.scene.kind == "none" or scenario.start.kind == "arena":
        return 0.0
    return _share(scenario.scene, scenario.start, scenario.dimensions)


@lru_cache(maxsize=64)
def _share(scene: scenery.Parameters, begin: start.Parameters, dims: int) -> float:
    place = scene_of(scene, dims)
    if not len(place.shapes):
        return 0.0
    reach, rng, shut = begin.radius if begin.kind == "ball" else 0.5 * begin.side, np.random.default_rng(0), 0
    for number in range(1, MOST + 1):
        spot = rng.uniform(-1.0, 1.0, 3) * (1.0, 1.0, float(dims == 3))
        if begin.kind == "ball":
            spot *= min(1.0, 1.0 / max(float(np.linalg.norm(spot)), 1e-9))
        spot *= reach
        shut += clearance(place, spot, begin.clearance) < begin.clearance or in_mesh(place, spot)
        if number >= DRAWN and shut < number:  # only a region that looks shut is looked at for longer
            break
    return shut / number
