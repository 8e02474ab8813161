"""Copies: texts of rules from earlier drivers, for drivers that would write the same.

Writing the texts of rules takes half of the time of the text of a driver. A copy is used if all
that it depended on is unchanged: the values of names in the rule, choices and vectors of its
records, and the names of functions that it calls, which come along.
"""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Mapping
from threading import Lock
from typing import Any, NamedTuple, Protocol

from airflock.core import resolve_global


class TextSource(Protocol):
    """The driver that a rule's text is written for: a `generate.DriverSource`."""

    constants: Mapping[str, Mapping[str, str | float]]
    vectors: Mapping[str, Mapping[str, int]]

    def name(self, item: Any, chosen: Mapping[str, str]) -> str:
        """Name in the driver of what a rule calls."""


class Dependency(NamedTuple):
    """One question about a rule: its kind, what it is about, and the answer."""

    kind: str
    about: tuple[Any, ...]
    answer: Any


class DependencyRecorder:
    """A recorder of all questions about one rule while it is copied, with their answers."""

    def __init__(self, rule: Callable[..., Any], source: TextSource):
        self.rule, self.source = rule, source
        self.asked: list[Dependency] = []

    def choice(self, record: str, field: str) -> Any:
        """The choice or the usual number that a field of a record is; None if it is neither."""
        return self._kept("choice", record, field)

    def size(self, record: str, field: str) -> int:
        """Return the number of components of a field of a record; 0 if it is no vector."""
        return int(self._kept("size", record, field))

    def free(self, name: str) -> Any:
        """Return the value of a free name of the rule; None if it has none."""
        return self._kept("free", name)

    def name(self, item: Any, chosen: Mapping[str, str]) -> str:
        """Name in the driver of what the rule calls."""
        return str(self._kept("name", item, tuple(chosen.items())))

    def hold(self, dependencies: list[Dependency]) -> bool:
        """Return True if all earlier answers still hold; functions that the rule calls come along."""
        return all(_same(each.answer, self._answer(each.kind, *each.about)) for each in dependencies)

    def _kept(self, kind: str, *about: Any) -> Any:
        answer = self._answer(kind, *about)
        self.asked.append(Dependency(kind, about, answer))
        return answer

    def _answer(self, kind: str, *about: Any) -> Any:
        if kind == "choice":
            return self.source.constants.get(about[0], {}).get(about[1])
        if kind == "size":
            return self.source.vectors.get(about[0], {}).get(about[1], 0)
        if kind == "free":
            return resolve_global(about[0], self.rule)
        return self.source.name(about[0], dict(about[1]))


def _same(known: Any, found: Any) -> bool:
    """Return True if an answer is unchanged: the same object, or an equal text or number of the same type."""
    return known is found or (type(known) is type(found) and isinstance(known, (str, int, float)) and known == found)


class TextCache:
    """A cache of texts of rules, each with the questions that it depends on; the least recently used go first.

    most : rules, each under one name and under all else that its text depends on; each : texts of one of them
    """

    def __init__(self, max_rules: int = 4096, max_texts: int = 256):
        self._most, self._each, self._lock = max_rules, max_texts, Lock()
        self._kept: OrderedDict[Hashable, tuple[tuple[list[Dependency], str], ...]] = OrderedDict()

    def text(self, key: Hashable, recorder: DependencyRecorder) -> str | None:
        """The text that was written where all answers were those of now; None if none was."""
        with self._lock:
            known = self._kept.get(key, ())
            if known:
                self._kept.move_to_end(key)
        # Answers are compared outside the lock: a comparison may write texts of called rules, which
        # takes the lock again.
        return next((text for asked, text in known if recorder.hold(asked)), None)

    def keep(self, key: Hashable, recorder: DependencyRecorder, text: str) -> None:
        """Keep a text, with the questions of its writing."""
        with self._lock:
            self._kept[key] = (*self._kept.get(key, ())[-self._each + 1 :], (recorder.asked, text))
            self._kept.move_to_end(key)
            while len(self._kept) > self._most:
                self._kept.popitem(last=False)
