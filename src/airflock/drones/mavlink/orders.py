"""Orders of the operator, signed with a key of their own, so that no drone, captured or not, can give one.

An order is a TUNNEL message: 35 bytes of content and an Ed25519 signature of 64. It travels inside
a frame that is signed like all others. The content holds a magic word, version, kind of order,
target (0: all), the mission, the time at which the order was given, the time for which it is, and a
point in degrees and millimetres.
"""

import struct
from enum import IntEnum
from typing import Any, NamedTuple

from airflock.drones.mavlink.frames import common_dialect
from airflock.support import LinkError

TUNNEL_MESSAGE = 385  # TUNNEL
OPERATOR_SYSTEM = 255  # system id of the operator's station
ORDER_FORMAT = struct.Struct("<2sBBBIQQiii")
ORDER_MAGIC, ORDER_VERSION = b"AF", 1
SEAL_LENGTH = 64  # bytes of an Ed25519 signature


class OrderKind(IntEnum):
    """Kinds of orders."""

    START = 1  # arm and take off, at the time that the order is for
    GO = 2  # flock now, without waiting for those who are missing
    GOTO = 3  # make for a point, with the law on
    HOLD = 4
    RESUME = 5
    RETURN = 6
    LAND = 7
    KILL = 8  # first step: nothing happens
    CONFIRM_KILL = 9  # second step within 5 s: motors off
    PING = 10  # the operator is there


CALL_OFF_ORDERS = frozenset(
    {OrderKind.HOLD, OrderKind.RETURN, OrderKind.LAND}
)  # they end what is flown, and call off a start not yet followed


class OperatorOrder(NamedTuple):
    """One order.

    target   : system id, 0 for all
    mission  : number of the mission
    given_at : time at which it was given, µs of Unix time
    at       : time at which it is to be done, µs of Unix time
    point    : latitude and longitude in 1e-7 degrees, altitude in mm; only for GOTO
    """

    kind: OrderKind
    target: int
    mission: int
    given_at: int
    at: int = 0
    point: tuple[int, int, int] = (0, 0, 0)


def order_bytes(order: OperatorOrder) -> bytes:
    """Return the bytes that are signed."""
    return ORDER_FORMAT.pack(
        ORDER_MAGIC, ORDER_VERSION, int(order.kind), order.target, order.mission, order.given_at, order.at, *order.point
    )  # fmt: skip


def new_operator_keys() -> tuple[bytes, bytes]:
    """Return a new private and public key, 32 bytes each."""
    private = _ed25519().Ed25519PrivateKey.generate()
    return private.private_bytes_raw(), private.public_key().public_bytes_raw()


def order_message(order: OperatorOrder, private_key: bytes) -> Any:
    """Return the dialect's message of an order, signed with the operator's private key."""
    data = order_bytes(order)
    sealed = data + _ed25519().Ed25519PrivateKey.from_private_bytes(private_key).sign(data)
    padded = list(sealed.ljust(128, b"\0"))
    return common_dialect().MAVLink_tunnel_message(order.target, 0, 0, len(sealed), padded)


def parse_order(values: dict[str, Any], public_key: bytes) -> OperatorOrder | None:
    """Return the order in the fields of a message; None if it is no order or the operator did not sign it.

    Raises LinkError where the library that checks signatures is not installed.
    """
    data = bytes(values["payload"])[: values["payload_length"]]
    if len(data) != ORDER_FORMAT.size + SEAL_LENGTH or values["payload_type"] != 0:
        return None
    magic, version, do, target, mission, given, at, *point = ORDER_FORMAT.unpack(data[: ORDER_FORMAT.size])
    if magic != ORDER_MAGIC or version != ORDER_VERSION or do not in OrderKind.__members__.values():
        return None
    keys = _ed25519()
    try:
        keys.Ed25519PublicKey.from_public_bytes(public_key).verify(data[ORDER_FORMAT.size :], data[: ORDER_FORMAT.size])
    except (keys.InvalidSignature, ValueError):
        return None
    return OperatorOrder(OrderKind(do), target, mission, given, at, (point[0], point[1], point[2]))


class _KeyClasses(NamedTuple):
    Ed25519PrivateKey: Any
    Ed25519PublicKey: Any
    InvalidSignature: Any


def _ed25519() -> _KeyClasses:
    """Import the classes of the keys when a signature is first made or checked: the import is slow."""
    try:
        from cryptography.exceptions import InvalidSignature
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
    except ImportError as error:
        raise LinkError("orders of the operator need cryptography: pip install 'airflock[fly]'") from error
    return _KeyClasses(Ed25519PrivateKey, Ed25519PublicKey, InvalidSignature)
