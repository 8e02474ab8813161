"""Teller: what the ether tells who watches a fleet in software: whose packets arrive where, and which faults hold."""

from collections.abc import Collection, Mapping, Sequence

from airflock.drones.mavlink import witness
from airflock.drones.mavlink.signing import Signer
from airflock.fleets.faults import KINDS, Fault
from airflock.fleets.starting import KEY
from airflock.parts.faults.registry import KINDS as OURS

WATCHED = ("127.0.0.1", 14600)  # where who watches hears a fleet in software
PERIOD = 0.5  # s between two reports
LATELY = 1.0  # s; a neighbour whose last packet arrived longer ago is not heard
NEVER = -1e9
OF_SCENARIO = {kind: f"{kind} of the scenario" if kind in KINDS else kind for kind in OURS}  # by kind how it is told
NUMBERS = {kind: number for number, kind in enumerate((*KINDS, *OF_SCENARIO.values()), start=witness.HEARS + 1)}


class Teller:
    """Keeps whose packets arrived, and reports it with the faults twice a second.

    members : system ids
    """

    def __init__(self, members: Sequence[int], faults: Sequence[Fault]):
        self._members, self._faults = tuple(members), tuple(faults)
        self._at = {member: dict.fromkeys(members, NEVER) for member in members}
        self._sign, self._due = Signer(KEY, witness.WITNESS), NEVER

    def arrived(self, to: int, datagram: bytes, now: float) -> None:
        """Note a datagram that arrived at a drone, by its place among the members."""
        sender = datagram[5] if len(datagram) > 5 else 0
        if sender in self._at:
            self._at[self._members[to]][sender] = now

    def report(self, now: float, utc: int, befallen: Mapping[str, Collection[int]] | None = None) -> list[bytes]:
        """Signed datagrams for who watches, where they are due.

        now      : time of the flight, s; utc: µs of Unix time
        befallen : kinds of fault of the scenario that hold, each with the places of whom they have befallen; a user's
                   own has no number, and is not told
        """
        if now < self._due:
            return []
        self._due = now + PERIOD
        told = [
            witness.message(witness.HEARS, member, [who for who, at in known.items() if now - at <= LATELY])
            for member, known in self._at.items()
        ]
        holding: dict[str, set[int]] = {}  # several faults of one kind are told as one
        for fault in self._faults:
            if fault.begin <= now < fault.end:
                holding.setdefault(fault.kind, set()).update(fault.who or self._members)
        for kind, places in (befallen or {}).items():
            if kind in OF_SCENARIO:
                holding[OF_SCENARIO[kind]] = {self._members[place] for place in places}
        told += [witness.message(NUMBERS[kind], 0, who) for kind, who in holding.items()]
        return [self._sign(each, utc) for each in told]
