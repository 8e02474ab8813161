"""Resting: what lives on the real clock does what is due, and then rests until a time while it hears its ports.

A life is a generator that yields its rests. `run_alone` lives it with the system's own poll, in a process that does
nothing
else: there a wake-up by an event loop costs three times as much, and a node wakes forty times a second.
"""

import select
import time
from collections.abc import Callable, Generator, Sequence
from typing import NamedTuple, TypeVar

from airflock.drones.onboard.ports import Port

Result = TypeVar("Result")
DataHandler = Callable[[bytes, float], None]  # takes bytes, and when they were read, s


class TaskRest(NamedTuple):
    """A rest.

    until : time.monotonic, s; hears: ports that are read as soon as anything arrives, each with who takes it
    """

    until: float
    handlers: Sequence[tuple[Port, DataHandler]] = ()


def hand_on_data(port: Port, handler: DataHandler) -> None:
    """Hand on what has arrived."""
    for data in port.read():
        handler(data, time.monotonic())


def run_alone(task: Generator[TaskRest, None, Result]) -> Result:
    """Live a life to its end; what it returns. Its ports are heard at least once at each rest, however late it is."""
    hears: Sequence[tuple[Port, DataHandler]] = ()
    poll, hands = select.poll(), {}  # type: ignore[var-annotated]
    while True:
        try:
            rest = next(task)
        except StopIteration as end:
            found: Result = end.value
            return found
        if rest.handlers is not hears:
            hears, poll, hands = (
                rest.handlers,
                select.poll(),
                {port.fileno(): (port, hand) for port, hand in rest.handlers},
            )
            for number in hands:
                poll.register(number, select.POLLIN)
        while True:
            for number, events in poll.poll(1e3 * max(0.0, rest.until - time.monotonic())):
                hand_on_data(*hands[number])
                if events & select.POLLHUP:
                    poll.unregister(number)  # a serial line that was pulled out would wake it without end
            if time.monotonic() >= rest.until:
                break
