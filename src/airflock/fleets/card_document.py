"""From a scenario to a flight card: the law, its world and its limits as numbers that a drone carries."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

from shapely.geometry import Polygon

from airflock.core import BodyParameters, Parameters, forward, with_defaults
from airflock.drones import CARD_VERSION, SafetyLimits
from airflock.parts import LAWS
from airflock.parts.bodies import Parameters as Multirotor
from airflock.scenarios import Scenario
from airflock.support import CardError, FlightSite, ScenarioError
from airflock.world import arena, inward_plane


def agent_records(scenario: Scenario, count: int, seed: int | None) -> list[tuple[Any, Any]]:
    """Return the numbers of law and body of each of the first `count` agents.

    seed : of the tolerances of manufacture; None: without tolerances, for real drones have their
           own

    Raises ScenarioError where groups have fewer agents.
    """
    if not scenario.varied and len(scenario.laws) == 1:
        return [(scenario.parameters, scenario.body.numbers)] * count
    if count > scenario.agents:
        raise ScenarioError(
            [f"groups are of {scenario.agents} agents, and {count} drones are to fly; set agents = {count}"]
        )
    groups = tuple(replace(group, spread={}) for group in scenario.groups) if seed is None else scenario.groups
    resolved = replace(scenario, groups=groups)
    varied = dict.fromkeys([*resolved.varied, *(each for law in resolved.laws for each in law.varied)])
    columns = {(of, name): resolved.agent_values(of, name, seed or 0) for of, name in varied}

    def own(agent: int) -> tuple[Any, Any]:
        law = resolved.law_of(agent)
        p = {name: columns["p", name][agent] for _, name in law.varied}
        b = {name: column[agent] for (of, name), column in columns.items() if of == "b"}
        return replace(law.parameters, **p), replace(scenario.body.numbers, **b)

    return [own(agent) for agent in range(count)]


def agent_sensors(scenario: Scenario, count: int, seed: int) -> list[Any]:
    """Return the numbers of the sensor of each of the first `count` agents, with the tolerances of a seed."""
    columns = {name: scenario.agent_values("s", name, seed) for of, name in scenario.varied if of == "s"}
    own = [{name: column[agent] for name, column in columns.items()} for agent in range(count)]
    return [replace(scenario.sensors.numbers, **numbers) for numbers in own]


DEFAULT_HEIGHT = 20.0  # m; our choice: above trees and people, below most limits
DEFAULT_FENCE_MARGIN = 30.0  # m; our choice: a flock turns some metres beyond the law's soft walls
FENCE_HEADROOM = 10.0  # m between the highest layer and the fence
CIRCLE_SIDES = 16  # sides of the polygon around a circular arena


def make_card_document(
    scenario: Scenario, *, site: tuple[float, float, float], members: Sequence[int], mission: int, expires: int,
    operator: bytes = b"", autopilot: str = "px4", height: float | None = None, margin: float = DEFAULT_FENCE_MARGIN,
    as_simulated: bool = False, seed: int | None = None, safety: Mapping[str, Any] | None = None,
    stop_for_lost: bool | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Return the document of a flight card, without its hash.

    site          : latitude and longitude (degrees), altitude (m) of the arena's centre on the
                    ground
    height        : of the flock, m above the site; in space, of the arena's centre
    margin        : of the fence around the law's walls, m
    as_simulated  : use neighbours' data as the scenario's radio does; else they are carried forward
                    and kept for 5 s
    seed          : of the tolerances of manufacture that groups have; None: real drones bring their
                    own
    safety        : limits that differ from those that follow from the scenario
    stop_for_lost : whether the rule of silence stops a drone, whatever the scenario says; None: it
                    does, and with as_simulated only where the scenario says so

    Raises CardError where the scenario has no walls, where neighbours are seen instead of heard, or
    where its law or its topology is not in the package.
    """
    _check_flyable(scenario)
    limits = replace(default_safety(scenario), **(safety or {}))
    low, high = arena.heights_of(scenario.world) if scenario.dimensions == 3 else (0.0, 0.0)
    height = max(DEFAULT_HEIGHT, limits.base - low) if height is None else height
    top = limits.base + limits.layer * (len(members) - 1)
    stands = scenario.stands()
    # A radio that keeps packets lets the newest count until the next; all others let each count
    # once.
    held = not scenario.radio.rule.keeps_packets
    stop_for_lost = not as_simulated or scenario.silence.rule == "stop" if stop_for_lost is None else stop_for_lost
    silence = with_defaults(
        scenario.silence, _preferred_speed(scenario), scenario.radio.delay, "stop" if stop_for_lost else "fly_on"
    )
    return {
        "airflock_card": CARD_VERSION,
        "name": scenario.name,
        "mission": mission,
        "expires": expires,
        "site": dict(zip(("latitude", "longitude", "altitude"), site, strict=True)),
        "members": list(members),
        "operator": operator.hex(),
        "autopilot": autopilot,
        "law": {"kind": scenario.model.name, **to_json_table(scenario.parameters)},
        "body": {"kind": scenario.body.rule.name, **_with_dead_time(scenario.body.numbers)},
        "own": _member_differences(scenario, agent_records(scenario, len(members), seed)),
        **_group_numbers(scenario, len(members)),
        "world": to_json_table(replace(scenario.world, latitude=None, longitude=None)),  # the site says where it is
        "shapes": {"shapes": stands.shapes.tolist(), "nodes": stands.nodes.tolist(), "links": stands.links.tolist()},
        "radio": {
            "delay": scenario.radio.delay,
            "extrapolate": not as_simulated or scenario.radio.rule.carry is forward,
            "forget": 5.0,
            **({"once": held, "any_stamp": True} if as_simulated else {}),
        },
        "silence": to_json_table(silence),
        **({"topology": to_json_table(scenario.topology.numbers)} if scenario.topology.rule is not None else {}),
        **({"steer": to_json_table(scenario.resolved_steer())} if scenario.steers else {}),
        "safety": _with_dead_time(limits),
        "fence": {
            "corners": fence_corners(scenario.world, margin),
            "low": min(2.0, 0.5 * limits.base),
            "high": max(height + high, top) + FENCE_HEADROOM,
        },
        "height": height,
        "period": scenario.sensors.period or scenario.flight.dt,
        "seed": 0,
    }


MOST_OFFSET = 100.0  # m; our choice: a site that is typed to 3 decimals is at most 80 m off
EXACT = 1.0  # m; nearer, a site is as exact as it is typed


def site_notes(scenario: Scenario, site: tuple[float, float, float], *, move_field: bool = False) -> list[str]:
    """Return a note where a site is not the place of a scenario's map: its outline moves there.

    move_field : fly the outline at any site
    Raises CardError where they are farther than MOST_OFFSET apart.
    """
    latitude, longitude = scenario.world.latitude, scenario.world.longitude
    if latitude is None or longitude is None:
        return []
    here = FlightSite(*site)
    apart = math.hypot(*here.local(latitude, longitude, 0.0)[:2])
    if apart <= EXACT:
        return []
    far = f"{apart / 1000.0:.3g} km" if apart >= 1000.0 else f"{apart:.3g} m"
    place = f"--site {site[0]:g},{site[1]:g} is {far} from the field's map, {latitude:.7f},{longitude:.7f}"
    if apart <= MOST_OFFSET or move_field:
        return [f"{place}: its outline is flown at the site, {far} from where it is on the map"]
    swapped = math.hypot(*here.local(longitude, latitude, 0.0)[:2]) <= max(MOST_OFFSET, 0.01 * apart)
    hint = "; latitude and longitude seem to be exchanged: a map file has longitude first, --site latitude"
    raise CardError(
        [
            f"{place}{hint if swapped else ''}; give the site of the map, the map of the site, or --move-field to fly "
            "its outline at the site"
        ]
    )


def omission_notes(scenario: Scenario) -> list[str]:
    """Return one line for each part of a scenario that no card holds: real drones bring their own."""
    kinds = ", ".join(dict.fromkeys(entry.fault.name for entry in scenario.faults))
    spread = ", ".join(dict.fromkeys(key for group in scenario.groups for _, key in group.spread))
    said = {"faults": kinds, "tolerances of groups": spread}
    return [f"the card leaves off the scenario's {what}: {names}" for what, names in said.items() if names]


def deviation_notes(scenario: Scenario, safety: SafetyLimits, members: int) -> list[str]:
    """Return one line for each part of a card that the scenario did not fly: its scores do not cover it."""
    notes = []
    if members != scenario.agents:
        notes.append(
            f"the card is for {members} drones, the scenario flies {scenario.agents}: scores and certificates of it do "
            f"not speak of {members}"
        )
    likely = default_safety(scenario)
    times = [(name, "s is shorter", getattr(likely, name) - getattr(safety, name)) for name in ("response", "delay")]
    rates = [(name, "m/s^2 is more", getattr(safety, name) - likely.accel) for name in ("accel", "brake")]
    for name, what, excess in times + rates:
        if excess > 0.0:
            usual = getattr(likely, "accel" if name == "brake" else name)
            notes.append(
                f"{name} = {getattr(safety, name):g} {what} than what the scenario gives a card, {usual:g} "
                f"{what.split()[0]}: distances to stop come out too short, unless the drones are as quick"
            )
    return notes


def _with_dead_time(record: BodyParameters | SafetyLimits) -> dict[str, Any]:
    """Return a record as a table; without a dead time it has the hash that it had before there was one."""
    table = to_json_table(record)
    return table if record.delay else {key: value for key, value in table.items() if key != "delay"}


def _check_flyable(scenario: Scenario) -> None:
    """Raise CardError where a scenario has a part that no card can hold."""
    fault = ""
    ours = {law.decide for law in LAWS.values()}
    others = [law.model.name for law in scenario.laws if law.model.decide not in ours]
    if scenario.world.arena == "none":
        fault = "world.arena = 'none': a card needs walls, and a fence around them"
    elif scenario.own_topology is not None:
        fault = f"the topology {scenario.own_topology.name} is not in the package; a card names ours"
    elif scenario.radio.rule.see is not None:
        fault = (
            f"radio.kind = {scenario.radio.rule.name!r}: nodes hear each other by radio; "
            "set radio.kind = 'constant' or another one by which they send"
        )
    elif others:
        fault = f"the law {others[0]} is not in the package; a card names laws only"
    if fault:
        raise CardError([f"{scenario.name}: {fault}"])


def _member_differences(scenario: Scenario, records: Sequence[tuple[Any, Any]]) -> list[dict[str, Any]]:
    """Return the numbers of law and body in which each member differs; empty where all are equal."""
    base = {"law": to_json_table(scenario.parameters), "body": to_json_table(scenario.body.numbers)}
    if not scenario.varied and len(scenario.laws) == 1:
        return []
    rows = [
        {
            part: {k: v for k, v in to_json_table(record).items() if v != base[part].get(k)}
            for part, record in zip(base, own, strict=True)
        }
        for own in records
    ]
    for agent, ((p, _), row) in enumerate(zip(records, rows, strict=True)):
        law = scenario.law_of(agent).model
        if law.name != scenario.model.name:
            row["law"] = {"kind": law.name, **to_json_table(p)}
    return rows


def _group_numbers(scenario: Scenario, count: int) -> dict[str, list[int]]:
    """Return the number of each member's group, where a law needs it."""
    needed = scenario.groups and any(law.uses_groups for law in scenario.laws)
    return {"groups": list(scenario.group_indices[:count])} if needed else {}


def default_safety(scenario: Scenario) -> SafetyLimits:
    """Return the limits that follow from a scenario: 1.5 times the preferred speed, as agile as its body."""
    usual, body = Multirotor(), scenario.body.numbers
    accel = min(getattr(body, "a_max", usual.a_max), 50.0)
    # Until an acceleration that grows by a jerk is there, half of the time is as good as lost.
    ramp = 0.5 * accel / body.jerk if hasattr(body, "jerk") else 0.0
    return SafetyLimits(
        speed_max=min(1.5 * _preferred_speed(scenario), 60.0),
        accel=accel,
        response=getattr(body, "tau", usual.tau),
        delay=min(body.delay + ramp, 10.0),
        brake=min(SafetyLimits.brake, accel),
        mission_time=min(max(scenario.flight.duration, 1.0), 36000.0),
    )


def _preferred_speed(scenario: Scenario) -> float:
    preferred = scenario.model.preferred_speed
    return float(preferred(scenario.parameters)) if preferred else 4.0


def fence_corners(world: arena.Parameters, margin: float) -> list[list[float]]:
    """Return the corners of a fence around an arena, margin (m) outside its walls."""
    if world.arena == "circle":
        # The sides of the polygon, not its corners, must clear the circle.
        reach = (world.radius + margin) / math.cos(math.pi / CIRCLE_SIDES)
        angles = [2.0 * math.pi * k / CIRCLE_SIDES for k in range(CIRCLE_SIDES)]
        return [[reach * math.cos(a), reach * math.sin(a)] for a in angles]
    if world.arena == "polygon":
        wider = Polygon(world.corners).buffer(margin, join_style="mitre")
        return [[x, y] for x, y in wider.exterior.coords[:-1]]
    h = 0.5 * world.side
    ring = [(-h, -h), (h, -h), (h, h), (-h, h)]
    sides = [inward_plane(a, b) for a, b in zip(ring, [*ring[1:], ring[0]], strict=True)]
    corners = []
    for one, two in zip([sides[-1], *sides[:-1]], sides, strict=True):  # each corner moves with its two sides
        # The corner is the intersection of the two sides after both have moved outwards by the
        # margin.
        a, b, _, d = one
        p, q, _, e = two
        det = a * q - b * p
        d, e = d + margin, e + margin
        corners.append([(b * e - q * d) / det, (p * d - a * e) / det])
    return corners


def to_json_table(record: Parameters) -> dict[str, Any]:
    """Return a record as a table for JSON, without numbers that were left to the scenario."""
    return {key: _listed(value) for key, value in asdict(record).items() if value is not None}


def _listed(value: Any) -> Any:
    return [_listed(v) for v in value] if isinstance(value, (list, tuple)) else value
