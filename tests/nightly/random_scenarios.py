"""Draws scenarios, flies them interpreted and by the reference, and counts what the draws hold.

    python tests/nightly/random_scenarios.py FOLDER [DRAWS]

One line of FOLDER/draws.jsonl for each draw; draws that stand there are not flown again. Ends with status 0 if all
agree and hold everything, 1 if not, 3 if its time (AIRFLOCK_LIMIT, s) is over: call it again to go on.
"""

import json
import os
import sys
import time
import warnings
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from against_reference import compared  # noqa: E402
from scenarios_drawn import drawn, missing, notions  # noqa: E402

DRAWS = 5000
BATCH = 20
SPARE = 120.0  # s before the limit at which no further batch is begun


def flown(first):
    """Draws first to first + BATCH - 1: their number, what they hold, how far the two flights lie apart."""
    warnings.simplefilter("ignore", RuntimeWarning)
    rows = []
    for number in range(first, first + BATCH):
        draw = drawn(Random(number))
        verdict = compared(draw)
        row = {"draw": number, "agrees": bool(verdict.agrees), "frames": verdict.frames, "values": verdict.values}
        rows.append(row | {"allowed": verdict.allowed, "fault": verdict.fault, "holds": sorted(notions(draw))})
    return rows


def main():
    folder = Path(sys.argv[1])
    draws = int(sys.argv[2]) if len(sys.argv) > 2 else DRAWS
    folder.mkdir(parents=True, exist_ok=True)
    kept = folder / "draws.jsonl"
    rows = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    done = {row["draw"] for row in rows}
    until = time.monotonic() + float(os.environ.get("AIRFLOCK_LIMIT", "inf")) - SPARE
    waiting = [first for first in range(0, draws, BATCH) if not done.issuperset(range(first, first + BATCH))]
    with ProcessPoolExecutor(2) as pool, kept.open("a") as out:
        while waiting and time.monotonic() < until:
            now, waiting = waiting[:8], waiting[8:]
            for future in as_completed([pool.submit(flown, first) for first in now]):
                fresh = [row for row in future.result() if row["draw"] not in done]
                rows += fresh
                out.writelines(json.dumps(row) + "\n" for row in fresh)
                out.flush()
                for row in fresh:
                    if not row["agrees"]:
                        print(f"draw {row['draw']}: {row['frames']:.2g} m apart, {row['values']:.2g} in values")
            print(f"{len(rows)} of {draws} draws", flush=True)
    wrong = [row["draw"] for row in rows if not row["agrees"]]
    chaotic = sum(row["agrees"] and not row["fault"] and max(row["allowed"]) > 1e-9 for row in rows)
    refused = sum(bool(row["fault"]) for row in rows)
    said = f"{len(rows)} draws: {len(wrong)} disagree; {chaotic} agree within their own chaos, {refused} fail alike"
    if waiting:
        print(f"{said}; {draws - len(rows)} still to fly")
        return 3
    lacking = missing([row["holds"] for row in rows])
    for name in lacking:
        print(f"no draw holds {name}")
    print(f"{said}; no draw holds {len(lacking)} of the choices and pairs of notions")
    return 1 if wrong or lacking else 0


if __name__ == "__main__":
    sys.exit(main())
