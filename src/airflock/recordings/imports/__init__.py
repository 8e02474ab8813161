"""Tracks of others: one reader per format, one set of checks, one time grid, and the door `load_tracks`.

A reader is a function in a file of this folder, or of the folder `readers` of an installed package
that declares the entry point `airflock.parts`. Its decorator declares which files it reads, and no
list names it:

    @reader("my log", suffixes=(".mylog",), sniff=lambda start: start.startswith(b"MYLOG")) def
    read_my_log(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
        '''Time and place of each bird.'''
"""

import ast
import warnings
from collections.abc import Callable, Iterator
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from inspect import cleandoc
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from airflock.core import installed

T = TypeVar("T", bound=Callable[..., Any])

SNIFFED = 4096  # bytes of a file that a sniffer gets


class Format(NamedTuple):
    """A format of files, as the decorator of its reader declares it.

    about : first paragraph of the reader's docstring; needs : packages beside those of Airflock
    """

    name: str
    suffixes: tuple[str, ...]
    needs: str
    about: str
    module: str
    function: str

    def load(self) -> Any:
        """Import the reader; its `sniff` is that of its decorator."""
        return getattr(import_module(self.module), self.function)


def reader(
    name: str, *, suffixes: tuple[str, ...], sniff: Callable[[bytes], bool] | None = None, needs: str = ""
) -> Callable[[T], T]:
    """Declare a reader of files; all but `sniff` is written literally, since it is read without running the file.

    name     : of the format; suffixes : endings of its files, in small letters
    sniff    : returns True for the first bytes of a file of this format: it then reads files of any
               ending
    needs    : packages beside those of Airflock, with their licences
    """

    def declare(read: T) -> T:
        read.sniff = sniff  # type: ignore[attr-defined]
        return read

    return declare


@cache
def formats() -> list[Format]:
    """Return the formats that can be read: ours, then those of installed packages.

    They are read from the text of the files: help names them without importing NumPy.
    """
    found = list(_declared(__name__))
    for owner, top in installed():
        try:
            found += _declared(f"{top}.readers")
        except Exception as error:  # a package of somebody else may fail in any way, and ours must go on
            warnings.warn(f"{owner}: {top}.readers: {error}; its readers are left out", stacklevel=2)
    return found


def _declared(package: str) -> Iterator[Format]:
    """Yield the formats that the files of a package declare; none where there is no such package."""
    try:
        spec = find_spec(package)
    except ModuleNotFoundError:
        return
    folders = spec.submodule_search_locations or () if spec else ()
    for path in sorted(path for folder in folders for path in Path(folder).glob("*.py")):
        # Each function alone, up to two blank lines: to parse the files would take longer than to read some tracks.
        for text in path.read_text(encoding="utf-8").split("\n@reader(")[1:]:
            node = ast.parse(f"@reader({text}".split("\n\n\n")[0], str(path)).body[0]
            assert isinstance(node, ast.FunctionDef) and isinstance(node.decorator_list[0], ast.Call)
            call = node.decorator_list[0]
            own = {key.arg: ast.literal_eval(key.value) for key in call.keywords if key.arg != "sniff"}
            about = cleandoc(ast.get_docstring(node) or "").split("\n\n")[0].replace("\n", " ")
            names = (f"{package}.{path.stem}", node.name)
            yield Format(ast.literal_eval(call.args[0]), own["suffixes"], own.get("needs", ""), about, *names)


def format_words() -> str:
    """Return endings and names of all formats, for help and errors: `.ulg (PX4 ULog), ...`."""
    return ", ".join(f"{', '.join(one.suffixes)} ({one.name})" for one in formats())
