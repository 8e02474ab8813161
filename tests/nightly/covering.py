"""Flies a set of flights that holds every pair of kinds: compiled and in the CUDA simulator, against the reference.

    python tests/nightly/covering.py FOLDER [PROCESSES]

One line of FOLDER/flights.jsonl for each flight; those that stand there are not flown again. Ends with status 0 if all
agree to 1e-9, 1 if not, 3 if its time (AIRFLOCK_LIMIT, s) is over: call it again to go on.
"""

import json
import os
import subprocess
import sys
import time
import warnings
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np  # noqa: E402

import covering  # noqa: E402
from airflock.engine import fly_world  # noqa: E402
from reference.flight import fly_plainly  # noqa: E402

NEAR = 1e-9  # m, m/s; order parameters relative above 1
SPARE = 120.0  # s before the limit at which no further flight is begun
SIMULATED = Path(__file__).resolve().parents[1] / "gpu" / "simulated.py"


def compiled(number):
    """How far the compiled flight of a combination lies from the reference."""
    warnings.simplefilter("ignore", RuntimeWarning)
    found = covering.flight(covering.pairs()[number])
    known, flown = fly_plainly(found, number), fly_world(found, number, precision=64, record=True)
    frames = [apart(flown.frames, known.frames), apart(flown.state, known.state)]
    values = [apart(flown.values[name], known.values[name]) for name in known.values]
    return max(frames), max(values)


def apart(one, other):
    """Largest difference of two arrays or numbers, relative above 1; inf where only one of them is not a number."""
    one, other = np.asarray(one, float), np.asarray(other, float)
    same = (one == other) | (np.isnan(one) & np.isnan(other))
    off = np.where(same, 0.0, np.abs(one - other) / np.maximum(1.0, np.abs(other)))
    return float(np.where(np.isnan(off), np.inf, off).max(initial=0.0))


def simulated(number):
    """The same by the CUDA simulator, in a process of its own."""
    environment = os.environ | {"NUMBA_ENABLE_CUDASIM": "1"}
    command = [sys.executable, str(SIMULATED), str(number), f"pair {number}"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    if done.returncode:
        return float("inf"), float("inf")
    found = json.loads(done.stdout)[f"pair {number}"]
    return found["frames"], found["values"]


def flown(number):
    """One line of the table."""
    row = {"flight": number, "holds": covering.pairs()[number]}
    return row | {"compiled": compiled(number), "simulated": simulated(number)}


def agrees(row):
    """Whether both drivers fly as the reference does."""
    return max(*row["compiled"], *row["simulated"]) < NEAR


def main():
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    kept = folder / "flights.jsonl"
    rows = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    count, done = len(covering.pairs()), {row["flight"] for row in rows}
    waiting = [number for number in range(count) if number not in done]
    until = time.monotonic() + float(os.environ.get("AIRFLOCK_LIMIT", "inf")) - SPARE
    cores = int(sys.argv[2]) if len(sys.argv) > 2 else 2
    with ProcessPoolExecutor(cores) as pool, kept.open("a") as out:
        while waiting and time.monotonic() < until:
            now, waiting = waiting[:cores], waiting[cores:]
            for future in as_completed([pool.submit(flown, number) for number in now]):
                row = future.result()
                rows.append(row)
                out.write(json.dumps(row) + "\n")
                out.flush()
                if not agrees(row):
                    print(f"flight {row['flight']}: {row}")
            print(f"{len(rows)} of {count} flights", flush=True)
    wrong = [row["flight"] for row in rows if not agrees(row)]
    worst = max((max(*row["compiled"], *row["simulated"]) for row in rows), default=0.0)
    said = f"{len(rows)} of {count} flights with every pair of kinds: {len(wrong)} disagree, at most {worst:.2g} apart"
    print(said)
    return 3 if waiting else int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
