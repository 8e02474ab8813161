"""The vocabularies of the rule contract: what each kind of rule may ask for, by name, and the records behind the names.

All quantities are in SI; a difference is always neighbour minus own.
"""

import inspect
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

from airflock.errors import RuleError
from airflock.spelling import meant

PAIR = {
    "dx": "offset to the neighbour as heard, east, m",
    "dy": "offset to the neighbour as heard, north, m",
    "dz": "offset to the neighbour as heard, up, m",
    "r": "length of the offset, m",
    "r2": "its square, m²; cheaper than r",
    "dvx": "velocity of the neighbour minus own, east, m/s",
    "dvy": "velocity of the neighbour minus own, north, m/s",
    "dvz": "velocity of the neighbour minus own, up, m/s",
    "dv": "length of the velocity difference, m/s",
    "vx": "own velocity as measured, east, m/s",
    "vy": "own velocity as measured, north, m/s",
    "vz": "own velocity as measured, up, m/s",
    "hx": "own heading (unit vector), east",
    "hy": "own heading (unit vector), north",
    "hz": "own heading (unit vector), up",
    "nhx": "heading of the neighbour as heard, east",
    "nhy": "heading of the neighbour as heard, north",
    "nhz": "heading of the neighbour as heard, up",
    "age": "age of the neighbour's data, s",
    "lower": "1.0 if the neighbour has the lower index, else 0.0",
    "kin": "1.0 if the neighbour is of the own group, else 0.0",
    "group": "number of the neighbour's group in [[groups]], the first being 0.0; -1.0 if it is in none",
}
SURFACE = {
    "distance": "distance to the surface, m; negative on its far side",
    "nx": "unit normal of the surface, pointing to where flying is allowed, east",
    "ny": "unit normal of the surface, pointing to where flying is allowed, north",
    "nz": "unit normal of the surface, pointing to where flying is allowed, up",
    "vx": "own velocity as measured, east, m/s",
    "vy": "own velocity as measured, north, m/s",
    "vz": "own velocity as measured, up, m/s",
}
FLOCK = {
    "n": "number of agents",
    "x": "true positions of all agents, east, m; x[i] is that of agent i",
    "y": "true positions of all agents, north, m; y[i] is that of agent i",
    "z": "true positions of all agents, up, m; z[i] is that of agent i",
    "vx": "their velocities, east, m/s",
    "vy": "their velocities, north, m/s",
    "vz": "their velocities, up, m/s",
    "wing": "parameters of the wing (aero.wing)",
    "aero": "parameters of the drag descent (aero.descent)",
    "work": "scratch arrays in the shapes that `workspace` gives, kept from call to call; work.name[row][column]",
    "shared": "columns of Shared to fill: shared.name[i] for every agent i",
}
AGENT = {
    "own": "Own: velocity vx vy vz (m/s) and heading hx hy hz as measured",
    "sums": "what `neighbour` summed up over all neighbours",
    "walls": "what `boundary` summed up over all surfaces",
    "memory": "the model's Memory of this agent",
    "percept": "Percept: time (s), the offsets centre_x centre_y centre_z to the arena's centre "
    "and goal_x goal_y goal_z to the goal (m), rays and noise",
    "period": "time between two decisions, s",
    "shared": "what `flock` found for this agent",
    "wing": "parameters of the wing (aero.wing)",
    "aero": "parameters of the drag descent (aero.descent)",
}
BODY = {
    "vx": "true velocity, east, m/s",
    "vy": "true velocity, north, m/s",
    "vz": "true velocity, up, m/s",
    "mx": "own velocity as measured, east, m/s",
    "my": "own velocity as measured, north, m/s",
    "mz": "own velocity as measured, up, m/s",
    "cx": "command, east; m/s or m/s² as the model's COMMAND says",
    "cy": "command, north; m/s or m/s² as the model's COMMAND says",
    "cz": "command, up; m/s or m/s² as the model's COMMAND says",
    "gx": "normal random number, east",
    "gy": "normal random number, north",
    "gz": "normal random number, up",
    "wx": "wind, east, m/s",
    "wy": "wind, north, m/s",
    "wz": "wind, up, m/s",
    "dt": "time step, s",
    "memory": "the body's Memory of this agent",
    "wing": "parameters of the wing (aero.wing)",
}
MEASURED = {
    "x": "position, east, m",
    "y": "position, north, m",
    "z": "position, up, m",
    "vx": "velocity, east, m/s",
    "vy": "velocity, north, m/s",
    "vz": "velocity, up, m/s",
    "speed": "length of the velocity, m/s",
    "hx": "heading (unit vector; zero at rest), east",
    "hy": "heading (unit vector; zero at rest), north",
    "hz": "heading (unit vector; zero at rest), up",
    "excursion": "distance outside the arena or inside an obstacle, m; negative where flying is allowed",
    "touches": "1.0 if a sphere of radius metrics.r_body met the scene on its last step of motion, else 0.0",
    "rays": "rays that the agent cast at its last decision; 0.0 in a recording",
    "pair": "what this metric's `pair` gathered for this agent",
    "memory": "this metric's Memory of this agent",
    "mean": "Mean over the flock: x y z (m), vx vy vz (m/s), hx hy hz, and number n",
    "shared": "what this metric's `survey` found for this agent",
    "wing": "parameters of the wing (aero.wing)",
}
MEMBER = {
    name: text
    for name, text in MEASURED.items()
    if name not in ("excursion", "touches", "rays", "memory", "mean", "shared", "wing")
} | {
    "mean": "Mean over the agent's own cluster",
}
STATE = {
    "x": "position, east, m",
    "y": "position, north, m",
    "z": "position, up, m",
    "vx": "velocity, east, m/s",
    "vy": "velocity, north, m/s",
    "vz": "velocity, up, m/s",
}
SENSED = {
    "x": "true position, east, m",
    "y": "true position, north, m",
    "z": "true position, up, m",
    "vx": "true velocity, east, m/s",
    "vy": "true velocity, north, m/s",
    "vz": "true velocity, up, m/s",
    "memory": "the sensor's Memory of this agent",
    **{f"g{k}": "normal random number, new at each measurement" for k in range(12)},
    **{f"u{k}": "uniform random number between 0 and 1, new at each measurement" for k in range(4)},
    "time": "time of the measurement, s",
    "period": "time between two measurements, s",
}
AXIS_ERROR = {
    "dx": "error of the position along one axis at the last measurement, m",
    "dv": "error of the velocity along this axis at the last measurement, m/s",
    "g": "normal random number of this axis",
    "period": "time between two measurements, s",
}
_PACKET = {
    "distance": "true distance of the two, m",
    "clear": "1.0 if nothing that stands in the world lies between the two, else 0.0",
    "talkers": "how many others are within radio.range of the receiver: all send, the sender among them",
    "step": "number of the decision",
    "period": "time between two decisions, s",
}
_CHANCES = {
    **{f"u{c}": "uniform random number between 0 and 1, new for each pair and decision" for c in range(4)},
    **{f"g{c}": "normal random number, new for each pair and decision" for c in range(4)},
}
MISSED = {
    **_PACKET,
    "fast": "packets that the first of RATES sends in this decision",
    "slow": "packets that the second of RATES sends in this decision",
}
RECEIVED = {
    **_PACKET,
    "dx": "true offset from the receiver to the sender, east, m",
    "dy": "true offset from the receiver to the sender, north, m",
    "dz": "true offset from the receiver to the sender, up, m",
    "vx": "true velocity of the receiver, east, m/s",
    "vy": "true velocity of the receiver, north, m/s",
    "vz": "true velocity of the receiver, up, m/s",
    "age": "age of the newest packet that the receiver has of the sender, s; 1e9 or more before the first",
    "packet": "the radio's Packet of this pair",
    **_CHANCES,
}
SEEN = {
    "dx": "true offset to the other one when the picture was taken, radio.delay ago, east, m",
    "dy": "true offset to the other one when the picture was taken, radio.delay ago, north, m",
    "dz": "true offset to the other one when the picture was taken, radio.delay ago, up, m",
    "ex": "offset at which the newest estimate, carried forward, expects it in that picture, east, m",
    "ey": "offset at which the newest estimate, carried forward, expects it in that picture, north, m",
    "ez": "offset at which the newest estimate, carried forward, expects it in that picture, up, m",
    "evx": "its velocity by the newest estimate, east, m/s",
    "evy": "its velocity by the newest estimate, north, m/s",
    "evz": "its velocity by the newest estimate, up, m/s",
    "vx": "own velocity as measured, east, m/s",
    "vy": "own velocity as measured, north, m/s",
    "vz": "own velocity as measured, up, m/s",
    "since": "time since the last picture in which it was found, s; about 1e9 before the first",
    "period": "time between two decisions, s",
    **_CHANCES,
}
CARRIED = {
    "x": "position in the newest packet, east, m",
    "y": "position in the newest packet, north, m",
    "z": "position in the newest packet, up, m",
    "vx": "velocity in the newest packet, east, m/s",
    "vy": "velocity in the newest packet, north, m/s",
    "vz": "velocity in the newest packet, up, m/s",
    "age": "age of the newest packet, s",
}
MEET = {
    "n": "number of others",
    "dx": "offsets to the others as believed, east, m; dx[j] is that to number j",
    "dy": "offsets to the others as believed, north, m; dy[j] is that to number j",
    "dz": "offsets to the others as believed, up, m; dz[j] is that to number j",
    "r2": "squares of their lengths, m²; 1e30 of whom is not heard",
    "hidden": "1.0 of whom something hides that stands in the world, else 0.0",
    "fade": "normal random numbers of the signals",
    "met": "to fill: 1.0 for whom the agent meets, else 0.0",
    "heap": "scratch of n numbers",
    "weak": "scratch of n further numbers",
}
COMMAND = {
    "cx": "command, east; m/s or m/s² as the model's COMMAND says",
    "cy": "command, north; m/s or m/s² as the model's COMMAND says",
    "cz": "command, up; m/s or m/s² as the model's COMMAND says",
}
ONSET = {
    "since": "time since the fault began, s",
    **{f"at_{name}": f"true {text}, when the fault began" for name, text in STATE.items()},
    **{f"at_{name}": f"{text}, when the fault began" for name, text in COMMAND.items()},
}
_LAST = {f"at_{name}": f"{text}, as it was last before the fault began" for name, text in STATE.items()}
CLUSTER = {
    "n": "members of the cluster",
    "hx": "sum of their headings, east",
    "hy": "sum of their headings, north",
    "hz": "sum of their headings, up",
    "hh": "sum of the squared lengths of their headings: how many of them move",
    "members": "what `member` summed up over the members",
    "mean": "Mean over the members",
}
SAMPLE = {
    "n": "number of agents",
    "mean": "Mean over the flock",
    "agents": "what `agent` summed up over all agents",
    "clusters": "what `cluster` summed up over all clusters",
    "dimensions": "2.0 in a plane, 3.0 in space",
    "time": "since the start, s",
}

VOCABULARY: dict[str, dict[str, str]] = {
    "reach": {"p": "parameters"},
    "sight": {"p": "parameters"},
    "wall_reach": {"p": "parameters"},
    "neighbour": {**PAIR, "p": "the model's parameters"},
    "boundary": {**SURFACE, "p": "the model's parameters"},
    "flock": {**FLOCK, "p": "the model's parameters"},
    "decide": {**AGENT, "p": "the model's parameters"},
    "move": {**BODY, "b": "the body's parameters"},
    "measure": {**SENSED, "s": "the sensor's parameters"},
    "error": {**AXIS_ERROR, "s": "the sensor's parameters"},
    "exact": {"s": "the sensor's parameters"},
    "bounds": {"s": "the sensor's parameters", "period": "time between two measurements, s", "dt": "time step, s"},
    "pair": {name: PAIR[name] for name in ("dx", "dy", "dz", "r", "r2", "lower")} | {"q": "metric parameters"},
    "linked": {"r": "distance of two agents, m", "r2": "its square, m²; cheaper than r", "q": "metric parameters"},
    "agent": {**MEASURED, "q": "metric parameters"},
    "member": {**MEMBER, "q": "metric parameters"},
    "cluster": {**CLUSTER, "q": "metric parameters"},
    "sample": {**SAMPLE, "q": "metric parameters"},
    "survey": {**FLOCK, "q": "metric parameters"},
    "within": {"q": "metric parameters"},
    "linked_within": {"q": "metric parameters"},
    "settled": {
        "pair": "what the rule `pair` adds up to over all who are nearer than `beyond`, and perhaps some others",
        "beyond": "distance, m",
        "q": "metric parameters",
    },
    "sense": {**STATE, **ONSET, **_LAST, "f": "the fault's parameters"},
    "tell": {**STATE, **ONSET, **_LAST, "f": "the fault's parameters"},
    "radio": {"reach": "radio.range, m", "since": ONSET["since"], "f": "the fault's parameters"},
    "clock": {"since": ONSET["since"], "f": "the fault's parameters"},
    "overrule": {**COMMAND, **ONSET, "f": "the fault's parameters"},
    "motion": {
        **{name: BODY[name] for name in ("vx", "vy", "vz", "cx", "cy", "cz", "dt")},
        "nx": "velocity after the step as the body flew it, east, m/s",
        "ny": "velocity after the step as the body flew it, north, m/s",
        "nz": "velocity after the step as the body flew it, up, m/s",
        **ONSET,
        "f": "the fault's parameters",
    },
    "leaves": {"f": "the fault's parameters"},
    "missed": {**MISSED, "k": "the radio's parameters"},
    "missed_few": {**MISSED, "k": "the radio's parameters"},
    "receive": {**RECEIVED, "k": "the radio's parameters"},
    "late": {**_PACKET, **_CHANCES, "k": "the radio's parameters"},
    "see": {**SEEN, "k": "the radio's parameters"},
    "carry": {**CARRIED, "k": "the radio's parameters"},
    "lasts": {"age": "age of the newest packet, s", "k": "the radio's parameters"},
    "meet": {**MEET, "t": "the topology's parameters"},
    "fitness": {
        "values": "order parameters of one flight, by name",
        "agents": "number of agents",
        "duration": "time flown, s",
        "q": "metric parameters",
    },
    "limits": {
        "b": "the body's parameters",
        "dt": "time step, s",
        "speed": "preferred speed of the law, m/s; 0.0 if it has none",
        "start": "speed at the start, m/s",
        "wing": "parameters of the wing (aero.wing)",
    },
    "endures": {
        "memory": "the body's Memory of this agent",
        "b": "the body's parameters",
        "wing": "parameters of the wing (aero.wing)",
    },
    "faults": {
        "q": "metric parameters",
        "largest": "largest extension, m; 0.0 without an arena",
        "edges": "world.edges",
    },
}
COMMANDS = ("velocity", "acceleration", "heading")
REDUCTIONS = ("sum", "min", "max")
OVER_TIME = ("mean", *REDUCTIONS)  # how the samples of a flight combine
CLOCKS = ("sample", "collision")  # metrics.period and metrics.collision_period


class Own(NamedTuple):
    """An agent's own state as it measures it: velocity (m/s) and heading (unit vector)."""

    vx: float
    vy: float
    vz: float
    hx: float
    hy: float
    hz: float


class Percept(NamedTuple):
    """What else an agent perceives: time (s), offsets to the arena's centre and to the goal (m), rays, noise.

    Without a goal its offset is zero. An engine binds the methods to its world and its streams; a drone passes a
    Percept of its own with a real range finder. As they stand here the world is empty and quiet.
    """

    time: float
    centre_x: float
    centre_y: float
    centre_z: float
    goal_x: float = 0.0
    goal_y: float = 0.0
    goal_z: float = 0.0

    def ray(self, ux: float, uy: float, uz: float, length: float) -> float:
        """Free distance (m) along the unit vector u to walls, obstacles and the scene, at most `length` (m)."""
        return length

    def cast(self, ux: float, uy: float, uz: float, length: float, radius: float) -> float:
        """Free distance (m) for a sphere of this radius (m) along the unit vector u, at most `length` (m).

        It ends at the arena's walls, its obstacles and what stands in the scene; a radius of 0 is a thin ray. A model
        that casts declares `sight(p)`, the largest length + radius (m).
        """
        return length

    def normal(self, draw: int) -> float:
        """Normal random number N(0, 1) of this agent and decision; `draw` from 0 to 255 tells several apart."""
        return 0.0

    def uniform(self, draw: int) -> float:
        """Uniform random number between 0 and 1; it shares its words with normal(draw), so use different draws."""
        return 0.5


BOUND = ("ray", "cast", "normal", "uniform")  # methods of Percept that an engine binds


class Mean(NamedTuple):
    """Means over a flock or a cluster of n agents: position (m), velocity (m/s), heading."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    hx: float
    hy: float
    hz: float
    n: float


@lru_cache(maxsize=1024)
def asks(rule: Callable[..., Any], kind: str, owner: str = "") -> tuple[str, ...]:
    """Names that a rule asks for, checked against the vocabulary of its kind."""
    names = tuple(inspect.signature(rule).parameters)
    known = VOCABULARY[kind]
    for name in names:
        if name not in known:
            hint = meant(name, known, ".", lead="; ", cutoff=0.6)
            where = f"{owner}.{kind}" if owner else kind
            raise RuleError(f"{where}({', '.join(names)}) asks for {name!r}{hint} Known: {', '.join(known)}")
    return names
