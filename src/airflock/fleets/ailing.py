"""Ailing: a node of a fleet in software whom faults of the scenario befall."""

from collections.abc import Callable

from airflock.drones import Node, NodeOutput
from airflock.fleets.befalling import DroneFaults
from airflock.fleets.rogue import falsify_packet
from airflock.support import FlightSite


class FaultyNode:
    """A node with the faults that befall it, used like the node itself.

    It sends what they tell, and its clock is as far ahead as they say; all else is left to the node.

    node  : gives the node; asked each time, so that it may be exchanged for one that keeps a log
    place : of the drone among the members
    time  : of the flight (s) at a time of the node's own clock
    """

    def __init__(
        self,
        node: Callable[[], Node],
        faults: DroneFaults,
        index: int,
        site: FlightSite,
        flight_time: Callable[[float], float] = lambda now: now,
    ):
        self._node, self._faults, self._index, self._site, self._flight_time = node, faults, index, site, flight_time
        self._clock_offset = 0

    def autopilot(self, data: bytes, now: float) -> None:
        """Take bytes that came from the autopilot."""
        self._node().autopilot(data, now)

    def radio(self, datagram: bytes, now: float) -> None:
        """Take a datagram that came by radio."""
        self._node().radio(datagram, now)

    def tick(self, now: float) -> NodeOutput:
        """Let the node decide."""
        at = self._flight_time(now)
        self.update_clock(at)
        out = self._node().tick(now)
        radios = tuple([self.told(datagram, at) for datagram in sent] for sent in out.radios)
        return out._replace(radios=radios)

    def update_clock(self, time: float) -> None:
        """Set the node's clock as its faults say at a time of the flight, s."""
        ahead = round(1e6 * self._faults.ahead(self._index, time))
        if ahead != self._clock_offset:
            self._node().shift_clock(ahead - self._clock_offset)
            self._clock_offset = ahead

    def told(self, datagram: bytes, time: float) -> bytes:
        """What is sent in place of a packet of the node at a time of the flight, s."""
        if not self._faults.can_falsify:
            return datagram
        return falsify_packet(datagram, self._site, lambda state: self._faults.told(self._index, time, state))
