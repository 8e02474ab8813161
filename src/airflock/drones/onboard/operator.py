"""The operator on board: which orders are taken, each once, and what they leave to be done."""

from typing import Any

from airflock.drones.mavlink.orders import CALL_OFF_ORDERS, OperatorOrder, OrderKind, parse_order
from airflock.drones.onboard.card import FlightCard
from airflock.support import LinkError

KILL_CONFIRM_WITHIN = 5_000_000  # µs; a kill must be confirmed within
MAX_ORDER_AGE = 5_000_000  # µs; an order given longer ago is not obeyed
MAX_START_DELAY = (
    10_000_000  # µs after its turn a drone may still start; our choice: later somebody may stand beside it
)
ORDER_REFUSALS = ("seal", "mission", "old", "replay", "no library")


class OperatorOrders:
    """Orders that were taken.

    given : when the last order was given, µs of Unix time, kept over restarts, so that none is obeyed twice
    """

    def __init__(self, card: FlightCard, member: int, last_order_time: int):
        self._card, self._member, self.last_order_time = card, member, last_order_time
        self.heard_at = -1e9
        self.refused = dict.fromkeys(ORDER_REFUSALS, 0)
        self.start_at: int | None = None  # µs of Unix time
        self.held = self.resume_ordered = self.kill_confirmed = False
        self.goal: tuple[float, float, float] | None = None
        self._kill_at = -KILL_CONFIRM_WITHIN
        self._queue: list[OrderKind] = []

    def take(self, values: dict[str, Any], now: float, utc: int) -> bool:
        """Take the order in a message's fields; False if it is none for this mission, not sealed, old or a replay."""
        try:
            order = parse_order(values, self._card.operator) if self._card.operator else None
        except LinkError:
            return self._refuse("no library")
        if order is None:
            return self._refuse("seal")
        if order.mission != self._card.mission:
            return self._refuse("mission")
        if abs(order.given_at - utc) > MAX_ORDER_AGE:
            return self._refuse("old")
        if order.given_at <= self.last_order_time:
            return self._refuse("replay")
        self.last_order_time, self.heard_at = order.given_at, now
        if order.target in (0, self._member):
            self._obey(order, utc)
        return True

    def _refuse(self, reason: str) -> bool:
        self.refused[reason] += 1
        return False

    def _obey(self, order: OperatorOrder, utc: int) -> None:
        if order.kind == OrderKind.START:
            self.start_at = order.at
        elif order.kind == OrderKind.HOLD:
            self.held, self.resume_ordered = True, False
        elif order.kind == OrderKind.RESUME:
            self.held, self.resume_ordered = False, True
        elif order.kind == OrderKind.GOTO:
            lat, lon, alt = order.point
            self.goal = self._card.site.local(lat * 1e-7, lon * 1e-7, alt * 1e-3)
        elif order.kind == OrderKind.KILL:
            self._kill_at = utc
        elif order.kind == OrderKind.CONFIRM_KILL:
            self.kill_confirmed = utc - self._kill_at <= KILL_CONFIRM_WITHIN
        elif order.kind in (OrderKind.RETURN, OrderKind.LAND):
            self.held = False
        if order.kind in CALL_OFF_ORDERS:
            self.start_at = None
        self._queue.append(order.kind)

    def next_order(self) -> OrderKind | None:
        """The order to be done at this tick, in the order in which they came."""
        return self._queue.pop(0) if self._queue else None

    def again(self, order: OrderKind) -> None:
        """Take an order at the next tick once more, for something else came first at this one."""
        self._queue.insert(0, order)

    def due(self, utc: int, member_delay: float) -> bool:
        """Whether the start was ordered and the own turn (s after it) has come."""
        return self.start_at is not None and utc - self.start_at - round(member_delay * 1e6) >= 0

    def missed(self, utc: int, member_delay: float) -> bool:
        """Whether the own turn was so long ago that it starts no more; then the start is forgotten."""
        if self.start_at is None or utc - self.start_at - round(member_delay * 1e6) <= MAX_START_DELAY:
            return False
        self.start_at = None
        return True
