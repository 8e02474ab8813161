"""Code of the user's own: the one place where a file that a scenario or a study names is run."""

from importlib import util
from pathlib import Path
from types import ModuleType

from airflock.errors import RuleError, ScenarioError


def own_code(key: str, name: str, folder: Path | None = None) -> ModuleType:
    """Module from a user's Python file, beside the scenario file or in the current folder; key: what named it.

    Raises ScenarioError where there is no such file, RuleError where it fails.
    """
    beside = Path(name) if folder is None else folder / name
    path = beside if beside.is_file() else Path(name)
    spec = util.spec_from_file_location(path.stem, path) if path.suffix == ".py" and path.is_file() else None
    if spec is None or spec.loader is None:
        raise ScenarioError([f"{key} = {name!r}: no such Python file"])
    module = util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as fault:  # the user's own file may fail in any way
        raise RuleError(f"{path}: {type(fault).__name__}: {fault}") from fault
    return module
