"""What a page tells of a running fleet in words: a row for each drone, faults, notes, and what is wrong. HTML."""

import html

from airflock.drones import HEARD_WITHIN, Peer
from airflock.fleets import INJECTED_KINDS, SCENARIO_FAULT_NAMES, FleetObserver
from airflock.parts.faults import KINDS as OURS
from airflock.studio.room import small_print_html

MAX_NOTES = 14  # notes
MAX_ROWS = 60  # drones that have a row of their own
MIN_REFUSED = 10  # datagrams of other keys after which it is said that none fits
REFUSAL_REASONS = {
    "signature": "signed with a different key than this card's mission uses",
    "clock": "from another time: the clocks differ by more than the card allows, or the card's limit is too small",
    "card": "from another card",
    "mission": "from another mission",
    "stranger": "from systems that are not members",
}
FAULT_TEXTS = {  # what is said of faults whose amount the ether does not tell
    "loss": "some packets to these drones are lost",
    "jitter": "packets to these drones are late",
    "duplicate": "some packets to these drones arrive twice",
    "corrupt": "some packets to these drones arrive with a wrong bit",
    "rogue": "somebody without the key sends packets as these drones, from another place",
    "impostor": "somebody with the key sends packets as these drones, from another place",
    "battery": "the battery reports a wrong level",
    "clock": "the node's clock is wrong",
}
TABLE_TAG = "<table style='width:100%;font-size:0.8em;border-collapse:collapse;text-align:right'>"


def members_html(observer: FleetObserver, now: float) -> str:
    """A row for each drone: phase, height, speed, battery, whom it hears, age of its last packet."""
    heads = ("", "phase", "m", "m/s", "%", "hears", "s ago")
    rows = [f"<tr>{''.join(f'<th>{head}</th>' for head in heads)}</tr>"]
    members = observer.card.members
    for member in members[:MAX_ROWS]:
        rows.append(_member_row(member, observer.peers[member], now))
    more = small_print_html(f"and {len(members) - MAX_ROWS} more") if len(members) > MAX_ROWS else ""
    return f"<div style='padding:0 0.75em'>{TABLE_TAG}{''.join(rows)}</table></div>{more}"


def _member_row(member: int, peer: Peer, now: float) -> str:
    if peer.status is None or peer.state is None:
        said = "another card" if peer.has_other_card else "not heard"
        return f"<tr style='color:#777'><th>{member}</th><td>{said}</td>{'<td>–</td>' * 5}</tr>"
    s, age = peer.state, now - peer.heard_at
    speed = (s.vx * s.vx + s.vy * s.vy + s.vz * s.vz) ** 0.5
    tone = " style='color:#b00020'" if age > HEARD_WITHIN else ""
    cells = (peer.phase.name.lower(), f"{s.z:.1f}", f"{speed:.1f}", f"{peer.status.battery}", f"{peer.status.peers}",
             f"{age:.1f}")  # fmt: skip
    return f"<tr{tone}><th>{member}</th>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"


def drone_html(observer: FleetObserver, member: int, now: float) -> str:
    """All that one drone tells of itself."""
    peer = observer.peers[member]
    if peer.status is None or peer.state is None:
        return small_print_html(f"<b>drone {member}</b>: not heard yet")
    s, told = peer.state, peer.status
    hears = [b if a == member else a for a, b in observer.links(now) if member in (a, b)]
    linked = f"; packets between it and {', '.join(map(str, sorted(hears)))}" if hears else ""
    others, age = len(observer.card.members) - 1, now - peer.heard_at
    return small_print_html(
        f"<b>drone {member}</b>: {peer.phase.name.lower()}, {'in the air' if told.is_airborne else 'on the ground'}<br>"
        f"at east {s.x:.1f}, north {s.y:.1f}, {s.z:.1f} m above the site, known to {told.accuracy:.1f} m<br>"
        f"flies {s.vx:.1f}, {s.vy:.1f}, {s.vz:.1f} m/s; battery {told.battery} %; clock off by {told.clock_error:.2f} s"
        f"<br>hears {told.peers} of {others}{linked}; last packet {age:.1f} s ago"
    )


def faults_html(observer: FleetObserver) -> str:
    """Faults that hold, with what they do."""
    said = (
        INJECTED_KINDS
        | FAULT_TEXTS
        | {told: _first_sentence(OURS[kind].doc) for kind, told in SCENARIO_FAULT_NAMES.items()}
    )
    lines = [f"<b>{kind}</b>, {observer.named(who)}: {said[kind]}" for kind, who in observer.faults.items()]
    return small_print_html("<br>".join(lines)) if lines else ""


def _first_sentence(doc: str) -> str:
    """What a kind of fault does, by the first sentence of its own words."""
    return doc.partition(": ")[2].partition(".")[0]


def notes_html(observer: FleetObserver) -> str:
    """What happened, newest first."""
    lines = []
    for told in list(observer.notes)[: -MAX_NOTES - 1 : -1]:
        who = f"drone {told.member}: " if told.member else ""
        lines.append(f"{told.time - observer.begun:.1f} s · {who}{html.escape(told.text)}")
    return small_print_html("<br>".join(lines))


def fleet_warning(observer: FleetObserver, now: float) -> str:
    """What is wrong with the whole: nothing arrives, or what arrives is not believed."""
    refused = observer.refused
    most = max(refused, key=refused.__getitem__, default="")
    if not observer.accepted_count and sum(refused.values()) >= MIN_REFUSED:
        return f"{sum(refused.values())} packets were refused, and none believed: {REFUSAL_REASONS.get(most, most)}"
    if not observer.accepted_count:
        return "nothing has been heard yet" if now - observer.begun > HEARD_WITHIN else ""
    return "" if observer.heard(now) else "no drone is heard any more"
