"""Airflock on a GPU against hand-written CUDA C and JAX: builds, checks and times everything, and judges it.

    python benchmarks/gpu.py [--quick] [--json FILE] [--only PART] [--trial flock.cu] [--rehearse]

Needs an NVIDIA GPU and `pip install 'airflock[cuda]'`; JAX with its CUDA plugin for the ratio of the big flock. At
most four minutes: each part is a process with a limit of its own (LIMITS), and the table is printed whatever failed.
CUDA C is built with NVRTC, which comes with numba-cuda; --trial also builds and runs a
program of its own with nvcc. Only ratios of interleaved runs mean anything: the least time of each side is shown.
--rehearse goes through every part without a GPU (Numba's simulator, tiny sizes); its figures mean nothing.

Exit status 1 if CPU and GPU disagree or a part failed; a time is never an error.
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import boids_jax
import cuda_c
import numpy as np
from c_reference import SCORES

from airflock.engine import cpu, plan_of, score_flights
from airflock.engine.cuda import launch
from airflock.engine.cuda.flight_kernel import ARGUMENTS
from airflock.engine.cuda.launch import layout_of
from airflock.engine.tables import world_tables
from airflock.scenarios.files import load
from airflock.support import gpu as device

HERE = Path(__file__).parent
PRESET = "vasarhelyi_2018/4ms"
COMPARED = ("phi_vel", "phi_corr", "n_min", "r_min_mean", "n_disc", "phi_wall", "phi_lap_abs", "polarisation")


# s; a kernel or a compilation cannot be interrupted within a process, so that each part has its own
LIMITS = {
    "second start": 30.0, "registers": 20.0, "evaluations": 60.0, "evolution": 40.0, "agreement": 25.0, "apart": 15.0,
    "big flock": 20.0, "JAX": 30.0, "trial": 60.0,
}  # fmt: skip
SLOWER = 20.0  # times a limit is longer in a rehearsal, whose simulator is slow


@dataclass
class Sizes:
    """How much is flown.

    duration, apart : of a flight, and of those that are compared number by number, s
    saturated       : flocks that fill a GPU
    generations     : of `generation` flights each, dependent on each other
    flights         : compared with the CPU in distribution
    boids, steps    : of the big flock
    """

    agents: int = 100
    duration: float = 600.0
    apart: float = 10.0
    saturated: int = 15_000
    generations: int = 150
    generation: int = 100
    flights: int = 1000
    boids: int = 1_000_000
    steps: int = 100


QUICK = Sizes(duration=60.0, saturated=1000, generations=15, flights=100, boids=100_000)


def ours(scenario: Any, flocks: int, per_agent: int) -> Callable[[], Any]:
    """A function that flies this many flocks with the generated kernel; memory is there already."""
    cuda = device.cuda_runtime()
    plan = plan_of(scenario, grid=False)
    shape = layout_of(plan, scenario.agents, flocks, device.multiprocessor_count())
    shape = replace(shape, per_agent=per_agent, threads=shape.threads // shape.per_agent * per_agent)
    driver = launch.flight_driver(plan, shape)
    jobs = [world_tables(scenario, plan, 1 + flock) for flock in range(flocks)]
    own = launch.make_arguments(plan, driver, shape, jobs, None)
    kernel = launch.configure_kernel(driver.fly, flocks, shape.threads)
    given = [own[name] for name in ARGUMENTS]

    def go() -> Any:
        kernel(*given)
        cuda.synchronize()
        return own

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


def evaluations(scenario: Any, sizes: Sizes) -> list[dict[str, Any]]:
    """Generated kernel against CUDA C over the number of flocks."""
    rows = []
    reference = {per: cuda_c.CudaC(scenario, per) for per in (1, 2, 4)}
    for flocks in sorted({1, sizes.generation, min(1000, sizes.saturated), sizes.saturated}):
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


def registers(scenario: Any) -> dict[int, Any]:
    """Registers per thread of the generated kernels, and how long it took to compile or load them."""
    found = {}
    for per in (1, 2, 4):
        begin = time.perf_counter()
        go = ours(scenario, 1, per)
        go()
        taken = round(time.perf_counter() - begin, 2)
        found[per] = {"registers": go.registers(), "compiled or loaded in s": taken}  # type: ignore[attr-defined]
    return found


def agreement(scenario: Any, flocks: int) -> dict[str, Any]:
    """Means over flights: CPU, GPU and CUDA C; z: difference of CPU and GPU in standard errors."""
    seeds = list(range(1, flocks + 1))
    begin = time.perf_counter()
    gpu = score_flights([scenario] * flocks, seeds, device="cuda")
    taken = time.perf_counter() - begin
    cpus = score_flights([scenario] * flocks, [s + 10**6 for s in seeds])
    c = cuda_c.CudaC(scenario, 1).ready(flocks)().copy_to_host()
    rows = {}
    for key in COMPARED:
        a, b = (np.array([row[key] for row in flights]) for flights in (cpus, gpu))
        error = np.hypot(a.std(ddof=1), b.std(ddof=1)) / flocks**0.5
        rows[key] = {"cpu": float(a.mean()), "gpu": float(b.mean()), "CUDA C": float(c[:, SCORES.index(key)].mean()),
                     "z": float((b.mean() - a.mean()) / max(error, 1e-12))}  # fmt: skip
    return {"flights": flocks, "seconds with tables and scores": round(taken, 2), "order parameters": rows}


def apart(scenario: Any) -> dict[str, float]:
    """Largest difference of any position (m) or velocity (m/s) of CPU and GPU in double precision, three seeds."""
    plan = plan_of(scenario, precision=64, record=True, grid=False)
    jobs = [world_tables(scenario, plan, seed) for seed in (1, 2, 3)]
    pairs = zip([cpu.fly_on_cpu(plan, job) for job in jobs], launch.fly_many(plan, jobs), strict=True)
    return {
        "seconds flown": scenario.flight.duration,
        "largest difference": max(float(np.abs(a.frames - b.frames).max()) for a, b in pairs),  # type: ignore[operator]
    }


def evolution(scenario: Any, sizes: Sizes) -> dict[str, Any]:
    """CMA-ES over four parameters: dependent generations, the optimiser and all bookkeeping included."""
    import cma

    keys = ("p_rep", "r0_frict", "c_frict", "v_frict")
    start = [getattr(scenario.parameters, key) for key in keys]
    options = {"popsize": sizes.generation, "verbose": -9, "seed": 1}
    search = cma.CMAEvolutionStrategy([1.0] * len(keys), 0.2, options)
    score_flights([scenario] * sizes.generation, list(range(sizes.generation)), device="cuda")
    begin, flown = time.perf_counter(), 0.0
    for generation in range(sizes.generations):
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
    count = sizes.generation * sizes.generations
    return {"evaluations": count, "seconds": round(taken, 2), "of them in score_flights": round(flown, 2)}


def second_start(sizes: Sizes) -> dict[str, float]:
    """Seconds from the start of a process to the end of its first launch; later ones find the kernel on disk."""
    n = sizes.generation
    code = (
        "from airflock import load\nfrom airflock.engine import score_flights\n"
        f"s = load({PRESET!r}, {{'duration': {min(1.0, sizes.duration)}, 'agents': {sizes.agents}}})\n"
        f"score_flights([s] * {n}, list(range({n})), device='cuda')\nimport time; print(time.time())"
    )
    code = "import rehearsal; rehearsal.begin()\n" + code if rehearsing() else code
    times = []
    for _ in range(2 if rehearsing() else 4):
        begin = time.time()
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=HERE)
        if done.returncode:
            raise RuntimeError(done.stderr[-1000:])
        times.append(float(done.stdout.split()[-1]) - begin)
    return {"first": round(times[0], 2), "second": round(statistics.median(times[1:]), 2)}


def rehearsing() -> bool:
    """Whether stand-ins are in place."""
    return "rehearsal" in sys.modules


def our_flock(sizes: Sizes) -> tuple[Any, Callable[[], Any], Callable[[], float]]:
    """Scenario of the big flock, a function that flies it from its start, and one that counts neighbours."""
    from airflock.engine.cuda.large_flock import LargeFlock

    scenario = load("zapotecatl_2016/literal", crowd_settings(sizes.boids))
    crowd = LargeFlock(scenario, plan_of(scenario), seed=1)
    begun = [device.cuda_runtime().to_device(table.copy_to_host()) for table in (crowd.near, crowd.rest)]

    def advance() -> None:
        crowd.near.copy_to_device(begun[0])
        crowd.rest.copy_to_device(begun[1])
        crowd.step = 0
        crowd.advance(sizes.steps)
        device.cuda_runtime().synchronize()

    return scenario, advance, lambda: float(crowd.neighbours())


def big_flock(sizes: Sizes) -> dict[str, Any]:
    """Steps per second of one flock by cells, each time from its start."""
    _, advance, neighbours = our_flock(sizes)
    (taken,) = least({"airflock": advance}, 5).values()
    return {
        "boids": sizes.boids,
        "airflock steps per second": round(sizes.steps / taken, 1),
        "neighbours": round(neighbours(), 2),
    }


def against_jax(sizes: Sizes) -> dict[str, Any]:
    """The big flock beside the same boids in JAX, in turn, ten steps each time from their start."""
    sizes = replace(sizes, steps=min(10, sizes.steps))
    reason = boids_jax.missing()
    if reason is None and "gpu" not in boids_jax.devices() and not rehearsing():
        reason = "JAX sees no GPU; it needs its CUDA plugin"
    if reason is not None:
        return {"without JAX": reason}
    scenario, advance, _ = our_flock(sizes)
    start = boids_jax.random_start(scenario, 1)
    found: dict[str, Any] = {"apart in float64": boids_jax.difference(crowd_settings, min(2000, sizes.boids), 10)}
    flock = boids_jax.Boids(scenario, start[:3].T, start[3:].T)
    at = flock.x, flock.v, flock.number

    def advance_jax() -> None:
        flock.x, flock.v, flock.number = at
        flock.advance(sizes.steps)

    taken = least({"airflock": advance, "JAX": advance_jax}, 2)
    found |= {f"{name} steps per second": round(sizes.steps / t, 1) for name, t in taken.items()}
    return found | {"speed against JAX": round(taken["JAX"] / taken["airflock"], 2)}


def crowd_settings(agents: int) -> dict[str, Any]:
    """A periodic box in which each boid has about 16 neighbours within its reach of 0.5 m."""
    volume = agents * 4.0 / 3.0 * np.pi * 0.5**3 / 16.0
    side = round(float(volume ** (1.0 / 3.0)), 3)
    return {
        "agents": agents, "world.edges": "periodic", "world.arena": "square", "world.side": side, "world.height": side,
        "start.kind": "arena", "start.separation": 0.0, "start.speed": 0.2, "metrics.kind": "order", "dt": 0.02,
        "metrics.period": 1.0, "duration": 600.0, "update": "synchronous",
    }  # fmt: skip


def say(value: Any) -> None:
    """Print at once."""
    print(value if isinstance(value, str) else json.dumps(value), flush=True)


def in_process(name: str, given: argparse.Namespace) -> Any:
    """What a part measures, in a process that its limit ends."""
    limit = LIMITS[name] * (SLOWER if given.rehearse else 1.0)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "part.json"
        command = [sys.executable, str(HERE / "gpu.py"), "--part", name, "--json", str(file)]
        command += [flag for flag in ("--quick", "--rehearse") if getattr(given, flag[2:])]
        command += ["--trial", str(given.trial)] if given.trial else []
        try:
            ended = subprocess.run(command, timeout=limit, check=False).returncode
        except subprocess.TimeoutExpired:
            return f"failed: over its limit of {limit:g} s"
        return json.loads(file.read_text()) if file.exists() else f"failed: ended with status {ended}"


def main() -> None:
    """Measure everything."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--rehearse", action="store_true")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--trial", type=Path)
    parser.add_argument("--only", action="append", metavar="PART", help="one of the parts, by its printed name")
    parser.add_argument("--part", help=argparse.SUPPRESS)
    given = parser.parse_args()
    sizes = QUICK if given.quick else Sizes()
    if given.rehearse:
        import rehearsal

        sizes = rehearsal.begin(Sizes)
    device.require_gpu()
    scenario = load(PRESET, {"duration": sizes.duration, "agents": sizes.agents})
    parts: dict[str, Callable[[], Any]] = {
        "second start": lambda: second_start(sizes),
        "registers": lambda: registers(scenario),
        "evaluations": lambda: evaluations(scenario, sizes),
        "evolution": lambda: evolution(scenario, sizes),
        "agreement": lambda: agreement(scenario, sizes.flights),
        "apart": lambda: apart(load(PRESET, {"duration": sizes.apart, "agents": sizes.agents})),
        "big flock": lambda: big_flock(sizes),
        "JAX": lambda: against_jax(sizes),
    }
    if given.trial:
        parts["trial"] = lambda: cuda_c.trial(given.trial)
    if given.part:  # the process of one part: its figures go to the parent's file
        try:
            value = parts[given.part]()
        except Exception as error:  # the other figures are wanted all the same
            value = f"failed: {type(error).__name__}: {str(error)[:2000]}"
        given.json.write_text(json.dumps(value))
        return
    found: dict[str, Any] = {"devices": device.describe_gpus()}
    say(found)
    for name in [name for name in parts if not given.only or name in given.only]:
        begin = time.perf_counter()
        found[name] = in_process(name, given)
        say({name: found[name], "took_s": round(time.perf_counter() - begin, 1)})
        if given.json:
            given.json.write_text(json.dumps(found, indent=1))
    from verdicts import table

    text, wrong = table(found, sizes)
    say(text)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
