"""The compiler of drivers: Numba's own passes, without the work that a driver never needs. Same machine code.

A driver is some sixty small functions, of which Python calls one. By default Numba makes of each a function that Python
could call: two wrappers that unpack its arguments, machine code of its own, and all three once more in every caller.
Here the others stay what their callers link, optimised code of LLVM (`options`). The rest saves Numba's own Python:
what it asks again and again about the same types is asked once.
"""

from collections.abc import Callable, Hashable
from typing import Any

from numba import types
from numba.core import ir
from numba.core.compiler import CompilerBase, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.imputils import RegistryLoader, builtin_registry
from numba.core.typed_passes import NativeLowering, NativeParforLowering, NopythonRewrites, NopythonTypeInference
from numba.core.untyped_passes import InlineClosureLikes

from airflock.engine.compile_shortcuts import shortcuts
from airflock.engine.libraries import PARALLEL_REPLACEMENT, DriverLibrary, InlinedLibrary
from airflock.support import vector_bits

LATER = ("make_function", "build_list", "build_set", "build_map")  # what closures and arrays out of lists begin with
ARRAY_VALUED = ("unary", "binop", "inplace_binop", "call")  # what is rewritten where its value is a whole array


class HashedFlags(Flags):  # type: ignore[misc]  # Numba has no types, here and below
    """Flags of one compilation; Numba compares and hashes them for every operator that it meets."""

    _usual = {name: option.default for name, option in Flags.options.items()}
    _same = hash(tuple(sorted(Flags.options)))

    def __hash__(self) -> int:
        return self._same  # as that of Flags, which hashes the names alone

    def __eq__(self, other: object) -> bool:
        return self is other or bool(super().__eq__(other))

    def values(self) -> dict[str, Any]:
        """All values by name."""
        return self._usual | self._values


@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[untyped-decorator]
class DriverLowering(NativeLowering):  # type: ignore[misc]
    """Lowering of a function of a driver."""

    _name = "driver_lowering"
    _library: type[DriverLibrary] = DriverLibrary

    def run_pass(self, state: Any) -> bool:
        """Make what callers link."""
        state.library = self._library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.counted = bool(state.flags.nrt)
        state.library.enable_object_caching()
        return bool(super().run_pass(state))


@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[untyped-decorator]
class InlinedLowering(DriverLowering):
    """Lowering of a function that only compiled functions call."""

    _name = "inlined_lowering"
    _library = InlinedLibrary

    def run_pass(self, state: Any) -> bool:
        """Make what callers link, and enter the function where they look for it."""
        state.flags.no_compile = True
        super().run_pass(state)
        found, described = state["cr"], state["cr"].fndesc
        # Python may not call it: behind it stands a method of C, one for each function, that says
        # so as a KeyError
        entry = f"{{{described.qualname.split('.')[-1]}, which only other functions of its driver call}}".format
        state.targetctx.insert_user_function(entry, described, [state.library])
        state["cr"] = found._replace(cfunc=entry)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[untyped-decorator]
class ParallelLowering(InlinedLowering):
    """Lowering of a function that only compiled functions call, whose loops are spread over threads."""

    _name = "spread_lowering"
    lowering_class = NativeParforLowering.lowering_class


@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[untyped-decorator]
class ClosurePass(InlineClosureLikes):  # type: ignore[misc]
    """Inlining of closures and of arrays out of lists, where a function has any."""

    _name = "closures_if_any"

    def run_pass(self, state: Any) -> bool:
        """Look for what begins one."""
        blocks = state.func_ir.blocks.values()
        return any(True for block in blocks for op in LATER for _ in block.find_exprs(op)) and super().run_pass(state)


@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[untyped-decorator]
class ArrayRewritePass(NopythonRewrites):  # type: ignore[misc]
    """Rewriting of expressions whose values are whole arrays, and of texts as indices, where a function has any."""

    _name = "array_rewrites_if_any"

    def run_pass(self, state: Any) -> bool:
        """Look for one."""
        texts = any(isinstance(kind, types.StringLiteral) for kind in state.typemap.values())
        values = (
            found.target.name
            for block in state.func_ir.blocks.values()
            for found in block.find_insts(ir.Assign)
            if getattr(found.value, "op", None) in ARRAY_VALUED
        )
        arrays = any(isinstance(state.typemap[name], types.Array) for name in values)
        return (texts or arrays) and super().run_pass(state)


def _stands_once(function: Any) -> bool:
    """Return True if a function is not made part of those that call it."""
    return function.dispatcher.targetoptions.get("forceinline") is False


def _holds_array(kind: Any) -> bool:
    """Return True if a type is that of an array, or of a record of some."""
    parts: Any = kind if isinstance(kind, types.BaseTuple) else ()
    return isinstance(kind, types.Array) or any(_holds_array(part) for part in parts)


class CachingTypingContext:
    """A typing context that remembers which form of an operator or a function of Numba's takes which types."""

    _known: dict[Hashable, Any] = {}

    def __init__(self, context: Any):
        self._context = context

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def resolve_function_type(self, function: Any, arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
        """Signature of a call. Only a function of the driver's own is asked each time: that has it compiled.

        It is compiled once for whole numbers, not once more for each that stands in the text of a caller. Not so what
        goes along arrays, such as those of a wing's 20 stations: LLVM adds up otherwise if it knows how long a loop is.
        Functions that stand once in a driver are there for all lengths.
        """
        own = isinstance(function, types.Dispatcher)
        if own and (_stands_once(function) or not any(_holds_array(one) for one in arguments)):
            arguments = tuple(
                types.unliteral(one) if isinstance(one, types.IntegerLiteral) else one for one in arguments
            )
        if named or isinstance(function, (types.Dispatcher, types.RecursiveCall)):
            return self._context.resolve_function_type(function, arguments, named)
        key = self._context, function, arguments
        if key not in self._known:
            found = self._context.resolve_function_type(function, arguments, named)
            if found is None:
                return None
            self._known[key] = found
        return self._known[key]


@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[untyped-decorator]
class CachedTypeInference(NopythonTypeInference):  # type: ignore[misc]
    """Type inference that resolves no call twice."""

    _name = "remembering_type_inference"

    def run_pass(self, state: Any) -> bool:
        """Infer all types of a function."""
        context, state.typingctx = state.typingctx, CachingTypingContext(state.typingctx)
        try:
            return bool(super().run_pass(state))
        finally:
            state.typingctx = context


class DriverCompiler(CompilerBase):  # type: ignore[misc]
    """Compiler of one function of a driver."""

    def __init__(self, *given: Any):
        *before, flags, named = given
        super().__init__(*before, HashedFlags(flags), named)  # type: ignore[call-arg]
        self.state.targetctx.refresh = _when_grown(self.state.targetctx.refresh)  # of this function's own copy

    def define_pipelines(self) -> list[Any]:
        """Numba's passes, with those of this file in their places."""
        found = DefaultPassBuilder.define_nopython_pipeline(self.state)
        inner = self.state.flags.no_cpython_wrapper
        other = {
            InlineClosureLikes: ClosurePass,
            NopythonTypeInference: CachedTypeInference,
            NopythonRewrites: ArrayRewritePass,
            NativeLowering: InlinedLowering if inner else DriverLowering,
            NativeParforLowering: ParallelLowering if inner else NativeParforLowering,
        }
        made = PassManager("driver")
        made.passes = [(other.get(kind, kind), said) for kind, said in found.passes]
        made.finalize()
        return [made]

    def _compile_core(self) -> Any:
        with shortcuts(PARALLEL_REPLACEMENT):  # below Numba's lock: one thread at a time
            return super()._compile_core()


def _when_grown(refresh: Callable[[], None]) -> Callable[[], None]:
    """Search for new implementations only if there are some; Numba searches whenever it finds none."""
    seen = -1

    def grown() -> None:
        nonlocal seen
        count = sum(len(getattr(builtin_registry, kind)) for kind in RegistryLoader.registry_items)
        if count != seen:
            seen = count
            refresh()

    return grown


INNER: dict[str, Any] = {"pipeline_class": DriverCompiler, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
CALLED: dict[str, Any] = INNER | {"no_cpython_wrapper": False}
WIDE = vector_bits() == 512  # whether `wide_vectors` of a driver asks for them
