"""Stand-ins with which `gpu.py` runs without a GPU, so that no line of it fails for the first time where there is one.

Numba's simulator flies flocks of three and takes it for a GPU; CUDA C is built, but its scores are made up.
"""

import os
import sys
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np


class Made:
    """Takes the place of cuda_c.CudaC: builds the program, and makes up what it would return."""

    def __init__(self, scenario: Any, per_agent: int):
        from cuda_c import built, numbers_of, times_of

        assert len(built(per_agent, "sm_90").code) > 10_000
        assert np.isfinite(numbers_of(scenario)).all() and times_of(scenario)["steps"] > 0

    def ready(self, flocks: int) -> Callable[[], Any]:
        """A function that returns scores (flock, order parameter)."""
        from c_reference import SCORES

        scores = np.ones((flocks, len(SCORES)), np.float32)
        return lambda: SimpleNamespace(copy_to_host=lambda: scores)


def begin(sizes: Callable[..., Any] = SimpleNamespace) -> Any:
    """Put the stand-ins in place and return sizes; starts the program anew where the simulator is not on yet."""
    if os.environ.get("NUMBA_ENABLE_CUDASIM") != "1":
        os.execve(sys.executable, [sys.executable, *sys.argv], os.environ | {"NUMBA_ENABLE_CUDASIM": "1"})
    import cuda_c
    from numba.cuda.simulator.kernel import FakeCUDAKernel

    from airflock import support
    from airflock.engine.cuda import large_flock, launch
    from airflock.support import gpu as device

    device.unavailable_reason = lambda: None
    device.describe_gpus = lambda: [{"name": "rehearsal"}]
    stand_ins = {
        "require_gpu": lambda allow_simulator=False: None,
        "free_gpu_memory": lambda: 10**9,
        "multiprocessor_count": lambda: 2,
    }
    for module in (device, support, launch, large_flock):
        for name, stand_in in stand_ins.items():
            if hasattr(module, name):
                setattr(module, name, stand_in)
    plain = launch.layout_of

    def layout_of(plan: Any, agents: int, flocks: int, processors: int = 2) -> Any:
        shape = plain(plan, agents, flocks, processors)
        return replace(shape, threads=agents * shape.per_agent, simulated=True)

    launch.layout_of = layout_of
    for module in list(sys.modules.values()):
        if getattr(module, "layout_of", None) is plain:
            module.layout_of = layout_of
    FakeCUDAKernel.get_regs_per_thread = lambda self: {}
    cuda_c.CudaC = Made
    return sizes(
        agents=3, duration=0.04, apart=0.04, saturated=5, generations=2, generation=4, flights=3, boids=120, steps=2
    )
