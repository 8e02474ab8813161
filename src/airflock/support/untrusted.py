"""The one entrance for text from outside: files, attributes, rows and options are measured before they are parsed.

A stranger's text may be too large, nested too deeply, or of numbers without end; parsers then take
minutes or gigabytes, or raise any exception. Here the size, the nesting (dotted keys count, too)
and the digits are bounded first, and `as_error` turns every later exception into one line that
names the source of the text.
"""

import json
import os
import re
import stat
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from xml.parsers import expat

from airflock.support.errors import (
    AirflockError,
    CardError,
    RecordingError,
    ScenarioError,
    describe_error,
    os_error_message,
    shortened,
)

MAX_BYTES = 5_000_000  # of one text; a polygon of 100,000 corners takes some 4 MB
MOST_DEPTH = 32  # tables and lists inside each other
MOST_DOTS = 16  # parts of one dotted key; the standard parser takes quadratic time and memory over them
MOST_VALUES = 1_000_000
MOST_KEYS = 10_000
MOST_KEY = 200  # letters of one key
MOST_SHORT = 4000  # letters of a JSON text that needs no measuring: a store has very many of them
MOST_ELEMENTS = 100_000  # of an XML text
MOST_DIGITS = 400  # of one number, in any base
MOST_WHOLE = 2**64  # whole numbers lie below it on both sides: seeds are the largest

_TOKEN = re.compile(
    r'"""(?:[^"\\]|\\.|"(?!""))*"{3,5}'  # strings of all four kinds: what is inside does not count
    r"|'''(?:[^']|'(?!''))*'{3,5}"
    r'|"(?:[^"\\\n]|\\.)*"'
    r"|'[^'\n]*'"
    r"|#[^\n]*"
    r"|[\[{\]}.=,\n]"
    rf"|[0-9a-zA-Z_]{{{MOST_DIGITS + 1},}}"
    r"|[\"']",  # a string without an end: a parser stops here as well
    re.DOTALL,
)

_UNQUOTED = re.compile(r"\s*([\w.-]+)\s*=\s*([-+]?[\d.]+ ?[a-zA-Zµ°%][\w/^°%]*)\s*(?:#.*)?")  # v_flock = 6 m/s


class TextError(AirflockError):
    """A text from outside is too large, nested too deeply, or no text at all; names the problem, not the file."""


class FormatError(TextError):
    """A text from outside does not have the expected format."""


@contextmanager
def as_error(where: object, error_class: type[AirflockError] = ScenarioError) -> Iterator[None]:
    """Turn every exception of the block into an `error_class` of one line that begins with `where`.

    An AirflockError of another kind has its line already. The cause is kept for `AIRFLOCK_DEBUG=1`.
    """
    try:
        yield
    except AirflockError as error:
        if not isinstance(error, TextError):
            raise
        raise _one(error_class, f"{where}: {error}") from error
    except OSError as error:
        raise _one(error_class, f"{where}: {os_error_message(error)}") from error
    except RecursionError as error:
        raise _one(error_class, f"{where}: is nested too deeply") from error
    except MemoryError as error:
        raise _one(error_class, f"{where}: needs more memory than there is") from error
    # The last resort may hide errors of our own; the fuzz tests count each use of it as a failure.
    except Exception as error:  # the last resort: a stranger's text must not end in a traceback
        raise _one(error_class, f"{where}: cannot be used: {describe_error(error)}") from error


def _one(kind: type[AirflockError], line: str) -> AirflockError:
    line = shortened(" ".join(line.split()))
    return kind([line]) if issubclass(kind, (ScenarioError, CardError)) else kind(line)


def to_path(path: Any) -> Path:
    """Return the name of a file as a path. Raises RecordingError for anything else."""
    if not isinstance(path, (str, os.PathLike)):
        raise RecordingError(f"{shortened(repr(path), 80)} is not a name of a file; give a text or a Path")
    return expand_path(path)


def expand_path(name: str | os.PathLike[str]) -> Path:
    """Return a path with ~ as the home folder, also where no shell has expanded it."""
    return Path(os.path.expanduser(name))


def is_file(path: str | os.PathLike[str]) -> bool:
    """Return True for the path of a regular file; False for a text that cannot be a path (too long, a NUL inside)."""
    try:
        return stat.S_ISREG(expand_path(path).stat().st_mode)
    except (OSError, ValueError):
        return False


def read_text(path: str | os.PathLike[str], max_bytes: int = MAX_BYTES) -> str:
    """Read a regular file in UTF-8, with or without a byte order mark; raises TextError or OSError."""
    source = expand_path(path)
    if not stat.S_ISREG(source.stat().st_mode):  # a named pipe would wait for ever
        raise TextError("is not a regular file")
    with source.open("rb") as file:
        # One byte more than allowed tells a file that is too large, without trusting the size that
        # it reports.
        content = file.read(max_bytes + 1)
    if len(content) > max_bytes:
        raise TextError(f"is larger than {max_bytes / 1e6:g} MB, more than any file of this kind needs")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FormatError(f"is not text in UTF-8: byte {error.start} is 0x{content[error.start]:02x}") from error


def read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read a TOML file as a dict; raises TextError or OSError."""
    return parse_toml(read_text(path))


def parse_toml(text: str) -> dict[str, Any]:
    """Parse a TOML text as a dict; raises FormatError where it is none and TextError beyond bounds."""
    # The standard parser takes 28 s and 6 GB for 120 kB of dots, so a text is measured in one pass
    # before it is parsed.
    _measure(text)
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FormatError(f"{error}{_quotes(text, str(error))}") from error
    _walk(document)
    return document


def _quotes(text: str, message: str) -> str:
    """Return a hint where the line at which a parser stopped holds a number with a unit."""
    place = re.search(r"at line (\d+)", message)
    line = text.splitlines()[int(place[1]) - 1] if place else ""
    with_unit = _UNQUOTED.fullmatch(line[:MOST_KEY])
    return f'; a number with its unit stands in quotes: {with_unit[1]} = "{with_unit[2]}"' if with_unit else ""


def parse_toml_value(text: str) -> Any:
    """Parse a value as TOML writes it, or return the text where it is none; raises TextError for several values."""
    try:
        # A whole document is parsed, so that a value of --set obeys the same bounds as a file.
        document = parse_toml(f"value = {text}")
    except FormatError:
        return text.strip()
    if list(document) != ["value"]:
        raise TextError("holds more than one value; give each key one of its own")
    return document["value"]


def parse_json_object(text: Any) -> dict[str, Any]:
    """Parse a JSON text as a dict; raises FormatError where it is none and TextError beyond bounds."""
    document = parse_json(text)
    if not isinstance(document, dict):
        raise FormatError(f"holds {type(document).__name__} {shortened(repr(document), 40)}, not an object of keys")
    return document


def parse_json(text: Any) -> Any:
    """Parse a JSON text as plain values; raises FormatError where it is none and TextError beyond bounds."""
    if not isinstance(text, str):
        raise FormatError(f"is {type(text).__name__}, no text")
    # Short texts of few brackets cannot exceed a bound, and a store holds very many of them.
    if len(text) > MOST_SHORT or text.count("[") + text.count("{") > MOST_DEPTH:
        _measure(text)
    try:
        document = json.loads(text)
    except ValueError as error:
        raise FormatError(f"is not JSON: {error}") from error
    _walk(document)
    return document


class Element(NamedTuple):
    """An element of an XML text: its tag without a namespace, its own text, the elements in it, its attribute name."""

    tag: str
    text: str
    children: list["Element"]
    name: str = ""


def parse_xml(text: str) -> Element:
    """Parse an XML text; return its outermost element. Raises FormatError where it is none, TextError beyond bounds.

    A document type is refused before anything of it is read, so that no entity is ever defined,
    expanded or fetched.
    """
    if len(text) > MAX_BYTES:
        raise TextError(f"is larger than {MAX_BYTES / 1e6:g} MB, more than any text of this kind needs")
    around: list[tuple[str, str, list[str], list[Element]]] = [("", "", [], [])]
    count = 0

    def begin(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if count > MOST_ELEMENTS:
            raise TextError(f"has more than {MOST_ELEMENTS} elements")
        if len(around) > MOST_DEPTH:
            raise TextError(f"is nested more than {MOST_DEPTH} deep")
        around.append((tag.rpartition(" ")[2], attributes.get("name", ""), [], []))

    def end(_: str) -> None:
        tag, name, parts, children = around.pop()
        around[-1][3].append(Element(tag, "".join(parts).strip(), children, name))

    def refuse(*_: Any) -> Any:
        raise FormatError("has a document type or entities, which no file of this kind needs")

    parser = expat.ParserCreate("utf-8", namespace_separator=" ")
    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.CharacterDataHandler = lambda part: around[-1][2].append(part)
    # Entities expand exponentially ("billion laughs") or fetch files; no format that is read here
    # needs them.
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = parser.ExternalEntityRefHandler = refuse
    try:
        parser.Parse(text.encode("utf-8"), True)
    except expat.ExpatError as error:
        raise FormatError(f"is not XML: {error}") from error
    return around[0][3][0]


def _measure(text: str) -> None:
    """Raise TextError for a text beyond bounds before it is parsed, in one pass over it."""
    if len(text) > MAX_BYTES:
        raise TextError(f"is larger than {MAX_BYTES / 1e6:g} MB, more than any text of this kind needs")
    depth = dots = values = 0
    for token in _TOKEN.finditer(text):
        kind = token.group()
        if kind == ".":
            dots += 1
            if dots >= MOST_DOTS:
                raise TextError(f"line {_line(text, token)}: a key of more than {MOST_DOTS} parts")
        elif kind in "[{":
            depth, dots = depth + 1, 0
            if depth > MOST_DEPTH:
                raise TextError(f"line {_line(text, token)}: nested more than {MOST_DEPTH} deep")
        # A stray closing bracket must not make room for more opening ones.
        elif kind in "]}":
            depth, dots = max(depth - 1, 0), 0
        elif kind in "=,\n":
            values, dots = values + (kind == ","), 0
            if values > MOST_VALUES:
                raise TextError(f"line {_line(text, token)}: more than {MOST_VALUES} values")
        # A string without an end: the parser stops here as well, so nothing behind it counts.
        elif kind in "\"'":
            return
        elif kind[0] not in "\"'#":
            raise TextError(f"line {_line(text, token)}: a number or a name of more than {MOST_DIGITS} letters")


def _line(text: str, token: re.Match[str]) -> int:
    return text.count("\n", 0, token.start()) + 1


def _walk(document: Any) -> None:
    """Raise TextError for a parsed document beyond bounds."""
    # A list and no recursion: the document may be nested as deep as a parser allows.
    keys, left = 0, [(document, 0, "")]
    while left:
        value, depth, name = left.pop()
        if isinstance(value, dict):
            keys += len(value)
            if keys > MOST_KEYS:
                raise TextError(f"has more than {MOST_KEYS} keys")
            for key, entry in value.items():
                if len(key) > MOST_KEY:
                    raise TextError(f"the key {shortened(key, 40)} has {len(key)} letters, more than {MOST_KEY}")
                left.append((entry, depth + 1, f"{name}.{key}" if name else key))
        elif isinstance(value, list):
            left += [(entry, depth + 1, name) for entry in value]
        elif isinstance(value, int) and not -MOST_WHOLE < value < MOST_WHOLE:
            raise TextError(f"{name} = {shortened(f'{value:x}', 20)} (hexadecimal) is beyond 2^64")
        if depth > MOST_DEPTH:
            raise TextError(f"{shortened(name, 80)} is nested more than {MOST_DEPTH} deep")
