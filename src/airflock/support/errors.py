"""Errors of Airflock: one line each, ready for a person to read; their collection, and hints for misspelt words."""

import re
import unicodedata
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from numbers import Real
from typing import Any, ParamSpec, TypeVar

MOST_LETTERS = 2000  # of one line; what a stranger's file holds is echoed, and must not flood a terminal
MOST_LINES = 50


def shortened(text: str, max_letters: int = MOST_LETTERS) -> str:
    """Cut the middle out of a text that is longer than `max_letters`."""
    if len(text) <= max_letters:
        return text
    half = max_letters // 2
    return f"{text[:half]} ... ({len(text) - 2 * half} letters) ... {text[-half:]}"


def shortened_lines(lines: list[str]) -> list[str]:
    """Return the first lines, each bounded, and the number of those that are left out."""
    shown = [shortened(line) for line in lines[:MOST_LINES]]
    # The number of the rest is one more line, so that nobody takes the list for complete.
    return shown if len(lines) <= MOST_LINES else [*shown, f"and {len(lines) - MOST_LINES} more errors"]


def printable(text: str) -> str:
    """Escape control letters, so that a text stays one line and moves no cursor."""
    # Text of a stranger's file is echoed in errors; an escape sequence in it could rewrite the
    # terminal.
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def os_error_message(error: OSError) -> str:
    """Return why a file cannot be used, for the end of a line that begins with its name."""
    return "no such file" if isinstance(error, FileNotFoundError) else error.strerror or str(error)


class AirflockError(Exception):
    """Root of every error that the command line prints as one line before it exits with status 2.

    Examples
    --------
    >>> import airflock
    >>> try:
    ...     airflock.load("vasarhelyi_2018/4m")
    ... except airflock.AirflockError as error:
    ...     print(error)
    vasarhelyi_2018/4m: no such file or preset; did you mean vasarhelyi_2018/4ms?
    """


@contextmanager
def collect_errors(errors: list[str]) -> Iterator[None]:
    """Collect the errors of the block, one line each, and go on, so that all of them are reported together."""
    try:
        yield
    except AirflockError as error:
        errors += [line for line in str(error).splitlines() if line not in errors]


class ParameterError(AirflockError):
    """A number, a choice or a key is not acceptable; names key, value, unit and allowed range."""


class ScenarioError(AirflockError):
    """A scenario file or a set of its keys cannot be used; carries all errors, one line each."""

    def __init__(self, errors: list[str]):
        self.errors = [printable(error) for error in shortened_lines(errors)]
        super().__init__("\n".join(self.errors))


class RuleError(AirflockError):
    """A rule breaks the contract of `airflock.core`."""


class RecordingError(AirflockError):
    """A file or a dataset is no recording, or cannot be written."""


class FlightError(AirflockError):
    """A flight could not start or failed: names world, agent and step."""


class SceneError(AirflockError):
    """A scene cannot be used: a mesh that is open, inverted, in a wrong unit or damaged, or one without free room."""


class DeviceError(AirflockError):
    """A device cannot be used, or not for this flight: gives the reason, the needed memory and the size that fits."""


class StudyError(AirflockError):
    """A study's folder cannot be used: another study's, another version's, or in use; or an executor is missing."""


class LinkError(AirflockError):
    """A link cannot be used: a library, a key file or a port is missing, or a message does not fit a frame."""


class CardError(AirflockError):
    """A flight card cannot be flown: carries all errors, one line each."""

    def __init__(self, errors: list[str]):
        self.errors = [printable(error) for error in shortened_lines(errors)]
        super().__init__("\n".join(self.errors))


class StudioError(AirflockError):
    """A page cannot be opened: its port is in use, or there is nothing to show."""


P = ParamSpec("P")
T = TypeVar("T")


INVALID: Any = object()  # stands for a part that is invalid; nothing is made of it


def value_or_default(value: T, default: T) -> T:
    """Return a part, or a stand-in where it is invalid, so that other parts are checked as well."""
    return default if value is INVALID else value


def invalid_if(dependency: Any, value: T) -> T:
    """Return INVALID where a part was checked with a stand-in (`value_or_default`) for an invalid dependency."""
    return INVALID if dependency is INVALID else value  # type: ignore[no-any-return]


class ErrorCollector:
    """Collect all validation errors of a request, then raise them together.

    A part is left out where one that it depends on is invalid, and only there. After `raise_errors`
    has returned, every part is what its reader made.

    notes : what was read otherwise than it was written, one line each

    Examples
    --------
    >>> errors = ErrorCollector(["dt = -1 s lies outside [1e-06, 10] s"])
    >>> errors.add("agents = 0 lies outside [1, 1e+07]")
    >>> bool(errors), len(errors.errors)
    (True, 2)
    """

    def __init__(self, errors: Iterable[str] = ()) -> None:
        # Keys of a dict: a file of a hundred thousand unknown keys is refused in linear time.
        self._lines = dict.fromkeys(errors)
        self._raised: list[AirflockError] = []
        self.notes: list[str] = []

    @property
    def errors(self) -> list[str]:
        """Errors so far, one line each, in the order in which they were added."""
        return list(self._lines)

    def __bool__(self) -> bool:
        return bool(self._lines)

    def read(self, reader: Callable[P, T], *parts: P.args, **named: P.kwargs) -> T:
        """Return what a reader makes of parts; INVALID, with its errors collected, where it raises an AirflockError."""
        # A reader of an invalid part would only report a consequence of an error that is collected
        # already.
        if not any(part is INVALID for part in (*parts, *named.values())):
            with self.collecting():
                return reader(*parts, **named)
        return INVALID  # type: ignore[no-any-return]

    @contextmanager
    def collecting(self, prefix: str = "") -> Iterator[None]:
        """Collect the errors of the block, each line behind a prefix, and go on."""
        try:
            yield
        except AirflockError as error:
            self._raised.append(error)
            self.add(*(f"{prefix}{line}" for line in str(error).splitlines()))

    def collect_each(self, reader: Callable[[Any], T], parts: Iterable[Any] | None) -> list[T]:
        """Read each of several parts; INVALID where one of them is."""
        if parts is INVALID:
            return INVALID  # type: ignore[return-value]
        results = [self.read(reader, part) for part in parts or ()]
        return INVALID if any(part is INVALID for part in results) else results

    def add(self, *errors: str) -> None:
        """Add errors that no reader raises; one that is known already is not repeated."""
        self._lines.update(dict.fromkeys(errors))

    def merge(self, part: "ErrorCollector") -> bool:
        """Add the errors and notes of a part; return True if it has errors."""
        self.add(*part._lines)
        self.notes += part.notes
        return bool(part)

    def raise_errors(self, where: str = "") -> None:
        """Raise the reader's own exception if it is the only error, or else a ScenarioError with all of them.

        where : of a document, named before each of its errors, which are a ScenarioError together
        """
        if where and self:
            raise ScenarioError([f"{where}: {error}" for error in self._lines])
        # A single error keeps its own class, which callers catch: RecordingError, StudyError, ...
        if len(self._raised) == 1 and self.errors == str(self._raised[0]).splitlines():
            raise self._raised[0]
        if self:
            raise ScenarioError(self.errors)


def suggest(
    word: object, known: Iterable[str], fallback: str = "", *, lead: str = "", prefix: str = "", cutoff: float = 0.5
) -> str:
    """Return a question for the nearest of the known words, or the fallback where none is near.

    lead   : stands before the question; prefix : before the word in it, such as "space."
    cutoff : how similar two words must be, from 0 to 1, as in `difflib`

    >>> suggest("vasarhely", ["viragh", "vasarhelyi"])
    'did you mean vasarhelyi?'
    >>> suggest("xyz", ["viragh", "vasarhelyi"], "known: viragh, vasarhelyi")
    'known: viragh, vasarhelyi'
    """
    near = get_close_matches(str(word), list(known), n=1, cutoff=cutoff)
    return f"{lead}did you mean {prefix}{near[0]}?" if near else fallback


def describe_error(error: BaseException) -> str:
    """Return an exception in one line, with the nearest name where an attribute is missing.

    >>> import math
    >>> try:
    ...     math.sqr(4.0)
    ... except AttributeError as error:
    ...     describe_error(error)
    "AttributeError: module 'math' has no attribute 'sqr'; did you mean sqrt?"
    """
    line = " ".join(f"{type(error).__name__}: {error}".removesuffix(": ").split())
    # Python's own suggestion is added by the traceback printer, which never runs here.
    if isinstance(error, AttributeError) and error.name is not None:
        line += suggest(error.name, (name for name in dir(error.obj) if not name.startswith("_")), lead="; ")
    return line


def to_identifier(text: str) -> str:
    """Convert a text to a name in a program: letters that no name may hold become _.

    >>> to_identifier("my-law 2"), to_identifier("3law"), to_identifier("couzin_2002")
    ('my_law_2', '_3law', 'couzin_2002')
    """
    name = re.sub(r"\W", "_", unicodedata.normalize("NFKC", text))
    return name if name.isidentifier() else f"_{name}"


DEVICES = ("auto", "cpu", "cuda", "python")


def check_device(device: str) -> None:
    """Raise ScenarioError for an unknown device."""
    if device not in DEVICES:
        raise ScenarioError([f"device = {device!r} is none of {', '.join(DEVICES)}"])


def check_precision(precision: int) -> None:
    """Raise ScenarioError for a number of bits other than 32 and 64."""
    if precision not in (32, 64):
        raise ScenarioError([f"precision = {precision} is neither 32 nor 64"])


def is_number(value: Any) -> bool:
    """Return True for Python's and NumPy's numbers; False for truth values, text, pandas' missing values and arrays."""
    return isinstance(value, Real) and not isinstance(value, bool)
