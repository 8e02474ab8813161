"""Facts: what of a scenario is fixed when its driver is generated, and how that driver is built."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from airflock.core import Body, Fault, Metric, Model, Radio, Sensor, Topology
from airflock.parts.bodies import BODIES
from airflock.parts.radios import DEFAULT_RADIO as USUAL_RADIO, RADIOS
from airflock.parts.sensors import DEFAULT_SENSOR, SENSORS
from airflock.world import arena, rays


class GroupLaw(NamedTuple):
    """A law that groups of a flock fly by, beside that of the others.

    choices : its compile-time constants, by name
    varied  : its numbers that differ among those who fly by it, as (letter, name)
    """

    model: Model
    choices: tuple[tuple[str, str | float], ...]
    varied: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class BuildOptions:
    """How a driver is built, whatever the scenario says.

    bits        : 32 or 64 per number
    record      : keep every sample (position, velocity, command) besides the running sums
    given_start : the flight starts from positions and velocities that are handed over
    grid        : neighbours by cells, all cores for one flock; else all pairs, one core
    near        : order parameters look at pairs and links by cells, too, where their rules allow it; needs `grid`
    absence     : agents may be absent: they lie behind those who are there (`engine.presence`)
    """

    bits: int = 32
    keep_frames: bool = False
    given_start: bool = False
    grid: bool = False
    near: bool = False
    absence: bool = False


@dataclass(frozen=True)
class PlanProperties:
    """Compile-time side of a flight: what the scenario says, and how it is built. `Plan` tells what follows from it.

    build     : how it is built; bits, record, given_start and grid read it
    numbers   : letter of each record of numbers and its fields: the columns of a driver's row, in order
    surfaces  : surface function of each family of walls, in the order of the faces table
    dryden    : gusts are those of the Dryden spectrum
    polygon   : the arena is a polygon, whose edges are walls; raised: the middle of its heights is not 0
    obstacle  : surface function of an obstacle
    excursion : how far outside a position is
    ray       : free distance along a direction
    body      : what turns commands into motion; body_choices its compile-time constants
    sensor    : what agents measure of themselves by; sensor_choices its compile-time constants
    noisy     : it errs
    edge      : what happens to a coordinate beyond the arena's faces, if anything
    start     : region in which agents start
    scene     : something stands in the world that agents see with rays, feel, or must not touch
    goals     : the flock has goals; herd: the goal is a shepherd
    own       : each agent has a goal of its own
    stop      : the flight ends at its first collision
    wing_choices : compile-time constants of the wing, where a rule solves for the whole flock
    aero_choices : those of drag descent, where it is added to the model
    radio     : which packets arrive; radio_choices its compile-time constants. lossy: some are lost by radio.loss
    few       : each of its rates sends at most `core.radio.FEW` packets in a decision
    silent    : an agent stops while a neighbour that it has lost could be near
    sequential: one agent after another perceives, decides and moves
    faults    : kinds of fault that may occur
    varied    : numbers that differ among agents, as (letter, name); each is a row
    topology  : which of those whom an agent hears it meets; None: all. fading: signals differ by chance
    laws      : laws of groups, beside `model`; the numbers of the first have the letter p1, and so on
    law       : which of all laws the stages are made for that ask one: 0 is `model`; None where there is no other
    grouped   : a rule asks for the groups of agents
    """

    model: Model
    model_choices: tuple[tuple[str, str | float], ...]
    numbers: tuple[tuple[str, tuple[str, ...]], ...]
    metrics: tuple[Metric, ...]
    surfaces: tuple[Callable[..., Any], ...]
    excursion: Callable[..., float]
    ray: Callable[..., float] = rays.to_nothing
    body: Body = BODIES["multirotor"]
    body_choices: tuple[tuple[str, str], ...] = ()
    sensor: Sensor = SENSORS[DEFAULT_SENSOR]
    sensor_choices: tuple[tuple[str, str], ...] = ()
    edge_rule: Callable[..., Any] | None = None
    start: str = "arena"
    scene: bool = False
    has_mesh: bool = False
    goals: bool = False
    stop: bool = False
    wing_choices: tuple[tuple[str, str], ...] = ()
    aero_choices: tuple[tuple[str, str], ...] = ()
    is_shepherd: bool = False
    own: bool = False
    sequential: bool = False
    dimensions: int = 2
    has_sensor_error: bool = True
    delayed: bool = True
    lossy: bool = False
    radio: Radio = RADIOS[USUAL_RADIO]
    radio_choices: tuple[tuple[str, str], ...] = ()
    few: bool = True
    stops_for_lost: bool = False
    windy: bool = False
    dryden: bool = False
    obstacles: bool = False
    obstacle: Callable[..., Any] = arena.convex_obstacle
    polygonal: bool = False
    off_centre_height: bool = False
    faults: tuple[Fault, ...] = ()
    varied: tuple[tuple[str, str], ...] = ()
    topology: Topology | None = None
    fading: bool = False
    laws: tuple[GroupLaw, ...] = ()
    law: int | None = None
    uses_groups: bool = False
    build: BuildOptions = BuildOptions()
