"""The operator on board: which orders are taken, each once, and what they leave to be done."""

from typing import Any

from airflock.drones.mavlink.orders import CALL_OFF, Do, Order, order_of
from airflock.drones.onboard.card import Card
from airflock.support.errors import LinkError

SECOND_STEP = 5_000_000  # µs; a kill must be confirmed within
SPREAD = 5_000_000  # µs; an order given longer ago is not obeyed
START_WITHIN = 10_000_000  # µs after its turn a drone may still start; our choice: later somebody may stand beside it
REASONS = ("seal", "mission", "old", "replay", "no library")


class Operator:
    """Orders that were taken.

    given : when the last order was given, µs of Unix time, kept over restarts, so that none is obeyed twice
    """

    def __init__(self, card: Card, member: int, given: int):
        self._card, self._member, self.given = card, member, given
        self.heard_at = -1e9
        self.refused = dict.fromkeys(REASONS, 0)
        self.start_at: int | None = None  # µs of Unix time
        self.held = self.resume = self.killed = False
        self.goal: tuple[float, float, float] | None = None
        self._kill_at = -SECOND_STEP
        self._new: list[Do] = []

    def take(self, values: dict[str, Any], now: float, utc: int) -> bool:
        """Take the order in a message's fields; False if it is none for this mission, not sealed, old or a replay."""
        try:
            order = order_of(values, self._card.operator) if self._card.operator else None
        except LinkError:
            return self._refuse("no library")
        if order is None:
            return self._refuse("seal")
        if order.mission != self._card.mission:
            return self._refuse("mission")
        if abs(order.given - utc) > SPREAD:
            return self._refuse("old")
        if order.given <= self.given:
            return self._refuse("replay")
        self.given, self.heard_at = order.given, now
        if order.target in (0, self._member):
            self._obey(order, utc)
        return True

    def _refuse(self, reason: str) -> bool:
        self.refused[reason] += 1
        return False

    def _obey(self, order: Order, utc: int) -> None:
        if order.do == Do.START:
            self.start_at = order.at
        elif order.do == Do.HOLD:
            self.held, self.resume = True, False
        elif order.do == Do.RESUME:
            self.held, self.resume = False, True
        elif order.do == Do.GOTO:
            lat, lon, alt = order.point
            self.goal = self._card.site.local(lat * 1e-7, lon * 1e-7, alt * 1e-3)
        elif order.do == Do.KILL:
            self._kill_at = utc
        elif order.do == Do.CONFIRM_KILL:
            self.killed = utc - self._kill_at <= SECOND_STEP
        elif order.do in (Do.RETURN, Do.LAND):
            self.held = False
        if order.do in CALL_OFF:
            self.start_at = None
        self._new.append(order.do)

    def next(self) -> Do | None:
        """The order to be done at this tick, in the order in which they came."""
        return self._new.pop(0) if self._new else None

    def again(self, order: Do) -> None:
        """Take an order at the next tick once more, for something else came first at this one."""
        self._new.insert(0, order)

    def due(self, utc: int, member_delay: float) -> bool:
        """Whether the start was ordered and the own turn (s after it) has come."""
        return self.start_at is not None and utc - self.start_at - round(member_delay * 1e6) >= 0

    def missed(self, utc: int, member_delay: float) -> bool:
        """Whether the own turn was so long ago that it starts no more; then the start is forgotten."""
        if self.start_at is None or utc - self.start_at - round(member_delay * 1e6) <= START_WITHIN:
            return False
        self.start_at = None
        return True
