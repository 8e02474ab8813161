"""Drivers on disk: one folder per content hash, so that no cache can ever serve stale physics.

The hash covers the whole driver text (all rules, ours and the user's, are inside), the versions of
the compiler, our own passes of it and the processor. What runs is always the text that was
generated, never a file's; compiled code is loaded only under a seal (`numba_private.sealed_cache`;
plain Numba has none), from a folder that belongs to the user alone (`airflock.support.cache`).
"""

import hashlib
import json
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from threading import Lock
from types import ModuleType
from typing import Any

import airflock
from airflock.engine.never_collected import frozen_imports
from airflock.engine.numba_private import is_tested
from airflock.support import DRIVERS, AirflockError, atomic, cache_folder, private_folder, shrink, toolchain_versions

SWEPT = 1 / 64  # share of new drivers, by their hash, at which the whole cache is looked through for old ones

PASSES = ("compiler.py", "numba_private/driver_compiler.py")  # what makes machine code of a driver's text

SCRIPT = Path(__file__).with_name("one_driver.py")

_loading = Lock()


@cache
def compiler_fingerprint() -> str:
    """Return the versions, processor and passes of ours that turn a text into machine code."""
    passes = hashlib.sha256(b"".join((Path(__file__).parent / name).read_bytes() for name in PASSES))
    return f"{toolchain_versions()}|{passes.hexdigest()}{'' if is_tested() else '|plain'}"


def load_driver(text: str, label: str, *, by_process: bool = True) -> ModuleType:
    """Import a driver from its text; compiled code of an earlier process is reused.

    by_process : where plain Numba compiles, it does so in a process of its own, and this one loads
                 the code
    """
    _import_compiler()
    # Numba's own cache looks at the time stamp of one file and would serve stale physics when a
    # helper elsewhere changes.
    digest = hashlib.sha256(f"{compiler_fingerprint()}\n{text}".encode()).hexdigest()[:20]
    name = f"airflock_driver_{label}_{digest}"
    with _loading:  # a thread must not get a module that another one is still executing
        return sys.modules[name] if name in sys.modules else _import(name, digest, text, label, by_process)


def _import_compiler() -> None:
    """Import what drivers import, if nobody has imported Numba yet."""
    with _loading:
        if "numba" not in sys.modules:
            with frozen_imports():
                from airflock.engine import compiler  # noqa: F401

                if is_tested():
                    from airflock.engine.numba_private import sealed_cache  # noqa: F401
        from numba import config

        if config.DISABLE_JIT:  # type: ignore[attr-defined]
            raise AirflockError(
                "NUMBA_DISABLE_JIT is set, so Numba compiles nothing: unset it, or fly with --device python "
                "(in Python: device='python')"
            )


def _import(name: str, digest: str, text: str, label: str, by_process: bool) -> ModuleType:
    try:
        path = _written(cache_folder() / DRIVERS / digest, label, text)
    except OSError:  # filled up since it was looked at
        path = _written(private_folder() / DRIVERS / digest, label, text)
    module = ModuleType(name)
    module.__file__ = str(path)
    module.TEXT = text  # type: ignore[attr-defined]
    sys.modules[name] = module
    # The text in memory runs, never the file: a changed file once flew other physics with status 0.
    exec(compile(text, path, "exec"), vars(module))  # our own text, and not what the file may hold by now
    if is_tested():
        from airflock.engine.numba_private.sealed_cache import seal_functions

        seal_functions(module, digest)
    elif by_process and hasattr(module, "advance"):
        module.advance.compile = _compiled_by_process(module, module.advance.compile)
    return module


def _compiled_by_process(module: ModuleType, compile_: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Wrap the compilation by plain Numba so that what flies is always code from the cache."""

    # In the process that compiles, calls reach copies of functions that were optimised one by one;
    # in code that is loaded they reach those optimised together. The last bits of a flight differ.
    def compiled(signature: Any) -> Any:
        if not any(Path(module.advance.stats.cache_path).glob("*.nbi")):
            compile_by_process(module, signature)
        return compile_(signature)

    return compiled


def compile_by_process(driver: ModuleType, types: tuple[Any, ...]) -> None:
    """Have another process compile a driver for these argument types, and keep it; wait for its end.

    Nothing happens where no process can be started, or it fails for any reason: then this process
    compiles.
    """
    # Numba keeps the interpreter lock for long stretches: compiling in a thread made gaps of 66 to
    # 171 ms in a page of 30 frames a second, a process below 50 ms. It is no fork: threads and LLVM
    # are not made for that.
    if not sys.executable:  # a program that has Python inside does not know where it is
        return
    file = Path(str(driver.__file__))
    paths = [path for path in sys.path if os.path.isabs(path)]
    request = {
        "paths": [*paths, str(Path(airflock.__file__).parents[1])],
        "text": driver.TEXT,
        "label": file.stem,
        "types": pickle.dumps(types).hex(),
    }
    # isolated (-I, -S): neither the folder in which somebody works nor a start-up file decides what
    # is imported
    with (
        suppress(OSError),
        subprocess.Popen(
            [sys.executable, "-I", "-S", str(SCRIPT)],
            env={**os.environ, "AIRFLOCK_CACHE": str(file.parents[2])},
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        ) as process,
    ):
        assert process.stdin is not None
        process.stdin.write(f"{json.dumps(request)}\n".encode())
        process.stdin.flush()
        process.wait()  # with its input open: the end of this process is the end of that one


def _written(folder: Path, label: str, text: str) -> Path:
    """File with a driver's text, for debuggers and for Numba, which keeps its files beside it."""
    path = folder / f"{label}.py"
    new = not folder.is_dir()
    if new:
        folder.unlink(missing_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
    if not path.is_file() or path.read_bytes() != text.encode():
        atomic.write_file(path, text)  # written beside and renamed: another process may be doing the same
    os.utime(folder)
    if new and int(folder.name[:2], 16) < 256 * SWEPT:
        shrink(folder.parent.parent)
    return path
