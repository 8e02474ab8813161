"""Bytes that two small fleets in lock-step send: one in the air with faults, one from the ground by an operator."""

import hashlib
from typing import Any

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from airflock.drones.mavlink.orders import OrderKind
from airflock.fleets import compare
from airflock.fleets.drone_faults import InjectedFault
from airflock.fleets.lockstep import LockstepFleet
from fleets import card, scenario

PRIVATE = bytes(range(32))
PUBLIC = Ed25519PrivateKey.from_private_bytes(PRIVATE).public_key().public_bytes_raw()
FIRST = 200  # datagrams that are recorded in full
FAULTS = (
    InjectedFault("loss", (2,), 2.0, 12.0, 0.3),
    InjectedFault("jitter", (3,), 0.0, 15.0, 0.5),
    InjectedFault("duplicate", (4,), 0.0, 20.0, 0.5),
    InjectedFault("corrupt", (1,), 5.0, 15.0, 0.2),
    InjectedFault("outage", (4,), 10.0, 14.0),
    InjectedFault("partition", (1, 2), 16.0, 18.0),
    InjectedFault("rogue", (2,), 6.0, 9.0, 30.0),
    InjectedFault("impostor", (3,), 8.0, 10.0, 30.0),
    InjectedFault("clock", (2,), amount=0.02),
    InjectedFault("node", (1,), 19.0, 21.0),
    InjectedFault("gnss", (4,), 20.0, 22.0),
    InjectedFault("battery", (3,), 22.0, 23.0, 5.0),
)


class Tap:
    """Digests of what passes: per kind of message (its MAVLink number) and sender, and the first datagrams in full."""

    def __init__(self) -> None:
        self.first: list[str] = []
        self.digests: dict[str, Any] = {}
        self.counts: dict[str, int] = {}

    def __call__(self, where: str, data: bytes) -> None:
        """Take the bytes of one datagram, or of several frames one after another."""
        if where.startswith("sent") and len(self.first) < FIRST:
            self.first.append(data.hex())
        frame = data
        while len(frame) >= 12:
            size = 12 + frame[1] + 13 * (frame[2] & 1)  # header, checksum, payload, signature
            kind = f"message {int.from_bytes(frame[7:10], 'little')} of {frame[5]}"
            key = where if where.startswith("delivered") else f"{where}: {kind}"  # some arrive with a wrong bit
            self.digests.setdefault(key, hashlib.sha256()).update(frame[:size])
            self.counts[key] = self.counts.get(key, 0) + 1
            frame = frame[size:]

    def data(self) -> dict[str, Any]:
        """Return the plain data."""
        streams = {
            key: {"frames": self.counts[key], "sha256": d.hexdigest()} for key, d in sorted(self.digests.items())
        }
        return {"streams": streams, "first": self.first}


def _tapped(fleet: Any) -> Tap:
    """Listen to the ether of a fleet, and to the wires between its nodes and vehicles."""
    tap, send, deliver = Tap(), fleet.channel.send, fleet.channel.deliver

    def sending(now: float, who: int, datagram: bytes, *rest: Any) -> None:
        tap("sent", datagram)
        send(now, who, datagram, *rest)

    def delivering(*arguments: Any) -> Any:
        for to, datagram in deliver(*arguments):
            tap(f"delivered to {to + 1}", datagram)
            yield to, datagram

    fleet.channel.send, fleet.channel.deliver = sending, delivering
    for vehicle in fleet.vehicles:

        def receiving(data: bytes, now: float, receive: Any = vehicle.receive) -> Any:
            tap("to the autopilot", data)
            return receive(data, now)

        def telling(now: float, telemetry: Any = vehicle.due_telemetry) -> Any:
            data = telemetry(now)
            tap("from the autopilot", data)
            return data

        vehicle.receive, vehicle.due_telemetry = receiving, telling
    return tap


def _ending(fleet: Any, tap: Tap) -> dict[str, Any]:
    notes = [f"{now:.2f} {who} {note}" for now, who, note in fleet.log]
    return tap.data() | {"flown": fleet.digest(), "phases": [phase.name for phase in fleet.phases()], "notes": notes}


def _in_the_air() -> dict[str, Any]:
    """Four drones with sensor errors and faults of the ether, of nodes and of vehicles, for 25 s."""
    flown = compare.with_metric_period(scenario(4, 25.0, noisy=True), 0.2)
    made = compare.software_card(flown, operator=PUBLIC)
    fleet = LockstepFleet(flown, made, 3, start=compare.simulated_start(flown, 3), faults=FAULTS, operator=PRIVATE)
    tap = _tapped(fleet)
    fleet.advance(25.0)
    return _ending(fleet, tap)


def _from_the_ground() -> dict[str, Any]:
    """Three drones that start, hold, go on and return by the operator's orders, in 45 s."""
    flown = scenario(3)
    fleet = LockstepFleet(flown, card(flown, operator=PUBLIC), 5, operator=PRIVATE)
    tap, hear = _tapped(fleet), fleet.nodes[0].radio

    def order(do: Any, **more: Any) -> None:
        def ordered(data: bytes, now: float) -> Any:
            tap("ordered", data)
            return hear(data, now)

        fleet.nodes[0].radio = ordered
        fleet.order(do, **more)
        fleet.nodes[0].radio = hear

    fleet.advance(5.0)
    order(OrderKind.START, at=6.0)
    fleet.advance(22.0)
    order(OrderKind.HOLD)
    fleet.advance(5.0)
    order(OrderKind.RETURN, target=2, at=34.0)
    fleet.advance(13.0)
    return _ending(fleet, tap)


def take() -> dict[str, Any]:
    """Return digests of the messages of both fleets and their first datagrams."""
    return {"in the air": _in_the_air(), "from the ground": _from_the_ground()}
