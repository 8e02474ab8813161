"""Plan: what of a scenario is fixed when its driver is generated. Everything else is a number at run time."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from airflock.aero import descent
from airflock.aero import wing as wings
from airflock.body import radio, sensors, wind
from airflock.body.registry import BODIES
from airflock.core.contract import Body, Metric, Model
from airflock.core.parameters import choices, number_names
from airflock.metrics import parameters as metric_parameters
from airflock.world import arena, edges, excursion, rays

ARENA = (
    "half_x",
    "half_y",
    "half_z",
    "extent_x",
    "extent_y",
    "extent_z",
    "separation",
    "speed",
    "clearance",
    "goal_radius",
    "goal_speed",
    "goal_spread",
    "goal_behind",
    "spacing_x",
    "spacing_y",
    "spacing_z",
    "jitter",
)
CLOCK = ("dt", "period")
WHOLE = (
    "agents", "steps", "decide_every", "sample_every", "collide_every", "delay", "ring", "world", "seed_low",
    "seed_high", "corners", "obstacles", "faces_0", "faces_1",
)  # fmt: skip


@dataclass(frozen=True)
class Plan:
    """Compile-time side of a flight.

    surfaces  : surface function of each family of walls, in the order of the faces table
    excursion : how far outside a position is
    ray       : free distance along a direction
    body      : what turns commands into motion; body_choices its compile-time constants
    edge      : what happens to a coordinate beyond the arena's faces, if anything
    start     : region in which agents start
    grid      : neighbours by cells, all cores for one flock; else all pairs, one core
    scene     : something stands in the world that agents see with rays, feel, or must not touch
    goals     : the flock has goals; herd: the goal is a shepherd
    own       : each agent has a goal of its own
    stop      : the flight ends at its first collision
    wing_choices : compile-time constants of the wing, where a rule solves for the whole flock
    aero_choices : those of drag descent, where it is added to the model
    sequential: one agent after another perceives, decides and moves
    record    : keep every sample (position, velocity, command) besides the running sums
    """

    model: Model
    model_choices: tuple[tuple[str, str | float], ...]
    model_numbers: tuple[str, ...]
    metrics: tuple[Metric, ...]
    surfaces: tuple[Callable[..., Any], ...]
    excursion: Callable[..., float]
    ray: Callable[..., float] = rays.to_nothing
    body: Body = BODIES["multirotor"]
    body_choices: tuple[tuple[str, str], ...] = ()
    edge: Callable[..., Any] | None = None
    start: str = "arena"
    scene: bool = False
    meshed: bool = False
    goals: bool = False
    stop: bool = False
    wing_choices: tuple[tuple[str, str], ...] = ()
    aero_choices: tuple[tuple[str, str], ...] = ()
    herd: bool = False
    own: bool = False
    sequential: bool = False
    grid: bool = False
    dimensions: int = 2
    bits: int = 32
    noisy: bool = True
    delayed: bool = True
    lossy: bool = False
    links: bool = False
    windy: bool = False
    obstacles: bool = False
    given_start: bool = False
    record: bool = False

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes that are flown: x y, or x y z."""
        return ("x", "y", "z")[: self.dimensions]

    @property
    def constants(self) -> dict[str, dict[str, str | float]]:
        """Choices and usual numbers by record name, inlined as constants."""
        wing: dict[str, str | float] = dict(self.wing_choices)
        aero: dict[str, str | float] = dict(self.aero_choices)
        return {"p": dict(self.model_choices), "b": dict(self.body_choices), "wing": wing, "aero": aero}

    @property
    def periodic(self) -> bool:
        """Whether offsets are taken to the nearest image."""
        return self.edge is edges.wrap

    @property
    def integration(self) -> str:
        """Whether positions move by the velocity before ("old") or after ("new") the body has moved."""
        return dict(self.body_choices).get("integration", self.body.integration)

    @property
    def records(self) -> dict[str, tuple[str, ...]]:
        """Columns of the parameter row, by record name, in order."""
        return {
            "p": self.model_numbers,
            "b": number_names(self.body.Parameters),
            "s": number_names(sensors.Parameters),
            "k": number_names(radio.Parameters),
            "a": number_names(wind.Parameters),
            "w": ARENA,
            "q": number_names(metric_parameters.Parameters),
            "c": CLOCK,
            "wing": number_names(wings.Parameters),
            "aero": number_names(descent.Parameters),
        }


def arena_surfaces(world: arena.Parameters) -> tuple[tuple[Callable[..., Any], ...], Callable[..., float]]:
    """Families of surfaces of an arena, and its excursion function; a periodic one has no walls to feel or to leave."""
    if world.edges == "periodic":
        return (), excursion.beyond_nothing
    three = world.dimensions == "3"
    ground = {"square": (arena.plane,), "polygon": (arena.plane,), "circle": (arena.cylinder,), "none": ()}[world.arena]
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


def make_plan(
    model: Model, parameters: Any, metrics: tuple[Metric, ...], world: arena.Parameters, **options: Any
) -> Plan:
    """Plan for a model with these parameters (only their choices matter) in this world."""
    surfaces, beyond = arena_surfaces(world)
    usual: dict[str, str | float] = {
        name: number for name, number in model.usual.items() if getattr(parameters, name) == number
    }
    return Plan(
        model=model,
        model_choices=tuple(sorted((usual | choices(parameters)).items())),
        model_numbers=number_names(parameters),
        metrics=metrics,
        surfaces=surfaces,
        excursion=beyond,
        ray=arena_ray(world),
        edge=EDGES[world.edges],
        dimensions=int(world.dimensions),
        obstacles=bool(world.obstacles),
        **options,
    )
