"""Python files of the user's own: run only by consent, and whatever goes wrong in one is one line.

A scenario or a study is data; a file of code that it names runs with all rights of the one who opens it. So it is
imported only if the caller says so: `trust=True`, `--trust`, or by giving the law itself (`law=`, `--law`).
"""

import hashlib
import inspect
import json
import traceback
from importlib import util
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import FunctionType, ModuleType

from airflock.core.contract import Model
from airflock.errors import RuleError, ScenarioError, bounded
from airflock.spelling import raised
from airflock.untrusted import is_file, own_path


def own_code(key: str, name: str, folder: Path | None = None, *, trust: bool) -> ModuleType:
    """Module of a Python file that a key names, beside the scenario file or else in the current folder.

    Raises what `own_module` raises.
    """
    beside = own_path(name) if folder is None else folder / own_path(name)
    return own_module(beside if is_file(beside) else own_path(name), f"{key} = {name!r}", trust=trust)


def own_module(path: Path, told: str, *, trust: bool) -> ModuleType:
    """Module of a Python file that a scenario or study names.

    told  : key and value that name it, for faults
    trust : whether the caller consents to running it
    Raises ScenarioError without consent or without the file, and RuleError for what its import raises.
    """
    if not is_file(path):
        raise ScenarioError([f"{told}: no such file"])
    if not trust:
        raise ScenarioError(
            [f"{told}: would run the code in {path.absolute()}; if you trust it, add --trust (in Python: trust=True)"]
        )
    spec = util.spec_from_file_location(path.stem, path)
    if spec is None or not isinstance(spec.loader, SourceFileLoader):
        raise ScenarioError([f"{told}: is not a Python file"])
    module = util.module_from_spec(spec)
    try:  # the text as it is now: bytecode kept beside it may be of an earlier text, or of a stranger's
        exec(spec.loader.source_to_code(path.read_bytes(), str(path)), vars(module))
    except (Exception, SystemExit, KeyboardInterrupt) as fault:  # the user's own file may fail in any way
        lines = [frame.lineno for frame in traceback.extract_tb(fault.__traceback__) if frame.filename == str(path)]
        place = f"{path}:{lines[-1]}" if lines else str(path)
        raise RuleError(f"{place}: {bounded(raised(fault))}") from fault
    return module


def law_hash(law: Model) -> str:
    """Hash of the text of a law's rules and of the functions of its own that they call."""
    texts: dict[str, str] = {}
    left = [value for value in (*vars(law).values(), *law.deciding) if isinstance(value, FunctionType)]
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
