"""Any valid scenario: draws of all sections, models, bodies, arenas, scenes, radios, noises, winds, goals, metrics.

A draw is small, 2 to 6 agents for about a second, and often sits on an edge on purpose: agents on a lattice whose step
is the range of the radio or of the law, at equal distances and equal speeds, beside boxes on the same lattice, so that
spheres and rays touch what they pass. `drawn` takes any `random.Random`; a seeded one draws the same in every process.
"""

import math
from dataclasses import dataclass
from itertools import combinations, product
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.core.model import Model
from airflock.core.parameters import Choice, Parameters, Quantity, choices, declarations, quantity
from airflock.core.topology import topology as topology_of_ones_own
from airflock.parts import BODIES as KNOWN_BODIES, FAULTS as KINDS, RADIOS, SENSORS
from airflock.scenarios.named_code import MODELS, find_law
from airflock.scenarios.part_kinds import CallerParts
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.scenario_builder import build_scenario
from airflock.scenarios.sections import SECTIONS, Flight
from airflock.support.errors import ScenarioError

# A length (m) at which agents of a law act on each other, the number that carries it, and a speed, m/s
SCALES = {
    "vasarhelyi_2018": (20.0, "r0_rep", 4.0), "viragh_2014": (20.0, "r0_rep", 4.0), "reynolds_1987": (0.5, "r_c", 0.2),
    "vicsek_1995": (1.0, "r", 0.3), "couzin_2002": (8.0, "dr_a", 3.0), "kidger": (20.0, "r_align", 10.0),
    "formation": (3.0, "r0_rep", 4.0), "dimock_2003": (5.0, "r_c", 10.0),
    "chen_2014": (3.0, "r_hunt", 1.0), "couzin_2005": (6.0, "rho", 1.0), "olfati_saber_2006": (8.0, "r", 4.0),
    "cucker_smale_2007": (10.0, "sigma", 4.0), "reynolds_1999": (20.0, "r_c", 4.0), "network": (20.0, "r", 4.0),
    "potential_field": (20.0, "d_1", 4.0),
}  # fmt: skip
BODIES = {
    "velocity": ("multirotor", "quadrotor", "fixed_wing", "direct", "jostled", "autopilot"),
    "acceleration": ("steered",), "heading": ("heading",),
}  # fmt: skip
CUBE = str(Path(__file__).parent / "cube.obj")
SEGMENTS = ("5", "5", "9")  # a lifting line of 80 segments takes minutes in plain Python


@dataclass(frozen=True, kw_only=True)
class Times(Parameters):
    """The number of a topology that is none of ours."""

    times: float = quantity(2.0, "1", low=1.0, high=100.0, meaning="how many times as far as the nearest")


def meet(n, r2, dz, hidden, fade, met, weak, t):
    """Who is not hidden, and at most so many times as far, or below by 1 m as dear, as the nearest."""
    nearest = 1e30
    for j in range(n):
        weak[j] = r2[j] * math.exp(0.1 * fade[j])
        if weak[j] < nearest:
            nearest = weak[j]
    for j in range(n):
        near = weak[j] <= t.times * t.times * nearest or abs(dz[j]) > 1.0
        met[j] = 1.0 if near and hidden[j] < 0.5 and r2[j] < 1e29 else 0.0


OWN_TOPOLOGY = topology_of_ones_own({"Parameters": Times, "meet": meet}, "one of its own")


class Draw(NamedTuple):
    """A scenario, a seed, and where its agents start (component, agent) if not at random; and its keys, to read."""

    scenario: Scenario
    seed: int
    start: NDArray[np.float64] | None
    keys: dict[str, Any]


def drawn(rng: Random) -> Draw:
    """One valid scenario."""
    for _ in range(200):
        keys, start = settings(rng)
        try:
            own = OWN_TOPOLOGY if keys.get("topology.kind") == OWN_TOPOLOGY.name else None
            found = build_scenario(
                {"model": {"kind": keys["model.kind"]}}, "drawn", keys, caller_parts=CallerParts(topology=own)
            )
        except ScenarioError:
            continue  # a crowd without room, or a goal inside a building: the border says so, and it draws again
        return Draw(found, rng.randrange(2**32), start, keys)
    raise AssertionError("200 draws without a valid scenario")


def settings(rng: Random) -> tuple[dict[str, Any], NDArray[np.float64] | None]:
    """Keys of a scenario that is mostly valid, and a start or None."""
    kind = rng.choice([*MODELS])
    length, reach, speed = SCALES[kind]
    dt = rng.choice((0.02, 0.05))
    keys: dict[str, Any] = {
        "model.kind": kind, "agents": rng.randint(2, 6), "duration": 1.0, "dt": dt, "start.speed": speed,
        "metrics.period": rng.choice((0.0, 0.1, 0.25)), "world.dimensions": rng.choice("23"),
    }  # fmt: skip
    three = keys["world.dimensions"] == "3"
    model(keys, rng, kind)
    world(keys, rng, length)
    scene(keys, rng, length)
    goals(keys, rng, length, three)
    begin(keys, rng, length, speed)
    perception(keys, rng, length, dt)
    metrics(keys, rng, length, speed, dt)
    topology(keys, rng, length, three)
    if kind == "dimock_2003" or "aero.k_d" in keys or keys["metrics.kind"] == "dimock":
        keys |= {"agents": min(keys["agents"], 3), "duration": 6 * dt}  # a lifting line for each agent and step
        if keys.get("goals.kind") == "own":
            keys["goals.points"] = keys["goals.points"][: keys["agents"]]
    start = lattice(keys, rng, length, speed, reach) if rng.random() < 0.35 else None
    groups(keys, rng, kind)
    faults(keys, rng, length)
    silence(keys, rng, kind, length, dt)
    if keys["update"] == "synchronous":  # commands wait less than a decision, some decisions, or not at all
        keys["body.delay"] = dt * (0, 1, 7)[rng.randrange(2**32) % 3]
    else:
        keys["body.delay"] = 0.0
    return keys, start


def silence(keys: dict[str, Any], rng: Random, kind: str, length: float, dt: float) -> None:
    """Who stops for a neighbour that is lost: at once, soon, or never within such a flight."""
    law = find_law(kind)
    hears = law.command == "velocity" and law.neighbour is not None and law.flock is None and "aero.k_d" not in keys
    if not hears or keys["update"] == "sequential" or rng.random() > 0.4:
        return
    keys |= {"silence.rule": "stop", "silence.patience": dt * rng.choice((0, 2, 6)), "silence.keep": 0.5 * length}
    keys["silence.pause"] = dt * (0, 1, 5)[keys["agents"] % 3]
    keys |= {"silence.closing": length * rng.choice((0.0, 1.0, 20.0)), "silence.forget": rng.choice((0.4, 20.0))}


def groups(keys: dict[str, Any], rng: Random, kind: str) -> None:
    """Agents with numbers of their own."""
    if rng.random() > 0.3:
        return
    found: list[dict[str, Any]] = [{"name": "some", "agents": rng.randint(1, keys["agents"])}]
    if found[0]["agents"] < keys["agents"]:
        found.append({"name": "rest"})
    law, body = find_law(kind), KNOWN_BODIES[keys["body.kind"]]
    for group in found:
        flown = other_law(rng, law) if rng.random() < 0.6 and "aero.k_d" not in keys else law
        sections = {"model": flown.Parameters, "body": body.Parameters}
        if keys["update"] == "synchronous":
            sections["sensors"] = SENSORS[keys["sensors.kind"]].Parameters
        for section, record in sections.items():
            own: dict[str, Any] = {}
            sometimes(own, rng, record, section, 0.3, ("rays", "most", "period"))
            numbers = {key.partition(".")[2]: value for key, value in own.items() if isinstance(value, float)}
            off = {name: {"value": value, "spread": 0.05 * abs(value)} for name, value in numbers.items()}
            group[section] = off if rng.random() < 0.5 else numbers
            if section == "model" and flown.flock is None and "aero.k_d" not in keys:
                group[section] |= {key.partition(".")[2]: value for key, value in own.items() if isinstance(value, str)}
        if flown is not law:
            group["model"]["kind"] = flown.name
        if flown.name == "kidger":
            group["model"] |= {"rays": 8, "most": 1, "r_sep": 1.0}
    keys["groups"] = found


def other_law(rng: Random, law: Model) -> Model:
    """A law of the same kind of command, if there is one that flies beside it."""
    known = [model for model in map(find_law, MODELS) if model.command == law.command and model.flock is None]
    return rng.choice(known) if law.flock is None else law


def faults(keys: dict[str, Any], rng: Random, length: float) -> None:
    """What befalls single agents."""
    if rng.random() > 0.4:
        return
    found = []
    for _ in range(rng.randint(1, 3)):
        kind = rng.choice(tuple(KINDS))
        entry: dict[str, Any] = {"kind": kind}
        for name, declared, default in declarations(KINDS[kind].Parameters):
            share = declared.unit == "1"
            entry[name] = rng.choice((0.0, 0.5, 1.0)) if share else rng.choice((0.3 * default, -0.5 * default, 0.2))
            entry[name] = min(max(entry[name], declared.low), declared.high)
        ends = kind != "fails" and rng.random() < 0.4
        if rng.random() < 0.6:
            begun = KINDS[kind].leaves is not None and keys.get("goals.kind") == "own"  # ways are planned for all
            entry["at"] = rng.choice((0.2 if begun else 0.0, 0.2, 0.37))
            entry |= rng.choice(({"until": 0.61}, {"lasts": 0.3})) if ends else {}
        else:
            entry |= {"per_hour": 8000.0, **({"lasts": 0.25} if ends else {})}
        if rng.random() < 0.5:
            entry["agents"] = sorted(rng.sample(range(keys["agents"]), rng.randint(1, keys["agents"])))
        elif "groups" in keys:
            entry["group"] = "some"
        if "agents" not in entry and "group" not in entry and rng.random() < 0.5:
            entry["number"] = rng.randint(1, keys["agents"])
        found.append(entry)
    keys["faults"] = found


def sometimes(keys: dict[str, Any], rng: Random, record: type, section: str, share: float, but: tuple[str, ...] = ()):
    """Draw some numbers and choices of a record anew: about their defaults, or on the edge of what is allowed."""
    for name, declared, default in declarations(record):
        if name in but or rng.random() > share:
            continue
        if isinstance(declared, Choice):
            keys[f"{section}.{name}"] = rng.choice(declared.options)
        elif isinstance(declared, Quantity) and default is not None:
            edge = declared.low if rng.random() < 0.15 and declared.low == 0.0 else default * rng.uniform(0.5, 2.0)
            keys[f"{section}.{name}"] = min(max(edge, declared.low), declared.high)


def model(keys: dict[str, Any], rng: Random, kind: str) -> None:
    """The law, its body, and drag descent beside another law."""
    law = find_law(kind)
    sometimes(keys, rng, law.Parameters, "model", 0.3, ("rays", "most"))
    if kind == "kidger":
        if keys.get("model.r_sep") == 0.0:
            keys["model.r_sep"] = 1e-3  # by 0, lines that a flight skips would divide
        keys |= {"model.rays": rng.choice((8, 40)), "model.most": rng.randint(1, 3)}
    body = rng.choice(BODIES[law.command])
    keys["body.kind"] = body
    if body in ("multirotor", "jostled") and rng.random() < 0.5:
        keys["body.noise"] = 0.0
    elif rng.random() < 0.5:
        sometimes(keys, rng, KNOWN_BODIES[body].Parameters, "body", 0.4, ("delay",))
    if body == "fixed_wing":
        keys["wing.weight"] = 0.02 * SCALES[kind][2] ** 2  # N; it stalls at a quarter of the law's speed
    if kind != "dimock_2003" and law.command == "velocity" and rng.random() < 0.12:
        keys |= {"aero.k_d": rng.choice((0.05, 0.3)), "aero.gradient": rng.choice(OPTIONS["aero"]["gradient"])}
    keys["wing.segments"] = rng.choice(SEGMENTS)
    for name in ("layout", "positions", "frame", "stall"):
        keys[f"wing.{name}"] = rng.choice(OPTIONS["wing"][name])


def world(keys: dict[str, Any], rng: Random, length: float) -> None:
    """Arena, edges and obstacles."""
    arena = rng.choice(("square", "circle", "polygon", "none"))
    keys["world.arena"] = arena
    edges = rng.choice(("open", "open", "bounce", "periodic")) if arena == "square" else "open"
    keys["world.edges"] = edges
    side = length * rng.choice((1.5, 3.0, 6.0))
    keys |= {"world.side": side, "world.radius": side, "world.height": side * rng.choice((0.5, 1.0))}
    if arena == "polygon":
        ring = [[-side, -side], [side, -0.8 * side], [1.2 * side, 0.3 * side], [0.0, side]]
        keys["world.corners"] = ring if rng.random() < 0.4 else [*ring, [0.1 * side, 0.05 * side], [-0.5 * side, 0.0]]
    if arena == "square":
        keys["world.walls"] = rng.choice(("every_edge", "nearest_per_axis"))
    if rng.random() < 0.3 and edges != "periodic":
        a, b = 0.1 * side, 0.25 * side
        islands = [[[a, a], [b, a], [b, b], [a, b]], [[-b, -b], [-a, -b], [-a, -a]]]
        keys["world.obstacles"] = islands = islands[: rng.randint(1, 2)]
        if len(islands) == 2 and rng.random() < 0.5:
            islands[1].append([-0.13 * side, -0.2 * side])  # a corner that makes it concave
        if keys["world.dimensions"] == "3" and rng.random() < 0.5:
            keys["world.heights"] = [[rng.uniform(-1.0, 0.0) * side, rng.uniform(0.1, 1.0) * side] for _ in islands]
    if keys["world.dimensions"] == "3" and edges == "open" and rng.random() < 0.3:
        keys["world.floor"] = rng.choice((-1.0, -0.3, 0.2)) * keys["world.height"]


def scene(keys: dict[str, Any], rng: Random, length: float) -> None:
    """What stands in the world."""
    kind = rng.choice(("none", "none", "none", "boxes", "boxes", "city", "forest", "mesh"))
    if kind == "none":
        return
    if kind == "mesh":
        keys |= {"scene.kind": kind, "scene.file": CUBE, "scene.unit": 0.5 * length, "scene.up": rng.choice("zy")}
        return
    keys |= {"scene.kind": kind, "scene.seed": rng.randrange(1000), "scene.ground": rng.choice(("yes", "no"))}
    if kind == "boxes":
        boxes = []
        for _ in range(rng.randint(1, 4)):
            x, y, z = (length * 0.25 * rng.randint(-6, 6) for _ in range(3))
            later = rng.choice((0.0, 0.0, 0.3))
            boxes.append([x, y, z, x + 0.25 * length, y + 0.5 * length, z + length, later])
        keys["scene.boxes"] = boxes
        return
    length = max(length, 20.0)  # trees have a size of their own
    keys |= {"scene.block": 2.0 * length, "scene.street": length, "scene.low": length, "scene.high": 2.0 * length}
    keys |= {
        "scene.blocks": 2,
        "scene.trees": 8,
        "scene.side": 4.0 * length,
        "scene.draw": rng.choice(("once", "flight")),
    }
    if rng.random() < 0.4:
        keys |= {"scene.later": 0.5, "scene.later_until": 0.6}


def goals(keys: dict[str, Any], rng: Random, length: float, three: bool) -> None:
    """Goals of the flock, or one for each agent."""
    scenes = ("scene",) if keys.get("scene.kind") in ("city", "forest") else ()
    kind = rng.choice(("none", "none", "points", "own", *scenes))
    if kind == "none":
        return
    count = keys["agents"] if kind == "own" else rng.randint(1, 3)
    keys["goals.kind"] = kind
    if kind == "scene":
        keys |= {"goals.count": 2, "goals.clearance": 0.1 * length, "goals.apart": 0.2 * length, "goals.low": length}
        keys |= {"goals.high": 3.0 * length}
    else:
        keys["goals.points"] = [[length * rng.uniform(-1.5, 1.5) for _ in range(3)] for _ in range(count)]
    keys |= {"goals.radius": length * rng.choice((0.1, 2.0)), "goals.speed": rng.choice((0.0, 0.5 * length))}
    if rng.random() < 0.4:
        keys |= {"goals.role": "herd", "goals.spread": length, "goals.behind": 0.5 * length}


def begin(keys: dict[str, Any], rng: Random, length: float, speed: float) -> None:
    """Where agents start."""
    kind = rng.choice((*(("arena", "arena") if keys["world.arena"] != "none" else ()), "ball", "box", "vee", "echelon"))
    keys |= {"start.kind": kind, "start.separation": rng.choice((0.0, 0.05 * length, 0.2 * length))}
    keys |= {
        "start.radius": 0.7 * length,
        "start.side": 1.4 * length,
        "start.clearance": rng.choice((0.0, 0.02 * length)),
    }
    keys |= {
        "start.spacing_x": 0.15 * length,
        "start.spacing_y": max(0.2 * length, 1.6),
        "start.spacing_z": 0.1 * length,
    }
    keys["start.jitter"] = rng.choice((0.0, 0.05 * length))
    keys["start.wall_clearance"] = keys["start.jitter"]  # as often 0 as not
    keys["start.speed"] = rng.choice((0.0, speed, speed))


def perception(keys: dict[str, Any], rng: Random, length: float, dt: float) -> None:
    """Sensors, radio and wind, or the order in which agents act on perfect perception."""
    keys["radio.range"] = length * rng.choice((0.5, 1.0, 4.0, 1e6))
    if rng.random() < 0.3:
        keys |= {"wind.east": rng.choice((0.0, 1.5)), "wind.north": -0.5, "wind.gust": rng.choice((0.0, 2.0))}
        keys |= {"wind.up": rng.choice((0.0, 0.3)), "wind.kind": rng.choice(("simple", "dryden"))}
    if rng.random() < 0.25 and keys["model.kind"] != "dimock_2003" and "aero.k_d" not in keys:
        keys |= {
            "update": "sequential",
            "sensors.kind": rng.choice(("perfect", "langevin")),
            "sensors.period": rng.choice((0.0, dt)),
            "radio.delay": 0.0,
        }
        if keys["sensors.kind"] == "langevin":
            keys["sensors.noise"] = 0.0
        return
    keys["update"] = "synchronous"
    keys["sensors.period"] = dt * rng.choice((0, 1, 2, 3, 5))
    sensors(keys, rng, length, dt)
    keys["radio.delay"] = dt * rng.choice((0, 0, 1, 4, 7))
    radio(keys, rng, length)
    if rng.random() < 0.4:
        keys |= {"radio.loss": rng.choice((0.3, 1.0)), "radio.loss_at": length}


def radio(keys: dict[str, Any], rng: Random, length: float) -> None:
    """The radio and its own numbers."""
    kind = rng.choice(
        ("constant", "constant", "links", "links", *(k for k in RADIOS if k not in ("constant", "links")))
    )
    keys["radio.kind"] = kind
    if kind in ("links", "shadow"):
        keys |= {"radio.near": 0.2 * length, "radio.far": length}
    if kind == "links":
        keys["radio.slow_rate"] = rng.choice((0.7, 4.0))
    if kind == "table":
        keys |= {"radio.spacing": 0.1 * length, "radio.received_0": 0.7, "radio.received_3": 0.2}
    if kind == "congestion":
        keys |= {"radio.airtime": rng.choice((0.0, 0.05)), "radio.rate": rng.choice((4.0, 30.0, 300.0))}
    if kind == "shadow":
        keys |= {"radio.wall": rng.choice((0.0, 6.0, 200.0)), "radio.exponent": rng.choice((2.0, 3.5))}
    if kind == "bursts":
        keys |= {"radio.outage_rate": rng.choice((0.0, 3.0)), "radio.outage_time": rng.choice((0.1, 1.0))}
        keys["radio.received_bad"] = rng.choice((0.0, 0.5))
    if kind == "vision":
        keys |= {"radio.field": rng.choice((2.0, 6.2)), "radio.field_up": rng.choice((1.0, 3.1))}
        keys |= {"radio.missed": rng.choice((0.0, 0.4)), "radio.hold": rng.choice((0.0, 0.3))}
        keys |= {"radio.range_sd": rng.choice((0.0, 0.2)), "radio.smoothing": rng.choice((0.001, 0.3))}
    if kind == "jitter":
        keys |= {"radio.jitter": rng.choice((0.0, 0.05, 0.3)), "radio.longest": rng.choice((0.0, 0.1, 2.0))}


def sensors(keys: dict[str, Any], rng: Random, length: float, dt: float) -> None:
    """By what agents know themselves."""
    kind = keys["sensors.kind"] = rng.choice(("langevin", "langevin", *SENSORS))
    if kind == "langevin":
        keys["sensors.noise"] = rng.choice((0.0, 0.05 * length))
        keys["sensors.scale"] = rng.choice((3.0, 0.3 * length))
    if kind == "delayed":
        keys["sensors.lag"] = max(keys["sensors.period"], dt) * rng.choice((0.0, 1.0, 1.3, 4.0))
    if kind == "gnss":
        for name in ("sd", "sd_up", "white", "bias", "sd_velocity", "jump_sd", "coasting"):
            keys[f"sensors.{name}"] = rng.choice((0.0, 0.02 * length))
        keys |= {"sensors.drift_time": rng.choice((0.1, 10.0)), "sensors.jump_rate": rng.choice((0.0, 2.0))}
        keys |= {"sensors.jump_time": rng.choice((0.0, 0.2)), "sensors.outage_time": rng.choice((0.0, 0.3))}
        keys["sensors.outage_rate"] = rng.choice((0.0, 2.0))


def topology(keys: dict[str, Any], rng: Random, length: float, three: bool) -> None:
    """Whom agents meet of those whom they hear."""
    if rng.random() < 0.5:
        return
    kinds = [kind for kind in OPTIONS["topology"]["kind"] if not (three and kind == "voronoi")]
    if rng.random() < 0.15:
        keys |= {"topology.kind": OWN_TOPOLOGY.name, "topology.times": rng.choice((1.0, 1.5, 2.0))}
        return
    keys |= {"topology.kind": rng.choice(kinds), "topology.k": rng.randint(1, 3)}
    keys |= {"topology.radius": length * rng.choice((0.0, 0.25, 0.5)), "topology.fading": rng.choice((0.0, 4.0))}
    keys |= {"topology.wall": rng.choice((0.0, 20.0)), "topology.exponent": rng.choice((2.0, 3.5))}


def metrics(keys: dict[str, Any], rng: Random, length: float, speed: float, dt: float) -> None:
    """What is measured."""
    kind = rng.choice(("vasarhelyi", "zapotecatl", "groups", "order", "kidger", "dimock"))
    keys |= {"metrics.kind": kind, "metrics.r_coll": length * rng.choice((0.1, 0.5)), "metrics.v_flock": speed}
    keys |= {"metrics.r_cluster": length * rng.choice((0.3, 1.0)), "metrics.r_body": 0.05 * length}
    keys |= {"metrics.r_b": 0.05 * length, "metrics.max_e": 4.0 * length, "metrics.k": rng.choice((0.0, length))}
    keys["metrics.t_settle"] = rng.choice((0.0, 0.4))
    if kind in ("vasarhelyi", "kidger", "dimock"):
        keys["metrics.stop"] = rng.choice(("never", "never", "collision"))
    keys["metrics.count"] = rng.choice(("each", "program")) if keys["world.edges"] != "periodic" else "each"
    keys["metrics.fitness"] = rng.choice(("paper", "sound"))
    if rng.random() < 0.4:
        keys["metrics.collision_period"] = dt * rng.choice((1, 3))


def lattice(keys: dict[str, Any], rng: Random, length: float, speed: float, reach: str) -> NDArray[np.float64]:
    """A start on the edge: agents on a lattice whose step is a range, all of one velocity or of opposite ones."""
    step = length * rng.choice((0.25, 0.5))
    many = rng.choice((1.0, 2.0))
    keys["radio.range"] = step * many
    keys[f"model.{reach}"] = step * rng.choice((1.0, many))
    three = keys["world.dimensions"] == "3"
    places = [(x, y, z) for x in range(-2, 3) for y in range(-2, 3) for z in (range(3) if three else (0,))]
    if keys["world.edges"] != "open":  # from given places agents start inside
        keys |= {"world.side": 8.0 * step, "world.height": 8.0 * step}
    chosen = np.array(rng.sample(places, keys["agents"]), float).T * step
    along = np.array([[speed], [0.0], [0.0]]) * np.ones(keys["agents"])
    if rng.random() < 0.5:
        along[:, ::2] *= -1.0
    return np.concatenate([chosen, along] if three else [chosen[:2], along[:2]])


def options(record: type) -> dict[str, tuple[str, ...]]:
    """Of each choice of a record what it may be."""
    return {name: declared.options for name, declared, _ in declarations(record) if isinstance(declared, Choice)}


OPTIONS = {section: options(record) for section, record in {**SECTIONS, "flight": Flight}.items()}
OPTIONS |= {kind: options(find_law(kind).Parameters) for kind in MODELS}
OPTIONS |= {
    "model": {"kind": tuple(MODELS)},
    "sensors": {"kind": tuple(SENSORS)},
    "body": {"kind": tuple(KNOWN_BODIES), **options(KNOWN_BODIES["heading"].Parameters)},
}
OPTIONS["wing"] = OPTIONS["wing"] | {"segments": tuple(dict.fromkeys(SEGMENTS))}
CHOICES = [f"faults.kind = {kind}" for kind in KINDS]
CHOICES += [f"{owner}.{name} = {x}" for owner, names in OPTIONS.items() for name, xs in names.items() for x in xs]
SWITCHES = (
    "three", "noisy", "late", "lossy", "links", "gusts", "periodic", "islands", "scene", "goals", "own", "sequential",
    "stop", "descends", "given", "sees", "walls", "groups", "laws", "faults", "absent", "silent", "waits",
)  # fmt: skip


def notions(draw: Draw) -> set[str]:
    """What is on or off, and which of each choice was drawn."""
    found, keys = draw.scenario, draw.keys
    switches: dict[str, bool] = {
        "three": found.dimensions == 3, "noisy": found.has_sensor_error, "late": found.radio.delay > 0.0,
        "lossy": found.radio.loss > 0.0, "links": found.radio.rule.name == "links", "gusts": found.wind.gust > 0.0,
        "periodic": found.world.edges == "periodic", "islands": bool(found.world.obstacles),
        "scene": found.scene.kind != "none", "goals": found.goals.kind not in ("none", "own"),
        "own": found.goals.kind == "own", "sequential": found.flight.update == "sequential",
        "stop": found.metrics.stop == "collision", "descends": found.is_aerodynamic, "given": draw.start is not None,
        "sees": found.model.sight is not None, "walls": found.model.boundary is not None,
        "groups": bool(found.groups), "laws": len(found.laws) > 1, "faults": bool(found.fault_kinds),
        "absent": any(kind.leaves for kind in found.fault_kinds), "silent": found.silence.rule == "stop",
        "waits": found.body.delay > 0.0,
    }  # fmt: skip
    assert tuple(switches) == SWITCHES
    kinds = {f"faults.kind = {kind.name}" for kind in found.fault_kinds}
    names = kinds | {f"{name} {'on' if on else 'off'}" for name, on in switches.items()}
    records = {
        "model": found.parameters, "body": found.body.numbers, "wind": found.wind, "radio": found.radio.numbers,
        "world": found.world, "scene": found.scene, "topology": found.topology.numbers,
        "goals": found.goals, "start": found.start, "wing": found.wing, "metrics": found.metrics.numbers,
        "flight": found.flight, "silence": found.silence,
    } | ({"aero": found.aero} if found.is_aerodynamic else {})  # fmt: skip
    kind = keys["model.kind"]
    for section, record in records.items():
        owner = kind if section == "model" else section
        names |= {f"{owner}.{name} = {value}" for name, value in choices(record).items()}
    names |= {f"radio.kind = {found.radio.rule.name}"}
    return names | {f"{section}.kind = {keys[f'{section}.kind']}" for section in ("model", "body", "sensors")}


IMPOSSIBLE = (
    {"absent on", "faults off"}, {"laws on", "groups off"}, {"laws on", "descends on"},
    {"goals on", "own on"},  # goals of the flock, or one for each agent
    {"periodic on", "islands on"},
    {"sequential on", "noisy on"}, {"sequential on", "late on"}, {"sequential on", "lossy on"},
    {"sequential on", "links on"}, {"descends on", "sequential on"},
    {"sequential on", "waits on"},
    {"sees on", "walls on"}, {"descends on", "sees on"}, {"silent on", "sequential on"}, {"silent on", "descends on"},
)  # fmt: skip


def missing(held_by_draw: list[list[str]]) -> list[str]:
    """What no draw holds, of the notions of each: a choice, or a pair of notions on or off."""
    held = set().union(*held_by_draw)
    switched = [[name for name in names if name.endswith((" on", " off"))] for names in held_by_draw]
    pairs = {pair for names in switched for pair in combinations(sorted(names), 2)}
    lacking = [name for name in CHOICES if name not in held]
    for one, other in combinations(sorted(SWITCHES), 2):
        for a, b in product(("on", "off"), repeat=2):
            pair = tuple(sorted((f"{one} {a}", f"{other} {b}")))
            if pair not in pairs and set(pair) not in IMPOSSIBLE:
                lacking.append(" with ".join(pair))
    return lacking
