"""Drivers on disk: one folder per content hash, so that no cache can ever serve stale physics.

The hash covers the whole driver text (all rules, ours and the user's, are inside), the versions of the compiler and the
processor. `AIRFLOCK_CACHE` names another place than the user's cache folder.
"""

import hashlib
import importlib.util
import os
import platform
import shutil
import sys
import tempfile
from functools import cache
from pathlib import Path
from threading import Lock
from types import ModuleType

from airflock import atomic


@cache
def toolchain() -> str:
    """Versions and processor that compiled code depends on."""
    import llvmlite
    import llvmlite.binding as llvm
    import numba
    import numpy

    return "|".join(
        (
            platform.python_version(),
            numba.__version__,
            llvmlite.__version__,
            numpy.__version__,
            llvm.get_host_cpu_name(),
        )
    )


ROOM = 20_000_000  # bytes that must be free for a driver and its compiled code


def cache_folder() -> Path:
    """Folder that holds all drivers; a temporary one if the usual place cannot be written or is full."""
    named = os.environ.get("AIRFLOCK_CACHE")
    base = Path(named) if named else Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "airflock"
    try:
        base.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=base):
            if shutil.disk_usage(base).free > ROOM:
                return base
    except OSError:
        pass  # not writable: the next best place serves as well
    spare = Path(tempfile.gettempdir()) / f"airflock-{os.getuid() if hasattr(os, 'getuid') else 'cache'}"
    spare.mkdir(parents=True, exist_ok=True)
    return spare


_loading = Lock()


def load_driver(text: str, label: str) -> ModuleType:
    """Import a driver from its text; compiled code of an earlier process is reused."""
    digest = hashlib.sha256(f"{toolchain()}\n{text}".encode()).hexdigest()[:20]
    name = f"airflock_driver_{label}_{digest}"
    with _loading:  # a thread must not get a module that another one is still executing
        return sys.modules[name] if name in sys.modules else _import(name, digest, text, label)


def _import(name: str, digest: str, text: str, label: str) -> ModuleType:
    folder = cache_folder() / digest
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{label}.py"
    if not path.exists():  # written beside and renamed: another process may be doing the same
        atomic.write(path, text)
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"cannot import {path}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
