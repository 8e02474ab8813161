"""What is asked for, read part by part, so that everything that is wrong with it is told at once."""

from collections.abc import Callable, Iterable
from typing import Any, ParamSpec, TypeVar

from airflock.support.errors import AirflockError, ScenarioError

P = ParamSpec("P")
T = TypeVar("T")


class _Wrong:
    """Stands for a part that is wrong; nothing is made of it."""


WRONG: Any = _Wrong()


def or_else(part: T, stand_in: T) -> T:
    """A part, or what is read on with where it is wrong, so that other parts are judged as well."""
    return stand_in if part is WRONG else part


def if_right(needed: Any, part: T) -> T:
    """A part that was judged with a stand-in for another one (`or_else`); wrong where that one is."""
    return WRONG if needed is WRONG else part  # type: ignore[no-any-return]


class Asked:
    """What is asked for, part by part; a part is left out where one that it is made of is wrong, and only there.

    faults : what is wrong so far, one line each

    Once `refuse` has come back, every part is what its reader made.
    """

    def __init__(self, faults: Iterable[str] = ()) -> None:
        self.faults = list(faults)
        self._raised: list[AirflockError] = []

    def read(self, reader: Callable[P, T], *parts: P.args, **named: P.kwargs) -> T:
        """What a reader makes of parts; where it raises an AirflockError, that is noted, and the part is wrong."""
        if not any(part is WRONG for part in (*parts, *named.values())):
            try:
                return reader(*parts, **named)
            except AirflockError as fault:
                self._raised.append(fault)
                self.note(*str(fault).splitlines())
        return WRONG  # type: ignore[no-any-return]

    def each(self, reader: Callable[[Any], T], parts: Iterable[Any] | None) -> list[T]:
        """What a reader makes of each of several parts; all of them are wrong where one is."""
        if parts is WRONG:
            return WRONG  # type: ignore[return-value]
        found = [self.read(reader, part) for part in parts or ()]
        return WRONG if any(part is WRONG for part in found) else found

    def note(self, *faults: str) -> None:
        """Note what else is wrong."""
        self.faults += [fault for fault in faults if fault not in self.faults]

    def refuse(self) -> None:
        """Raise what a reader raised, if nothing else is wrong, or else a ScenarioError with all that is."""
        if len(self._raised) == 1 and self.faults == str(self._raised[0]).splitlines():
            raise self._raised[0]
        if self.faults:
            raise ScenarioError(self.faults)
