"""Planning: a plan from a model, a world and options; which rules of the world stand behind its choices."""

from collections.abc import Callable, Mapping
from typing import Any

from airflock.core.contract import Metric, Model
from airflock.core.parameters import choices
from airflock.engine.plan import Plan
from airflock.world import arena, edges, excursion, rays
from airflock.world.place import obstacle_rule, raised


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


RAYS = {"square": rays.to_box, "polygon": rays.to_polygon, "circle": rays.to_cylinder, "none": rays.to_nothing}
EDGES = {"open": None, "bounce": edges.bounce, "periodic": edges.wrap}


def constants_of(
    model: Model, parameters: Any, varied: tuple[tuple[str, str], ...]
) -> tuple[tuple[str, str | float], ...]:
    """Choices of a law, and its usual numbers where they are so and do not differ among agents."""
    usual: dict[str, str | float] = {
        name: number
        for name, number in model.usual.items()
        if getattr(parameters, name) == number and ("p", name) not in varied
    }
    return tuple(sorted((usual | choices(parameters)).items()))


def make_plan(
    model: Model,
    parameters: Any,
    metrics: tuple[Metric, ...],
    world: arena.Parameters,
    numbers: Mapping[str, tuple[str, ...]],
    **options: Any,
) -> Plan:
    """Plan for a model with these parameters (only their choices matter) in this world; numbers: fields by letter."""
    surfaces, beyond = arena_surfaces(world)
    return Plan(
        model=model,
        model_choices=constants_of(model, parameters, options.get("varied", ())),
        numbers=tuple(numbers.items()),
        metrics=metrics,
        surfaces=surfaces,
        excursion=beyond,
        ray=arena_ray(world),
        edge=EDGES[world.edges],
        dimensions=int(world.dimensions),
        obstacles=bool(world.obstacles),
        obstacle=obstacle_rule(world),
        polygon=world.arena == "polygon" and world.edges != "periodic",
        raised=raised(world),
        **options,
    )
