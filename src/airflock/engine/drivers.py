"""Drivers: what flies a plan, compiled or interpreted; interruptions and messages while it compiles."""

import inspect
import multiprocessing
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import cache, lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from airflock.engine import interpreted
from airflock.engine.passes.driver import flight_driver_text
from airflock.engine.plan import Plan
from airflock.engine.replace import checked_replace
from airflock.engine.store import load_driver
from airflock.support import RuleError, check_interrupted

COMPILING = "compiling … (only once for this kind of flight; later flights start at once)"
PATIENCE = 1.0  # s until a user who waits sees it


def flight_text(plan: Plan) -> str:
    """Text of the driver that flies a plan, the same whether samples are kept; each recording says by which."""
    # Writing a text takes 0.06 s, half of a short interpreted flight. It is not kept on disk: a
    # plan holds functions, and no file can show that they are unchanged.
    return _text(plan.built(record=False) if plan.record else plan)


@lru_cache(maxsize=256)
def _text(plan: Plan) -> str:
    return flight_driver_text(plan)


@cache
def flight_driver(plan: Plan) -> ModuleType:
    """Compiled driver of a plan."""
    return load_driver(flight_text(plan), plan.model.name)


def driver_of(plan: Plan, device: str = "cpu") -> ModuleType:
    """Driver of a plan: compiled, or with device = python its text as plain Python."""
    return interpreted.flight_driver(plan) if device == "python" else flight_driver(plan)


LOOPS = """
import math
from numba import njit
from airflock.engine.compiler import CALLED, INNER
LOOP = dict(error_model="numpy", nogil=True, _nrt=False)
"""


def load_loops(
    plan: Plan | None,
    inner: Sequence[Callable[..., Any]],
    outer: Sequence[Callable[..., Any]],
    constants: Mapping[str, int | float],
) -> ModuleType:
    """Compile loops of a caller around the driver of a plan: the loops are kept with it, and no step is called from
    Python.

    inner     : plain functions that the loops call, such as an `advance` of their own where there
                is no plan
    outer     : plain functions that Python calls; they may call `advance` with the arguments of a
                `DriverState`
    constants : numbers that both name
    """
    # The driver is compiled as a part of the loops, and not kept by itself: its own lock is theirs.
    kept, within = "@njit(cache=True, **JIT | CALLED)", "@njit(**ONCE)"
    parts = ["" if plan is None else checked_replace(flight_text(plan), kept, within, 1), LOOPS]
    parts += [f"{name} = {value!r}" for name, value in constants.items()]
    for functions, options in ((inner, "**LOOP, **INNER"), (outer, "cache=True, **LOOP | CALLED")):
        parts += [f"\n@njit({options})\n{inspect.getsource(function)}" for function in functions]
    return load_driver("\n".join(parts), "straight_loops" if plan is None else f"{plan.model.name}_loops")


def device_of(driver: ModuleType) -> str:
    """Return the device of a driver: cpu, or python, uncompiled."""
    return "cpu" if hasattr(driver.advance, "overloads") else "python"


def is_loaded(driver: ModuleType) -> bool:
    """Return True if a driver flies at once: it has been compiled or read in this process, or is interpreted."""
    return bool(getattr(driver.advance, "overloads", True))


def is_compiled(driver: ModuleType) -> bool:
    """Return True if a driver needs no compiling: this process has compiled it, or an earlier one has kept it."""
    return is_loaded(driver) or any(Path(driver.advance.stats.cache_path).glob("*.nbi"))


def compile_messages(function: Any, model: str) -> AbstractContextManager[None]:
    """Around calls of a function of a driver: `rule_errors_of_compiler`, if it has to be compiled first."""
    return nullcontext() if getattr(function, "overloads", True) else rule_errors_of_compiler(model)


@contextmanager
def rule_errors_of_compiler(model: str) -> Iterator[None]:
    """Turn an error of the compiler into one line, and react to an interruption after each of its passes.

    A user who waits at a terminal or in a notebook sees a message. Raises RuleError, GivenUp.
    """
    from numba.core.errors import NumbaError
    from numba.core.event import Listener, install_listener

    class InterruptListener(Listener):  # type: ignore[misc]  # Numba has no types
        """Each thread that compiles hears of its own passes."""

        def on_start(self, event: Any) -> None:
            """Give up the work of this thread if it was interrupted. Raises GivenUp."""
            check_interrupted()

        def on_end(self, event: Any) -> None:
            """Do nothing at the end of a pass; the next one checks."""

    try:
        with install_listener("numba:run_pass", InterruptListener()), message_if_slow():
            yield
    except NumbaError as error:
        lines = [line.strip() for line in str(error).splitlines()]
        said = next((line for line in lines if line and not line.startswith(("Failed in", "During", "File"))), "")
        raise RuleError(f"model {model}: a rule does not compile, though plain Python takes it: {said}") from error


@contextmanager
def message_if_slow() -> Iterator[None]:
    """Say once that something is compiled, if it takes longer than PATIENCE, to a person who waits for it."""
    if not _watched():
        yield
        return
    timer = threading.Timer(PATIENCE, _say)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _watched() -> bool:
    """True if a person sees what this thread says: at a terminal or in a notebook, and not of one of many workers."""
    main = threading.current_thread() is threading.main_thread() and multiprocessing.parent_process() is None
    return main and ("ipykernel" in sys.modules or sys.stderr.isatty())


def _say() -> None:
    sys.stderr.write(f"{COMPILING}\n")
    sys.stderr.flush()
