"""What agents that differ or fail cost: processor time of a step beside the plain flight, N = 100.

    python benchmarks/individuals.py [--rounds 600] [--only NAME ...] [--json FILE]

All flights are open at once and take turns, some hundred steps each, by the time of the thread. Two ratios: of the
least times, and the median of those within a turn. Faults begin in the first second, last to the end, and hit one
agent. Of kinds that let an agent leave, and in the last row of all kinds, the fault is due after the last step.

Who suffers flies otherwise, and so does the flock: where agents come nearer to each other, pairs are looked at more
often. "void" rows have numbers of the fault at which it changes nothing, so that they tell what it costs by itself.
"""

import argparse
import json
import time
from pathlib import Path
from statistics import median

import airflock
from airflock.core.parameters import number_names
from airflock.faults.registry import KINDS

PRESET, STEPS = "vasarhelyi_2018/4ms", 400
STILL = {"east": 0.0, "north": 0.0, "up": 0.0}
VOID = {
    "motor": {"share": 1.0}, "gnss_offset": STILL, "gnss_drift": STILL, "radio_range": {"share": 1.0},
    "pretender": STILL, "clock": {"ahead": 0.0},
}  # fmt: skip


def own(record, letter_of):
    """Numbers of a record with half a percent of tolerance each."""
    return {name: {"spread": 0.005 * abs(getattr(record, name))} for name in letter_of}


def cases():
    """Settings by the name of a row."""
    plain = airflock.load(PRESET)
    p = own(plain.parameters, number_names(type(plain.parameters)))
    b = own(plain.body, number_names(type(plain.body)))
    faults = {kind: [{"kind": kind, "at": 0.1, "agents": [3]}] for kind in KINDS if KINDS[kind].leaves is None}
    late = [{"kind": kind, "at": 1e5 - 1.0, "agents": [3]} for kind in KINDS]
    return {
        "plain": {},
        "the same again": {"start.speed": plain.start.speed},
        "one number": {"groups": [{"name": "a", "agents": 50, "model": {"p_rep": 0.2}}, {"name": "b"}]},
        "all of p": {"groups": [{"name": "a", "model": p}]},
        "all of p and b": {"groups": [{"name": "a", "model": p, "body": b}]},
        **{kind: {"faults": found} for kind, found in faults.items()},
        **{f"{kind}, void": {"faults": [{**faults[kind][0], **VOID[kind]}]} for kind in VOID},
        **{entry["kind"]: {"faults": [entry]} for entry in late if entry["kind"] not in faults},
        "all, none begun": {"faults": late},
    }


def main():
    """Measure, and print a table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rounds", type=int, default=600)
    options.add_argument("--only", nargs="*", default=[])
    options.add_argument("--json", type=Path)
    given = options.parse_args()
    flights = {}
    for name, settings in cases().items():
        if name == "plain" or not given.only or name in given.only:
            flights[name] = airflock.open(airflock.load(PRESET, {"duration": 1e5, **settings}), 1).advance(steps=STEPS)
            print(f"{name}: ready", flush=True)
    took = {name: [] for name in flights}
    for _ in range(given.rounds):
        for name, flight in flights.items():
            begun = time.thread_time()
            flight.advance(steps=STEPS)
            took[name].append(time.thread_time() - begun)
    plain = took["plain"]
    rows = {
        name: {
            "us_per_step": 1e6 * min(times) / STEPS, "ratio": min(times) / min(plain),
            "median": median(t / of for t, of in zip(times, plain, strict=True)),
        }
        for name, times in took.items()
    }  # fmt: skip
    print("                    µs a step  of the least  median")
    for name, row in rows.items():
        print(f"{name:18s} {row['us_per_step']:10.3f} {row['ratio']:13.3f} {row['median']:7.3f}")
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
