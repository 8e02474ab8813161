"""The flight card: everything that a drone must know before it flies, as plain JSON; all members carry the same one.

It is written on the ground from a scenario (`airflock fly prepare`), and read on board with the
standard library. Its hash travels in every packet: drones with different cards do not flock.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import atan2, degrees, isfinite
from pathlib import Path
from typing import Any

from airflock.core import (
    FAR,
    Model,
    PacketPolicy,
    Parameters as Record,
    Pilot,
    SilenceParameters,
    State,
    choice,
    number_names,
    quantity,
)
from airflock.drones.mavlink.autopilots import AUTOPILOTS, Autopilot, ParameterCheck
from airflock.parts import BODIES, LAWS, TOPOLOGIES, steering
from airflock.parts.topologies import parameters as topologies
from airflock.support import (
    AirflockError,
    CardError,
    FlightSite,
    ParameterError,
    as_error,
    atomic,
    collect_errors,
    parse_json,
    read_text,
    suggest,
)
from airflock.world import (
    COLUMNS,
    Shapes,
    WorldMap,
    arena,
    counter_clockwise,
    inward_plane,
    is_convex,
    polygon,
    polygon_error,
)


def read_record(record_class: Any, table: Any, section: str, errors: list[str]) -> Any:
    """Read a record of parameters from a table; add its errors to the list."""
    if not isinstance(table, dict):
        errors.append(f"{section} = {table!r} is not a table")
        return None
    fields = record_class.__dataclass_fields__
    for key in table:
        if key not in fields:
            errors.append(
                f"{section}.{key} is not known{suggest(key, fields, lead='; ', prefix=f'{section}.', cutoff=0.6)}"
            )
    try:
        return record_class(**to_tuples({key: value for key, value in table.items() if key in fields}))
    except ParameterError as error:
        errors += [f"{section}.{line.partition('.')[2]}" for line in str(error).splitlines()]
    except (TypeError, ValueError) as error:
        errors.append(f"{section}: {error}")
    return None


def to_tuples(table: Any) -> Any:
    """Return a table with tuples in place of its lists."""
    if isinstance(table, dict):
        return {key: to_tuples(value) for key, value in table.items()}
    return tuple(to_tuples(value) for value in table) if isinstance(table, list) else table


def read_numbers(
    table: Any,
    key_prefix: str,
    ranges: Mapping[str, tuple[float, float]],
    errors: list[str],
    other_keys: tuple[str, ...] = (),
) -> dict[str, float]:
    """Read numbers of a table within their ranges; add the errors to the list."""
    numbers = {}
    if not isinstance(table, dict):
        errors.append(f"{key_prefix} = {table!r} is not a table")
        return {}
    at = f"{key_prefix}." if key_prefix else ""
    errors += [f"{at}{key} is not known" for key in table if key not in ranges and key not in other_keys]
    errors += [f"{at}{key} is missing" for key in other_keys if key not in table]
    for key, (low, high) in ranges.items():
        value = table.get(key)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(value):
            errors.append(f"{at}{key} = {value!r} is not a number")
        elif not low <= value <= high:
            errors.append(f"{at}{key} = {value:g} lies outside [{low:g}, {high:g}]")
        else:
            numbers[key] = value
    return numbers


def are_valid_shapes(rows: Any) -> bool:
    """Return True if the rows of a scene can be read: `world.shapes` and the tree of `world.bvh`."""
    if not isinstance(rows, dict) or set(rows) != {"shapes", "nodes", "links"}:
        return False
    wide = {"shapes": COLUMNS, "nodes": 6, "links": 3}
    for name, width in wide.items():
        for row in rows[name] if isinstance(rows[name], list) else [None]:
            if not isinstance(row, list) or len(row) != width or not all(type(v) in (int, float) for v in row):
                return False
    count, last = len(rows["nodes"]), len(rows["shapes"])
    if len(rows["links"]) != count:
        return False
    return all(k < s <= count and 0 <= a <= b <= last for k, (s, a, b) in enumerate(rows["links"]))


def is_ring(corners: Any) -> bool:
    """Return True if a value is a list of points."""
    return isinstance(corners, list) and all(
        isinstance(c, list) and len(c) == 2 and all(type(v) in (int, float) and isfinite(v) for v in c) for c in corners
    )


def read_public_key(text: Any, errors: list[str]) -> bytes:
    """Return a public key from its hexadecimal digits; empty for none."""
    try:
        key = bytes.fromhex(text)
    except (TypeError, ValueError):
        key = b"?"
    if len(key) not in (0, 32):
        errors.append("operator: is not a public key of 64 hexadecimal digits")
    return key


def ours(default: float, unit: str, **more: Any) -> Any:
    """Return a quantity whose default nobody but us has chosen."""
    return quantity(default, unit, source="our choice", **more)


@dataclass(frozen=True, kw_only=True)
class SafetyLimits(Record):
    """Limits of the velocity, and thresholds at which a mission is interrupted or ended."""

    speed_max: float = ours(6.0, "m/s", low=0.1, high=60.0, meaning="largest commanded speed")
    climb_max: float = ours(2.0, "m/s", low=0.1, high=10.0, meaning="largest vertical speed")
    accel: float = quantity(
        6.0, "m/s^2", low=0.1, high=50.0, source="Vásárhelyi et al. 2018, Table S5",
        meaning="a command differs from the own velocity by at most accel (delay + response + tick)",
    )  # fmt: skip
    response: float = quantity(
        1.0, "s", low=0.01, high=60.0, source="Vásárhelyi et al. 2018, Table S5", meaning="relaxation time of the drone"
    )
    delay: float = quantity(
        0.0, "s", low=0.0, high=10.0, source="Vásárhelyi et al. 2018 have none",
        meaning="dead time of the drone, for which it flies on before it answers a command",
    )  # fmt: skip
    brake: float = ours(2.5, "m/s^2", low=0.1, high=20.0, meaning="deceleration of the braking curve at the fence")
    brake_gain: float = ours(1.0, "1/s", low=0.05, high=10.0, meaning="its gain near the fence")
    soft_margin: float = ours(
        3.0, "m", low=0.0, high=1000.0, meaning="distance from the fence at which outward speed is 0"
    )
    base: float = ours(10.0, "m", low=2.0, high=500.0, meaning="height of the lowest layer")
    uneven: float = ours(
        5.0, "m", low=0.5, high=500.0, meaning="largest height of a drone on the ground above or below the site"
    )
    layer: float = ours(3.0, "m", low=0.5, high=50.0, meaning="distance of two layers")
    start_step: float = ours(2.0, "s", low=0.0, high=60.0, meaning="from one start to the next")
    start_apart: float = ours(3.0, "m", low=0.5, high=100.0, meaning="smallest distance on the ground")
    home_radius: float = ours(2.0, "m", low=0.5, high=50.0, meaning="within this distance: above home")
    gather: float = ours(200.0, "m", low=1.0, high=5000.0, meaning="farthest a member may be to flock")
    yield_range: float = ours(
        8.0, "m", low=0.5, high=100.0, meaning="on the way home, neighbours nearer than this repel"
    )
    near: float = ours(2.0, "m", low=0.1, high=50.0, meaning="a take-off waits for a neighbour within")
    stream: float = quantity(1.5, "s", low=1.0, high=10.0, source="PX4: more than 1 s", meaning="setpoints before use")
    arm_time: float = ours(10.0, "s", low=2.0, high=120.0, meaning="for arming, before it gives up")
    climb_time: float = ours(5.0, "s", low=1.0, high=60.0, meaning="to begin climbing")
    stale: float = ours(0.5, "s", low=0.1, high=5.0, meaning="age of the own position: hold")
    stale_land: float = ours(5.0, "s", low=0.5, high=60.0, meaning="without a position: land")
    h_acc: float = ours(3.0, "m", low=0.1, high=100.0, meaning="worst accuracy of a position")
    jump: float = ours(5.0, "m", low=0.5, high=100.0, meaning="largest plausible jump of a position")
    gnss_land: float = ours(10.0, "s", low=1.0, high=120.0, meaning="with bad navigation: land")
    battery_low: float = ours(25.0, "%", low=0.0, high=100.0, meaning="left when home is reached")
    battery_critical: float = ours(12.0, "%", low=0.0, high=100.0, meaning="land here")
    battery_way: float = ours(10.0, "%/km", low=0.0, high=1000.0, meaning="what the way home takes")
    outside_land: float = ours(10.0, "s", low=1.0, high=300.0, meaning="beyond the fence: land")
    peers_least: float = ours(1.0, "1", low=0.0, high=250.0, meaning="neighbours to be heard")
    peers_hold: float = ours(10.0, "s", low=1.0, high=600.0, meaning="with fewer: hold")
    peers_return: float = ours(30.0, "s", low=2.0, high=600.0, meaning="with fewer: return")
    deaf_return: float = ours(20.0, "s", low=2.0, high=600.0, meaning="with nobody heard: return")
    clock_error: float = ours(0.2, "s", low=0.01, high=5.0, meaning="suspicious error of a clock")
    clock_return: float = ours(10.0, "s", low=1.0, high=300.0, meaning="with a bad clock: return")
    clock_spread: float = ours(1.0, "s", low=0.1, high=10.0, meaning="stamps farther off than this are refused")
    late: float = ours(1.0, "s", low=0.1, high=10.0, meaning="a tick this late is an overload")
    overloads: float = ours(3.0, "1", low=1.0, high=100.0, meaning="overloads after which it returns")
    calm: float = ours(3.0, "s", low=0.5, high=60.0, meaning="all well for this long: go on")
    operator_time: float = ours(10.0, "s", low=1.0, high=3600.0, meaning="silence that counts as lost")
    operator_lost: str = choice("ignore", ("ignore", "hold", "return"), meaning="what to do without the operator")
    mission_time: float = ours(600.0, "s", low=1.0, high=36000.0, meaning="in the air, then return")
    status_period: float = ours(0.1, "s", low=0.02, high=5.0, meaning="between packets, fast radio")
    slow_period: float = ours(1.0, "s", low=0.1, high=60.0, meaning="between packets, slow radio")
    tick: float = ours(0.05, "s", low=0.01, high=0.2, meaning="between setpoints")


FenceSide = tuple[float, float, float, float]


class Fence:
    """A fence around the flight, as distances and normals of its sides for the limiter.

    corners : of a simple polygon, m
    """

    def __init__(self, corners: Sequence[Sequence[float]]):
        ring = counter_clockwise(corners)
        pairs = list(zip(ring, [*ring[1:], ring[0]], strict=True))
        self.edges = [[*a[:2], *b[:2]] for a, b in pairs]
        self.convex_planes = [inward_plane(a, b) for a, b in pairs] if is_convex(corners) else []

    def sides(self, x: float, y: float) -> list[FenceSide]:
        """Return distance (m, negative beyond) and inward unit normal of each side that can be reached from a position.

        These are all sides of a convex fence; of any other, the sides that can be seen. From
        outside the nearest point counts, too.
        """
        # A convex fence is a handful of planes, each valid everywhere. A polygon with a notch needs
        # the sides that can be seen from here, or a side behind another one would push.
        if self.convex_planes:
            return [(a * x + b * y + d, a, b, 0.0) for a, b, _, d in self.convex_planes]
        count = len(self.edges)
        surfaces = [polygon.wall(x, y, 0.0, self.edges, e, count, FAR) for e in range(count)]
        surfaces.append(polygon.outside(x, y, 0.0, self.edges, count))
        return [(s.distance, s.nx, s.ny, 0.0) for s in surfaces if s.distance < FAR]

    def outside(self, x: float, y: float) -> float:
        """Return the distance beyond the fence, m; negative inside."""
        if self.convex_planes:
            return -min([a * x + b * y + d for a, b, _, d in self.convex_planes])
        return float(polygon.obstacle(x, y, 0.0, self.edges, 0, len(self.edges)).distance)


MEMBER_PARTS = ("law", "body")  # of which members may have numbers of their own


def law_of_package(name: str) -> Model:
    """Return a law of the package by its name."""
    # A law is named, never carried as code: a card is data. Laws of a user's own fly from an
    # installed package.
    if name not in LAWS:
        raise CardError([f"law.kind = {name!r} is not a law of this version"])
    return LAWS[name]


def read_law(table: Any, errors: list[str], section: str = "law") -> tuple[Model | None, Any]:
    """Read law and parameters of a card; add the errors to the list."""
    try:
        found = law_of_package(str(table["kind"]))
    except (AirflockError, KeyError, TypeError) as error:
        errors.append(str(error) if isinstance(error, AirflockError) else f"{section}.kind is missing")
        return None, None
    return found, read_record(found.Parameters, {k: v for k, v in table.items() if k != "kind"}, section, errors)


def read_body(table: Any, errors: list[str]) -> tuple[Any, Any]:
    """Read body and parameters of a card; add the errors to the list."""
    kind = table.get("kind") if isinstance(table, dict) else None
    if not isinstance(kind, str) or kind not in BODIES:
        errors.append(f"body.kind = {kind!r} is none of {', '.join(BODIES)}")
        return None, None
    return BODIES[kind], read_record(
        BODIES[kind].Parameters, {k: v for k, v in table.items() if k != "kind"}, "body", errors
    )  # fmt: skip


def read_member_parts(
    d: Mapping[str, Any], law: Model | None, body: Any, errors: list[str]
) -> tuple[tuple[Model, Any, Any], ...]:
    """Read law, its numbers and those of the body of each member; empty where all are equal."""
    rows = d["own"]
    if rows == [] or law is None or body is None:
        return ()
    if not isinstance(rows, list) or not isinstance(d["members"], list) or len(rows) != len(d["members"]):
        errors.append("own: give a table with law and body for each member, or an empty list")
        return ()
    parts = []
    for number, row in enumerate(rows):
        sound = isinstance(row, dict) and all(isinstance(row.get(part), dict) for part in MEMBER_PARTS)
        if not sound:
            errors.append(f"own[{number}] = {row!r}: give the tables law and body")
            continue
        where, usual = (
            f"own[{number}]",
            {part: {k: v for k, v in d[part].items() if k != "kind"} for part in MEMBER_PARTS},
        )
        b = read_record(body.Parameters, usual["body"] | row["body"], f"{where}.body", errors)
        if "kind" in row["law"]:
            other, p = read_law(row["law"], errors, f"{where}.law")
            other = None if other is None else steering.law_for_command(other, law.command)
        else:
            other, p = law, read_record(law.Parameters, usual["law"] | row["law"], f"{where}.law", errors)
        if other is not None:
            parts.append((other, p, b))
    return tuple(parts)


def wall_reach(law: Model, p: Any) -> float:
    """Return the distance (m) up to which a law with these numbers perceives walls and obstacles."""
    return FAR if law.wall_reach is None else float(law.wall_reach(p))


CARD_VERSION = 2  # a card of version 1 does not name its rule of silence
CARD_KEYS = (
    "airflock_card", "name", "mission", "expires", "site", "members", "operator", "autopilot", "law", "body", "own",
    "world", "shapes", "radio", "silence", "safety", "fence", "height", "period", "seed", "hash",
)  # fmt: skip
OPTIONAL_CARD_KEYS = (
    "topology",
    "groups",
    "steer",
)  # left out where a drone meets all that it hears, no law uses groups, and the body takes the law's command
HEARING_KEYS = (
    "once",
    "any_stamp",
)  # of `radio`; left out on real drones: how a simulated agent hears (`core.hearing`)
NUMBER_RANGES = {
    "mission": (1, 2**32 - 1), "expires": (1, 2**40), "height": (1.0, 1e4), "period": (0.01, 60.0), "seed": (0, 2**63),
}  # fmt: skip
GRAVITY = 9.80665  # m/s²
MAX_RAMP = 0.3  # of the relaxation time, in which an acceleration is there; our choice: 20 m/s³ for 6 m/s² and 1 s
MAX_SYSTEM_ID = 250  # system ids above are left to ground stations


@dataclass(frozen=True)
class FlightCard:
    """A checked card.

    mission  : number of the mission
    expires  : Unix time, s
    site     : origin of local coordinates
    members  : system ids, in the order of their layers
    operator : public key of the operator, 32 bytes; empty: nobody may give orders
    own      : law, its numbers and those of the body of each member, where members differ
    groups   : number of each member's group, -1 in none, where a law needs it
    low, high: heights of the fence above the site, m
    height   : of the flock, m above the site; in space, of the arena's centre
    hash     : SHA-256 of the document without its own entry
    """

    name: str
    mission: int
    expires: int
    site: FlightSite
    members: tuple[int, ...]
    operator: bytes
    autopilot: Autopilot
    model: Model
    parameters: Any
    body: Any
    body_parameters: Any
    own: tuple[tuple[Model, Any, Any], ...]
    groups: tuple[int, ...]
    place: WorldMap
    hearing: PacketPolicy
    delay: float
    silence: SilenceParameters
    topology: topologies.Parameters
    steer: steering.Parameters
    safety: SafetyLimits
    fence: Fence
    low: float
    high: float
    height: float
    flat: bool
    period: float
    seed: int
    hash: str
    document: Mapping[str, Any] = field(repr=False)

    @cached_property
    def parameter_checks(self) -> tuple[ParameterCheck, ...]:
        """Return what is checked of the autopilot before the drone arms, by the response that this card relies on."""
        s = self.safety
        # A body without a limit of jerk is one whose acceleration is there at once.
        jerk = getattr(self.body_parameters, "jerk", s.accel / (MAX_RAMP * s.response))
        # A multirotor accelerates by its tilt; a gain of 1/s answers in its inverse.
        needed = {
            "accel": s.accel, "jerk": jerk, "speed": s.speed_max, "tilt": degrees(atan2(s.accel, GRAVITY)),
            "gain": 1.0 / s.response,
        }  # fmt: skip
        return tuple(c.reaching(needed[c.limits]) if c.limits else c for c in self.autopilot.parameter_checks)

    def layer(self, member: int) -> float:
        """Return the height (m) of a member's own layer."""
        # Each member has a layer of its own, so that paths to and from home never meet.
        return self.safety.base + self.safety.layer * self.members.index(member)

    def turn(self, member: int) -> float:
        """Return how long (s) after the first member this one starts."""
        return self.safety.start_step * self.members.index(member)

    def pilot(self, member: int) -> Pilot:
        """Make the pilot of one member."""
        index = self.members.index(member)
        law, p, b = self.own[index] if self.own else (self.model, self.parameters, self.body_parameters)
        return Pilot(
            law, p, self.place.seen(wall_reach(law, p)), index=index, period=self.period, groups=self.groups,
            hearing=self.hearing, body=self.body, b=b, silence=self.silence, flat=self.flat,
            steer=self.steer, seed=self.seed, topology=TOPOLOGIES[self.topology.kind], t=self.topology,
        )  # fmt: skip

    def sides(self, own: State) -> list[tuple[float, float, float, float]]:
        """Return distance (m, negative beyond) and inward normal of the fence's sides and of obstacles."""
        surfaces = self.fence.sides(own.x, own.y)
        return surfaces + [(s.distance, s.nx, s.ny, s.nz) for s in self.place.solid_surfaces(*self.law_state(own)[:3])]

    def outside(self, x: float, y: float, z: float) -> float:
        """Return the distance of a local position beyond the fence or its heights, m; negative inside."""
        # Below the fence is no breach: a drone lands and takes off there.
        return max(self.fence.outside(x, y), z - self.high)

    def law_state(self, own: State) -> State:
        """Return a local state with the law's height: from the arena's centre, or from the ground of a scene."""
        x, y, z, vx, vy, vz = own
        return own if self._has_ground else State(x, y, z - self.height, vx, vy, vz)

    @cached_property
    def _has_ground(self) -> bool:
        """Return True if it flies over the ground of a scene."""
        return bool(self.document["shapes"].get("shapes"))


def card_hash(document: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a card without its own entry, over JSON with sorted keys and no spaces."""
    # Sorted keys and no spaces: the hash must not depend on who wrote the JSON.
    rest = {key: value for key, value in document.items() if key != "hash"}
    return hashlib.sha256(json.dumps(rest, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def write_card(path: Path, document: Mapping[str, Any]) -> FlightCard:
    """Check a card, add its hash and write it."""
    sealed = {**document, "hash": card_hash(document)}
    card = parse_card(sealed, str(path))
    atomic.write_file(path, json.dumps(sealed, indent=1) + "\n")
    return card


def read_card(path: Path) -> FlightCard:
    """Read a card from its file; CardError has one line per error."""
    with as_error(path, CardError):
        return parse_card(parse_json(read_text(path)), str(path))


def parse_card(document: Any, source: str = "card") -> FlightCard:
    """Make a card from its document; CardError lists all errors."""
    if not isinstance(document, dict) or document.get("airflock_card") != CARD_VERSION:
        raise CardError([f"{source}: is not a flight card of version {CARD_VERSION}"])
    errors: list[str] = []
    for key in document:
        if key not in (*CARD_KEYS, *OPTIONAL_CARD_KEYS):
            errors.append(f"{key} is not known{suggest(key, (*CARD_KEYS, *OPTIONAL_CARD_KEYS), lead='; ', cutoff=0.6)}")
    errors += [f"{key} is missing" for key in CARD_KEYS if key not in document]
    if errors:
        raise CardError([f"{source}: {error}" for error in errors])
    if document["hash"] != card_hash(document):
        raise CardError([f"{source}: was changed after it was written: its hash does not match"])
    card = _card_from_document(document, errors)
    if not errors and card is not None:
        errors += _geometry_errors(card)
    if errors or card is None:
        raise CardError([f"{source}: {error}" for error in errors])
    return card


def _card_from_document(d: Mapping[str, Any], errors: list[str]) -> FlightCard | None:
    """Make a card from a document that has all keys; None where a value is invalid, as noted in errors."""
    site = read_numbers(
        d["site"],
        "site",
        {"latitude": (-85.0, 85.0), "longitude": (-180.0, 180.0), "altitude": (-500.0, 9000.0)},
        errors,
    )
    fence = read_numbers(d["fence"], "fence", {"low": (0.0, 1e4), "high": (1.0, 1e4)}, errors, other_keys=("corners",))
    heard = d["radio"]
    odd = {key: heard[key] for key in HEARING_KEYS if key in heard} if isinstance(heard, dict) else {}
    errors += [f"radio.{key} = {value!r}: give true or false" for key, value in odd.items() if type(value) is not bool]
    heard = {key: value for key, value in heard.items() if key not in odd} if isinstance(heard, dict) else heard
    spans = {"delay": (0.0, 30.0), "forget": (0.0, 600.0)}
    radio = read_numbers(heard, "radio", spans, errors, other_keys=("extrapolate",))
    one = read_numbers({key: d[key] for key in NUMBER_RANGES}, "", NUMBER_RANGES, errors)
    members, groups, rows = d["members"], d.get("groups", []), d["shapes"]
    corners: Any = d["fence"].get("corners") if isinstance(d["fence"], dict) else None
    errors += _member_errors(members)
    if not isinstance(d["autopilot"], str) or d["autopilot"] not in AUTOPILOTS:
        errors.append(f"autopilot = {d['autopilot']!r} is none of {', '.join(AUTOPILOTS)}")
    errors += _corner_errors(corners)
    operator = read_public_key(d["operator"], errors)
    law, parameters = read_law(d["law"], errors)
    body, numbers = read_body(d["body"], errors)
    law = law if law is None or body is None else steering.law_for_command(law, body.accepts)
    steer = read_record(steering.Parameters, d.get("steer", {}), "steer", errors)
    own = read_member_parts(d, law, body, errors)
    world = read_record(arena.Parameters, d["world"], "world", errors)
    silence = read_record(SilenceParameters, d["silence"], "silence", errors)
    topology = read_record(topologies.Parameters, d.get("topology", {}), "topology", errors)
    safety = read_record(SafetyLimits, d["safety"], "safety", errors)
    errors += _group_errors(groups, members)
    if not are_valid_shapes(rows):
        errors.append("shapes: give the tables shapes (18 numbers each), nodes (6) and links (3)")
    laws = [each for each in (law, *(row[0] for row in own)) if each is not None]
    if steer is not None and any(each.steer for each in laws):
        errors += [f"steer.{key} is missing" for key in number_names(steer) if getattr(steer, key) is None]
    if errors or law is None:
        return None
    place = WorldMap(
        world, Shapes(rows.get("shapes", ()), rows.get("nodes", ()), rows.get("links", ())),
        look=wall_reach(law, parameters), casts=any(each.sight is not None for each in laws),
    )  # fmt: skip
    return FlightCard(
        name=str(d["name"]),
        mission=int(one["mission"]),
        expires=int(one["expires"]),
        site=FlightSite(site["latitude"], site["longitude"], site["altitude"]),
        members=tuple(members),
        operator=operator,
        autopilot=AUTOPILOTS[d["autopilot"]],
        model=law,
        parameters=parameters,
        body=body,
        body_parameters=numbers,
        own=own,
        groups=tuple(groups),
        place=place,
        hearing=_packet_policy(bool(heard["extrapolate"]), radio["forget"], **odd),
        delay=radio["delay"],
        silence=silence,
        topology=topology,
        steer=steer,
        safety=safety,
        fence=Fence(corners),
        low=fence["low"],
        high=fence["high"],
        height=one["height"],
        flat=world.dimensions == "2",
        period=one["period"],
        seed=int(one["seed"]),
        hash=str(d["hash"]),
        document=d,
    )


def _packet_policy(extrapolate: bool, max_age: float, once: bool = False, any_stamp: bool = False) -> PacketPolicy:
    """Return the use of neighbours' data; with any_stamp all times of packets are accepted."""
    # In a simulation all agents share one clock, and packets of a jittering radio may overtake each
    # other; believing any stamp is what the simulated agents do.
    if any_stamp:
        return PacketPolicy(extrapolate, max_age, once, early=FAR, drop_reordered=False)
    return PacketPolicy(extrapolate, max_age, once)


def _member_errors(members: Any) -> list[str]:
    """Return the errors in the list of system ids."""
    listed = members if isinstance(members, list) else []
    invalid = [m for m in listed if type(m) is not int or not 1 <= m <= MAX_SYSTEM_ID]
    if invalid:
        return [f"members: {invalid[0]!r} is none of the system ids from 1 to {MAX_SYSTEM_ID}"]
    if not listed:
        return [f"members = {members!r}: give a list of system ids from 1 to {MAX_SYSTEM_ID}"]
    return [f"members = {members}: a system id occurs twice"] if len(set(listed)) < len(listed) else []


def _corner_errors(corners: Any) -> list[str]:
    """Return the errors in the corners of the fence."""
    if not is_ring(corners):
        return ["fence.corners: give a list of points [east, north] in m"]
    error = polygon_error(corners)
    return [f"fence.corners {error}"] if error else []


def _group_errors(groups: Any, members: Any) -> list[str]:
    """Return the errors in the numbers of the members' groups."""
    sound = isinstance(groups, list) and all(type(g) is int and -1 <= g <= MAX_SYSTEM_ID for g in groups)
    if not sound or (groups and isinstance(members, list) and len(groups) != len(members)):
        return [f"groups = {groups!r}: give the number of each member's group, -1 in none"]
    return []


def _geometry_errors(card: FlightCard) -> list[str]:
    """Return the reasons for which fence, heights, layers and walls do not fit, or a law cannot be flown."""
    errors = []
    world = arena.Parameters(**to_tuples(card.document["world"]))
    top = card.layer(card.members[-1])
    if not card.low < card.safety.base or top > card.high:
        errors.append(
            f"fence: layers from {card.safety.base:g} to {top:g} m do not lie between fence.low = {card.low:g} m and "
            f"fence.high = {card.high:g} m; raise fence.high or lower safety.layer"
        )
    low, high = (0.0, 0.0) if card.flat else arena.heights_of(world)
    if card.height + low < card.low or card.height + high > card.high:
        errors.append(
            f"height = {card.height:g} m from {low:+g} m to {high:+g} m does not lie between fence.low = {card.low:g} "
            f"m and fence.high = {card.high:g} m"
        )
    for x, y in _arena_points(world):
        if card.outside(x, y, card.height) > 1e-6:
            errors.append(f"fence: does not enclose the law's walls: the arena reaches to east {x:g} m, north {y:g} m")
            break
    kind = TOPOLOGIES[card.topology.kind]
    if kind is not None and kind.flat and not card.flat:
        errors.append(f"topology.kind = {kind.name!r}: works in a plane only; set world.dimensions = '2'")
    if world.edges != "open":
        errors.append(f"world.edges = {world.edges!r}: real space has no such edges; set world.edges = 'open'")
    # A pilot is made here, on the ground, so that a law that cannot fly this card fails before
    # take-off.
    for member in card.members if card.own else card.members[:1]:
        with collect_errors(errors):
            card.pilot(member)
    return errors


def _arena_points(world: arena.Parameters) -> list[tuple[float, float]]:
    h, r = 0.5 * world.side, world.radius
    if world.arena == "polygon":
        return [(float(c[0]), float(c[1])) for c in world.corners]
    if world.arena == "circle":
        return [(r, 0.0), (0.0, r), (-r, 0.0), (0.0, -r), (0.7 * r, 0.7 * r), (-0.7 * r, -0.7 * r)]
    return [(h, h), (-h, h), (-h, -h), (h, -h)] if world.arena == "square" else []
