"""Compiled: argument types of a kernel, and its PTX for any GPU without one at hand."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType, SimpleNamespace
from typing import Any

from airflock.engine.compile_shortcuts import Replacement, cached_call_type, patched, post_processed, rename_in_blocks
from airflock.engine.cuda.flight_kernel import ARGUMENTS

# ------------------------------------------------------------------------ what compiling leaves out


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
    """Return True if all flags are equal."""
    return flags is other or usual(flags, other)


# ------------------------------------------------------------------------------- PTX without a card


# dimensions and kind of every argument: r real, i 64-bit and s 32-bit whole numbers, u words
KINDS = dict(zip(ARGUMENTS, (
    "2r", "2i", "3r", "3r", "3i", "3r", "3r", "2r", "2i", "3r", "3r", "3r", "4r", "4r", "3r", "3u", "3r", "3r", "1s",
    "3r", "3r", "2r", "4r", "3r", "1i", "4r", "3i", "3r",
), strict=True))  # fmt: skip


def signature(bits: int) -> tuple[Any, ...]:
    """Numba types of the arguments of a kernel of many flocks."""
    from numba import types

    real = types.float32 if bits == 32 else types.float64
    scalar: dict[str, Any] = {"r": real, "i": types.int64, "s": types.int32, "u": types.uint32}
    return tuple(types.Array(scalar[kind[1]], int(kind[0]), "C") for kind in KINDS.values())


@contextmanager
def target_capability(capability: tuple[int, int]) -> Iterator[None]:
    """Device functions are compiled for this compute capability instead of the present GPU's."""
    dispatcher: Any = import_module("numba.cuda.dispatcher")
    kept = dispatcher.get_current_device
    dispatcher.get_current_device = lambda: SimpleNamespace(compute_capability=capability)
    try:
        yield
    finally:
        dispatcher.get_current_device = kept


def ptx(
    driver: ModuleType,
    types: tuple[Any, ...],
    capabilities: tuple[tuple[int, int], ...] = ((8, 0), (9, 0)),
    kernel: str = "fly",
) -> dict[tuple[int, int], str]:
    """PTX of a kernel for some compute capabilities; needs no GPU, but the compiler of numba-cuda."""
    compiler: Any = import_module("numba.cuda.compiler")
    dispatched = getattr(driver, kernel)
    options = dispatched.targetoptions
    with target_capability(capabilities[0]), shortcuts():
        library, _ = compiler._compile_pyfunc_with_fixup(
            dispatched.py_func,
            types,
            device=False,
            fastmath=options.get("fastmath"),
            launch_bounds=options.get("launch_bounds"),
            cc=capabilities[0],
            lto=False,
            abi="numba",
        )
        return {cc: "\n".join(library.get_asm_strs(cc=cc)) for cc in capabilities}
