"""Compiled kernels: argument types of a kernel, its first launch, and its PTX for any GPU without one at hand."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType, SimpleNamespace
from typing import Any

from airflock.engine.cuda.flight_kernel import ARGUMENTS
from airflock.engine.numba_private.sealed_cache import rare_gc


@contextmanager
def first_launch(kernel: Any) -> Iterator[None]:
    """Around a launch: the first one of a kernel compiles it, or finds it on disk."""
    if getattr(kernel, "overloads", True):  # the simulator's kernels have none and are never compiled
        yield
        return
    lock: Any = import_module("numba.cuda.core.compiler_lock").global_compiler_lock
    with lock, rare_gc():
        yield


@contextmanager
def without_occupancy_warning() -> Iterator[None]:
    """Around the configuration of a launch: numba-cuda warns of fewer than 128 blocks, as many as there are flocks."""
    settings: Any = import_module("numba.cuda.core.config")
    usual, settings.CUDA_LOW_OCCUPANCY_WARNINGS = settings.CUDA_LOW_OCCUPANCY_WARNINGS, 0
    try:
        yield
    finally:
        settings.CUDA_LOW_OCCUPANCY_WARNINGS = usual


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
    with target_capability(capabilities[0]), rare_gc():
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
