"""Machines with a GPU of some size, or with none, where there is neither."""

import sys
from types import SimpleNamespace

from airflock.support import gpu


def runtime(free=0, available=True, fault=None, device=None):
    """Stands for numba-cuda's runtime interface on a machine with a GPU with so many free bytes, or with none."""

    def current():
        if device is not None:
            raise device
        return SimpleNamespace(MULTIPROCESSOR_COUNT=132)

    memory = SimpleNamespace(free=free, total=free)
    return SimpleNamespace(
        is_available=lambda: available,
        cuda_error=lambda: fault,
        get_current_device=current,
        current_context=lambda: SimpleNamespace(get_memory_info=lambda: memory),
    )


def replace_gpu(monkeypatch, **properties):
    """Put such a machine in the place of this one; call `forget_gpu` when the test ends.

    The loader of numba-cuda is replaced, not `gpu.cuda_runtime`: other modules hold that function by its name.
    """

    def load(name):
        if sys.modules.get(name, name) is None:  # a test says that it is not installed
            raise ModuleNotFoundError(f"import of {name} halted", name=name)
        return runtime(**properties)

    monkeypatch.setattr(gpu, "import_module", load)
    forget_gpu()


def forget_gpu():
    """Forget what was found out about the GPU, so that the next test looks again."""
    gpu.unavailable_reason.cache_clear()
