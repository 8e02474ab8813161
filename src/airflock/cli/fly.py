"""Verb fly: prepare a mission on the ground, run a node, give orders, fly a log again."""

import math
import time
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer
from typer.core import TyperGroup

from airflock.cli import options, tables
from airflock.cli.verb import Verb
from airflock.errors import CardError, ScenarioError, gathering
from airflock.spelling import meant
from airflock.untrusted import is_file

DATAGRAM = 95  # bytes of a signed status packet
OVERHEAD = 64  # bytes of headers of the link; our choice, WiFi with UDP and IP has 64
PREAMBLE = 2e-4  # s of a packet before its first bit; WiFi's long preamble
KILL = "; the motors stop when kill --confirm follows within 5 s"
SHARE = 0.6  # of the channel's time that a flock may take; our choice: random access breaks down beyond
FAST_BITS, SLOW_BITS = 6e6, 250e3  # bit/s: WiFi's multicast rate as it should be set; IEEE 802.15.4


class Fly(TyperGroup):
    """Subcommands; anything else is a flight card, which is flown."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """A subcommand by its name; `card` for the name of a file."""
        if args and args[0] not in self.commands and (Path(args[0]).suffix or is_file(args[0])):
            args = ["card", *args]
        return super().resolve_command(ctx, args)


app = typer.Typer(
    cls=Fly, no_args_is_help=True, rich_markup_mode="rich",
    help="""Fly the same law on real drones: one card for all, a node beside each autopilot, orders from one operator.

    Example: airflock fly prepare vasarhelyi_2018/real_4ms --site 47.50,19.04,120 --members 1-10,
    then on each drone airflock fly mission.json --member 3 --autopilot udp:127.0.0.1:14540 --radio ...
    """,
)  # fmt: skip


@app.command(
    "card", context_settings={"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []}
)
def card(ctx: typer.Context) -> None:
    """Run a node: the same as python -m airflock.onboard CARD ...; `airflock fly card --help` lists its options."""
    from airflock.onboard.run import main

    raise typer.Exit(main(ctx.args))


@app.command("prepare", cls=Verb)
def prepare(
    scenario: options.Where,
    site: Annotated[
        str, typer.Option(metavar="LAT,LON,ALT", help="Centre of the arena on the ground; ALT above sea level, m.")
    ],
    members: Annotated[str, typer.Option(metavar="1-10", help="System ids of the drones, such as 1-10 or 1,2,5.")],
    changes: options.Set = None,
    trust: options.Trust = False,
    autopilot: Annotated[str, typer.Option(help="px4 or ardupilot.")] = "px4",
    height: Annotated[
        float | None, typer.Option(help="Height of the flock, m above the site.", show_default="20")
    ] = None,
    margin: Annotated[float, typer.Option(min=0.0, help="Distance of the fence outside the law's walls, m.")] = 30.0,
    hours: Annotated[float, typer.Option(min=0.1, max=168.0, help="How long card and key stay valid, h.")] = 12.0,
    limits: Annotated[
        list[str] | None, typer.Option("--limit", metavar="KEY=VALUE", help="Change a limit, for instance brake=2.")
    ] = None,
    fast_bits: Annotated[float, typer.Option(min=100.0, help="Bits per second of the fast radio.")] = FAST_BITS,
    slow_bits: Annotated[float, typer.Option(min=100.0, help="Bits per second of the slow radio.")] = SLOW_BITS,
    out: Annotated[Path, typer.Option(metavar="FILE.json", help="The card; keys are written beside it.")] = Path(
        "mission.json"
    ),
    as_json: options.Json = False,
) -> None:
    """Write the flight card, the mission's key and the operator's key.

    Card and mission.key go to every drone; mission.operator stays with the operator.

    Example: airflock fly prepare vasarhelyi_2018/real_4ms --site 47.50,19.04,120 --members 1-10 --out mission.json
    """
    import secrets

    from airflock.fleet.prepare import card_document
    from airflock.mavlink.orders import new_keys
    from airflock.onboard.card import card_of, hash_of
    from airflock.scenarios.files import load

    faults: list[str] = []
    where, systems = _site("--site", site, faults), _members(members, faults)
    with gathering(faults):
        options.writable((out, (".json",)))
    files = Files(out, out.with_suffix(".key"), out.with_suffix(".operator"))
    faults += [f"{path}: exists; a mission is never overwritten" for path in files if path.exists()]
    loaded = None
    with gathering(faults):
        loaded = load(scenario, options.settings(changes), trust=trust)
    safety = _limits(limits, faults)
    private, public = new_keys()
    document: dict[str, Any] = {}
    if loaded is not None:
        with gathering(faults):
            document = card_document(
                loaded, site=where, members=systems, mission=1 + secrets.randbelow(2**32 - 1),
                expires=int(time.time() + 3600.0 * hours), operator=public, autopilot=autopilot, height=height,
                margin=margin, safety=safety,
            )  # fmt: skip
            card_of({**document, "hash": hash_of(document)}, str(out))
    loads = airtimes(len(systems), document["safety"], fast_bits, slow_bits) if document else []
    faults += [each.fault(len(systems)) for each in loads if each.share > SHARE]
    if faults or loaded is None:
        raise CardError(faults)
    tables.say_notes(loaded.notes)
    card = _write_mission(files, document, private)
    if as_json:
        radio = {each.radio: each.share for each in loads}
        tables.emit_json({"card": str(out), "hash": card.hash, "members": list(card.members), "airtime": radio})
    else:
        _say_prepared(files, card, loads)


class Files(NamedTuple):
    """What a preparation writes: the card, the mission's key and the operator's key."""

    card: Path
    key: Path
    operator: Path


class Airtime(NamedTuple):
    """How much of a radio's time a flock takes.

    radio : fast or slow; limit : which of the card's limits sets its rate; share : of the time, 0 to 1
    """

    radio: str
    limit: str
    share: float

    def fault(self, count: int) -> str:
        """Why so many drones cannot use it, and what helps."""
        return (
            f"{self.radio} radio: {count} drones would take {self.share:.0%} of its time; at most {SHARE:.0%}: "
            f"lower the rate (--limit {self.limit}=...) or raise --{self.radio}-bits"
        )


def airtimes(count: int, safety: dict[str, Any], fast: float, slow: float) -> list[Airtime]:
    """What `count` drones take of the fast and the slow radio, from their rates in bit/s and the card's limits."""
    loads = []
    for radio, limit, bits in (("fast", "status_period", fast), ("slow", "slow_period", slow)):
        packet = PREAMBLE + 8.0 * (DATAGRAM + OVERHEAD) / bits
        loads.append(Airtime(radio, limit, count * packet / float(safety[limit])))
    return loads


def _limits(given: list[str] | None, faults: list[str]) -> dict[str, Any]:
    """Limits of the card that --limit changes; what is wrong is noted, and left out."""
    from airflock.core.parameters import declarations
    from airflock.onboard.safety import Safety

    known = [name for name, _, _ in declarations(Safety)]
    safety: dict[str, Any] = {}
    with gathering(faults):
        safety = options.settings(given)
    faults += [
        f"--limit {name}: is not a limit; {meant(name, known, ', '.join(known))}"
        for name in safety
        if name not in known
    ]
    return {name: value for name, value in safety.items() if name in known}


def _write_mission(files: Files, document: dict[str, Any], private: bytes) -> Any:
    """Write card and keys, all of them or none; private: the operator's key. The card that was written."""
    import secrets

    from airflock.mavlink.keys import write_key
    from airflock.onboard.card import write_card

    try:
        card = write_card(files.card, document)
        write_key(files.key, secrets.token_bytes(32))
        write_key(files.operator, private)
    except BaseException:  # a full disk, Ctrl-C: a card without its keys is of no use
        for path in files:
            path.unlink(missing_ok=True)
        raise
    return card


def _say_prepared(files: Files, card: Any, loads: list[Airtime]) -> None:
    """Say what was written, how high the drones may fly, and how autopilots have to be set."""
    tables.say(f"wrote {files.card} (hash {card.hash[:8]}), {files.key}, {files.operator}")
    top = card.layer(card.members[-1])
    tables.say(f"fence {card.low:g} to {card.high:g} m above the site; layers up to {top:g} m")
    for load in loads:
        tables.say(f"{load.radio} radio: {load.share:.0%} of its time, by an estimate from its bit rate")
    for guard in card.autopilot.guards:
        safe = "to the own system id" if guard.own else f"within [{guard.low:g}, {guard.high:g}]"
        why = guard.reason(card.safety.speed_max, card.safety.response)
        tables.say(f"set {guard.name} {safe}: {why}")


@app.command("order", cls=Verb)
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
    from airflock.mavlink import orders
    from airflock.mavlink.keys import read_key
    from airflock.mavlink.signing import Signer
    from airflock.onboard.card import read_card
    from airflock.onboard.ports import open_port

    faults: list[str] = []
    what = orders.Do.__members__.get("CONFIRM_KILL" if confirm and do == "kill" else do.upper())
    if what is None or do == "confirm_kill":
        faults.append(f"{do}: is not an order; give start, go, goto, hold, resume, return, land, kill or ping")
    if (do == "goto") != (point is not None):
        faults.append("--point LAT,LON,ALT belongs to goto, and goto needs it")
    where = _site("--point", point, faults) if point else (0.0, 0.0, 0.0)
    with gathering(faults):
        card = read_card(card_file)
        if target and target not in card.members:
            faults.append(f"--target {target}: the card's members are {', '.join(map(str, card.members))}")
        if point and not faults:
            options.refuse(_beyond(card, where, point))
    with gathering(faults):
        key, private = read_key(card_file.with_suffix(".key")), read_key(card_file.with_suffix(".operator"))
    options.refuse(faults)
    assert what is not None
    port = open_port(radio)
    try:
        utc = time.time_ns() // 1000
        place = (round(where[0] * 1e7), round(where[1] * 1e7), round(where[2] * 1e3))
        command = orders.Order(what, target, card.mission, utc, utc + round(delay * 1e6), place)
        message, sign = orders.message(command, private), Signer(key, orders.OPERATOR)
        for _ in range(5):
            if not port.write(sign(message, time.time_ns() // 1000)):
                raise CardError([f"{radio}: cannot send; does the port say where to send (>HOST:PORT)?"])
            time.sleep(0.1)
    finally:
        port.close()
    effect = KILL if what is orders.Do.KILL else ""
    tables.say(f"sent {what.name} to {f'drone {target}' if target else 'all'}{effect}")


@app.command("replay", cls=Verb)
def replay(
    card_file: Annotated[Path, typer.Argument(metavar="CARD", help="The flight card.", show_default=False)],
    log: Annotated[Path, typer.Argument(metavar="LOG", help="Log of a node.", show_default=False)],
    as_json: options.Json = False,
) -> None:
    """Fly the log of a node again: the same inputs must give the same outputs, to the bit.

    Example: airflock fly replay mission.json mission-3-20270115T101500Z.log
    """
    from airflock.mavlink.keys import read_key
    from airflock.onboard.card import read_card
    from airflock.onboard.log import read_log

    card, key = read_card(card_file), read_key(card_file.with_suffix(".key"))
    ticks, different, notes = 0, [], []
    for tick in read_log(log, card, key):
        ticks += 1
        notes += [(tick.time, note) for note in tick.out.notes]
        if not tick.same:
            different.append(tick.time)
    if as_json:
        tables.emit_json({"ticks": ticks, "different": different, "notes": notes})
    else:
        for at, note in notes:
            tables.say(f"{at:10.2f} s  {note}")
        tables.say(f"{ticks} ticks, {len(different)} with another output than was logged")
    if different:
        raise ScenarioError(
            [f"{log}: {len(different)} of {ticks} ticks differ when flown again, first at {different[0]:g} s"]
        )


def _beyond(card: Any, where: tuple[float, float, float], point: str) -> list[str]:
    """What no drone would obey: a point outside the card's fence, which they refuse, each by itself."""
    x, y, z = card.site.local(*where)
    if not card.low <= z <= card.high:
        return [
            f"--point {point}: lies {z:.4g} m above the site; the fence reaches from {card.low:g} to {card.high:g} m "
            f"(ALT is above sea level, the site's is {where[2] - z:g} m)"
        ]
    far = card.fence.outside(x, y)
    return [f"--point {point}: lies {far:.4g} m outside of the fence"] if far > 0.0 else []


def _site(option: str, text: str, faults: list[str]) -> tuple[float, float, float]:
    try:
        latitude, longitude, altitude = (float(part) for part in text.split(","))
        if not math.isfinite(latitude + longitude + altitude):
            raise ValueError
    except ValueError:
        faults.append(f"{option} {text}: is not LAT,LON,ALT, for instance 47.50,19.04,120")
        return 0.0, 0.0, 0.0
    return latitude, longitude, altitude


def _members(text: str, faults: list[str]) -> list[int]:
    members: list[int] = []
    for part in text.split(","):
        first, dash, last = part.partition("-")
        last = last if dash else first
        if not (first.isdigit() and last.isdigit() and 0 <= int(last) - int(first) <= 250):
            faults.append(f"--members {text}: write 1-10 or 1,2,5")
            return [1]
        members += range(int(first), int(last) + 1)
    return members
