"""Laws by name, and Python files of the user's own: these run only by consent, and each error in one is one line.

A scenario or a study is data; a file of code that it names runs with all rights of the person who
opens it. So it is imported only with consent: `trust=True`, `--trust`, or the law itself (`law=`,
`--law`).
"""

import hashlib
import inspect
import json
import linecache
import os
import sysconfig
import traceback
from collections.abc import Callable, Mapping
from importlib import util
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from airflock.core import Model, bound_values, declarations, model
from airflock.parts import LAWS
from airflock.support import (
    ParameterError,
    RuleError,
    ScenarioError,
    cache_folder,
    describe_error,
    expand_path,
    is_file,
    shortened,
    to_identifier,
)

MODELS = LAWS


def find_law(kind: Any, folder: Path | None = None, *, where: str = "model.kind", trust: bool = False) -> Model:
    """Find a law by name, or in a user's own file (relative to the scenario file), which runs only with `trust`."""
    if kind is None:
        section, _, key = where.rpartition(".")
        how = f'write a law under [{section}], for instance {key} = "{MODELS.default}"'
        others = f"known: {', '.join(MODELS)}, or a file that ends in .py"
        raise ScenarioError([f'{where} is missing; {how}, or begin the file with extends = "PRESET"; {others}'])
    if not isinstance(kind, str):
        raise ScenarioError([f"{where} = {shortened(repr(kind), 80)} is not a name; known: {', '.join(MODELS)}"])
    if kind in MODELS:
        return MODELS[kind]
    if kind.endswith(".py"):
        return build_from_file(model, where, kind, folder, trust=trust)
    raise ScenarioError([f"{where} = {kind!r}: {MODELS.unknown(kind, ', or a file that ends in .py')}"])


def law_from_caller(law: Any) -> Model:
    """Make the model of a law that the caller gives: giving it is consent to run it."""
    if isinstance(law, Model):
        return law
    if isinstance(law, (str, os.PathLike)):
        return find_law(str(law), where="law", trust=True)
    if isinstance(law, Mapping) or hasattr(law, "__dict__"):
        return model(law)
    raise ScenarioError(
        [f"law = {law!r} is not a law; give a module, a class, a mapping, or one of {', '.join(MODELS)}"]
    )


T = TypeVar("T")


def import_user_file(path: Path, where: str, *, trust: bool) -> ModuleType:
    """Import a Python file that a scenario or study names.

    where : key and value that name it, for errors
    trust : True if the caller consents to running it
    Raises ScenarioError without consent or without the file, and RuleError for exceptions of its
    import.
    """
    if not is_file(path):
        raise ScenarioError([f"{where}: no such file"])
    # `--set model.kind=mine.py` is no consent, as settings often come from elsewhere. Only `law=`,
    # `--law` and `--trust` are.
    if not trust:
        raise ScenarioError(
            [f"{where}: would run the code in {path.absolute()}; if you trust it, add --trust (in Python: trust=True)"]
        )
    spec = util.spec_from_file_location(path.stem, path)
    if spec is None or not isinstance(spec.loader, SourceFileLoader):
        raise ScenarioError([f"{where}: is not a Python file"])
    module = util.module_from_spec(spec)
    linecache.cache.pop(str(path), None)  # rules are compiled from it; it sees no change that keeps size and time
    try:  # the text as it is now: bytecode kept beside it may be of an earlier text, or of a stranger's
        exec(spec.loader.source_to_code(path.read_bytes(), str(path)), vars(module))
    # A file may call sys.exit or be interrupted while it is imported; the command must still end
    # with one line.
    except (Exception, SystemExit, KeyboardInterrupt) as error:  # the user's own file may fail in any way
        # The last frame in the user's own file is the useful place, not the library function in
        # which it failed.
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
        place = f"{path}:{lines[-1]}" if lines else str(path)
        raise RuleError(f"{place}: {shortened(describe_error(error))}{_beside(path, error)}") from error
    return module


def _beside(path: Path, error: BaseException) -> str:
    """Return a hint for a missing module that lies beside the importing file; "" for any other error."""
    wanted = str(error.name).partition(".")[0] if isinstance(error, ModuleNotFoundError) else ""
    if not wanted or not is_file(path.with_name(f"{wanted}.py")):
        return ""
    return f"; code of your own is one file, also of those who get it from you: write into it what {wanted}.py has"


def build_from_file(
    make: Callable[[ModuleType, str], T], key: str, name: str, folder: Path | None = None, *, trust: bool
) -> T:
    """Make an object from the module and the name of a user's own file; every error names the file.

    Raises what `import_user_file` and `make` raise.
    """
    beside = expand_path(name) if folder is None else folder / expand_path(name)  # or in the current folder
    path = beside if is_file(beside) else expand_path(name)
    module = import_user_file(path, f"{key} = {name!r}", trust=trust)
    try:
        made = make(module, to_identifier(Path(name).stem))
        # A default outside its own range is found here, and not by the first flight that leaves the
        # number out.
        if isinstance(record := getattr(module, "Parameters", None), type) and declarations(record):
            record()  # its defaults are checked by their own ranges
        return made
    except (RuleError, ParameterError) as error:
        lines = str(error).splitlines()
        named_lines = [line if Path(name).name in line else f"{name}: {line}" for line in lines]
        raise type(error)("\n".join(named_lines)) from error


def user_error_line(error: Exception) -> str:
    """Return the line and place of an exception that the user's own code raised; "" if anything else raised it."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    path = Path(last.filename).resolve()
    # The error is the user's only if the last frame is neither ours, nor Python's, nor an installed
    # package's, nor a generated driver's.
    others = (
        Path(__file__).resolve().parents[1],
        Path(sysconfig.get_path("stdlib")).resolve(),
        cache_folder().resolve(),
    )
    installed = {"site-packages", "dist-packages"} & set(path.parts)
    if installed or not path.is_file() or any(path.is_relative_to(folder) for folder in others):
        return ""
    return f"{last.filename}:{last.lineno}: {shortened(describe_error(error))}"


def law_hash(law: Model) -> str:
    """Return a hash of the text of a law's rules, and of the functions and numbers that they refer to."""
    texts: dict[str, str] = {}
    for rule, values in bound_values((*vars(law).values(), *law.decide_rules)).items():
        try:
            texts[rule.__qualname__] = inspect.cleandoc(inspect.getsource(rule))
        except (OSError, TypeError):  # typed at a prompt: there is only its code
            texts[rule.__qualname__] = rule.__code__.co_code.hex()
        numbers = {name: repr(value) for name, value in values.items() if not isinstance(value, type)}
        texts |= {f"{rule.__qualname__}.{name}": number for name, number in numbers.items()}
    return hashlib.sha256(json.dumps(sorted(texts.items())).encode()).hexdigest()[:16]
