"""What is asked for, read part by part, so that everything that is wrong with it is told at once."""

from collections.abc import Callable, Iterable
from typing import Any, ParamSpec, TypeVar

from airflock.support.errors import AirflockError, ScenarioError

P = ParamSpec("P")
T = TypeVar("T")


class _Wrong:
    """Stands for a part that is wrong; nothing is made of it."""


INVALID: Any = _Wrong()


def value_or_default(value: T, default: T) -> T:
    """A part, or what is read on with where it is wrong, so that other parts are judged as well."""
    return default if value is INVALID else value


def invalid_if(dependency: Any, value: T) -> T:
    """A part that was judged with a stand-in for another one (`value_or_default`); wrong where that one is."""
    return INVALID if dependency is INVALID else value  # type: ignore[no-any-return]


class ErrorCollector:
    """What is asked for, part by part; a part is left out where one that it is made of is wrong, and only there.

    faults : what is wrong so far, one line each

    Once `raise_errors` has come back, every part is what its reader made.
    """

    def __init__(self, errors: Iterable[str] = ()) -> None:
        self.faults = list(errors)
        self._raised: list[AirflockError] = []

    def read(self, reader: Callable[P, T], *parts: P.args, **named: P.kwargs) -> T:
        """What a reader makes of parts; where it raises an AirflockError, that is noted, and the part is wrong."""
        if not any(part is INVALID for part in (*parts, *named.values())):
            try:
                return reader(*parts, **named)
            except AirflockError as fault:
                self._raised.append(fault)
                self.note(*str(fault).splitlines())
        return INVALID  # type: ignore[no-any-return]

    def collect_each(self, reader: Callable[[Any], T], parts: Iterable[Any] | None) -> list[T]:
        """What a reader makes of each of several parts; all of them are wrong where one is."""
        if parts is INVALID:
            return INVALID  # type: ignore[return-value]
        found = [self.read(reader, part) for part in parts or ()]
        return INVALID if any(part is INVALID for part in found) else found

    def note(self, *errors: str) -> None:
        """Note what else is wrong."""
        self.faults += [fault for fault in errors if fault not in self.faults]

    def raise_errors(self) -> None:
        """Raise what a reader raised, if nothing else is wrong, or else a ScenarioError with all that is."""
        if len(self._raised) == 1 and self.faults == str(self._raised[0]).splitlines():
            raise self._raised[0]
        if self.faults:
            raise ScenarioError(self.faults)
