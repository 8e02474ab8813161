"""Verb fly order: what the operator tells the drones."""

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli import options, tables
from airflock.support import CardError, ErrorCollector

KILL_NOTE = "; the motors stop when kill --confirm follows within 5 s"


def order(
    card_file: Annotated[Path, typer.Argument(metavar="CARD", help="The flight card.", show_default=False)],
    do: Annotated[
        str, typer.Argument(metavar="ORDER", help="start, go, goto, hold, resume, return, land, kill or ping.")
    ],
    radio: Annotated[str, typer.Option(metavar="PORT", help="udp:HOST:PORT>HOST:PORT or serial:/dev/NAME:BAUD")],
    target: Annotated[int, typer.Option(min=0, max=250, help="System id; 0 for all.")] = 0,
    delay: Annotated[float, typer.Option("--in", min=0.0, max=60.0, help="Delay of a start, s.")] = 3.0,
    point: Annotated[
        str | None, typer.Option(metavar="LAT,LON,ALT", help="Where to go, for goto; ALT above sea level, m.")
    ] = None,
    confirm: Annotated[bool, typer.Option("--confirm", help="Second step of a kill, within 5 s of the first.")] = False,
) -> None:
    """Send an order, signed with the operator's key beside the card. It is sent five times; each drone obeys it once.

    Example: airflock fly order mission.json start --radio 'udp:0.0.0.0:14601>192.168.1.255:14600'
    """
    from airflock.drones import PacketSigner, check_port, orders, read_card, read_key

    asked = ErrorCollector()
    what = orders.OrderKind.__members__.get("CONFIRM_KILL" if confirm and do == "kill" else do.upper())
    if what is None or do == "confirm_kill":
        asked.note(f"{do}: is not an order; give start, go, goto, hold, resume, return, land, kill or ping")
    if (do == "goto") != (point is not None):
        asked.note("--point LAT,LON,ALT belongs to goto, and goto needs it")
    where = asked.read(options.parse_position, "--point", point) if point else (0.0, 0.0, 0.0)
    card = asked.read(read_card, card_file)
    asked.read(_check_target, card, target)
    if point:
        asked.read(_check_inside_fence, card, where, point)
    key = asked.read(read_key, card_file.with_suffix(".key"))
    private = asked.read(read_key, card_file.with_suffix(".operator"))
    asked.read(check_port, radio)
    asked.raise_errors()
    assert what is not None
    utc = time.time_ns() // 1000
    place = (round(where[0] * 1e7), round(where[1] * 1e7), round(where[2] * 1e3))
    command = orders.OperatorOrder(what, target, card.mission, utc, utc + round(delay * 1e6), place)
    _send(radio, orders.order_message(command, private), PacketSigner(key, orders.OPERATOR_SYSTEM))
    effect = KILL_NOTE if what is orders.OrderKind.KILL else ""
    tables.print_message(f"sent {what.name} to {f'drone {target}' if target else 'all'}{effect}")


def _send(radio: str, message: Any, sign: Any) -> None:
    """Send an order five times; raises CardError where the port cannot."""
    from airflock.drones import open_port

    port = open_port(radio)
    try:
        for _ in range(5):
            if not port.write(sign(message, time.time_ns() // 1000)):
                raise CardError([f"{radio}: cannot send; does the port say where to send (>HOST:PORT)?"])
            time.sleep(0.1)
    finally:
        port.close()


def _check_target(card: Any, target: int) -> None:
    """Refuse a drone that is no member of the mission."""
    if target and target not in card.members:
        raise CardError([f"--target {target}: the card's members are {', '.join(map(str, card.members))}"])


def _check_inside_fence(card: Any, option: tuple[float, float, float], point: str) -> None:
    """Refuse what no drone would obey: a point outside the card's fence, which they refuse, each by itself."""
    x, y, z = card.site.local(*option)
    if not card.low <= z <= card.high:
        line = (
            f"--point {point}: lies {z:.4g} m above the site; the fence reaches from {card.low:g} to {card.high:g} m "
            f"(ALT is above sea level, the site's is {option[2] - z:g} m)"
        )
        raise CardError([line])
    far = card.fence.outside(x, y)
    if far > 0.0:
        raise CardError([f"--point {point}: lies {far:.4g} m outside of the fence"])
