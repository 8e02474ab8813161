"""How the drones of a fleet in software begin: keys, vehicles on the ground or in the air, orders of an operator."""

import hashlib
from functools import partial
from pathlib import Path
from typing import Any

from airflock.core import State, number_names
from airflock.drones import FlightCard, OperatorOrder, OrderKind, PacketSigner, orders, read_key, write_card, write_key
from airflock.fleets.dice import MotionNoise
from airflock.fleets.modes import GUIDED
from airflock.fleets.vehicle import SoftwareVehicle
from airflock.scenarios import Scenario
from airflock.support import CardError, Geodetic

SOFTWARE_KEY = hashlib.sha256(b"a fleet in software has no secret").digest()
SECONDS_BEFORE_START = 12.0  # s on the ground before a start is ordered
DROPS_OUT_NOTE = "drops out by a fault: node and motors are off"
ACCEPTED_BEFORE_START = (
    60_000_000  # µs; packets sent so long before a node began are accepted, for its clock may be wrong
)


def make_vehicle(
    scenario: Scenario, card: FlightCard, index: int, body: Any, noise: MotionNoise, started: int
) -> SoftwareVehicle:
    """A vehicle on the ground; grounds are a square of places 4 m apart.

    place : among the members; body: numbers of its own; started: Unix time of its time 0, µs
    """
    side = max(1, round(len(card.members) ** 0.5))
    at = (4.0 * (index % side) - 2.0 * (side - 1), 4.0 * (index // side) - 2.0 * (side - 1), 0.0)
    noisy = "noise" in number_names(body) and body.noise > 0.0
    draw = partial(noise, drone=index) if noisy else lambda step: (0.0, 0.0, 0.0)
    made = SoftwareVehicle(
        card.autopilot.name, card.members[index], card.site, at, scenario.vehicle, body, draw, started
    )
    made.place = index
    return made


def write_card_and_key(path: Path, card: FlightCard) -> None:
    """Write the card of a fleet in software, and its key beside it, so that `airflock watch` shows the fleet.

    Over such files of an earlier fleet in software only: raises CardError where a mission's own would be lost.
    """
    key = path.with_suffix(".key")
    if key.exists() and read_key(key) != SOFTWARE_KEY:
        raise CardError([f"{key}: exists and is of a real mission; give another name with --card"])
    if path.exists() and not key.exists():
        raise CardError([f"{path}: exists without a key of a fleet in software; give another name with --card"])
    write_card(path, card.document)
    if not key.exists():
        write_key(key, SOFTWARE_KEY)


def law_zero_height(card: FlightCard) -> float:
    """Height (m) above the site at which the law counts zero."""
    return -card.law_state(State(*(0.0,) * 6)).z


def is_clear_between(card: FlightCard, here: tuple[float, float, float], there: tuple[float, float, float]) -> bool:
    """Whether nothing stands between two places of vehicles, m."""
    a, b = (card.law_state(State(*place, 0.0, 0.0, 0.0)) for place in (here, there))
    return not card.place.is_blocked(*a[:3], *b[:3])


def put_in_air(vehicle: SoftwareVehicle, card: FlightCard, start: State) -> None:
    """Put a vehicle in the air, where it obeys its node as if it had for long."""
    vehicle.state = start._replace(z=start.z + (card.height if card.flat else law_zero_height(card)))
    vehicle.armed, vehicle.mode, vehicle.setpoint_at, vehicle.stream_since = True, GUIDED, 0.0, -9.0


class OperatorStation:
    """An operator of a fleet in software: signs orders.

    card : of the fleet; private: key of the operator
    """

    def __init__(self, card: FlightCard, private: bytes):
        self._card, self._private, self._sign, self._last_order_time = (
            card,
            private,
            PacketSigner(SOFTWARE_KEY, orders.OPERATOR_SYSTEM),
            0,
        )

    def order(self, do: OrderKind, utc: int, *, target: int = 0, at: int = 0, point: Geodetic | None = None) -> bytes:
        """Datagram of an order given at utc for a time `at`, µs of Unix time; no two are given at one time."""
        self._last_order_time = max(utc, self._last_order_time + 1)
        p = point or Geodetic(0.0, 0.0, 0.0)
        place = (round(p.latitude * 1e7), round(p.longitude * 1e7), round(p.altitude * 1e3))
        given = OperatorOrder(do, target, self._card.mission, self._last_order_time, at, place)
        return self._sign(orders.order_message(given, self._private), self._last_order_time)
