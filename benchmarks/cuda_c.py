"""The hand-written CUDA C evaluation from Python: built with NVRTC, fed with a scenario's numbers."""

import re
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from c_reference import SCORES, parameters_of

from airflock.scenarios.cost import step_counts
from airflock.support import gpu as device

HERE = Path(__file__).parent
SOURCE = HERE / "vasarhelyi.cu"


def fields() -> list[str]:
    """Names of the numbers that vasarhelyi.cu reads, in their order: fewer than vasarhelyi.h has."""
    found = re.search(r"struct parameters \{([^}]*)\};", SOURCE.read_text())
    if found is None:
        raise LookupError("vasarhelyi.cu has no struct parameters")
    declarations = [line.split(None, 1)[1] for line in found[1].split(";") if line.strip()]
    return [member.strip() for line in declarations for member in line.split(",")]


def built(per_agent: int, arch: str) -> Any:
    """Machine code of vasarhelyi.cu for one number of threads per agent; needs no GPU."""
    from cuda.core import Program, ProgramOptions

    options = ProgramOptions(std="c++17", arch=arch, use_fast_math=True, define_macro=[("PER_AGENT", str(per_agent))])
    return Program(SOURCE.read_text(), "c++", options).compile("cubin")


class CudaC:
    """vasarhelyi.cu for one number of threads per agent."""

    def __init__(self, scenario: Any, per_agent: int):
        from cuda.core import Device

        self.device = Device()
        self.device.set_current()
        self.kernel = built(per_agent, f"sm_{''.join(map(str, self.device.compute_capability))}").get_kernel("fly")
        self.per_agent, self.scenario = per_agent, scenario
        self.times = times_of(scenario)

    def ready(self, flocks: int) -> Callable[[], Any]:
        """A function that flies this many flocks, seeds from 1 on, and returns the scores (flock, order parameter)."""
        from cuda.core import LaunchConfig, launch as run

        cuda, t = device.cuda_runtime(), self.times
        rows = cuda.to_device(np.tile(numbers_of(self.scenario), (flocks, 1)))
        scores = cuda.to_device(np.zeros((flocks, len(SCORES)), np.float32))
        threads = -(-t["agents"] // 32) * 32 * self.per_agent
        whole = [np.int32(t[name]) for name in ("agents", "steps", "decide_every", "sample_every", "delay")]
        given = (_address(rows), *whole, np.uint32(1), _address(scores))
        stream = self.device.default_stream

        def go(kept: Any = rows) -> Any:  # the kernel knows an address only: what lies there must not be given back
            run(stream, LaunchConfig(grid=flocks, block=threads), self.kernel, *given)
            stream.sync()
            return scores

        return go


def _address(array: Any) -> int:
    return int(array.__cuda_array_interface__["data"][0])


def times_of(scenario: Any) -> dict[str, int]:
    """Numbers of events in steps, and of agents."""
    found = step_counts(scenario) | {"agents": scenario.agents}
    return found | {"delay": found["delay"] // found["decide_every"]}


def numbers_of(scenario: Any) -> Any:
    """Numbers of a scenario in the order of vasarhelyi.cu."""
    known = parameters_of(scenario)
    return np.array([getattr(known, name) for name in fields()], np.float32)


def trial(source: Path) -> str:
    """Output of another CUDA C program that prints its own times."""
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "trial"
        capability = "".join(map(str, device.cuda_runtime().get_current_device().compute_capability))
        command = ["nvcc", "-O3", f"-arch=sm_{capability}", "-use_fast_math", str(source), "-o", str(program)]
        subprocess.run(command, check=True)
        return subprocess.run([str(program)], capture_output=True, text=True, check=True).stdout
