"""Airflock on a GPU against hand-written CUDA C, interleaved: builds, checks and times everything in one call.

    python benchmarks/gpu.py [--quick] [--json FILE] [--trial flock.cu]

Needs an NVIDIA GPU and `pip install 'airflock[cuda]'`; takes about six minutes, --quick one. The reference is built
with NVRTC, which comes with numba-cuda; --trial also builds and runs a program of its own with nvcc. Only ratios of
interleaved runs mean anything: the least time of each side is shown.
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from c_reference import PARAMETERS, SCORES, Reference

from airflock.engine.cuda import device, launch
from airflock.engine.cuda.kernel import ARGUMENTS
from airflock.engine.cuda.shape import shape_of
from airflock.engine.simulate import plan_of, score_flights
from airflock.engine.tables import tables
from airflock.scenarios.files import load

HERE = Path(__file__).parent
PRESET = "vasarhelyi_2018/4ms"
COMPARED = ("phi_vel", "phi_corr", "n_min", "r_min_mean", "n_disc", "phi_wall", "phi_lap_abs", "polarisation")


class CudaC:
    """vasarhelyi.cu for one number of threads per agent."""

    def __init__(self, scenario: Any, per_agent: int):
        from cuda.core import Device, Program, ProgramOptions

        self.device = Device()
        self.device.set_current()
        capability = "".join(map(str, self.device.compute_capability))
        options = ProgramOptions(
            std="c++17", arch=f"sm_{capability}", use_fast_math=True, define_macro=[("PER_AGENT", str(per_agent))]
        )
        text = (HERE / "vasarhelyi.cu").read_text()
        self.kernel = Program(text, "c++", options).compile("cubin").get_kernel("fly")
        self.per_agent, self.scenario = per_agent, scenario
        self.times = _times(scenario)

    def ready(self, flocks: int) -> Callable[[], Any]:
        """A function that flies this many flocks, seeds from 1 on, and returns the scores (flock, order parameter)."""
        from cuda.core import LaunchConfig
        from cuda.core import launch as run

        cuda, t = device.runtime(), self.times
        rows = cuda.to_device(np.tile(_numbers(self.scenario), (flocks, 1)))
        scores = cuda.to_device(np.zeros((flocks, len(SCORES)), np.float32))
        threads = -(-t["agents"] // 32) * 32 * self.per_agent
        whole = [np.int32(t[name]) for name in ("agents", "steps", "decide_every", "sample_every", "delay")]
        given = (_address(rows), *whole, np.uint32(1), _address(scores))
        stream = self.device.default_stream

        def go() -> Any:
            run(stream, LaunchConfig(grid=flocks, block=threads), self.kernel, *given)
            stream.sync()
            return scores

        return go


def _address(array: Any) -> int:
    return int(array.__cuda_array_interface__["data"][0])


def _times(scenario: Any) -> dict[str, int]:
    from airflock.engine.tables import clock

    found = clock(scenario) | {"agents": scenario.agents}
    return found | {"delay": found["delay"] // found["decide_every"]}


def _numbers(scenario: Any) -> Any:
    """Parameters of vasarhelyi.h in their order."""
    with tempfile.TemporaryDirectory() as folder:
        known = Reference(scenario, Path(folder)).parameters
    return np.array([getattr(known, name) for name in PARAMETERS], np.float32)


def ours(scenario: Any, flocks: int, per_agent: int) -> Callable[[], Any]:
    """A function that flies this many flocks with the generated kernel; memory is there already."""
    cuda = device.runtime()
    plan = replace(plan_of(scenario), grid=False)
    shape = shape_of(scenario.agents, flocks, device.multiprocessors())
    shape = replace(shape, per_agent=per_agent, threads=shape.lanes * per_agent)
    driver = launch.flight_driver(plan, shape)
    jobs = [tables(scenario, plan, 1 + flock) for flock in range(flocks)]
    own = launch.arrays(plan, driver, shape, jobs, None)
    kernel = driver.fly[flocks, shape.threads]
    given = [own[name] for name in ARGUMENTS]

    def go() -> Any:
        kernel(*given)
        cuda.synchronize()
        return own

    go.values = lambda: launch.results(plan, jobs, own)  # type: ignore[attr-defined]
    go.registers = lambda: list(driver.fly.get_regs_per_thread().values())  # type: ignore[attr-defined]
    return go


def least(sides: dict[str, Callable[[], Any]], rounds: int) -> dict[str, float]:
    """Least time (s) of each side, run in turn."""
    times: dict[str, list[float]] = {name: [] for name in sides}
    for go in sides.values():
        go()
    for turn in range(rounds):
        names = list(sides) if turn % 2 == 0 else list(sides)[::-1]
        for name in names:
            begin = time.perf_counter()
            sides[name]()
            times[name].append(time.perf_counter() - begin)
    return {name: min(taken) for name, taken in times.items()}


def evaluations(scenario: Any, quick: bool) -> list[dict[str, Any]]:
    """Generated kernel against CUDA C over the number of flocks."""
    rows = []
    reference = {per: CudaC(scenario, per) for per in (1, 2, 4)}
    for flocks in (1, 100, 1000) if quick else (1, 100, 1000, 15_000):
        most = (1,) if flocks > 5000 else (1, 2, 4)
        sides: dict[str, Callable[[], Any]] = {}
        for per in most:
            sides[f"airflock {per}"] = ours(scenario, flocks, per)
            sides[f"CUDA C {per}"] = reference[per].ready(flocks)
        found = least(sides, 3)
        best = {side: min(t for name, t in found.items() if name.startswith(side)) for side in ("airflock", "CUDA C")}
        row = {"flocks": flocks, "ms": {name: round(1e3 * t, 2) for name, t in found.items()}}
        row |= {f"{side} per second": round(flocks / t, 1) for side, t in best.items()}
        rows.append(row | {"speed against CUDA C": round(best["CUDA C"] / best["airflock"], 3)})
        say(rows[-1])
    return rows


def agreement(scenario: Any, flocks: int) -> dict[str, Any]:
    """Means over flights: CPU, GPU and CUDA C; z: difference of CPU and GPU in standard errors."""
    seeds = list(range(1, flocks + 1))
    begin = time.perf_counter()
    gpu = score_flights([scenario] * flocks, seeds, device="cuda")
    taken = time.perf_counter() - begin
    cpu = score_flights([scenario] * flocks, [s + 10**6 for s in seeds])
    c = CudaC(scenario, 1).ready(flocks)().copy_to_host()
    rows = {}
    for key in COMPARED:
        a, b = (np.array([row[key] for row in flights]) for flights in (cpu, gpu))
        error = np.hypot(a.std(ddof=1), b.std(ddof=1)) / flocks**0.5
        rows[key] = {"cpu": a.mean(), "gpu": b.mean(), "CUDA C": float(c[:, SCORES.index(key)].mean()),
                     "z": float((b.mean() - a.mean()) / max(error, 1e-12))}  # fmt: skip
    return {"flights": flocks, "seconds with tables and scores": round(taken, 2), "order parameters": rows}


def evolution(scenario: Any, generations: int) -> dict[str, Any]:
    """CMA-ES over four parameters: dependent generations of 100 flights, the optimiser and all bookkeeping included."""
    import cma

    keys = ("p_rep", "r0_frict", "c_frict", "v_frict")
    start = [getattr(scenario.parameters, key) for key in keys]
    search = cma.CMAEvolutionStrategy([1.0] * len(keys), 0.2, {"popsize": 100, "verbose": -9, "seed": 1})
    score_flights([scenario] * 100, list(range(100)), device="cuda")
    begin, flown = time.perf_counter(), 0.0
    for generation in range(generations):
        asked = search.ask()
        candidates = []
        for point in asked:
            values = {k: float(abs(f) * s) for k, f, s in zip(keys, point, start, strict=True)}
            candidates.append(replace(scenario, parameters=replace(scenario.parameters, **values)))
        t = time.perf_counter()
        rows = score_flights(candidates, [generation] * len(candidates), device="cuda")
        flown += time.perf_counter() - t
        search.tell(asked, [-row["fitness"] for row in rows])
    taken = time.perf_counter() - begin
    return {"evaluations": 100 * generations, "seconds": round(taken, 2), "of them in score_flights": round(flown, 2)}


def second_start() -> dict[str, float]:
    """From a fresh process to the end of the first launch, twice; the second finds the compiled kernel on disk."""
    code = (
        "import time; b = time.perf_counter()\n"
        "from airflock.engine.simulate import score_flights\nfrom airflock.scenarios.files import load\n"
        f"s = load({PRESET!r}, {{'duration': 1.0}})\nscore_flights([s] * 100, list(range(100)), device='cuda')\n"
        "print(time.perf_counter() - b)"
    )
    times = [float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)
             for _ in range(3)]  # fmt: skip
    return {"first": round(times[0], 2), "second": round(statistics.median(times[1:]), 2)}


def trial(source: Path) -> str:
    """Output of another CUDA C program that prints its own times."""
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "trial"
        capability = "".join(map(str, device.runtime().get_current_device().compute_capability))
        command = ["nvcc", "-O3", f"-arch=sm_{capability}", "-use_fast_math", str(source), "-o", str(program)]
        subprocess.run(command, check=True)
        return subprocess.run([str(program)], capture_output=True, text=True, check=True).stdout


def say(value: Any) -> None:
    """Print at once."""
    print(value if isinstance(value, str) else json.dumps(value), flush=True)


def main() -> None:
    """Measure everything."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--trial", type=Path)
    given = parser.parse_args()
    device.required()
    scenario = load(PRESET, {"duration": 60.0} if given.quick else {})
    found: dict[str, Any] = {"devices": device.describe()}
    parts: dict[str, Callable[[], Any]] = {
        "second start": second_start,
        "registers": lambda: {per: _registers(scenario, per) for per in (1, 2, 4)},
        "evaluations": lambda: evaluations(scenario, given.quick),
        "evolution": lambda: evolution(scenario, 15 if given.quick else 150),
        "agreement": lambda: agreement(scenario, 100 if given.quick else 1000),
        "big flock": lambda: big_flock(100_000 if given.quick else 1_000_000),
    }
    if given.trial:
        parts["trial"] = lambda: trial(given.trial)
    for name, part in parts.items():
        begin = time.perf_counter()
        try:
            found[name] = part()
        except Exception as fault:  # the other figures are wanted all the same
            found[name] = f"failed: {type(fault).__name__}: {str(fault)[:2000]}"
        say({name: found[name], "took_s": round(time.perf_counter() - begin, 1)})
        if given.json:
            given.json.write_text(json.dumps(found, indent=1))


def _registers(scenario: Any, per_agent: int) -> Any:
    go = ours(scenario, 1, per_agent)
    begin = time.perf_counter()
    go()
    return {"registers": go.registers(), "compiled or loaded in s": round(time.perf_counter() - begin, 2)}  # type: ignore[attr-defined]


def big_flock(agents: int) -> dict[str, Any]:
    """Steps per second of one flock whose neighbours are found by cells."""
    from airflock.engine.cuda.crowd import Crowd

    scenario = load("zapotecatl_2016/literal", crowd_settings(agents))
    crowd = Crowd(scenario, plan_of(scenario), seed=1)
    crowd.advance(5)
    device.runtime().synchronize()
    times = []
    for _ in range(5):
        begin = time.perf_counter()
        crowd.advance(100)
        device.runtime().synchronize()
        times.append((time.perf_counter() - begin) / 100)
    return {
        "agents": agents,
        "neighbours": round(crowd.neighbours(), 2),
        "steps_per_second": round(1.0 / min(times), 1),
    }


def crowd_settings(agents: int) -> dict[str, Any]:
    """A periodic box in which each boid has about 16 neighbours within its reach of 0.5 m."""
    volume = agents * 4.0 / 3.0 * np.pi * 0.5**3 / 16.0
    side = round(float(volume ** (1.0 / 3.0)), 3)
    return {
        "agents": agents, "world.edges": "periodic", "world.arena": "square", "world.side": side, "world.height": side,
        "start.kind": "arena", "start.separation": 0.0, "start.speed": 0.2, "metrics.kind": "order", "dt": 0.02,
        "metrics.period": 1.0, "duration": 600.0, "update": "synchronous",
    }  # fmt: skip


if __name__ == "__main__":
    main()
