"""The scene of a scenario, and the goals in it: made once, kept as arrays."""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import constrained_delaunay_triangles
from shapely.geometry import Polygon

from airflock.support import SceneError
from airflock.world import bvh, goals, scenery
from airflock.world.inside import inside
from airflock.world.scenes.city import buildings, half_side
from airflock.world.scenes.forest import trees
from airflock.world.scenes.tree import TALL_HEIGHT, Scene, box_rows, ground_row, make_scene, segment_rows, triangle_rows
from airflock.world.shapes import APPEARS, BOX, CYLINDER

__all__ = ["Scene", "clearance", "in_mesh", "scene_of", "waypoints"]

Polygons = tuple[tuple[tuple[float, ...], ...], ...]
MARGIN = 100.0  # m; the ground reaches beyond the scene, so that no flock slips under it
DEPTH = 1000.0  # m; thickness of the ground: nothing starts below it
MANY = 50_000  # shapes; of more no lists are made, which would take longer than they save
ATTEMPTS = 100_000  # draws of all free points
IN_VAIN = 10_000  # of them without finding one: hardly any of the scene is free


@lru_cache(maxsize=32)
def scene_of(
    p: scenery.Parameters, dimensions: int, polygons: Polygons = (), heights: tuple[tuple[float, ...], ...] = ()
) -> Scene:
    """Scene as arrays; in a plane every building and tree is its ground plan.

    polygons : walls besides, m; heights: lowest and highest of the last of them, if they have ends in height, m
    """
    tall = len(polygons) - len(heights)
    walls = [
        segment_rows([[*a, *b] for a, b in zip(ring, ring[1:] + ring[:1], strict=True)]) for ring in polygons[:tall]
    ]
    walls += [triangle_rows(_faces(ring, *ends)) for ring, ends in zip(polygons[tall:], heights, strict=True)]
    if p.kind == "none":
        return make_scene(walls)
    notes: tuple[str, ...] = ()
    if p.kind == "mesh":
        from airflock.world.scenes.meshes import load_mesh

        rows, notes = load_mesh(p, dimensions)
    elif p.kind == "boxes":
        given = np.array(p.boxes, float).reshape(-1, 7)
        rows = box_rows(given[:, :6])
        rows[:, APPEARS] = given[:, 6]
    else:
        rows = buildings(p) if p.kind == "city" else trees(p)
        rows[:, APPEARS] = appearance_times(p, len(rows))
    if dimensions == 2:
        flat = (rows[:, 6] == BOX) | (rows[:, 6] == CYLINDER)
        rows[flat, 2], rows[flat, 5] = -TALL_HEIGHT, TALL_HEIGHT
        return make_scene([rows, *walls], notes)
    half = half_side(p, rows) + MARGIN
    below = [ground_row([-half, -half, -DEPTH, half, half, 0.0])] if p.ground == "yes" else []
    return make_scene([*below, rows, *walls], notes)


def _faces(ring: tuple[tuple[float, ...], ...], low: float, high: float) -> list[list[tuple[float, ...]]]:
    """Triangles (3 corners each, m) of an upright prism over a simple polygon."""
    pairs = list(zip(ring, ring[1:] + ring[:1], strict=True))
    found = [[(*a, low), (*b, low), (*b, high)] for a, b in pairs]
    found += [[(*a, low), (*b, high), (*a, high)] for a, b in pairs]
    flat = [part.exterior.coords[:3] for part in constrained_delaunay_triangles(Polygon(ring)).geoms]
    return found + [[(*corner, z) for corner in part] for part in flat for z in (low, high)]


def appearance_times(p: scenery.Parameters, count: int) -> NDArray[np.float64]:
    """When each of so many shapes appears, s; 0: it stands from the start. A tree's trunk and crown come together."""
    parts = 2 if p.kind == "forest" else 1
    rng = np.random.default_rng([int(p.seed), 2])
    late, when = rng.uniform(0.0, 1.0, (2, count // parts))
    return np.tile(np.where(late < p.later, np.maximum(when * p.later_until, 1e-6), 0.0), parts)


def clearance(scene: Scene, position: Any, within: float = 1e6) -> float:
    """Distance (m) to what stands in a scene; negative inside a solid, 1e30 if nothing is within (m)."""
    x, y, z = (float(c) for c in position)
    return float(bvh.nearest(x, y, z, within, *_tables(scene)).distance)


def in_mesh(scene: Scene, position: Any) -> bool:
    """Whether a position lies inside a closed mesh, in a plane inside its cut at height 0."""
    x, y, z = (float(c) for c in position)
    return scene.has_closed_surface and bool(inside(x, y, z, *_tables(scene)) > 0.5)


def _tables(found: Scene) -> Any:
    """Shapes, nodes and links for plain Python: lists, or the arrays where there are too many."""
    return found.as_lists if len(found.shapes) < MANY else (found.shapes, found.nodes, found.links)


@lru_cache(maxsize=32)
def waypoints(g: goals.Parameters, p: scenery.Parameters, dimensions: int) -> NDArray[np.float64]:
    """Goals in their order (goal, 3), m.

    Free points are drawn by the scene's seed: within the scene, between the two heights, clear of everything, and at
    least goals.apart from the one before.
    """
    if g.kind == "none":
        return np.zeros((0, 3))
    if g.kind in ("points", "own"):
        found = np.array(g.points, float).reshape(-1, 3)
        return found * (1.0, 1.0, 0.0) if dimensions == 2 else found
    place = scene_of(p, dimensions)
    half = (
        half_side(p, place.shapes)
        if p.kind in ("city", "forest")
        else 0.5 * float(np.ptp(place.bounds, axis=0)[:2].min())
    )
    rng = np.random.default_rng([int(p.seed), 1])
    chosen: list[NDArray[np.float64]] = []
    last = np.zeros(3)
    vain = 0
    for _ in range(ATTEMPTS):
        if vain == IN_VAIN:
            break
        vain += 1
        spot = np.array(
            [*rng.uniform(-half, half, 2), rng.uniform(g.low, max(g.high, g.low)) if dimensions == 3 else 0.0]
        )
        free = np.linalg.norm(spot - last) >= g.apart and clearance(place, spot, g.clearance) >= g.clearance
        if free and not in_mesh(place, spot):
            chosen.append(spot)
            last, vain = spot, 0
            if len(chosen) == int(g.count):
                return np.array(chosen)
    raise SceneError(
        f"goals.kind = 'scene': no free point at {g.clearance:g} m from everything and {g.apart:g} m from the last; "
        "lower goals.clearance, goals.apart or scene.density"
    )
