"""The compiler of drivers: Numba's passes, without machine code that nobody calls.

A driver is some sixty small functions, of which Python calls one. By default Numba makes of each a
function that Python could call: two wrappers that unpack its arguments, machine code of its own,
and all three once more in every caller. Here the others stay what their callers link: optimised
code of LLVM.
"""

from collections.abc import Hashable
from typing import Any

from numba import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.runtime import rtsys  # type: ignore[attr-defined]  # Numba has no types, here and below
from numba.core.typed_passes import NativeLowering, NativeParforLowering, NopythonTypeInference

from airflock.engine.layout import CACHE_LINE


class DriverLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code of a function that Python calls."""

    counts_references = True  # to arrays

    def add_ir_module(self, module: Any) -> None:
        """Add functions, whose vectors on the stack lie whole in one line of the cache."""
        # LLVM moves the stack only where it is told so before it shares out the registers; else
        # vectors lie at multiples of 16 bytes, across two lines in every second process, and pair
        # loops that are short of registers take 8 % more.
        for function in module.functions:
            if function.blocks:
                function.attributes.alignstack = CACHE_LINE
        super().add_ir_module(module)

    def add_linking_library(self, library: Any) -> None:
        """Link another library; that which counts references only where any are counted."""
        if self.counts_references or library is not rtsys.library:
            super().add_linking_library(library)

    def _optimize_final_module(self) -> None:
        # Functions that stand by themselves are called by this driver alone. Internal linkage lets
        # LLVM hand over only what is read of an array; whole records took a tenth of a flight of 30.
        for function in self._final_module.functions:
            if not function.is_declaration and any(b"noinline" in attribute for attribute in function.attributes):
                function.linkage = "internal"
        super()._optimize_final_module()


class InlinedLibrary(DriverLibrary):
    """Code of a function that only compiled functions call: optimised, and never turned into machine code."""

    def _optimize_final_module(self) -> None:
        JITCodeLibrary._optimize_final_module(self)

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[untyped-decorator]
class DriverLowering(NativeLowering):  # type: ignore[misc]
    """Lowering of a function that Python calls."""

    _name = "driver_lowering"
    _library: type[DriverLibrary] = DriverLibrary

    def run_pass(self, state: Any) -> bool:
        """Make the library that callers link."""
        state.library = self._library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.counts_references = bool(state.flags.nrt)
        state.library.enable_object_caching()
        return bool(super().run_pass(state))


@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[untyped-decorator]
class InlinedLowering(DriverLowering):
    """Lowering of a function that only compiled functions call."""

    _name = "inlined_lowering"
    _library = InlinedLibrary

    def run_pass(self, state: Any) -> bool:
        """Make the library that callers link, and enter the function where they look for it."""
        state.flags.no_compile = True
        super().run_pass(state)
        result, described = state["cr"], state["cr"].fndesc
        # Python may not call it: in place of an address stands a method of C, one for each function,
        # that says so as a KeyError.
        entry = f"{{{described.qualname.split('.')[-1]}, which only other functions of its driver call}}".format
        state.targetctx.insert_user_function(entry, described, [state.library])
        state["cr"] = result._replace(cfunc=entry)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[untyped-decorator]
class ParallelLowering(InlinedLowering):
    """Lowering of a function that only compiled functions call, whose loops are spread over threads."""

    _name = "spread_lowering"
    lowering_class = NativeParforLowering.lowering_class


def _stands_once(function: Any) -> bool:
    """Return True if a function is not made part of those that call it."""
    return function.dispatcher.targetoptions.get("forceinline") is False


def _holds_array(kind: Any) -> bool:
    """Return True if a type is that of an array, or of a record of some."""
    parts: Any = kind if isinstance(kind, types.BaseTuple) else ()
    return isinstance(kind, types.Array) or any(_holds_array(part) for part in parts)


class _SharedTypes:
    """A typing context in which a function of a driver is compiled once for all whole numbers.

    Numba compiles it once more for each whole number that stands in the text of a caller. Not so
    what goes along arrays, such as those of a wing's 20 stations: LLVM adds up otherwise if it
    knows how long a loop is. Functions that stand once in a driver are there for all lengths.
    """

    # Signatures of operators and of functions of Numba's: it searches all forms for every statement.
    # Without this memory a driver for a city compiles in 7.0 s instead of 6.2.
    _known: dict[Hashable, Any] = {}

    def __init__(self, context: Any):
        self._context = context

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def resolve_function_type(self, function: Any, arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
        """Return the signature of a call."""
        own = isinstance(function, types.Dispatcher)
        if own and (_stands_once(function) or not any(_holds_array(one) for one in arguments)):
            arguments = tuple(
                types.unliteral(one) if isinstance(one, types.IntegerLiteral) else one for one in arguments
            )
        if named or isinstance(function, (types.Dispatcher, types.RecursiveCall)):
            return self._context.resolve_function_type(function, arguments, named)
        key = self._context, function, arguments
        if key not in self._known:
            signature = self._context.resolve_function_type(function, arguments, named)
            if signature is None:
                return None
            self._known[key] = signature
        return self._known[key]


@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[untyped-decorator]
class SharedTypeInference(NopythonTypeInference):  # type: ignore[misc]
    """Type inference with one version of a function for all whole numbers."""

    _name = "shared_type_inference"

    def run_pass(self, state: Any) -> bool:
        """Infer all types of a function."""
        context, state.typingctx = state.typingctx, _SharedTypes(state.typingctx)
        try:
            return bool(super().run_pass(state))
        finally:
            state.typingctx = context


class DriverCompiler(CompilerBase):  # type: ignore[misc]
    """Compiler of one function of a driver."""

    def define_pipelines(self) -> list[Any]:
        """Return Numba's passes, with those of this file in their places."""
        usual = DefaultPassBuilder.define_nopython_pipeline(self.state)
        inner = self.state.flags.no_cpython_wrapper
        own = {
            NopythonTypeInference: SharedTypeInference,
            NativeLowering: InlinedLowering if inner else DriverLowering,
            NativeParforLowering: ParallelLowering if inner else NativeParforLowering,
        }
        manager = PassManager("driver")
        manager.passes = [(own.get(kind, kind), name) for kind, name in usual.passes]
        manager.finalize()
        return [manager]
