"""Surfaces: which rules of the world stand behind the choices of an arena, and the numbers that they are handed."""

from collections.abc import Callable
from typing import Any

from airflock.world import arena, edges, excursion, rays
from airflock.world.place import inward_plane

RAYS = {"square": rays.to_box, "polygon": rays.to_polygon, "circle": rays.to_cylinder, "none": rays.to_nothing}
EDGE_RULES = {"open": None, "bounce": edges.bounce, "periodic": edges.wrap}


def arena_surfaces(world: arena.Parameters) -> tuple[tuple[Callable[..., Any], ...], Callable[..., float]]:
    """Families of surfaces of an arena, and its excursion function; a periodic one has no walls to feel or to leave."""
    if world.edges == "periodic":
        return (), excursion.beyond_nothing
    three = world.dimensions == "3"
    caps = (arena.plane,) if three else ()
    ground = {"square": (arena.plane,), "polygon": caps, "circle": (arena.cylinder,), "none": ()}[world.arena]
    if world.arena == "square" and world.walls == "nearest_per_axis":
        return (arena.slab,), excursion.beyond_box
    beyond = {
        "square": excursion.beyond_box,
        "polygon": excursion.beyond_polygon,
        "circle": excursion.beyond_cylinder,
        "none": excursion.beyond_nothing,
    }[world.arena]
    if three and world.arena == "circle":
        return (arena.cylinder, arena.plane), beyond
    return ground, beyond


def arena_ray(world: arena.Parameters) -> Callable[..., float]:
    """Free distance along a direction to the arena's walls."""
    return rays.to_nothing if world.edges == "periodic" else RAYS[world.arena]


def face_rows(world: arena.Parameters) -> tuple[list[list[float]], list[int]]:
    """Rows of the surface functions of `arena_surfaces`, and how many belong to each family."""
    three = world.dimensions == "3"
    h, z = 0.5 * world.side, 0.5 * world.height
    low, high = arena.heights_of(world)
    caps = [[0.0, 0.0, 1.0, -low], [0.0, 0.0, -1.0, high]] if three else []
    if world.arena == "none" or world.edges == "periodic":
        return [], []
    if world.arena == "circle":
        return [[0.0, 0.0, 0.0, world.radius], *caps], [1, len(caps)]
    if world.arena == "square" and world.walls == "nearest_per_axis":
        rows = [[1.0, 0.0, 0.0, h], [0.0, 1.0, 0.0, h]] + ([[0.0, 0.0, 1.0, z]] if three else [])
        return rows, [len(rows)]
    corners = ((-h, -h), (h, -h), (h, h), (-h, h)) if world.arena == "square" else ()  # a polygon's edges are no planes
    rows = [list(inward_plane(a, b)) for a, b in zip(corners, (*corners[1:], *corners[:1]), strict=True)]
    return rows + caps, [len(rows) + len(caps)]
