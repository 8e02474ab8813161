"""Memory that was freed and that the C library keeps for itself."""

import ctypes


def trim_heap() -> None:
    """Give back to the system what was freed in small pieces, where the C library can (glibc)."""
    try:
        ctypes.CDLL(None).malloc_trim(0)
    except (OSError, AttributeError, TypeError):  # another C library: nothing to do
        return
