"""Machines with a GPU of some size, or with none, where there is neither."""

from types import SimpleNamespace


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
