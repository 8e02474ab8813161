"""Teller: what the ether tells who watches a fleet in software: whose packets arrive where, and which faults hold."""

from collections.abc import Collection, Mapping, Sequence

from airflock.drones import PacketSigner, witness
from airflock.fleets.faults import INJECTED_KINDS, InjectedFault
from airflock.fleets.starting import SOFTWARE_KEY
from airflock.parts.faults import KINDS as OURS

DEFAULT_WATCH_ADDRESS = ("127.0.0.1", 14600)  # where who watches hears a fleet in software
REPORT_PERIOD = 0.5  # s between two reports
HEARD_WITHIN = 1.0  # s; a neighbour whose last packet arrived longer ago is not heard
NEVER_HEARD = -1e9
SCENARIO_FAULT_NAMES = {
    kind: f"{kind} of the scenario" if kind in INJECTED_KINDS else kind for kind in OURS
}  # by kind how it is told
FAULT_NUMBERS = {
    kind: number
    for number, kind in enumerate((*INJECTED_KINDS, *SCENARIO_FAULT_NAMES.values()), start=witness.HEARS_REPORT + 1)
}


class TelemetryBroadcast:
    """Keeps whose packets arrived, and reports it with the faults twice a second.

    members : system ids
    """

    def __init__(self, members: Sequence[int], faults: Sequence[InjectedFault]):
        self._members, self._faults = tuple(members), tuple(faults)
        self._arrival_times = {member: dict.fromkeys(members, NEVER_HEARD) for member in members}
        self._sign, self._next_report = PacketSigner(SOFTWARE_KEY, witness.CHANNEL_SYSTEM), NEVER_HEARD

    def note_arrival(self, receiver: int, datagram: bytes, now: float) -> None:
        """Note a datagram that arrived at a drone, by its place among the members."""
        sender = datagram[5] if len(datagram) > 5 else 0
        if sender in self._arrival_times:
            self._arrival_times[self._members[receiver]][sender] = now

    def report(self, now: float, utc: int, active_faults: Mapping[str, Collection[int]] | None = None) -> list[bytes]:
        """Signed datagrams for who watches, where they are due.

        now      : time of the flight, s; utc: µs of Unix time
        befallen : kinds of fault of the scenario that hold, each with the places of whom they have befallen; a user's
                   own has no number, and is not told
        """
        if now < self._next_report:
            return []
        self._next_report = now + REPORT_PERIOD
        told = [
            witness.report_message(
                witness.HEARS_REPORT, member, [who for who, at in known.items() if now - at <= HEARD_WITHIN]
            )
            for member, known in self._arrival_times.items()
        ]
        holding: dict[str, set[int]] = {}  # several faults of one kind are told as one
        for fault in self._faults:
            if fault.begin <= now < fault.end:
                holding.setdefault(fault.kind, set()).update(fault.who or self._members)
        for kind, places in (active_faults or {}).items():
            if kind in SCENARIO_FAULT_NAMES:
                holding[SCENARIO_FAULT_NAMES[kind]] = {self._members[place] for place in places}
        told += [witness.report_message(FAULT_NUMBERS[kind], 0, who) for kind, who in holding.items()]
        return [self._sign(each, utc) for each in told]
