"""How the drones of a fleet in software begin: keys, vehicles on the ground or in the air, orders of an operator."""

import hashlib
from functools import partial
from pathlib import Path
from typing import Any

from airflock.core.agent import State
from airflock.core.parameters import number_names
from airflock.drones.mavlink import orders
from airflock.drones.mavlink.keys import read_key, write_key
from airflock.drones.mavlink.orders import Do, Order
from airflock.drones.mavlink.signing import Signer
from airflock.drones.onboard.card import Card, write_card
from airflock.fleets.dice import OuterNoise
from airflock.fleets.modes import OURS
from airflock.fleets.vehicle import Vehicle
from airflock.scenarios.scenario import Scenario
from airflock.support.coordinates import Geodetic
from airflock.support.errors import CardError

KEY = hashlib.sha256(b"a fleet in software has no secret").digest()
READY_TIME = 12.0  # s on the ground before a start is ordered
DROPS_OUT = "drops out by a fault: node and motors are off"
SINCE = 60_000_000  # µs; packets sent so long before a node began are accepted, for its clock may be wrong


def vehicle_of(scenario: Scenario, card: Card, place: int, body: Any, noise: OuterNoise, started: int) -> Vehicle:
    """A vehicle on the ground; grounds are a square of places 4 m apart.

    place : among the members; body: numbers of its own; started: Unix time of its time 0, µs
    """
    side = max(1, round(len(card.members) ** 0.5))
    at = (4.0 * (place % side) - 2.0 * (side - 1), 4.0 * (place // side) - 2.0 * (side - 1), 0.0)
    noisy = "noise" in number_names(body) and body.noise > 0.0
    draw = partial(noise, drone=place) if noisy else lambda step: (0.0, 0.0, 0.0)
    made = Vehicle(card.autopilot.name, card.members[place], card.site, at, scenario.vehicle, body, draw, started)
    made.place = place
    return made


def write_for_watching(path: Path, card: Card) -> None:
    """Write the card of a fleet in software, and its key beside it, so that `airflock watch` shows the fleet.

    Over such files of an earlier fleet in software only: raises CardError where a mission's own would be lost.
    """
    key = path.with_suffix(".key")
    if key.exists() and read_key(key) != KEY:
        raise CardError([f"{key}: exists and is of a real mission; give another name with --card"])
    if path.exists() and not key.exists():
        raise CardError([f"{path}: exists without a key of a fleet in software; give another name with --card"])
    write_card(path, card.document)
    if not key.exists():
        write_key(key, KEY)


def lift_of(card: Card) -> float:
    """Height (m) above the site at which the law counts zero."""
    return -card.law_state(State(*(0.0,) * 6)).z


def clear(card: Card, here: tuple[float, float, float], there: tuple[float, float, float]) -> bool:
    """Whether nothing stands between two places of vehicles, m."""
    a, b = (card.law_state(State(*place, 0.0, 0.0, 0.0)) for place in (here, there))
    return not card.place.blocked(*a[:3], *b[:3])


def in_the_air(vehicle: Vehicle, card: Card, start: State) -> None:
    """Put a vehicle in the air, where it obeys its node as if it had for long."""
    vehicle.state = start._replace(z=start.z + (card.height if card.flat else lift_of(card)))
    vehicle.armed, vehicle.mode, vehicle.target_at, vehicle.first_at = True, OURS, 0.0, -9.0


class Station:
    """An operator of a fleet in software: signs orders.

    card : of the fleet; private: key of the operator
    """

    def __init__(self, card: Card, private: bytes):
        self._card, self._private, self._sign, self._given = card, private, Signer(KEY, orders.OPERATOR), 0

    def order(self, do: Do, utc: int, *, target: int = 0, at: int = 0, point: Geodetic | None = None) -> bytes:
        """Datagram of an order given at utc for a time `at`, µs of Unix time; no two are given at one time."""
        self._given = max(utc, self._given + 1)
        p = point or Geodetic(0.0, 0.0, 0.0)
        place = (round(p.latitude * 1e7), round(p.longitude * 1e7), round(p.altitude * 1e3))
        given = Order(do, target, self._card.mission, self._given, at, place)
        return self._sign(orders.message(given, self._private), self._given)
