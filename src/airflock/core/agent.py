"""One agent, one decision, as plain Python: what a drone runs on board, and what the tests trust.

A `Model` and what one agent perceives go in, a command comes out. Rules are called by their
argument names, in the order of the drivers: all neighbours, all surfaces, then the decision. In a
plane every z is zero.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, Self

from airflock.core import random
from airflock.core.contract import State, call_rule
from airflock.core.maths import FAR, TINY, norm
from airflock.core.model import Model
from airflock.core.topology import Topology
from airflock.core.vocabulary import Own, Percept

START = {"sum": 0.0, "min": FAR, "max": -FAR}  # what a reduction gives where nothing is reduced


class HeardNeighbour(NamedTuple):
    """A neighbour as heard: who it is (its index in the flock), its state, and the age of these data, s.

    fade  : normal number by which its signal is weaker than its distance says; 0 where nothing is
            drawn
    group : number of its group; -1 where it is in none
    """

    who: int
    state: State
    age: float
    fade: float = 0.0
    group: float = -1.0


class Decision(NamedTuple):
    """Decision of one agent: its command (m/s, m/s² or a heading, as Model.command says) and its new Memory."""

    command: tuple[float, float, float]
    memory: Any


def decide(
    model: Model,
    p: Any,
    own: State,
    neighbours: Iterable[HeardNeighbour],
    surfaces: Iterable[tuple[float, float, float, float]],
    memory: Any = None,
    *,
    time: float,
    period: float,
    index: int = 0,
    group: float = -1.0,
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0),
    percept: Percept | None = None,
    shared: Any = None,
    wing: Any = None,
    aero: Any = None,
    steer: Any = None,
) -> Decision:
    """Decision of one agent.

    model, p   : flocking law and its parameters
    own        : own state as measured
    neighbours : everybody who is heard now, without the agent itself; model.reach is applied here
    surfaces   : distance (m, negative on the far side) and unit normal of every wall and obstacle
    memory     : Memory from the last decision; None before the first
    time       : since the start of the flight, s; period : between two decisions, s
    index      : own index in the flock; group : number of its group, -1 in none; centre : of the
                 arena, m
    shared     : what the model's `flock` found for this agent; wing, aero : parameters of the wing
                 and of drag descent
    steer      : numbers of the section [steer], for a law whose command is converted
    percept    : where rays or noise are wanted, one whose methods are bound to a range finder and
                 to random numbers

    Raises RuleError where a rule asks for what the model does not provide.
    """
    vx, vy, vz = own.vx, own.vy, own.vz
    f = 1.0 / norm(vx, vy, vz)
    given: dict[str, Any] = {
        "own": Own(vx, vy, vz, f * vx, f * vy, f * vz),
        "sums": sum_neighbours(model, p, own, neighbours, index, group),
        "walls": sum_surfaces(model, p, own, surfaces),
        "memory": initial_memory(model) if memory is None else memory,
        "percept": percept or Percept(time, centre[0] - own.x, centre[1] - own.y, centre[2] - own.z),
        "period": period,
        "shared": shared,
        "wing": wing,
        "aero": aero,
        "steer": steer,
        "p": p,
    }
    result = call_rule(model.decide, "decide", given, model.name)
    x, y, z = result[:3]
    if model.steer is not None:
        x, y, z = call_rule(model.steer, "steer", given | {"cx": x, "cy": y, "cz": z}, model.name)
    if model.added is not None:
        more = call_rule(model.added.decide, "decide", given, model.added.name)
        x, y, z = x + more[0], y + more[1], z + more[2]
    return Decision((x, y, z), result[3] if len(result) > 3 else memory)


def initial_memory(model: Model) -> Any:
    """Memory of an agent before its first decision; None if the model keeps none."""
    return model.Memory() if model.Memory is not None else None


def sum_neighbours(
    model: Model, p: Any, own: State, neighbours: Iterable[HeardNeighbour], index: int, group: float = -1.0
) -> Any:
    """The model's Sums over all neighbours within its reach; None without Sums."""
    if model.Sums is None:
        return None
    if model.neighbour is None:
        return _zeros(model.Sums)
    near = call_rule(model.reach, "reach", {"p": p}, model.name) if model.reach is not None else FAR
    terms = []
    for heard in neighbours:
        given = pair_arguments(own, heard, index, group)
        # The order of sums is that of a driver: neighbours by index, so that plain Python and a
        # compiled driver agree to rounding.
        if given["r2"] <= near * near + TINY:  # which r2 carries as a guard: a neighbour at exactly the reach counts
            given["p"] = p
            terms.append(call_rule(model.neighbour, "neighbour", given, model.name))
    return reduce_records(model.Sums, model.reduce, terms)


def sum_surfaces(model: Model, p: Any, own: State, surfaces: Iterable[tuple[float, float, float, float]]) -> Any:
    """The model's Walls, summed over all surfaces; None without Walls."""
    if model.Walls is None:
        return None
    if model.boundary is None:
        return _zeros(model.Walls)
    terms = []
    for distance, nx, ny, nz in surfaces:
        given = {"distance": distance, "nx": nx, "ny": ny, "nz": nz, "vx": own.vx, "vy": own.vy, "vz": own.vz, "p": p}
        terms.append(call_rule(model.boundary, "boundary", given, model.name))
    return reduce_records(model.Walls, {}, terms)


def pair_arguments(own: State, heard: HeardNeighbour, index: int, group: float = -1.0) -> dict[str, Any]:
    """Everything that a neighbour rule may ask for, SI; differences are neighbour minus own; group : the own one."""
    other = heard.state
    dx, dy, dz = other.x - own.x, other.y - own.y, other.z - own.z
    dvx, dvy, dvz = other.vx - own.vx, other.vy - own.vy, other.vz - own.vz
    f = 1.0 / norm(own.vx, own.vy, own.vz)
    g = 1.0 / norm(other.vx, other.vy, other.vz)
    return {
        "dx": dx, "dy": dy, "dz": dz, "r": norm(dx, dy, dz), "r2": dx * dx + dy * dy + dz * dz + TINY,
        "dvx": dvx, "dvy": dvy, "dvz": dvz, "dv": norm(dvx, dvy, dvz),
        "vx": own.vx, "vy": own.vy, "vz": own.vz, "hx": f * own.vx, "hy": f * own.vy, "hz": f * own.vz,
        "nhx": g * other.vx, "nhy": g * other.vy, "nhz": g * other.vz,
        "age": heard.age, "lower": 1.0 if heard.who < index else 0.0,
        "kin": 1.0 if heard.group == group else 0.0, "group": heard.group,
    }  # fmt: skip


def reduce_records(record: type[Any], how: Mapping[str, str], terms: Iterable[tuple[float, ...]]) -> Any:
    """One record from many: each field summed, or its least or greatest value where `how` says so."""
    fields: tuple[str, ...] = record._fields
    ways = [how.get(name, "sum") for name in fields]
    totals = [START[way] for way in ways]
    if not how:
        for term in terms:
            totals = [total + value for total, value in zip(totals, term, strict=True)]
        return record(*totals)
    for term in terms:
        totals = [reduce_values(way, total, value) for way, total, value in zip(ways, totals, term, strict=True)]
    return record(*totals)


def reduce_values(how: str, total: float, value: float) -> float:
    """A total with one more value: sum, min or max."""
    return total + value if how == "sum" else (min(total, value) if how == "min" else max(total, value))


def _zeros(record: type[Any]) -> Any:
    return record(*([0.0] * len(record._fields)))


def met_neighbours(
    topology: Topology | None,
    t: Any,
    own: State,
    heard: Iterable[HeardNeighbour],
    place: "WorldMap | None" = None,
) -> list[HeardNeighbour]:
    """Select the heard neighbours that an agent meets, in their order.

    topology, t : kind and its parameters; None: all
    own         : own state as measured
    heard       : all heard neighbours, at the image at which the agent meets them
    place       : the world, queried for what stands in between; None: nothing stands anywhere
    """
    found = list(heard)
    if topology is None or not found:
        return found
    x, y, z = own.x, own.y, own.z
    offsets = [(h.state.x - x, h.state.y - y, h.state.z - z) for h in found]
    count = len(found)
    # TINY is added as in a driver, so that a rule which divides by r2 meets the same numbers in
    # plain Python.
    squares = [dx * dx + dy * dy + dz * dz + TINY for dx, dy, dz in offsets]
    hidden = [0.0] * count
    if place is not None and topology.asks_for("hidden"):
        hidden = [1.0 if place.is_blocked(x, y, z, h.state.x, h.state.y, h.state.z) else 0.0 for h in found]
    met = [0.0] * count
    given = {
        "n": count, "r2": squares, "hidden": hidden, "fade": [h.fade for h in found], "met": met, "t": t,
        "dx": [d[0] for d in offsets], "dy": [d[1] for d in offsets], "dz": [d[2] for d in offsets],
        "heap": [FAR] * count, "weak": [FAR] * count,
    }  # fmt: skip
    call_rule(topology.meet, "meet", given, topology.name)
    return [h for h, taken in zip(found, met, strict=True) if taken > 0.5]


Vector = tuple[float, float, float]
STILL: Vector = (0.0, 0.0, 0.0)


class WorldMap(Protocol):
    """Interface of a world as a pilot queries it; `airflock.world.WorldMap` implements it from a map."""

    def beside(self, own: State, other: State, /) -> State:
        """State of another agent at its image nearest to own: itself wherever space is not periodic."""

    def surfaces(self, x: float, y: float, z: float, /) -> Iterable[tuple[float, float, float, float]]:
        """Distance (m) and unit normal of every wall and obstacle."""

    def ray(self, x: float, y: float, z: float, ux: float, uy: float, uz: float, length: float, /) -> float:
        """Free distance of a thin ray, m."""

    def cast(
        self, x: float, y: float, z: float, ux: float, uy: float, uz: float, length: float, radius: float, /
    ) -> float:  # fmt: skip
        """Free distance of a sphere, m."""

    def is_blocked(self, x: float, y: float, z: float, to_x: float, to_y: float, to_z: float, /) -> bool:
        """Return True if an obstacle or the scene stands between two positions, m."""


class BoundPercept(Percept):
    """Percept of one agent at one decision, bound to a map of the world and to its own random numbers."""

    place: WorldMap
    at: State
    random_key: tuple[int, int, int]
    rays: int

    @classmethod
    def of(
        cls,
        place: WorldMap,
        own: State,
        time: float,
        goal: Vector | None = None,
        asker: tuple[int, int, int] = (0, 0, 0),
    ) -> Self:
        """Percept at a position; goal: where it is (m), if there is one; asker: seed, number of decision and agent."""
        offset = STILL if goal is None else (goal[0] - own.x, goal[1] - own.y, goal[2] - own.z)
        found = cls(time, -own.x, -own.y, -own.z, *offset)
        found.place, found.at, found.random_key, found.rays = place, own, asker, 0
        return found

    def ray(self, ux: float, uy: float, uz: float, length: float) -> float:
        """Free distance along the unit vector u, at most length, m."""
        return self.place.ray(*self.at[:3], ux, uy, uz, length)

    def cast(self, ux: float, uy: float, uz: float, length: float, radius: float) -> float:
        """Free distance of a sphere of this radius along the unit vector u, at most length, m; counted in `rays`."""
        self.rays += 1
        return self.place.cast(*self.at[:3], ux, uy, uz, length, radius)

    def normal(self, draw: int) -> float:
        """Normal random number of this agent and decision."""
        words = random.random_words(self.random_key[0], random.MODEL, 0, *self.random_key[1:], draw)
        return float(random.normal_pair(words[0], words[1])[0])

    def uniform(self, draw: int) -> float:
        """Uniform random number of this agent and decision."""
        words = random.random_words(self.random_key[0], random.MODEL, 0, *self.random_key[1:], draw)
        return float(random.uniform(words[0]))


@dataclass(frozen=True)
class AgentView:
    """Record of one decision: the perceptions of the agent, and the result.

    agent, time : its number; time of the decision, s
    true, own   : its state, and its state as it measured it: position (m) and velocity (m/s)
    heard       : neighbours in range whose packets it has: who, state as heard (m, m/s), age (s)
    met         : of each of them, in the same order, whether the topology lets it meet that one
    terms       : result of the neighbour rule for each of them; 0 for those not met or beyond its
                  reach
    alike       : result of the rule for each of them, had it flown as the agent does
    sums, walls : what the law was given of all neighbours, and of all surfaces
    memory      : the law's memory after the decision
    command     : in the unit of the law's command
    body        : what the body remembers, such as its thrust or the energy that it used; None if
                  nothing
    """

    agent: int
    time: float
    true: State
    own: State
    heard: tuple[HeardNeighbour, ...]
    met: tuple[bool, ...]
    terms: tuple[Any, ...]
    alike: tuple[Any, ...]
    sums: Any
    walls: Any
    memory: Any
    command: tuple[float, ...]
    body: Any = None
