"""The GPU: whether one can be used, what it is, and why there is none."""

import os
from functools import cache
from importlib import import_module
from typing import Any

from airflock.support.errors import DeviceError

INSTALL = "pip install 'airflock[cuda]'"


def cuda_runtime() -> Any:
    """Return numba-cuda's runtime interface."""
    return import_module("numba.cuda")


@cache
def unavailable_reason() -> str | None:
    """Return why no GPU can be used here, as one line; None if one can."""
    try:
        import_module("numba_cuda")
        cuda = cuda_runtime()
    except ImportError as error:
        missing = isinstance(error, ModuleNotFoundError) and error.name == "numba_cuda"
        return f"numba-cuda is not installed; {INSTALL}" if missing else f"numba-cuda: {_first_line(error)}"
    # The simulator of numba-cuda says that a GPU is available.
    if is_simulated():
        return "the CUDA simulator is on (NUMBA_ENABLE_CUDASIM); it is only for tests"
    try:
        if not cuda.is_available():
            return f"no GPU can be used: {_first_line(cuda.cuda_error() or 'no device found')}"
        # A driver may report a device that it then cannot open.
        cuda.get_current_device()
    except Exception as error:  # the driver's own errors come in many types
        return f"the GPU cannot be used: {_first_line(error)}"
    return None


def _first_line(error: BaseException | str) -> str:
    # Messages of the driver begin with blank lines and underlines.
    lines = [line.strip(" .:-") for line in str(error).splitlines() if line.strip(" .:-")]
    return lines[0] if lines else type(error).__name__


def is_simulated() -> bool:
    """Return True if Numba's CUDA simulator stands for a GPU."""
    return os.environ.get("NUMBA_ENABLE_CUDASIM", "0") not in ("", "0")


def is_available() -> bool:
    """Return True if a GPU can be used."""
    return unavailable_reason() is None


def require_gpu(allow_simulator: bool = False) -> None:
    """Raise DeviceError with the reason if no GPU can be used."""
    if allow_simulator and is_simulated():
        return
    error = unavailable_reason()
    if error is not None:
        raise DeviceError(f"device = cuda: {error}; choose device = cpu or auto")


def free_gpu_memory() -> int:
    """Return the free bytes in the GPU's memory."""
    return int(cuda_runtime().current_context().get_memory_info().free)


def multiprocessor_count() -> int:
    """Return the number of multiprocessors of the GPU."""
    return int(cuda_runtime().get_current_device().MULTIPROCESSOR_COUNT)


def describe_gpus() -> list[dict[str, Any]]:
    """Describe every GPU: name, compute capability, multiprocessors, memory in GB."""
    if not is_available():
        return []
    cuda, gpus = cuda_runtime(), []
    for device in cuda.gpus:
        with device:
            memory = cuda.current_context().get_memory_info()
            name = device.name.decode() if isinstance(device.name, bytes) else str(device.name)
            gpus.append(
                {
                    "name": name,
                    "compute_capability": ".".join(map(str, device.compute_capability)),
                    "multiprocessors": int(device.MULTIPROCESSOR_COUNT),
                    "memory_gb": round(memory.total / 1e9, 1),
                    "free_gb": round(memory.free / 1e9, 1),
                }
            )
    return gpus
