"""Airflock against hand-written C, interleaved: builds the reference, checks agreement, times both, prints ratios.

    python benchmarks/run.py [--quick] [--json] [--rounds 9] [--vector-bits 256] [--trial flock.c]

Only ratios of interleaved runs mean anything: of each pair the least time of each side and the median of the ratios of
single rounds are shown. One thread is measured in processor time, all cores in elapsed time.
"""

import argparse
import json
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import c_reference
import numpy as np
from c_reference import Reference
from trial import Trial

from airflock.engine import fly_world, score_flight, score_flights
from airflock.scenarios.files import load
from airflock.scenarios.scenario import Scenario
from airflock.support.machine import vector_bits
from airflock.support.threads import available_cores

PRESET, LINKS = "vasarhelyi_2018/4ms", "vasarhelyi_2018/real_gnss"
SEEDS = (1, 2, 3)  # flights of one round on one thread
COMPARED = ("phi_vel", "phi_corr", "r_min_mean", "phi_lap_abs", "polarisation", "n_coll")


@dataclass
class Pair:
    """Two ways to do the same: name, what is measured, what it is measured against, and the largest ratio allowed.

    least, other : least time of a flight, ms; ratio : of these; median : of the ratios of single rounds
    """

    name: str
    ours: Callable[[], object]
    theirs: Callable[[], object]
    bound: float | None
    flights: int
    clock: Callable[[], float] = time.process_time
    least: float = 0.0
    other: float = 0.0
    ratio: float = 0.0
    median: float = 0.0

    def measure(self, rounds: int) -> None:
        """Time both in turn, each first in every second round."""
        self.ours(), self.theirs()
        times: list[tuple[float, float]] = []
        for turn in range(rounds):
            taken = [0.0, 0.0]
            for side in (0, 1) if turn % 2 == 0 else (1, 0):
                begin = self.clock()
                (self.ours, self.theirs)[side]()
                taken[side] = (self.clock() - begin) / self.flights * 1e3
            times.append((taken[0], taken[1]))
        self.least, self.other = min(a for a, _ in times), min(b for _, b in times)
        self.ratio, self.median = self.least / self.other, statistics.median(a / b for a, b in times)

    def row(self) -> dict[str, object]:
        """Numbers for a table or JSON."""
        whole = {name: value for name, value in asdict(self).items() if name not in ("ours", "theirs", "clock")}
        return whole | {"holds": self.bound is None or self.ratio <= self.bound}


def pairs(scenario: Scenario, folder: Path, bits: int, many: int, trial: Path | None) -> list[Pair]:
    """Everything that is compared."""
    seldom = load(PRESET, {"duration": scenario.flight.duration, "metrics.collision_period": 0.2})
    c, c64 = (Reference(scenario, folder, bits=real, vector_bits=bits) for real in (32, 64))
    c_seldom = Reference(seldom, folder, vector_bits=bits)
    links = load(LINKS, {"duration": scenario.flight.duration})

    def flown(found: Scenario, precision: int = 32) -> Callable[[], object]:
        return lambda: [score_flight(found, seed, precision=precision) for seed in SEEDS]

    def written(reference: Reference, *, skip: bool = True) -> Callable[[], object]:
        return lambda: [reference.evaluate(seed, skip=skip) for seed in SEEDS]

    one = len(SEEDS)
    found = [
        Pair("float32, collisions every 0.2 s", flown(seldom), written(c_seldom), 1.15, one),
        Pair("float32, collisions every 0.01 s", flown(scenario), written(c), 1.15, one),
        Pair("the same, C looks at all pairs", flown(scenario), written(c, skip=False), 1.25, one),
        Pair("float64, collisions every 0.01 s", flown(scenario, 64), written(c64), None, one),
        Pair(
            "two lossy links, 30 drones, float32", flown(links), written(Reference(links, folder, vector_bits=bits)),
            1.15, one,
        ),
        Pair(
            f"all {available_cores()} cores, float32, {many} flights",
            lambda: score_flights([scenario] * many, list(range(1, many + 1))),
            lambda: c.evaluate_many(1, many), 1.3, many, time.perf_counter,
        ),
    ]  # fmt: skip
    if trial is not None:
        earlier = Trial(trial, scenario, folder, c.vector_bits)
        same = Reference(scenario, folder, vector_bits=bits, trial=True)
        same_seldom = Reference(seldom, folder, vector_bits=bits, trial=True)
        for name, ours, every in (("0.2", same_seldom, False), ("0.01", same, True)):
            theirs = [lambda seed=seed, every=every: earlier.evaluate(seed, every) for seed in SEEDS]
            found.append(
                Pair(
                    f"C reference / earlier C, collisions every {name} s",
                    written(ours, skip=False), lambda theirs=theirs: [call() for call in theirs], 1.0, one,
                )
            )  # fmt: skip
    return found


def agreement(scenario: Scenario, folder: Path, bits: int, seeds: int) -> dict[str, object]:
    """How far C and airflock are apart: the same seeds over the first seconds, and means over many seeds."""
    found: dict[str, object] = {}
    tried = (PRESET, 64, 10.0, 1e-9), (PRESET, 32, 4.0, 2e-3), (LINKS, 64, 10.0, 1e-9)
    for preset, precision, seconds, margin in tried:
        short = load(preset, {"duration": seconds})
        frames, _ = Reference(short, folder, bits=precision, vector_bits=bits).frames(1)
        flown = fly_world(short, 1, precision=precision, record=True)
        apart, what = float(np.abs(frames - flown.frames[:, :4]).max()), "" if preset == PRESET else "two lossy links, "
        name = f"{what}float{precision}, first {seconds:g} s"
        found[name] = {"apart": apart, "margin": margin, "holds": apart <= margin}
    ours = score_flights([scenario] * seeds, list(range(1, seeds + 1)))
    theirs = Reference(scenario, folder, vector_bits=bits).evaluate_many(1, seeds)
    for name in COMPARED:
        a, b = (np.array([run[name] for run in runs]) for runs in (ours, theirs))
        error = float(np.hypot(a.std(ddof=1), b.std(ddof=1)) / seeds**0.5)
        apart = abs(float(a.mean() - b.mean()))
        found[name] = {
            "airflock": float(a.mean()), "c": float(b.mean()), "apart": apart, "margin": 3.0 * error,
            "holds": apart <= 3.0 * error,
        }  # fmt: skip
    return found


def machine(bits: int) -> dict[str, object]:
    """What the figures depend on."""
    cpu = platform.processor()
    if Path("/proc/cpuinfo").exists():
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        cpu = next((line.partition(": ")[2] for line in lines if line.startswith("model name")), cpu)
    version = subprocess.run([str(c_reference.compiler()), "--version"], capture_output=True, text=True).stdout
    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty", "--abbrev=10"], capture_output=True, text=True, cwd=c_reference.HERE
    ).stdout
    import numba

    return {
        "processor": cpu, "cores": available_cores(), "compiler": version.splitlines()[0],
        "flags": " ".join(c_reference.flags(bits)), "c_vector_bits": bits, "airflock_vector_bits": vector_bits(),
        "numba": numba.__version__, "python": platform.python_version(), "commit": commit.strip(),
    }  # fmt: skip


def show(result: dict[str, dict[str, object]], rows: list[dict[str, object]]) -> None:
    """Print everything as tables in Markdown."""
    for name, value in result["machine"].items():
        print(f"{name:22} {value}")
    print("\n| agreement | airflock | C | apart | margin | |\n|---|---|---|---|---|---|")
    for name, found in result["agreement"].items():
        means = " | ".join(f"{found[side]:.5g}" if side in found else "" for side in ("airflock", "c"))
        print(f"| {name} | {means} | {found['apart']:.2g} | {found['margin']:.2g} | {mark(found)} |")
    print(
        "\n| per flight | airflock ms | C ms | ratio of least | median ratio | bound | |\n|---|---|---|---|---|---|---|"
    )
    for row in rows:
        bound = f"{row['bound']:g}" if row["bound"] else ""
        print(
            f"| {row['name']} | {row['least']:.1f} | {row['other']:.1f} | {row['ratio']:.3f} | {row['median']:.3f} "
            f"| {bound} | {mark(row)} |"
        )


def mark(found: dict[str, object]) -> str:
    """Whether a bound holds, in a word."""
    return "holds" if found["holds"] else "**misses**"


def main() -> int:
    """Run all; exit status 1 if C and airflock disagree (a time is never an error)."""
    parser = argparse.ArgumentParser(description="Airflock against hand-written C, interleaved.")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--quick", action="store_true", help="60 s instead of 600 s of flight, 8 instead of 20 seeds")
    parser.add_argument("--rounds", type=int, default=9, help="rounds of each comparison (default 9)")
    parser.add_argument("--vector-bits", type=int, choices=(128, 256, 512), default=0, help="width of C's vectors")
    parser.add_argument("--trial", type=Path, help="flock.c of an earlier evaluation, to compare the reference with")
    given = parser.parse_args()
    if c_reference.compiler() is None:
        print("no C compiler: neither $CC, cc nor gcc", file=sys.stderr)
        return 2
    bits = given.vector_bits or c_reference.widest()
    scenario = load(PRESET, {"duration": 60.0 if given.quick else 600.0})
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        result = {"machine": machine(bits), "agreement": agreement(scenario, folder, bits, 8 if given.quick else 20)}
        found = pairs(scenario, folder, bits, 4 * available_cores(), given.trial)
        for pair in found:
            pair.measure(max(1, given.rounds))
    rows = [pair.row() for pair in found]
    if given.json:
        print(json.dumps({**result, "ratios": rows}))
    else:
        show(result, rows)
    return 0 if all(entry["holds"] for entry in result["agreement"].values()) else 1


if __name__ == "__main__":
    sys.exit(main())
