"""All errors that Airflock raises on purpose: one line each, ready for a person to read."""

from collections.abc import Iterator
from contextlib import contextmanager

MOST_LETTERS = 2000  # of one line; what a stranger's file holds is echoed, and must not flood a terminal
MOST_LINES = 50


def shortened(text: str, max_letters: int = MOST_LETTERS) -> str:
    """A text without its middle where it is longer than `most` letters."""
    if len(text) <= max_letters:
        return text
    half = max_letters // 2
    return f"{text[:half]} ... ({len(text) - 2 * half} letters) ... {text[-half:]}"


def shortened_lines(lines: list[str]) -> list[str]:
    """The first lines, each bounded, and how many are left out."""
    shown = [shortened(line) for line in lines[:MOST_LINES]]
    return shown if len(lines) <= MOST_LINES else [*shown, f"and {len(lines) - MOST_LINES} more faults"]


def printable(text: str) -> str:
    """A text whose control letters are written out, so that it stays one line and moves no cursor."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def os_error_message(error: OSError) -> str:
    """Why a file cannot be used, for the end of a line that begins with its name."""
    return "no such file" if isinstance(error, FileNotFoundError) else error.strerror or str(error)


class AirflockError(Exception):
    """Root of every error that the command line prints as one line before it exits with status 2.

    Examples
    --------
    >>> import airflock
    >>> try:
    ...     airflock.load("vasarhelyi_2018/4m")
    ... except airflock.AirflockError as fault:
    ...     print(fault)
    vasarhelyi_2018/4m: no such file or preset; did you mean vasarhelyi_2018/4ms?
    """


@contextmanager
def collect_errors(errors: list[str]) -> Iterator[None]:
    """Note the faults of what is checked inside, one line each, and go on, so that all can be told at once."""
    try:
        yield
    except AirflockError as fault:
        errors += [line for line in str(fault).splitlines() if line not in errors]


class ParameterError(AirflockError):
    """A number, a choice or a key is not acceptable; names key, value, unit and allowed range."""


class ScenarioError(AirflockError):
    """A scenario file or a set of its keys cannot be used; carries every fault that was found, one line each."""

    def __init__(self, errors: list[str]):
        self.faults = [printable(fault) for fault in shortened_lines(errors)]
        super().__init__("\n".join(self.faults))


class RuleError(AirflockError):
    """A rule breaks the contract of `airflock.core.contract`."""


class RecordingError(AirflockError):
    """A file or a dataset is no recording, or cannot be written."""


class FlightError(AirflockError):
    """A flight could not be started or went wrong: says which world, agent and step."""


class SceneError(AirflockError):
    """A scene cannot be used: a mesh that is open, inverted, in a wrong unit or damaged, or one without free room."""


class DeviceError(AirflockError):
    """A device cannot be used, or not for this flight: says why, how much memory is needed and what fits."""


class StudyError(AirflockError):
    """A study's folder cannot be used: another study's, another version's, or in use; or an executor is missing."""


class LinkError(AirflockError):
    """A link cannot be used: a library, a key file or a port is missing, or what shall be sent does not fit a frame."""


class CardError(AirflockError):
    """A flight card cannot be flown: carries every fault that was found, one line each."""

    def __init__(self, errors: list[str]):
        self.faults = [printable(fault) for fault in shortened_lines(errors)]
        super().__init__("\n".join(self.faults))


class StudioError(AirflockError):
    """A page cannot be opened: its port is in use, or there is nothing to show."""
