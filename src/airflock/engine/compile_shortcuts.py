"""Work of Numba's that changes nothing, left out while a driver is compiled. Same machine code.

What Numba asks again for every statement is asked once, and what nobody reads is not computed. For that, parts of Numba
are exchanged under its lock and put back before it is released: whatever else a process compiles meets Numba as it is.
A version of Numba that nobody has tried compiles as it likes, which takes longer.
"""

import gc
import sys
from collections.abc import Callable, Hashable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from weakref import WeakKeyDictionary

import numba
from llvmlite import binding
from numba.core import base, codegen, config, event, interpreter, ssa, types
from numba.core.imputils import RegistryLoader, builtin_registry
from numba.core.postproc import PostProcessor
from numba.core.typing import templates
from numba.core.typing.context import BaseContext

from airflock.engine.never_collected import frozen_imports

TRIED = (0, 62), (0, 68)  # first and last version of Numba of which this was tried, beside 0.65
# Outside the tested range Numba compiles as it likes: slower, with the same flights.
IS_TESTED_VERSION = TRIED[0] <= tuple(map(int, numba.__version__.split(".")[:2])) <= TRIED[1]
SELDOM = (100_000, 50, 50)  # for gc: a compilation makes millions of objects that stay; to look at them takes a tenth

Replacement = tuple[Any, str, Callable[..., Any]]  # whose, which of its functions, and what is called in its place

_signatures: dict[Hashable, Any] = {}
_sizes: dict[Hashable, int] = {}
_places: dict[Callable[..., Any], bool] = {}
_fresh: WeakKeyDictionary[Any, Hashable] = WeakKeyDictionary()
_once: dict[Callable[..., Any], Any] = {}


@contextmanager
def shortcuts(*more: Replacement) -> Iterator[None]:
    """Around the passes over one function, below Numba's lock; may be entered again for another one that it calls."""
    with patched(*(*SPARED, *more) if IS_TESTED_VERSION else ()):
        yield


@contextmanager
def patched(*spared: Replacement) -> Iterator[None]:
    """Exchange parts of Numba and collect garbage seldom, by one thread at a time."""
    with ExitStack() as changed:
        changed.enter_context(rare_gc())
        for owner, name, spare in spared:
            changed.enter_context(_exchanged(owner, name, spare))
        yield


def import_numpy_implementations() -> None:
    """Read the modules in which Numba implements NumPy without SciPy, which takes longer than all the others.

    Numba imports it to learn that it is there; what needs it looks again when it is called. Below Numba's lock.
    """
    if not IS_TESTED_VERSION or "numba.np.arraymath" in sys.modules:
        return
    with frozen_imports():
        from numba.np import linalg

        usual = linalg.ensure_blas
        linalg.ensure_blas = _there
        try:
            from numba.np import arraymath

            arraymath.ensure_blas = usual  # type: ignore[attr-defined]  # Numba has no types, here and below
        finally:
            linalg.ensure_blas = usual


def _there() -> None:
    """Nothing: SciPy is required by this package."""


@contextmanager
def rare_gc() -> Iterator[None]:
    """Look for garbage seldom; to be held below Numba's lock, one thread at a time."""
    usual = gc.get_threshold()
    gc.set_threshold(max(usual[0], SELDOM[0]) if usual[0] else 0, *map(max, usual[1:], SELDOM[1:]))
    try:
        yield
    finally:
        gc.set_threshold(*usual)


@contextmanager
def _exchanged(owner: Any, name: str, spare: Callable[..., Any]) -> Iterator[None]:
    """Put `spare` in the place of a method or a module's function; it is given what stood there."""
    usual = vars(owner)[name]
    if getattr(usual, "spare", None) is spare:  # further out
        yield
        return

    def exchanged(*given: Any, **named: Any) -> Any:
        return spare(usual, *given, **named)

    exchanged.spare = spare  # type: ignore[attr-defined]
    setattr(owner, name, exchanged)
    try:
        yield
    finally:
        setattr(owner, name, usual)


def cached_call_type(original: Callable[..., Any], function: Any, context: Any, arguments: Any, named: Any) -> Any:
    """Signature of a call of a function of Numba's, which its typing and its lowering ask for each statement."""
    if named:
        return original(function, context, arguments, named)
    key = context, function, tuple(arguments)
    if key not in _signatures:
        _signatures[key] = original(function, context, arguments, named)
    return _signatures[key]


def _size(usual: Callable[..., int], context: Any, kind: Any) -> int:
    """Bytes of a type of LLVM, for which Numba writes, reads and compiles a module."""
    text = str(kind)
    if "%" in text:  # a name, of which the text does not tell the parts
        return usual(context, kind)
    key = context.target_data, text
    if key not in _sizes:
        _sizes[key] = usual(context, kind)
    return _sizes[key]


def post_processed(original: Callable[..., None], processor: Any, emit_dels: bool = False, **named: Any) -> None:
    """Blocks in order after a pass. Which variables live where is computed only if it is asked for."""
    code = processor.func_ir
    if code.is_generator:
        original(processor, emit_dels, **named)
        return
    there = vars(sys.modules[type(processor).__module__])  # Numba has this twice: numba-cuda brings its own
    code.blocks = there["transforms"].canonicalize_cfg(code.blocks)
    code.variable_lifetime = there["VariableLifetime"](code.blocks)
    code.generator_info = None
    if emit_dels:
        processor._insert_var_dels(**named)


def rename_in_blocks(original: Callable[..., Any], blocks: dict[int, Any], states: Any, handler: Any) -> dict[int, Any]:
    """Blocks with versions of one variable: of those that name it. The others stay as they are."""
    naming = {label: block for label, block in blocks.items() if states["varname"] in _named(block)}
    made = original(naming, states, handler)
    for label, block in made.items():
        block.named = naming[label].named
    return {label: made.get(label, block) for label, block in blocks.items()}


def _named(block: Any) -> set[str]:
    """Variables that a block named before any got versions."""
    if not hasattr(block, "named"):
        block.named = {variable.name for statement in block.body for variable in statement.list_vars()}
    return block.named  # type: ignore[no-any-return]


def _takes_place(usual: Callable[..., bool], function: Callable[..., Any]) -> bool:
    """Return True if an implementation of Numba's takes the place in the text as an argument."""
    if function not in _places:
        _places[function] = usual(function)
    return _places[function]


def _without_exits(usual: Callable[..., Any], code: Any) -> Any:
    """Statements without those that end a `with`, which no rule and no stage holds."""
    held = any(name.startswith("$setup_with_exitfn") for name in code.blocks[min(code.blocks)].scope.localvars._con)
    return usual(code) if held else code


def registry_sizes() -> Hashable:
    """Return the sizes of Numba's registries, which grow with every new implementation."""
    lowered = sum(len(getattr(builtin_registry, kind)) for kind in RegistryLoader.registry_items)
    typed = templates.builtin_registry
    return len(sys.modules), lowered, len(typed.functions), len(typed.attributes), len(typed.globals)


def _refreshed(usual: Callable[..., None], context: Any) -> None:
    """Look for new implementations, where there are any since a context last looked."""
    now = registry_sizes()
    if _fresh.get(context) != now:
        usual(context)
        _fresh[context] = registry_sizes()


def _unchanged(usual: Callable[..., None]) -> None:
    """Nothing: what Numba reads of its environment and of a file, function by function, was read for the first one."""


def _known(usual: Callable[..., Any], *given: Any) -> Any:
    """Return the remembered answer to a question about this processor and this LLVM."""
    if usual not in _once:
        _once[usual] = usual(*given)
    return _once[usual]


def _told(usual: Callable[..., None], kind: str, *given: Any, **named: Any) -> None:
    """An event; not each call of LLVM, where only the sums of their times are kept."""
    kept = all(type(listener) is event.TimingListener for listener in event._registered[kind])
    if not (kind == "numba:llvm_lock" and kept):
        usual(kind, *given, **named)


SPARED: tuple[Replacement, ...] = (
    (types.functions.BaseFunction, "get_call_type", cached_call_type),
    (base.BaseContext, "get_abi_sizeof", _size),
    (base, "_has_loc", _takes_place),
    (base.BaseContext, "refresh", _refreshed),
    (BaseContext, "refresh", _refreshed),
    (config, "reload_config", _unchanged),
    (binding, "get_process_triple", _known),
    (codegen.CPUCodegen, "_check_llvm_bugs", _known),
    (PostProcessor, "run", post_processed),
    (interpreter, "peep_hole_delete_with_exit", _without_exits),
    (ssa, "_run_block_rewrite", rename_in_blocks),
    (event, "start_event", _told),
    (event, "end_event", _told),
)
