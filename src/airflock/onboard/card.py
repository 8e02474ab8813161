"""The flight card: everything that a drone must know before it flies, as plain JSON that every member carries alike.

Written on the ground from a scenario (`airflock fly prepare`), read on board with the standard library. Its hash
travels in every packet: drones with different cards do not flock.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from difflib import get_close_matches
from importlib import import_module
from math import isfinite
from pathlib import Path
from typing import Any

from airflock import atomic
from airflock.body.registry import BODIES
from airflock.core.agent import State
from airflock.core.contract import Model, model
from airflock.core.pilot import Hearing, Pilot
from airflock.core.silence import Parameters as Silence
from airflock.errors import AirflockError, CardError, ParameterError, reason
from airflock.mavlink.autopilots import AUTOPILOTS, Autopilot
from airflock.mavlink.coordinates import Site
from airflock.onboard.fence import Fence
from airflock.onboard.safety import Safety
from airflock.topology import parameters as topologies
from airflock.topology.registry import TOPOLOGIES
from airflock.world import arena
from airflock.world.place import Place, Shapes, polygon_fault
from airflock.world.shapes import COLUMNS

VERSION = 1
KEYS = (
    "airflock_card", "name", "mission", "expires", "site", "members", "operator", "autopilot", "law", "body", "world",
    "shapes", "radio", "silence", "safety", "fence", "height", "period", "seed", "hash",
)  # fmt: skip
OPTIONAL = ("topology",)  # left out where a drone meets all whom it hears
NUMBERS = {
    "mission": (1, 2**32 - 1), "expires": (1, 2**40), "height": (1.0, 1e4), "period": (0.01, 60.0), "seed": (0, 2**63),
}  # fmt: skip
LARGEST_SYSTEM = 250  # system ids above are left to ground stations


@dataclass(frozen=True)
class Card:
    """A checked card.

    mission  : number of the mission; expires: Unix time, s
    site     : origin of local coordinates; members: system ids, in the order of their layers
    operator : public key of who may give orders, 32 bytes; empty: nobody may
    fence    : corners; low, high: heights above the site, m
    height   : at which the flock flies, m above the site; in space, of the arena's centre
    hash     : SHA-256 of the document without its own entry
    """

    name: str
    mission: int
    expires: int
    site: Site
    members: tuple[int, ...]
    operator: bytes
    autopilot: Autopilot
    model: Model
    parameters: Any
    body: Any
    body_parameters: Any
    place: Place
    hearing: Hearing
    delay: float
    silence: Silence
    topology: topologies.Parameters
    safety: Safety
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

    def pilot(self, member: int) -> Pilot:
        """The pilot of one member."""
        return Pilot(
            self.model, self.parameters, self.place, index=self.members.index(member), period=self.period,
            hearing=self.hearing, body=self.body, b=self.body_parameters, silence=self.silence, flat=self.flat,
            seed=self.seed, topology=TOPOLOGIES[self.topology.kind], t=self.topology,
        )  # fmt: skip

    def sides(self, own: State) -> list[tuple[float, float, float, float]]:
        """Distance (m, negative beyond) and inward normal of the fence's sides and of obstacles, for the limiter."""
        found = self.fence.sides(own.x, own.y)
        return found + [(s.distance, s.nx, s.ny, s.nz) for s in self.place.solids(*self.law_state(own)[:3])]

    def outside(self, x: float, y: float, z: float) -> float:
        """Distance of a local position beyond the fence or its heights, m; negative inside."""
        return max(self.fence.outside(x, y), z - self.high)

    def law_state(self, own: State) -> State:
        """A local state as the law counts heights: from the arena's centre, or from the ground of a scene."""
        x, y, z, vx, vy, vz = own
        return own if self.document["shapes"].get("shapes") else State(x, y, z - self.height, vx, vy, vz)


def hash_of(document: Mapping[str, Any]) -> str:
    """SHA-256 of a card without its own entry, over JSON with sorted keys and no spaces."""
    rest = {key: value for key, value in document.items() if key != "hash"}
    return hashlib.sha256(json.dumps(rest, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def write_card(path: Path, document: Mapping[str, Any]) -> Card:
    """Check a card, add its hash and write it."""
    sealed = {**document, "hash": hash_of(document)}
    card = card_of(sealed, str(path))
    atomic.write(path, json.dumps(sealed, indent=1) + "\n")
    return card


def read_card(path: Path) -> Card:
    """Card from its file; CardError with one line per fault."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as fault:
        raise CardError([f"{path}: {reason(fault)}"]) from fault
    except (ValueError, RecursionError) as fault:
        raise CardError([f"{path}: is not JSON: {fault}"]) from fault
    return card_of(document, str(path))


def card_of(document: Any, where: str = "card") -> Card:
    """Card from its document, all faults at once."""
    if not isinstance(document, dict) or document.get("airflock_card") != VERSION:
        raise CardError([f"{where}: is not a flight card of version {VERSION}"])
    faults: list[str] = []
    for key in document:
        if key not in (*KEYS, *OPTIONAL):
            near = get_close_matches(key, (*KEYS, *OPTIONAL), n=1)
            faults.append(f"{key} is not known{f'; did you mean {near[0]}?' if near else ''}")
    faults += [f"{key} is missing" for key in KEYS if key not in document]
    if faults:
        raise CardError([f"{where}: {fault}" for fault in faults])
    if document["hash"] != hash_of(document):
        raise CardError([f"{where}: was changed after it was written: its hash does not fit"])
    card = _made(document, faults)
    if not faults and card is not None:
        faults += _geometry_faults(card)
    if faults or card is None:
        raise CardError([f"{where}: {fault}" for fault in faults])
    return card


def _made(d: Mapping[str, Any], faults: list[str]) -> Card | None:
    site = _numbers(
        d["site"],
        "site",
        {"latitude": (-85.0, 85.0), "longitude": (-180.0, 180.0), "altitude": (-500.0, 9000.0)},
        faults,
    )
    fence = _numbers(d["fence"], "fence", {"low": (0.0, 1e4), "high": (1.0, 1e4)}, faults, more=("corners",))
    radio = _numbers(d["radio"], "radio", {"delay": (0.0, 30.0), "forget": (0.0, 600.0)}, faults, more=("extrapolate",))
    one = _numbers({key: d[key] for key in NUMBERS}, "", NUMBERS, faults)
    members = d["members"]
    sound = isinstance(members, list) and all(type(m) is int and 1 <= m <= LARGEST_SYSTEM for m in members)
    if not sound or not members:
        faults.append(f"members = {members!r}: give system ids from 1 to {LARGEST_SYSTEM}")
    elif len(set(members)) < len(members):
        faults.append(f"members = {members}: a system id occurs twice")
    if not isinstance(d["autopilot"], str) or d["autopilot"] not in AUTOPILOTS:
        faults.append(f"autopilot = {d['autopilot']!r} is none of {', '.join(AUTOPILOTS)}")
    corners: Any = d["fence"].get("corners") if isinstance(d["fence"], dict) else None
    if not _is_ring(corners):
        faults.append("fence.corners: give a list of points [east, north] in m")
    elif polygon_fault(corners):
        faults.append(f"fence.corners {polygon_fault(corners)}")
    operator = _hexadecimal(d["operator"], faults)
    law, parameters = _law(d["law"], faults)
    body, numbers = _body(d["body"], faults)
    world = _record(arena.Parameters, d["world"], "world", faults)
    silence = _record(Silence, d["silence"], "silence", faults)
    topology = _record(topologies.Parameters, d.get("topology", {}), "topology", faults)
    safety = _record(Safety, d["safety"], "safety", faults)
    rows = d["shapes"]
    if not _are_shapes(rows):
        faults.append("shapes: give the tables shapes (18 numbers each), nodes (6) and links (3)")
    if faults or law is None:
        return None
    place = Place(
        world, Shapes(rows.get("shapes", ()), rows.get("nodes", ()), rows.get("links", ())),
        look=1e30 if law.wall_reach is None else float(law.wall_reach(parameters)), casts=law.sight is not None,
    )  # fmt: skip
    return Card(
        name=str(d["name"]), mission=int(one["mission"]), expires=int(one["expires"]),
        site=Site(site["latitude"], site["longitude"], site["altitude"]), members=tuple(members), operator=operator,
        autopilot=AUTOPILOTS[d["autopilot"]], model=law, parameters=parameters, body=body, body_parameters=numbers,
        place=place, hearing=Hearing(bool(d["radio"]["extrapolate"]), radio["forget"]), delay=radio["delay"],
        silence=silence, topology=topology, safety=safety,
        fence=Fence(corners),
        low=fence["low"], high=fence["high"], height=one["height"], flat=world.dimensions == "2",
        period=one["period"], seed=int(one["seed"]), hash=str(d["hash"]), document=d,
    )  # fmt: skip


def _geometry_faults(card: Card) -> list[str]:
    """Why fence, heights, layers and walls do not fit together, or why no drone can fly the law."""
    faults = []
    world = arena.Parameters(**_frozen(card.document["world"]))
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
    for x, y in _outline(world):
        if card.outside(x, y, card.height) > 1e-6:
            faults.append(f"fence: does not hold the law's walls: the arena reaches to east {x:g} m, north {y:g} m")
            break
    kind = TOPOLOGIES[card.topology.kind]
    if kind is not None and kind.flat and not card.flat:
        faults.append(f"topology.kind = {kind.name!r}: cells are found in a plane; world.dimensions = '2' is one")
    if world.edges != "open":
        faults.append(f"world.edges = {world.edges!r}: real space is open; nothing bounces or comes in again")
    try:
        card.pilot(card.members[0])
    except AirflockError as fault:
        faults += str(fault).splitlines()
    return faults


def _outline(world: arena.Parameters) -> list[tuple[float, float]]:
    h, r = 0.5 * world.side, world.radius
    if world.arena == "polygon":
        return [(float(c[0]), float(c[1])) for c in world.corners]
    if world.arena == "circle":
        return [(r, 0.0), (0.0, r), (-r, 0.0), (0.0, -r), (0.7 * r, 0.7 * r), (-0.7 * r, -0.7 * r)]
    return [(h, h), (-h, h), (-h, -h), (h, -h)] if world.arena == "square" else []


def find_law(name: str) -> Model:
    """A law of the package by its name."""
    if not name.isidentifier():
        raise CardError([f"law.kind = {name!r} is not a law of this version"])
    try:
        return model(import_module(f"airflock.models.{name}"))
    except ModuleNotFoundError as fault:
        raise CardError([f"law.kind = {name!r} is not a law of this version"]) from fault


def _law(table: Any, faults: list[str]) -> tuple[Model | None, Any]:
    try:
        found = find_law(str(table["kind"]))
    except (AirflockError, KeyError, TypeError) as fault:
        faults.append(str(fault) if isinstance(fault, AirflockError) else "law.kind is missing")
        return None, None
    return found, _record(found.Parameters, {k: v for k, v in table.items() if k != "kind"}, "law", faults)


def _body(table: Any, faults: list[str]) -> tuple[Any, Any]:
    kind = table.get("kind") if isinstance(table, dict) else None
    if not isinstance(kind, str) or kind not in BODIES:
        faults.append(f"body.kind = {kind!r} is none of {', '.join(BODIES)}")
        return None, None
    return BODIES[kind], _record(
        BODIES[kind].Parameters, {k: v for k, v in table.items() if k != "kind"}, "body", faults
    )  # fmt: skip


def _record(kind: Any, table: Any, where: str, faults: list[str]) -> Any:
    """A record of parameters from a table, its faults noted."""
    if not isinstance(table, dict):
        faults.append(f"{where} = {table!r} is not a table")
        return None
    known = kind.__dataclass_fields__
    for key in table:
        if key not in known:
            near = get_close_matches(key, known, n=1)
            faults.append(f"{where}.{key} is not known{f'; did you mean {where}.{near[0]}?' if near else ''}")
    try:
        return kind(**_frozen({key: value for key, value in table.items() if key in known}))
    except ParameterError as fault:
        faults += [f"{where}.{line.partition('.')[2]}" for line in str(fault).splitlines()]
    except (TypeError, ValueError) as fault:
        faults.append(f"{where}: {fault}")
    return None


def _frozen(table: Any) -> Any:
    if isinstance(table, dict):
        return {key: _frozen(value) for key, value in table.items()}
    return tuple(_frozen(value) for value in table) if isinstance(table, list) else table


def _numbers(
    table: Any, where: str, spans: Mapping[str, tuple[float, float]], faults: list[str], more: tuple[str, ...] = ()
) -> dict[str, float]:
    """Numbers of a table within their ranges; what is wrong is noted."""
    found = {}
    if not isinstance(table, dict):
        faults.append(f"{where} = {table!r} is not a table")
        return {}
    at = f"{where}." if where else ""
    faults += [f"{at}{key} is not known" for key in table if key not in spans and key not in more]
    faults += [f"{at}{key} is missing" for key in more if key not in table]
    for key, (low, high) in spans.items():
        value = table.get(key)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(value):
            faults.append(f"{at}{key} = {value!r} is not a number")
        elif not low <= value <= high:
            faults.append(f"{at}{key} = {value:g} lies outside [{low:g}, {high:g}]")
        else:
            found[key] = value
    return found


def _are_shapes(rows: Any) -> bool:
    """Whether the rows of a scene can be read: `world.shapes` and the tree of `world.bvh`."""
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


def _is_ring(corners: Any) -> bool:
    return isinstance(corners, list) and all(
        isinstance(c, list) and len(c) == 2 and all(type(v) in (int, float) and isfinite(v) for v in c) for c in corners
    )


def _hexadecimal(text: Any, faults: list[str]) -> bytes:
    try:
        key = bytes.fromhex(text)
    except (TypeError, ValueError):
        key = b"?"
    if len(key) not in (0, 32):
        faults.append("operator: is not a public key of 64 hexadecimal digits")
    return key


def records(**given: Any) -> dict[str, Any]:
    """Records of parameters as plain tables."""
    return {name: json.loads(json.dumps(asdict(record))) for name, record in given.items()}
