"""Background compile: a driver compiled by another process, so that this one flies on without a halt.

Numba compiles under the interpreter's lock and keeps it for a tenth of a second at a time: a flight beside it would
stand still as long. The other process keeps the driver in the cache, under its seal, and this one loads it from there.
"""

import json
import os
import pickle
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import airflock
from airflock.engine.driver_state import DriverState
from airflock.engine.drivers import is_compiled

SCRIPT = Path(__file__).with_name("one_driver.py")


def compile_in_background(state: DriverState) -> DriverState:
    """Have a state's driver compiled by another process, and load it; for a thread that may wait. Returns the state.

    Where no process can be started, or it fails for any reason, this thread compiles and says what is wrong.
    """
    if sys.executable and not is_compiled(state.driver):  # a program that has Python inside does not know where it is
        with suppress(OSError):
            _in_a_process(state)
    return state.compile()


def _in_a_process(state: DriverState) -> None:
    """Let a process compile a state's driver, and wait for its end. Raises OSError where none can be started."""
    # Numba keeps the interpreter lock for long stretches: compiling in a thread made gaps of 66 to
    # 171 ms in a page of 30 frames a second, a process below 50 ms. It is no fork: threads and LLVM
    # are not made for that.
    driver = state.driver
    file = Path(str(driver.__file__))
    paths = [path for path in sys.path if os.path.isabs(path)]
    asked = {
        "paths": [*paths, str(Path(airflock.__file__).parents[1])],
        "text": driver.TEXT,
        "label": file.stem,
        "types": pickle.dumps(tuple(map(driver.advance.typeof_pyval, state.arguments(0, 0)))).hex(),
    }
    # isolated (-I, -S): neither the folder in which somebody works nor a start-up file decides what
    # is imported
    with subprocess.Popen(
        [sys.executable, "-I", "-S", str(SCRIPT)],
        env={**os.environ, "AIRFLOCK_CACHE": str(file.parents[2])},
        stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    ) as process:  # fmt: skip
        assert process.stdin is not None
        process.stdin.write(f"{json.dumps(asked)}\n".encode())
        process.stdin.flush()
        process.wait()  # with its input open: the end of this process is the end of that one
