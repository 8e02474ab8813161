"""Libraries: code of LLVM of the functions of a driver, of which only what Python calls becomes machine code."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from numba.core.codegen import Codegen, JITCodeLibrary
from numba.core.runtime import rtsys  # type: ignore[attr-defined]  # Numba has no types, here and below

from airflock.engine.compile_shortcuts import IS_TESTED_VERSION
from airflock.engine.layout import CACHE_LINE

# what Numba calls the body of a loop over threads, what unpacks its arguments, and what hands its
# parts to threads
OF_LOOPS = ("__numba_parfor_gufunc", "<numba.np.ufunc.wrappers.", "parallelgufuncwrapper")


class DriverLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code of a function."""

    counted = True  # whether it counts references to arrays

    def add_ir_module(self, module: Any) -> None:
        """Add functions. A vector that does not fit into registers lies on the stack: whole in one line of the cache.

        LLVM moves the stack only where it is told so before it shares out the registers; else vectors lie at multiples
        of 16 bytes, across two lines in every second process, and pair loops that are short of registers take 8 % more.
        """
        for function in module.functions:
            if function.blocks:
                function.attributes.alignstack = CACHE_LINE
        super().add_ir_module(module)

    def add_linking_library(self, library: Any) -> None:
        """Link another one; that which counts references only where any are counted."""
        if self.counted or library is not rtsys.library:
            super().add_linking_library(library)

    def _optimize_final_module(self) -> None:
        """Optimise; functions that stand by themselves are nobody else's, so that they are called with what they read.

        Of each row that is where it lies; the rest of its record would go over the stack, which takes a tenth of a
        flight of 30.
        """
        for function in self._final_module.functions:
            if not function.is_declaration and any(b"noinline" in found for found in function.attributes):
                # Internal linkage lets LLVM hand over only what is read of an array; whole records
                # took a tenth of a flight of 30 agents.
                function.linkage = "internal"
        super()._optimize_final_module()

    def _optimize_functions(self, module: Any) -> None:
        if not IS_TESTED_VERSION:
            super()._optimize_functions(module)
            return
        module.data_layout = self._codegen._data_layout
        written = [found for found in module.functions if not found.is_declaration]
        super()._optimize_functions(SimpleNamespace(functions=written))


class InlinedLibrary(DriverLibrary):
    """Code of a function that only compiled functions call: optimised, and never turned into machine code."""

    def _optimize_final_module(self) -> None:
        JITCodeLibrary._optimize_final_module(self)

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


def _made(usual: Callable[..., Any], codegen: Any, name: str, **named: Any) -> Any:
    """A library of Numba's. Those of a loop over threads are linked, and called, by the function around it alone."""
    return InlinedLibrary(codegen, name) if name.startswith(OF_LOOPS) else usual(codegen, name, **named)


PARALLEL_REPLACEMENT = Codegen, "create_library", _made
