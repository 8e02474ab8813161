"""Drivers: what flies a plan, compiled or interpreted; interruptions and messages while it compiles."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import cache, lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from airflock.engine import interpreted
from airflock.engine.passes.driver import flight_driver_text
from airflock.engine.plan import Plan
from airflock.engine.store import load_driver
from airflock.support import RuleError


def flight_text(plan: Plan) -> str:
    """Text of the driver that flies a plan, the same whether samples are kept; each recording says by which."""
    # Writing a text takes 0.06 s, half of a short interpreted flight. It is not kept on disk: a
    # plan holds functions, and no file can show that they are unchanged.
    return _text(plan.built(keep_frames=False) if plan.record else plan)


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


def device_of(driver: ModuleType) -> str:
    """Return the device of a driver: cpu, or python, uncompiled."""
    return "cpu" if hasattr(driver.advance, "overloads") else "python"


def is_loaded(driver: ModuleType) -> bool:
    """Return True if a driver flies at once: it has been compiled or read in this process, or is interpreted."""
    return bool(getattr(driver.advance, "overloads", True))


def is_compiled(driver: ModuleType) -> bool:
    """Return True if a driver needs no compiling: this process has compiled it, or an earlier one has kept it."""
    return is_loaded(driver) or any(Path(driver.advance.stats.cache_path).glob("*.nbi"))


def compile_messages(driver: ModuleType, model: str) -> AbstractContextManager[None]:
    """Around calls of a driver: `rule_errors_of_compiler`, if it has to be compiled first."""
    return function_compile_messages(driver.advance, model)


def function_compile_messages(function: Any, model: str) -> AbstractContextManager[None]:
    """Around calls of a function of a driver: `rule_errors_of_compiler`, if it has to be compiled first."""
    return nullcontext() if getattr(function, "overloads", True) else rule_errors_of_compiler(model)


@contextmanager
def rule_errors_of_compiler(model: str) -> Iterator[None]:
    """Turn an error of the compiler into one line, and react to an interruption after each of its passes.

    A user who waits at a terminal or in a notebook sees a message. Raises RuleError, GivenUp.
    """
    from numba.core.errors import NumbaError
    from numba.core.event import install_listener

    from airflock.engine.compile_events import InterruptListener, message_if_slow

    try:
        with install_listener("numba:run_pass", InterruptListener()), message_if_slow():
            yield
    except NumbaError as error:
        lines = [line.strip() for line in str(error).splitlines()]
        said = next((line for line in lines if line and not line.startswith(("Failed in", "During", "File"))), "")
        raise RuleError(f"model {model}: a rule does not compile, though plain Python takes it: {said}") from error
