"""Work of numba-cuda's that changes nothing, left out while a kernel is compiled, as on the CPU. Same PTX."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from airflock.engine.compile_shortcuts import Replacement, cached_call_type, patched, post_processed, rename_in_blocks

TRIED = (0, 30), (0, 30)  # first and last version of numba-cuda of which this was tried


@contextmanager
def shortcuts() -> Iterator[None]:
    """Around the compilation of kernels by one thread at a time."""
    tried = TRIED[0] <= tuple(map(int, import_module("numba_cuda").__version__.split(".")[:2])) <= TRIED[1]
    with patched(*_spared() if tried else ()):
        yield


@contextmanager
def first_launch(kernel: Any) -> Iterator[None]:
    """Around a launch: the first one of a kernel compiles it, or finds it on disk. Two fifths of the time are saved."""
    if getattr(kernel, "overloads", True):  # the simulator's kernels have none and are never compiled
        yield
        return
    lock: Any = import_module("numba.cuda.core.compiler_lock").global_compiler_lock
    with lock, shortcuts():
        yield


def _spared() -> tuple[Replacement, ...]:
    """Those of numba-cuda, which has a compiler of its own with the names of Numba's."""
    core = "numba.cuda.core."
    flags: Any = import_module(core + "targetconfig").TargetConfig
    return (
        (import_module("numba.core.types").functions.BaseFunction, "get_call_type", cached_call_type),
        (import_module(core + "postproc").PostProcessor, "run", post_processed),
        (import_module(core + "ssa"), "_run_block_rewrite", rename_in_blocks),
        (flags, "values", _values),
        (flags, "__hash__", _hash),
        (flags, "__eq__", _equal),
    )


def _values(usual: Callable[..., Any], flags: Any) -> dict[str, Any]:
    """All flags of a compilation by name, of which few are not the usual ones."""
    return {name: flags._values.get(name, option.default) for name, option in flags.options.items()}


def _hash(usual: Callable[..., int], flags: Any) -> int:
    """That of their names, which is all that Numba hashes."""
    return hash(tuple(sorted(flags.options)))


def _equal(usual: Callable[..., Any], flags: Any, other: Any) -> Any:
    """Whether all flags are the same."""
    return flags is other or usual(flags, other)
