"""Verb fly prepare: the flight card of a mission, and its keys."""

import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from airflock.cli import options, tables
from airflock.support import INVALID, CardError, ErrorCollector, suggest, value_or_default

DATAGRAM_BYTES = 95  # bytes of a signed status packet
OVERHEAD_BYTES = 64  # bytes of headers of the link; our choice, WiFi with UDP and IP has 64
PREAMBLE_SECONDS = 2e-4  # s of a packet before its first bit; WiFi's long preamble
DEFAULT_SITE = (0.0, 0.0, 0.0)
MAX_AIRTIME_SHARE = 0.6  # of the channel's time that a flock may take; our choice: random access breaks down beyond
FAST_BITS, SLOW_BITS = 6e6, 250e3  # bit/s: WiFi's multicast rate as it should be set; IEEE 802.15.4


def prepare(
    ctx: typer.Context,
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

    from airflock.drones import card_hash, new_operator_keys, parse_card
    from airflock.fleets import DEFAULT_FENCE_MARGIN, deviation_notes, make_card_document, omission_notes

    asked = options.collect_option_errors(ctx)
    where, systems = asked.read(options.parse_position, "--site", site), asked.read(_members, members)
    asked.read(options.check_writable, (out, (".json",)))
    files = MissionFiles(out, out.with_suffix(".key"), out.with_suffix(".operator"))
    asked.note(*(f"{path}: exists; a mission is never overwritten" for path in files if path.exists()))
    loaded = options.collect_scenario(asked, scenario, asked.read(options.parse_settings, changes), trust=trust)
    safety = _limits(limits, loaded, asked)
    private, public = new_operator_keys()

    def card_for(scenario: Any) -> dict[str, Any]:
        made = make_card_document(
            scenario,
            site=value_or_default(where, DEFAULT_SITE),
            members=value_or_default(systems, [1]),
            mission=1 + secrets.randbelow(2**32 - 1),
            expires=int(time.time() + 3600.0 * value_or_default(hours, 1.0)),
            operator=public,
            autopilot=autopilot,
            height=value_or_default(height, None),
            margin=value_or_default(margin, DEFAULT_FENCE_MARGIN),
            safety=safety,
        )
        parse_card({**made, "hash": card_hash(made)}, str(out))
        return made

    document = asked.read(card_for, loaded)
    loads = asked.read(_check_airtimes, systems, document, fast_bits, slow_bits)
    asked.raise_errors()
    card = _write_mission(files, document, private)
    beside = deviation_notes(loaded, card.safety, len(card.members))
    tables.print_notes([*loaded.notes, *omission_notes(loaded), *beside])
    if as_json:
        radio = {each.radio: each.share for each in loads}
        tables.print_json({"card": str(out), "hash": card.hash, "members": list(card.members), "airtime": radio})
    else:
        _print_summary(files, card, loads)


class MissionFiles(NamedTuple):
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
            f"{self.radio} radio: {count} drones would take {self.share:.0%} of its time; "
            f"at most {MAX_AIRTIME_SHARE:.0%}: "
            f"lower the rate (--limit {self.limit}=...) or raise --{self.radio}-bits"
        )


def radio_airtimes(count: int, safety: dict[str, Any], fast: float, slow: float) -> list[Airtime]:
    """What `count` drones take of the fast and the slow radio, from their rates in bit/s and the card's limits."""
    loads = []
    for radio, limit, bits in (("fast", "status_period", fast), ("slow", "slow_period", slow)):
        packet = PREAMBLE_SECONDS + 8.0 * (DATAGRAM_BYTES + OVERHEAD_BYTES) / bits
        loads.append(Airtime(radio, limit, count * packet / float(safety[limit])))
    return loads


def _check_airtimes(systems: list[int], document: dict[str, Any], fast: float, slow: float) -> list[Airtime]:
    """What the drones of a card take of their radios. Raises CardError where that is too much."""
    loads = radio_airtimes(len(systems), document["safety"], fast, slow)
    if faults := [each.fault(len(systems)) for each in loads if each.share > MAX_AIRTIME_SHARE]:
        raise CardError(faults)
    return loads


def _limits(pairs: list[str] | None, scenario: Any, errors: ErrorCollector) -> dict[str, Any]:
    """Limits of the card that --limit changes; what is wrong is noted, and left out."""
    from airflock.core import declarations
    from airflock.drones import SafetyLimits
    from airflock.fleets import default_safety

    known = [name for name, _, _ in declarations(SafetyLimits)]
    safety = value_or_default(errors.read(options.parse_settings, pairs, option="--limit"), {})
    wrong = [name for name in safety if name not in known]
    errors.note(*(f"--limit {name}: is not a limit; {suggest(name, known, ', '.join(known))}" for name in wrong))
    safety = {name: value for name, value in safety.items() if name in known}
    changed = errors.read(lambda flown: replace(default_safety(flown), **safety), scenario)
    return {} if changed is INVALID else safety


def _write_mission(files: MissionFiles, document: dict[str, Any], private: bytes) -> Any:
    """Write card and keys, all of them or none; private: the operator's key. The card that was written."""
    import secrets

    from airflock.drones import write_card, write_key

    try:
        card = write_card(files.card, document)
        write_key(files.key, secrets.token_bytes(32))
        write_key(files.operator, private)
    except BaseException:  # a full disk, Ctrl-C: a card without its keys is of no use
        for path in files:
            path.unlink(missing_ok=True)
        raise
    return card


def _print_summary(files: MissionFiles, card: Any, loads: list[Airtime]) -> None:
    """Say what was written, how high the drones may fly, and how autopilots have to be set."""
    tables.print_message(f"wrote {files.card} (hash {card.hash[:8]}), {files.key}, {files.operator}")
    top = card.layer(card.members[-1])
    tables.print_message(f"fence {card.low:g} to {card.high:g} m above the site; layers up to {top:g} m")
    for load in loads:
        tables.print_message(f"{load.radio} radio: {load.share:.0%} of its time, by an estimate from its bit rate")
    for guard in card.autopilot.parameter_checks:
        why = guard.reason(card.safety.speed_max, card.safety.response)
        tables.print_message(f"set {guard.name} {guard.told()}: {why}")


def _members(text: str) -> list[int]:
    """System ids, as they are written in a line."""
    members: list[int] = []
    for part in text.split(","):
        first, dash, last = part.partition("-")
        last = last if dash else first
        if not (first.isdigit() and last.isdigit() and 0 <= int(last) - int(first) <= 250):
            raise CardError([f"--members {text}: write 1-10 or 1,2,5"])
        members += range(int(first), int(last) + 1)
    return members
