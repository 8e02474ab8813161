"""Options with which drivers compile their functions; every driver's text names them."""

from typing import Any

from airflock.engine.numba_private import is_tested
from airflock.support import vector_bits

INNER: dict[str, Any] = {}  # of functions that only compiled functions call
CALLED: dict[str, Any] = {}  # of the one that Python calls
WIDE = vector_bits() == 512  # whether `wide_vectors` of a driver asks for them

if is_tested():
    from airflock.engine.numba_private.driver_compiler import DriverCompiler

    INNER |= {"pipeline_class": DriverCompiler, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    CALLED |= INNER | {"no_cpython_wrapper": False}
