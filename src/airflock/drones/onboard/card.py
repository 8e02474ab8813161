"""The flight card: everything that a drone must know before it flies, as plain JSON that every member carries alike.

Written on the ground from a scenario (`airflock fly prepare`), read on board with the standard library. Its hash
travels in every packet: drones with different cards do not flock.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from airflock.core import FAR, Model, PacketPolicy, Pilot, SilenceParameters, State
from airflock.drones.mavlink.autopilots import AUTOPILOTS, Autopilot
from airflock.drones.onboard.fence import Fence
from airflock.drones.onboard.fields import (
    are_valid_shapes,
    is_ring,
    read_numbers,
    read_public_key,
    read_record,
    to_tuples,
)
from airflock.drones.onboard.laws import read_body, read_law, read_member_parts, wall_reach
from airflock.drones.onboard.safety import SafetyLimits
from airflock.parts.topologies import TOPOLOGIES, parameters as topologies
from airflock.support import CardError, FlightSite, as_error, atomic, collect_errors, parse_json, read_text, suggest
from airflock.world import Shapes, WorldMap, arena, polygon_error

CARD_VERSION = 2  # a card of version 1 does not name its rule of silence
CARD_KEYS = (
    "airflock_card", "name", "mission", "expires", "site", "members", "operator", "autopilot", "law", "body", "own",
    "world", "shapes", "radio", "silence", "safety", "fence", "height", "period", "seed", "hash",
)  # fmt: skip
OPTIONAL_CARD_KEYS = (
    "topology",
    "groups",
)  # left out where a drone meets all whom it hears, where no law asks for groups
HEARING_KEYS = (
    "once",
    "any_stamp",
)  # of `radio`; left out on real drones: how a simulated agent hears (`core.hearing`)
NUMBER_RANGES = {
    "mission": (1, 2**32 - 1), "expires": (1, 2**40), "height": (1.0, 1e4), "period": (0.01, 60.0), "seed": (0, 2**63),
}  # fmt: skip
MAX_SYSTEM_ID = 250  # system ids above are left to ground stations


@dataclass(frozen=True)
class FlightCard:
    """A checked card.

    mission  : number of the mission; expires: Unix time, s
    site     : origin of local coordinates; members: system ids, in the order of their layers
    operator : public key of who may give orders, 32 bytes; empty: nobody may
    own      : law, its numbers and those of the body of each member, where they differ from one to another
    groups   : number of each member's group, -1 in none, where a law asks for it
    fence    : corners; low, high: heights above the site, m
    height   : at which the flock flies, m above the site; in space, of the arena's centre
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

    def layer(self, member: int) -> float:
        """Height (m) of a member's own layer."""
        return self.safety.base + self.safety.layer * self.members.index(member)

    def turn(self, member: int) -> float:
        """How long (s) after the start of the first member this one starts."""
        return self.safety.start_step * self.members.index(member)

    def pilot(self, member: int) -> Pilot:
        """The pilot of one member."""
        index = self.members.index(member)
        law, p, b = self.own[index] if self.own else (self.model, self.parameters, self.body_parameters)
        return Pilot(
            law, p, self.place.seen(wall_reach(law, p)), index=index, period=self.period, groups=self.groups,
            hearing=self.hearing, body=self.body, b=b, silence=self.silence, flat=self.flat,
            seed=self.seed, topology=TOPOLOGIES[self.topology.kind], t=self.topology,
        )  # fmt: skip

    def sides(self, own: State) -> list[tuple[float, float, float, float]]:
        """Distance (m, negative beyond) and inward normal of the fence's sides and of obstacles, for the limiter."""
        found = self.fence.sides(own.x, own.y)
        return found + [(s.distance, s.nx, s.ny, s.nz) for s in self.place.solid_surfaces(*self.law_state(own)[:3])]

    def outside(self, x: float, y: float, z: float) -> float:
        """Distance of a local position beyond the fence or its heights, m; negative inside."""
        return max(self.fence.outside(x, y), z - self.high)

    def law_state(self, own: State) -> State:
        """A local state as the law counts heights: from the arena's centre, or from the ground of a scene."""
        x, y, z, vx, vy, vz = own
        return own if self._has_ground else State(x, y, z - self.height, vx, vy, vz)

    @cached_property
    def _has_ground(self) -> bool:
        """Whether it flies over the ground of a scene."""
        return bool(self.document["shapes"].get("shapes"))


def card_hash(document: Mapping[str, Any]) -> str:
    """SHA-256 of a card without its own entry, over JSON with sorted keys and no spaces."""
    rest = {key: value for key, value in document.items() if key != "hash"}
    return hashlib.sha256(json.dumps(rest, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def write_card(path: Path, document: Mapping[str, Any]) -> FlightCard:
    """Check a card, add its hash and write it."""
    sealed = {**document, "hash": card_hash(document)}
    card = parse_card(sealed, str(path))
    atomic.write_file(path, json.dumps(sealed, indent=1) + "\n")
    return card


def read_card(path: Path) -> FlightCard:
    """Card from its file; CardError with one line per fault."""
    with as_error(path, CardError):
        return parse_card(parse_json(read_text(path)), str(path))


def parse_card(document: Any, source: str = "card") -> FlightCard:
    """Card from its document, all faults at once."""
    if not isinstance(document, dict) or document.get("airflock_card") != CARD_VERSION:
        raise CardError([f"{source}: is not a flight card of version {CARD_VERSION}"])
    faults: list[str] = []
    for key in document:
        if key not in (*CARD_KEYS, *OPTIONAL_CARD_KEYS):
            faults.append(f"{key} is not known{suggest(key, (*CARD_KEYS, *OPTIONAL_CARD_KEYS), lead='; ', cutoff=0.6)}")
    faults += [f"{key} is missing" for key in CARD_KEYS if key not in document]
    if faults:
        raise CardError([f"{source}: {fault}" for fault in faults])
    if document["hash"] != card_hash(document):
        raise CardError([f"{source}: was changed after it was written: its hash does not match"])
    card = _made(document, faults)
    if not faults and card is not None:
        faults += _geometry_errors(card)
    if faults or card is None:
        raise CardError([f"{source}: {fault}" for fault in faults])
    return card


def _made(d: Mapping[str, Any], errors: list[str]) -> FlightCard | None:
    """Card from a document whose keys are all there; None where something is wrong with what they hold, as noted."""
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
    own = read_member_parts(d, law, body, errors)
    world = read_record(arena.Parameters, d["world"], "world", errors)
    silence = read_record(SilenceParameters, d["silence"], "silence", errors)
    topology = read_record(topologies.Parameters, d.get("topology", {}), "topology", errors)
    safety = read_record(SafetyLimits, d["safety"], "safety", errors)
    errors += _group_errors(groups, members)
    if not are_valid_shapes(rows):
        errors.append("shapes: give the tables shapes (18 numbers each), nodes (6) and links (3)")
    if errors or law is None:
        return None
    place = WorldMap(
        world, Shapes(rows.get("shapes", ()), rows.get("nodes", ()), rows.get("links", ())),
        look=wall_reach(law, parameters), casts=any(each.sight is not None for each in (law, *(row[0] for row in own))),
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


def _packet_policy(extrapolate: bool, max_age: float, use_once: bool = False, any_stamp: bool = False) -> PacketPolicy:
    """What is done with neighbours' data; any_stamp: they count whatever time they say that they are of."""
    stamps = {"early": FAR, "in_order": False} if any_stamp else {}
    return PacketPolicy(extrapolate, max_age, use_once, **stamps)  # type: ignore[arg-type]


def _member_errors(members: Any) -> list[str]:
    """What is wrong with the list of system ids."""
    listed = members if isinstance(members, list) else []
    wrong = [m for m in listed if type(m) is not int or not 1 <= m <= MAX_SYSTEM_ID]
    if wrong:
        return [f"members: {wrong[0]!r} is none of the system ids from 1 to {MAX_SYSTEM_ID}"]
    if not listed:
        return [f"members = {members!r}: give a list of system ids from 1 to {MAX_SYSTEM_ID}"]
    return [f"members = {members}: a system id occurs twice"] if len(set(listed)) < len(listed) else []


def _corner_errors(corners: Any) -> list[str]:
    """What is wrong with the corners of the fence."""
    if not is_ring(corners):
        return ["fence.corners: give a list of points [east, north] in m"]
    fault = polygon_error(corners)
    return [f"fence.corners {fault}"] if fault else []


def _group_errors(groups: Any, members: Any) -> list[str]:
    """What is wrong with the numbers of the members' groups."""
    sound = isinstance(groups, list) and all(type(g) is int and -1 <= g <= MAX_SYSTEM_ID for g in groups)
    if not sound or (groups and isinstance(members, list) and len(groups) != len(members)):
        return [f"groups = {groups!r}: give the number of each member's group, -1 in none"]
    return []


def _geometry_errors(card: FlightCard) -> list[str]:
    """Why fence, heights, layers and walls do not fit together, or why no drone can fly the law."""
    faults = []
    world = arena.Parameters(**to_tuples(card.document["world"]))
    top = card.layer(card.members[-1])
    if not card.low < card.safety.base or top > card.high:
        faults.append(
            f"fence: layers from {card.safety.base:g} to {top:g} m do not lie between fence.low = {card.low:g} m and "
            f"fence.high = {card.high:g} m; raise fence.high or lower safety.layer"
        )
    low, high = (0.0, 0.0) if card.flat else arena.heights_of(world)
    if card.height + low < card.low or card.height + high > card.high:
        faults.append(
            f"height = {card.height:g} m from {low:+g} m to {high:+g} m does not lie between fence.low = {card.low:g} "
            f"m and fence.high = {card.high:g} m"
        )
    for x, y in _arena_points(world):
        if card.outside(x, y, card.height) > 1e-6:
            faults.append(f"fence: does not enclose the law's walls: the arena reaches to east {x:g} m, north {y:g} m")
            break
    kind = TOPOLOGIES[card.topology.kind]
    if kind is not None and kind.flat and not card.flat:
        faults.append(f"topology.kind = {kind.name!r}: works in a plane only; set world.dimensions = '2'")
    if world.edges != "open":
        faults.append(f"world.edges = {world.edges!r}: real space has no such edges; set world.edges = 'open'")
    for member in card.members if card.own else card.members[:1]:
        with collect_errors(faults):
            card.pilot(member)
    return faults


def _arena_points(world: arena.Parameters) -> list[tuple[float, float]]:
    h, r = 0.5 * world.side, world.radius
    if world.arena == "polygon":
        return [(float(c[0]), float(c[1])) for c in world.corners]
    if world.arena == "circle":
        return [(r, 0.0), (0.0, r), (-r, 0.0), (0.0, -r), (0.7 * r, 0.7 * r), (-0.7 * r, -0.7 * r)]
    return [(h, h), (-h, h), (-h, -h), (h, -h)] if world.arena == "square" else []
