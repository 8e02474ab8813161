"""All uses of private modules of Numba, behind one guard.

Private modules change without notice. Where Numba is not of the TESTED versions, or
AIRFLOCK_PLAIN_NUMBA is set, drivers are compiled by plain `njit` and kept by Numba's own cache: the
same flights, compiled more slowly.

driver_compiler : the compiler of drivers, without the work that a driver never needs
sealed_cache    : compiled drivers on disk under checksums, and a lock so that one process compiles
                  each
cuda_compiler   : kernels for GPUs, their PTX without a GPU
"""

import os
from importlib.metadata import PackageNotFoundError, version

# First and last minor release that the agreement tests have run with.
TESTED = {"numba": ((0, 68), (0, 68)), "numba-cuda": ((0, 30), (0, 30))}


def is_tested(package: str = "numba") -> bool:
    """Return True if the private modules of an installed package may be used."""
    if os.environ.get("AIRFLOCK_PLAIN_NUMBA"):
        return False
    try:
        major, minor = version(package).split(".")[:2]
    except PackageNotFoundError:
        return False
    first, last = TESTED[package]
    return first <= (int(major), int(minor)) <= last
