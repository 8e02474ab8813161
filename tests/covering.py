"""Flights that hold every kind that a scenario can name, and flights that hold every pair of kinds.

Kinds are those of the registries: sensors, radios, topologies, bodies, winds, faults; and the ways in which groups
differ. A kind counts as held where the flight's plan says so, not where a key names it: a receiver without any error is
none. `PLANS` are few, for every change. `pairs` finds a larger set by itself, for the night.
"""

from itertools import combinations
from random import Random

from airflock.core.parameters import choices, declarations
from airflock.engine import plan_of
from airflock.parts import BODIES, FAULTS as KINDS, RADIOS, SENSORS, TOPOLOGIES
from airflock.scenarios.scenario_builder import build_scenario
from airflock.scenarios.sections import SECTIONS
from flocks import ISLANDS, NOTCHED, scenario

GROUPS = ("none", "numbers", "spread", "laws")
WINDS = dict((name, declared) for name, declared, _ in declarations(SECTIONS["wind"]))["kind"].options
FAULTS = 3  # in one flight of the larger set, each of which meets all the others

GNSS = {
    "sensors.kind": "gnss", "sensors.drift_time": 3.0, "sensors.bias": 1.0, "sensors.white": 0.3,
    "sensors.jump_rate": 0.7, "sensors.jump_time": 0.3, "sensors.outage_rate": 0.7, "sensors.outage_time": 0.3,
}  # fmt: skip
COMMON = {"duration": 10.0, "world.side": 90.0, "world.height": 50.0, "world.radius": 48.0, "start.separation": 5.0}


def fault(kind, at, agents, **numbers):
    """An entry of [[faults]]."""
    return {"kind": kind, "at": at, "agents": list(agents), **numbers}


SWARM = {"start.separation": 0.0, "start.kind": "ball", "metrics.kind": "order", "dt": 0.05, "world.arena": "none"}
# law, keys; agents 0 to 4 are there in the small flights of the CUDA simulator, too
PLANS = {
    "paper": ("vasarhelyi_2018", {"agents": 12, "world.walls": "nearest_per_axis", "metrics.r_coll": 8.0}),
    "storm": ("viragh_2014", {
        "model.r2_frict": 20.0,  # friction that lets some leave the arena
        "agents": 9, "world.obstacles": ISLANDS, "radio.loss": 0.7, "radio.delay": 0.47, "wind.east": 1.0,
        "sensors.period": 0.15,  # an odd number of steps: decisions fall between the two steps of one draw
        "wind.gust": 2.0, "start.speed": 3.0, "metrics.r_coll": 7.0, "metrics.collision_period": 0.03,
    }),
    "links": ("vasarhelyi_2018", {
        "agents": 8, "world.dimensions": "3", "world.walls": "nearest_per_axis", "radio.kind": "links",
        "radio.delay": 0.2, "radio.near": 5.0, "radio.far": 30.0, "model.limit": "cap", "radio.range": 60.0,
        "topology.kind": "visible", "topology.radius": 3.0, "groups": [
            {"name": "a", "agents": [1, 4], "body": {"tau": 2.0}, "model": {"p_rep": {"value": 0.3, "spread": 0.1}}},
            {"name": "b", "agents": 2, "sensors": {"noise": 0.1}},
        ],
    }),
    "polygon": ("vasarhelyi_2018", {
        "agents": 8, "body.kind": "autopilot",
        "world.arena": "polygon", "world.corners": NOTCHED, "radio.kind": "links", "radio.loss": 0.6,
        "radio.near": 10.0, "radio.far": 25.0, "radio.slow_rate": 0.7, "radio.fast_rate": 33.0, "wind.north": -1.5,
        "sensors.kind": "delayed", "sensors.lag": 0.4, "radio.delay": 0.31, "sensors.period": 0.3,
        "metrics.period": 0.5, "faults": [
            fault("clock", 0.1, [0], ahead=0.5), fault("radio_silent", 0.3, [1]), fault("radio_deaf", 0.3, [2, 3]),
            fault("radio_range", 0.2, [4], share=0.4), fault("radio_frozen", 0.4, [3]),
            fault("pretender", 0.2, [2], east=9.0),
        ],
    }),
    "circle": ("vasarhelyi_2018", {
        "agents": 10, "world.arena": "circle", "sensors.noise": 0.0, "radio.delay": 0.0, "body.kind": "fixed_wing",
        "model.v_flock": 15.0, "start.speed": 15.0, "wind.east": 2.0, "radio.kind": "congestion",
        "body.battery": "lithium", "body.capacity": 900.0, "radio.airtime": 0.02,
        "topology.kind": "nearest", "topology.k": 3,
        "groups": [{"name": "a", "agents": [1, 4], "model": {"kind": "viragh_2014", "v_flock": 14.0}}],
    }),
    "silo": ("viragh_2014", GNSS | {
        "agents": 6, "world.dimensions": "3", "world.arena": "circle", "world.obstacles": ISLANDS, "radio.loss": 0.5,
        "world.floor": -12.0, "world.ceiling": 40.0, "world.heights": [[-9.0, 5.0], [-20.0, 60.0]],
        "wind.kind": "dryden", "wind.up": 0.5, "radio.delay": 0.0, "start.speed": 2.0, "body.kind": "quadrotor",
        "body.battery": "lithium", "body.capacity": 1300.0,
        "radio.kind": "bursts", "radio.outage_rate": 2.0, "radio.outage_time": 0.4, "faults": [
            fault("gnss_offset", 0.1, [0], east=8.0), fault("gnss_drift", 0.2, [1], north=6.0),
            fault("gnss_frozen", 0.2, [2], lasts=0.9), fault("gnss_spoofed", 0.4, [3], up=0.5),
        ],
    }),
    "silence": ("vasarhelyi_2018", {  # near 15 m most packets are lost: everybody misses some, and stops now and then
        "agents": 7, "radio.kind": "shadow", "radio.delay": 0.2, "radio.near": 5.0, "radio.far": 20.0,
        "world.obstacles": ISLANDS, "silence.rule": "stop", "silence.patience": 0.6,
        "topology.kind": "strongest", "topology.k": 2, "body.kind": "direct", "model.limit": "cap", "duration": 4.0,
        "faults": [
            fault("motor", 0.1, [0], share=0.3), fault("stuck", 0.3, [1], lasts=0.5), fault("fails", 0.4, [2]),
            fault("battery", 0.1, [3], endurance=0.4),
        ],
    }),
    "seen": ("vasarhelyi_2018", {
        "agents": 6, "radio.kind": "vision", "radio.delay": 0.1, "body.kind": "jostled", "body.noise": 0.01,
        "model.limit": "cap", "duration": 4.0, "groups": [
            {"name": "a", "agents": [1, 4], "model": {"v_flock": {"value": 3.0, "spread": 0.2}}},
        ],
    }),
    "boids": ("reynolds_1987", SWARM | {
        "agents": 7, "radio.kind": "jitter", "radio.delay": 0.1, "radio.jitter": 0.2, "radio.longest": 0.4,
        "start.radius": 0.4, "start.speed": 0.2, "sensors.noise": 0.0, "duration": 2.0,
    }),
    "fish": ("couzin_2005", SWARM | {
        "agents": 7, "radio.kind": "table", "radio.spacing": 1.0, "radio.received_3": 0.4, "topology.kind": "voronoi",
        "start.radius": 4.0, "start.speed": 1.0, "sensors.noise": 0.0, "duration": 5.0,
    }),
}  # fmt: skip


def build(name, **settings):
    """Scenario of one of the plans, with some keys anew."""
    kind, keys = PLANS[name]
    return scenario(kind, **{key.replace(".", "__"): value for key, value in (COMMON | keys | settings).items()})


# ------------------------------------------------------------------------------------------------------------- kinds

SINGLE = {
    "sensors": tuple(SENSORS), "radio": tuple(RADIOS), "topology": tuple(TOPOLOGIES), "body": tuple(BODIES),
    "wind": ("none", *WINDS), "groups": GROUPS,
}  # fmt: skip
EVERY = frozenset([*((factor, kind) for factor, kinds in SINGLE.items() for kind in kinds)]) | {
    ("faults", kind) for kind in KINDS
}


def held(found):
    """Kinds that a scenario's plan holds, as (factor, kind)."""
    plan = plan_of(found, precision=64, record=True, grid=False)
    differ = {("groups", "laws")} if plan.laws else set()
    spread = any(sd > 0.0 for group in found.groups for sd in group.spread.values())
    numbers = any(group.numbers for group in found.groups) and plan.varied
    differ |= ({("groups", "spread")} if spread else set()) | ({("groups", "numbers")} if numbers else set())
    return {
        ("sensors", plan.sensor.name if plan.has_sensor_error else "perfect"), ("radio", plan.radio.name),
        ("topology", plan.topology.name if plan.topology is not None else "range"), ("body", plan.body.name),
        ("wind", choices(found.wind)["kind"] if plan.windy else "none"),
        *(("faults", kind.name) for kind in plan.faults), *(differ or {("groups", "none")}),
    }  # fmt: skip


def possible(one, other):
    """Whether two different kinds can meet in a flight: of one factor only faults and ways of groups can."""
    return one[0] != other[0] or one[0] == "faults"


PAIRS = frozenset(frozenset(pair) for pair in combinations(sorted(EVERY), 2) if possible(*pair))


# ------------------------------------------------------------------------------------------------------------- pairs


def pairs(tries=60, seed=0):
    """Combinations of kinds in which each pair is held, found greedily: of some drawn, that with the most new pairs.

    Each begins with a pair that is still missing. A list of dictionaries of factor and kind, `faults` a tuple.
    """
    rng, missing, found = Random(seed), set(PAIRS), []
    while missing:
        first = sorted(min(missing, key=lambda pair: sorted(pair)))
        drawn = [_drawn(rng, first) for _ in range(tries)]
        best = max(drawn, key=lambda one: len(_of(one) & missing))
        missing -= _of(best)
        found.append(best)
    return found


def _drawn(rng, first):
    """One combination that holds the kinds `first`."""
    made = {factor: rng.choice(kinds) for factor, kinds in SINGLE.items()}
    made |= {factor: kind for factor, kind in first if factor != "faults"}
    known = [kind for factor, kind in first if factor == "faults"]
    rest = [kind for kind in KINDS if kind not in known]
    return made | {"faults": tuple(known + rng.sample(rest, FAULTS - len(known)))}


def _of(made):
    """Pairs that a combination holds."""
    kinds = [(factor, kind) for factor, kind in made.items() if factor != "faults"]
    kinds += [("faults", kind) for kind in made["faults"]]
    return {frozenset(pair) for pair in combinations(kinds, 2)}


LAWS = {  # by what a body takes: law, length (m), speed (m/s), a number and another law
    "velocity": ("vasarhelyi_2018", 20.0, 4.0, ("p_rep", 0.2), {"kind": "viragh_2014"}),
    "acceleration": ("reynolds_1987", 0.5, 0.2, ("w_a", 40.0), {"form": "printed"}),
    "heading": ("couzin_2005", 6.0, 1.0, ("rho", 4.0), {"kind": "couzin_2002"}),
}  # fmt: skip


def flight(made):
    """Scenario of a combination: seven agents for a second, in a square with two islands where the law has walls."""
    law, length, speed, (number, value), other = LAWS[BODIES[made["body"]].accepts]
    keys = {
        "agents": 7, "duration": 0.96, "dt": 0.04, "metrics.kind": "order", "metrics.period": 0.08,
        "start.kind": "ball", "start.radius": 0.6 * length, "start.separation": 0.1 * length, "start.speed": speed,
        "world.side": 4.0 * length, "sensors.period": 0.08, "radio.delay": 0.08, "radio.range": 2.0 * length,
        "body.kind": made["body"], "radio.kind": made["radio"], "topology.kind": made["topology"],
        "topology.k": 2, "topology.radius": 0.05 * length, "sensors.kind": made["sensors"],
    }  # fmt: skip
    keys |= {"world.arena": "none"} if law != "vasarhelyi_2018" else {"world.obstacles": ISLANDS}
    if made["body"] == "fixed_wing":  # which stalls at what suits a multirotor
        keys |= {"model.v_flock": 15.0, "start.speed": 15.0}
        other = {**other, "v_flock": 15.0}
    keys |= _sensor(made["sensors"], length) | _radio(made["radio"], length)
    if made["wind"] != "none":
        keys |= {"wind.kind": made["wind"], "wind.east": 0.2 * speed, "wind.gust": 0.2 * speed}
    sd = {"value": value, "spread": 0.05 * value}
    keys["groups"] = {
        "none": [], "numbers": [{"name": "a", "agents": [1, 4], "model": {number: value}}],
        "spread": [{"name": "a", "agents": [1, 4], "model": {number: sd}}, {"name": "b", "model": {number: sd}}],
        "laws": [{"name": "a", "agents": [1, 4], "model": other}],
    }[made["groups"]]  # fmt: skip
    keys["faults"] = [_fault(kind, place, length) for place, kind in enumerate(made["faults"])]
    return build_scenario({"model": {"kind": law}}, "covering", keys)


def _sensor(kind, length):
    numbers = {"sensors.noise": 0.05 * length} if kind == "langevin" else {}
    numbers |= {"sensors.lag": 0.15} if kind == "delayed" else {}
    return numbers | ({**GNSS, "sensors.bias": 0.05 * length} if kind == "gnss" else {})


def _radio(kind, length):
    numbers = {
        "constant": {"radio.loss": 0.3, "radio.loss_at": length}, "links": {"radio.near": 0.2, "radio.far": 1.0},
        "shadow": {"radio.near": 0.2, "radio.far": 1.0}, "table": {"radio.spacing": 0.2, "radio.received_3": 0.4},
        "congestion": {"radio.airtime": 0.02}, "bursts": {"radio.outage_rate": 3.0, "radio.outage_time": 0.3},
        "jitter": {"radio.jitter": 0.1, "radio.longest": 0.3}, "vision": {"radio.missed": 0.2},
    }[kind]  # fmt: skip
    scaled = ("radio.near", "radio.far", "radio.spacing")
    return {key: value * length if key in scaled else value for key, value in numbers.items()}


def _fault(kind, place, length):
    """A fault that begins early, of one agent; numbers in metres are as large as the flock."""
    numbers = {}
    for name, declared, default in declarations(KINDS[kind].Parameters):
        metres = declared.unit in ("m", "m/s")
        numbers[name] = 0.3 * length if metres else default
    numbers |= {"endurance": 0.4} if kind == "battery" else {}
    return fault(kind, 0.12 + 0.16 * place, [2 * place], **numbers)
