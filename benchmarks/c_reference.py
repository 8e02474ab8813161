"""The hand-written C evaluation from Python: built with the system's compiler, fed with a scenario's numbers."""

import ctypes
import os
import platform
import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from airflock.scenarios.cost import step_counts
from airflock.scenarios.scenario import Scenario

HERE = Path(__file__).parent


def fields(name: str) -> list[str]:
    """Names of the members of a struct of vasarhelyi.h, in their order."""
    text = re.sub(r"/\*.*?\*/", "", (HERE / "vasarhelyi.h").read_text(), flags=re.DOTALL)
    found = re.search(r"typedef struct \{([^}]*)\} " + name + ";", text)
    if found is None:
        raise LookupError(f"vasarhelyi.h has no struct {name}")
    declarations = [line.split(None, 1)[1] for line in found[1].split(";") if line.strip()]
    return [member.strip() for line in declarations for member in line.split(",")]


PARAMETERS, SCORES = fields("parameters"), fields("score")
TIMES = [name for name in fields("schedule") if not name.startswith("seed")]


class Schedule(ctypes.Structure):
    """Numbers of events, in steps; the seed."""

    _fields_ = [(name, ctypes.c_int64 if name in TIMES else ctypes.c_uint32) for name in fields("schedule")]


class Score(ctypes.Structure):
    """Order parameters."""

    _fields_ = [(name, ctypes.c_double) for name in SCORES]

    def values(self) -> dict[str, float]:
        """As a dict."""
        return {name: getattr(self, name) for name in SCORES}


def compiler() -> str | None:
    """The system's C compiler: $CC, cc or gcc; None without one."""
    return next((found for name in (os.environ.get("CC"), "cc", "gcc") if name and (found := shutil.which(name))), None)


def flags(vector_bits: int) -> list[str]:
    """Flags of every build: as fast as the compiler can, for this processor."""
    wide = {512: ["-mprefer-vector-width=512"], 256: ["-mprefer-vector-width=256", "-DVECTOR_BYTES=32"]}
    return ["-O3", "-march=native", "-ffast-math", *wide.get(vector_bits, [])]


def widest() -> int:
    """Width of the widest vectors of this machine, bits, as the C compiler sees it."""
    command = [str(compiler()), "-march=native", "-dM", "-E", "-x", "c", os.devnull]
    macros = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return 512 if "__AVX512F__" in macros else 256 if "__AVX2__" in macros else 128


def build(source: Path, library: Path, options: Sequence[str]) -> Path:
    """Compile and link one shared library.

    Linking apart, without -ffast-math: with it gcc would add code that flushes denormal numbers to zero in the whole
    process, Python included.
    """
    cc, threads = str(compiler()), [] if platform.system() == "Darwin" else ["-fopenmp"]
    compiled = library.with_suffix(".o")
    steps = (
        [cc, "-std=gnu11", *options, *threads, "-fPIC", "-c", str(source), "-o", str(compiled)],
        [cc, "-shared", *threads, str(compiled), "-o", str(library), "-lm"],
    )
    for command in steps:
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)}\n{done.stderr}")
    return library


def parameters_of(scenario: Scenario, bits: int = 32) -> Any:
    """Numbers of a scenario as the struct of vasarhelyi.h."""
    body, sensors, measured = scenario.body.numbers, scenario.sensors.numbers, scenario.resolved_metrics()
    numbers = {name: getattr(scenario.parameters, name) for name in PARAMETERS if hasattr(scenario.parameters, name)}
    numbers |= {
        "tau": body.tau, "a_max": body.a_max, "outer_noise": body.noise,
        "sensor_noise": sensors.noise, "damping": sensors.damping,
        "spring": (2.0 * sensors.damping * sensors.noise) ** 0.5 / sensors.scale,
        **{name: getattr(scenario.radio.numbers, name) for name in PARAMETERS if hasattr(scenario.radio.numbers, name)},
         "half_side": 0.5 * scenario.world.side,
        "separation": scenario.separation(), "r_coll": measured.r_coll, "r_cluster": measured.r_cluster,
        "dt": scenario.flight.dt, "period": sensors.period,
    }  # fmt: skip
    real = ctypes.c_float if bits == 32 else ctypes.c_double
    kind = type("Parameters", (ctypes.Structure,), {"_fields_": [(name, real) for name in PARAMETERS]})
    return kind(*(numbers[name] for name in PARAMETERS))


class Reference:
    """One build of vasarhelyi.c for one scenario: a square arena whose nearer walls act, the multirotor of Table S5."""

    def __init__(self, scenario: Scenario, folder: Path, *, bits: int = 32, vector_bits: int = 0, trial: bool = False):
        self.vector_bits = vector_bits or widest()
        self.bits = bits
        room = -(-scenario.agents // 16) * 16
        options = [*flags(self.vector_bits), f"-DROOM={room}"]
        options += ["-DREAL=double"] if bits == 64 else []
        options += ["-DTRIAL_PHYSICS"] if trial else []
        name = f"vasarhelyi_{bits}_{self.vector_bits}{'_trial' if trial else ''}_{room}.so"
        self.library = ctypes.CDLL(str(build(HERE / "vasarhelyi.c", folder / name, options)))
        if self.library.vector_bytes() * 8 != self.vector_bits or self.library.real_bytes() * 8 != bits:
            raise RuntimeError(f"{name} was built with another width of vectors or reals")
        self.scenario = scenario
        self.parameters = parameters_of(scenario, bits)
        times = step_counts(scenario)
        self.times = {name: times[name] for name in TIMES if name in times} | {"agents": scenario.agents}
        self.times["links"] = int(scenario.radio.rule.name == "links")
        self.times["delay"] = times["delay"] // times["decide_every"]

    def _schedule(self, seed: int, skip: bool) -> Schedule:
        numbers = self.times | {"skip": int(skip)}
        return Schedule(*(numbers[name] for name in TIMES), seed & 0xFFFFFFFF, seed >> 32)

    def evaluate(self, seed: int, *, skip: bool = True) -> dict[str, float]:
        """Order parameters of one flight; skip: no look at the pairs while nobody can have come near enough."""
        return self._fly(seed, skip, None)

    def frames(self, seed: int) -> tuple[Any, dict[str, float]]:
        """Frames (time, component x y vx vy, agent) of one flight, and its order parameters."""
        samples = self.times["steps"] // self.times["sample_every"] + 1
        frames = np.zeros((samples, 4, self.times["agents"]), np.float32 if self.bits == 32 else np.float64)
        return frames, self._fly(seed, True, frames)

    def _fly(self, seed: int, skip: bool, frames: Any) -> dict[str, float]:
        score = Score()
        place = None if frames is None else frames.ctypes.data_as(ctypes.c_void_p)
        given = ctypes.byref(self.parameters), ctypes.byref(self._schedule(seed, skip)), place, ctypes.byref(score)
        if status := self.library.evaluate(*given):
            raise RuntimeError(f"agent {-status - 1} found no place")
        return score.values()

    def evaluate_many(self, seed: int, worlds: int) -> list[dict[str, float]]:
        """Order parameters of many flights with seeds from `seed` on, on all cores."""
        scores = (Score * worlds)()
        schedule = self._schedule(seed, True)
        self.library.evaluate_many(
            ctypes.byref(self.parameters), ctypes.byref(schedule), ctypes.c_int64(worlds), ctypes.byref(scores)
        )
        return [score.values() for score in scores]
