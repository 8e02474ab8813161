"""Python files of the user's own: run only by consent, and whatever goes wrong in one is one line.

A scenario or a study is data; a file of code that it names runs with all rights of the one who opens it. So it is
imported only if the caller says so: `trust=True`, `--trust`, or by giving the law itself (`law=`, `--law`).
"""

import hashlib
import inspect
import json
import sysconfig
import traceback
from collections.abc import Callable
from importlib import util
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import FunctionType, ModuleType
from typing import TypeVar

from airflock.core import Model, declarations
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

T = TypeVar("T")


def load_user_module(key: str, name: str, folder: Path | None = None, *, trust: bool) -> ModuleType:
    """Module of a Python file that a key names, beside the scenario file or else in the current folder.

    Raises what `import_user_file` raises.
    """
    beside = expand_path(name) if folder is None else folder / expand_path(name)
    return import_user_file(beside if is_file(beside) else expand_path(name), f"{key} = {name!r}", trust=trust)


def import_user_file(path: Path, where: str, *, trust: bool) -> ModuleType:
    """Module of a Python file that a scenario or study names.

    told  : key and value that name it, for faults
    trust : whether the caller consents to running it
    Raises ScenarioError without consent or without the file, and RuleError for what its import raises.
    """
    if not is_file(path):
        raise ScenarioError([f"{where}: no such file"])
    if not trust:
        raise ScenarioError(
            [f"{where}: would run the code in {path.absolute()}; if you trust it, add --trust (in Python: trust=True)"]
        )
    spec = util.spec_from_file_location(path.stem, path)
    if spec is None or not isinstance(spec.loader, SourceFileLoader):
        raise ScenarioError([f"{where}: is not a Python file"])
    module = util.module_from_spec(spec)
    try:  # the text as it is now: bytecode kept beside it may be of an earlier text, or of a stranger's
        exec(spec.loader.source_to_code(path.read_bytes(), str(path)), vars(module))
    except (Exception, SystemExit, KeyboardInterrupt) as fault:  # the user's own file may fail in any way
        lines = [frame.lineno for frame in traceback.extract_tb(fault.__traceback__) if frame.filename == str(path)]
        place = f"{path}:{lines[-1]}" if lines else str(path)
        raise RuleError(f"{place}: {shortened(describe_error(fault))}{_beside(path, fault)}") from fault
    return module


def _beside(path: Path, fault: BaseException) -> str:
    """What to do about a module that was not found, where it lies beside the file that asks for it."""
    wanted = str(fault.name).partition(".")[0] if isinstance(fault, ModuleNotFoundError) else ""
    if not wanted or not is_file(path.with_name(f"{wanted}.py")):
        return ""
    return f"; code of your own is one file, also of those who get it from you: write into it what {wanted}.py has"


def build_from_file(
    make: Callable[[ModuleType, str], T], key: str, name: str, folder: Path | None = None, *, trust: bool
) -> T:
    """What is made of the module and the name of a user's own file; every fault names the file.

    Raises what `import_user_file` and `make` raise.
    """
    module = load_user_module(key, name, folder, trust=trust)
    try:
        made = make(module, to_identifier(Path(name).stem))
        if isinstance(record := getattr(module, "Parameters", None), type) and declarations(record):
            record()  # its defaults are checked by their own ranges
        return made
    except (RuleError, ParameterError) as fault:
        lines = str(fault).splitlines()
        told = [line if Path(name).name in line else f"{name}: {line}" for line in lines]
        raise type(fault)("\n".join(told)) from fault


def user_error_line(error: Exception) -> str:
    """What code of the user's own raised, in a line with its place; empty if anything else raised it."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    path = Path(last.filename).resolve()
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
    """Hash of the text of a law's rules and of the functions of its own that they call."""
    texts: dict[str, str] = {}
    left = [value for value in (*vars(law).values(), *law.decide_rules) if isinstance(value, FunctionType)]
    while left:
        rule = left.pop()
        if rule.__qualname__ in texts:
            continue
        try:
            texts[rule.__qualname__] = inspect.cleandoc(inspect.getsource(rule))
        except (OSError, TypeError):  # typed at a prompt: there is only its code
            texts[rule.__qualname__] = rule.__code__.co_code.hex()
        inside = [cell.cell_contents for cell in rule.__closure__ or ()]
        called = [rule.__globals__.get(name) for name in rule.__code__.co_names]
        left += [
            found
            for found in (*inside, *called)
            if isinstance(found, FunctionType) and found.__module__ == rule.__module__
        ]
    return hashlib.sha256(json.dumps(sorted(texts.items())).encode()).hexdigest()[:16]
