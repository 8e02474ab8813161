"""Types of rules: a type checker reads typed copies of rule files and tells what it finds by the file's own lines."""

import os
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import airflock
from airflock.atomic import write
from airflock.cache import cache_trouble, usual_folder
from airflock.checking.annotations import TypedCopy, typed_copy
from airflock.errors import RuleError
from airflock.untrusted import from_outside, own_path, read_text

PACKAGE = Path(airflock.__file__).parent
SCALAR = ("core/maths.py",)  # every function of these takes and gives plain numbers
# `import airflock` as rules use it; the rest of the package would have to be read with all that it imports
SLIM = """
from typing import Any
from airflock.core.contract import body as body, metric as metric, model as model
from airflock.core.sensor import sensor as sensor
from airflock.core.radio import radio as radio
from airflock.core.parameters import Parameters as Parameters, choice as choice, quantity as quantity
def __getattr__(name: str) -> Any: ...
"""
SETTINGS = """\
check_untyped_defs = True
strict_equality = True
ignore_missing_imports = True
follow_imports = silent
[mypy-numpy.*,pandas.*,scipy.*,xarray.*,matplotlib.*,numba.*]
follow_imports = skip
follow_imports_for_stubs = True
"""
NEVER = re.compile(r"Non-overlapping equality check .*: \"Literal\[(.*)\]\", .*: \"Literal\[(.*)\]\"\)")
TOLD = re.compile(r"(?P<file>.+?):(?P<line>\d+): error: (?P<text>.*?)(?:  \[[a-z-]+\])?")


class TypeFault(NamedTuple):
    """What a type checker says of one line of a rule file."""

    file: str
    line: int
    text: str

    def __str__(self) -> str:
        """One line for a person."""
        return f"{self.file}:{self.line}: {self.text}"


class TypeReport(NamedTuple):
    """What was found in some rule files.

    rules  : of each file, the rules that were checked
    faults : sorted by file and line
    """

    rules: dict[str, tuple[str, ...]]
    faults: tuple[TypeFault, ...]

    def __str__(self) -> str:
        """One line a file, then one a fault."""
        checked = [f"{file}: {', '.join(rules)}" for file, rules in self.rules.items()]
        return "\n".join([*checked, *map(str, self.faults)])


def check_types(files: str | Path | Sequence[str | Path], *, out: str | Path | None = None) -> TypeReport:
    r"""Let a type checker read rule files: laws, bodies, order parameters, metric sets, sensors, radios, faults.

    The argument names of a rule say what it is given, so the file needs no annotations: a copy is made in which every
    argument has the type of the vocabulary, and mypy reads the copy. It tells a parameter that does not exist
    (`p.prep`), a choice that can never hold (`p.limit == "cup"`), a record with too few fields, a command of two
    components. Nothing of the files runs.

    Parameters
    ----------
    files : str, Path or sequence of them
        Python files that hold rules.
    out : str or Path, optional
        Folder for the typed copies, which fly as the originals do: for an editor, or another type checker.

    Returns
    -------
    TypeReport
        The rules of each file, and the faults with file, line and text; none if all is well.

    Raises
    ------
    RuleError
        If a file cannot be read, is no Python or holds no rule; if its typed copy would replace it; or if mypy
        is not installed.

    Examples
    --------
    >>> import airflock
    >>> from pathlib import Path
    >>> text = "def preferred_speed(p):\n    return p.sped\n" + '''
    ... import airflock
    ... class Parameters(airflock.Parameters):
    ...     speed: float = airflock.quantity(4.0, "m/s", low=0.1, high=30.0, meaning="preferred speed")
    ... def decide(own, p):
    ...     return p.speed * own.hx, p.speed * own.hy, p.speed * own.hz
    ... '''
    >>> _ = Path("mine.py").write_text(text)
    >>> print(airflock.check_types("mine.py").faults[0])
    mine.py:2: "Parameters" has no attribute "sped"; maybe "speed"?
    """
    if not isinstance(files, Iterable) and not isinstance(files, Path):
        raise RuleError(f"{files!r} is not a file of rules; give its name, or a list of names")
    names = [str(own_path(file)) for file in ([files] if isinstance(files, (str, Path)) else files)]
    copies = _copies(names)
    if out is not None:
        _put(copies, own_path(out))
    faults = {TypeFault(name, line, text) for name, copy in copies.items() for line, text in copy.unknown}
    faults |= set(_told(copies))
    return TypeReport({name: copy.rules for name, copy in copies.items()}, tuple(sorted(faults)))


def _copies(names: Sequence[str]) -> dict[str, TypedCopy]:
    """Typed copies of files; raises a RuleError with a line for each file that is none of rules."""
    copies: dict[str, TypedCopy] = {}
    faults = []
    for name in names:
        if Path(name).suffix in (".toml", ".nc"):
            faults.append(f"{name}: is not a file of rules, which ends in .py; airflock validate {name} checks it")
            continue
        try:
            with from_outside(name, RuleError):
                copies[name] = typed_copy(read_text(name))
        except RuleError as fault:
            cause = fault.__cause__
            where = f"{name}:{cause.lineno}: {cause.msg}" if isinstance(cause, SyntaxError) else str(fault)
            faults.append(where)
            continue
        if not copies[name].rules:
            needed = (
                "a law has decide, a body move, an order parameter sample, a sensor measure or error, a radio missed, "
                "receive, late or see, a topology meet"
            )
            faults.append(f"{name}: holds no rule; {needed}")
    if faults:
        raise RuleError("\n".join(faults))
    return copies


def _put(copies: dict[str, TypedCopy], folder: Path) -> None:
    """Write typed copies into a folder, which is made if it is missing; no original is written over."""
    places = {name: folder / Path(name).name for name in copies}
    for name, place in places.items():
        if place.resolve() in {Path(other).resolve() for other in copies}:
            raise RuleError(f"{place}: the typed copy of {name} would replace it; give another folder")
        if list(places.values()).count(place) > 1:
            raise RuleError(f"{place}: two files of that name; type them one by one")
    folder.mkdir(parents=True, exist_ok=True)
    for name, place in places.items():
        write(place, copies[name].text)


def _told(copies: dict[str, TypedCopy]) -> Iterator[TypeFault]:
    """What mypy says of typed copies, by the lines of the originals."""
    try:
        from mypy import api
    except ImportError as fault:
        raise RuleError("types need mypy: pip install 'airflock[types]'") from fault
    with TemporaryDirectory() as folder:
        room = Path(folder).resolve()
        settings = room / "settings.ini"
        settings.write_text(f"[mypy]\nmypy_path = {','.join(_beside(copies))}\n{SETTINGS}", encoding="utf-8")
        shown = {f"rules_{number}.py": name for number, name in enumerate(copies)}
        for place, name in shown.items():  # under names of their own: mypy takes no my-law.py, and one module once
            (room / place).write_text(copies[name].text, encoding="utf-8")
        options = ["--config-file", str(settings), "--no-error-summary", "--no-pretty"]
        options += ["--cache-dir", os.devnull if cache_trouble(usual_folder()) else str(usual_folder() / "types")]
        options += ["--no-color-output", "--hide-error-context"]
        for number, (original, text) in enumerate(_ours()):
            shadow = room / f"ours_{number}.py"
            shadow.write_text(text, encoding="utf-8")
            options += ["--shadow-file", str(original), str(shadow)]
        said, complaints, status = api.run([*options, *(str(room / place) for place in shown)])
    if status not in (0, 1) or complaints:
        raise RuleError(f"mypy failed: {' '.join((complaints or said).split())}")
    for line in said.splitlines():
        found = TOLD.fullmatch(line)
        if found is None:
            continue
        place = Path(found["file"]).name  # what its cache says of the same text has another folder
        if place not in shown:  # what is imported is read silently: this is a file that mypy cannot place
            raise RuleError(f"mypy failed: {line}")
        name = shown[place]
        text = NEVER.sub(r"never holds: \2 is none of \1", found["text"])
        yield TypeFault(name, copies[name].line(int(found["line"])), text)


def _beside(names: Iterable[str]) -> list[str]:
    """Folders in which modules of a user's own may lie beside the rule files."""
    folders = {Path(name).resolve().parent for name in names}
    own = (str(folder) for folder in folders if PACKAGE not in (folder, *folder.parents))
    return sorted(folder for folder in own if not set(folder) & set(",:\n%"))  # which an ini file cannot hold


def _ours() -> Iterator[tuple[Path, str]]:
    """Each file of the package that a type checker shall read otherwise, with the text to be read."""
    yield PACKAGE / "__init__.py", SLIM
    for path in shipped():
        yield path, typed_copy(path.read_text(encoding="utf-8"), scalar(path)).text


def shipped() -> list[Path]:
    """Our own rule files."""
    folders = ("models", "body", "metrics", "sensors", "radios", "faults")
    return [*(PACKAGE / name for name in SCALAR), *(p for f in folders for p in sorted((PACKAGE / f).glob("*.py")))]


def scalar(path: Path) -> bool:
    """Whether all functions of one of our files take and give plain numbers."""
    return path.relative_to(PACKAGE).as_posix() in SCALAR
