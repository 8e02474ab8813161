"""What agents that differ or fail cost: processor time of a step beside the plain flight, N = 100.

    python benchmarks/individuals.py [--processes 16] [--flights 6] [--rounds 6] [--only NAME ...] [--json FILE]

A process may be fast or slow by luck, by where its memory lies, and so may each flight in it, by 2 %. So several fresh
ones measure, one after another, and each opens several flights of a row, all in an order of its own. All are open at
once and take turns, 4,000 steps each, by the time of the thread; a flight's figure is the least of its turns. Told are
two ratios to the plain flight: of the least of all flights, and of the means of the flights of a process, averaged over
processes, with the standard error of that. The plain flight stands there a second and a third time, as the noise floor:
what differs from 1 by no more than they do is not told apart from 1.

Faults hit one agent. "void" rows have numbers of the fault at which it changes nothing, and "due" rows a fault that is
due after the last step, so that bit by bit the plain flight is flown: they tell what the text of a driver costs. In
other rows a fault begins in the first second and lasts to the end. Who suffers flies otherwise, and so does the flock:
where agents come nearer to each other, pairs are looked at more often. `--blind` measures no collisions, so that nobody
looks at pairs at all.
"""

import argparse
import json
import random
import subprocess
import sys
import time
from pathlib import Path
from statistics import mean, stdev

import airflock
from airflock.core.parameters import number_names
from airflock.parts import FAULTS as KINDS

PRESET, STEPS, END = "vasarhelyi_2018/4ms", 4000, 1e5
STILL = {"east": 0.0, "north": 0.0, "up": 0.0}
VOID = {
    "motor": {"share": 1.0}, "gnss_offset": STILL, "gnss_drift": STILL, "radio_range": {"share": 1.0},
    "pretender": STILL, "clock": {"ahead": 0.0}, "battery": {"endurance": 0.9 * END, "share": 1.0},
}  # fmt: skip


def own(record):
    """Numbers of a record with half a percent of tolerance each."""
    return {name: {"spread": 0.005 * abs(getattr(record, name))} for name in number_names(type(record))}


def cases():
    """Settings by the name of a row."""
    plain = airflock.load(PRESET)
    p, b = own(plain.parameters), own(plain.body.numbers)
    due = {kind: {"kind": kind, "at": END - 1.0, "agents": [3]} for kind in KINDS}
    begun = {kind: {**due[kind], "at": 0.1} for kind in KINDS if KINDS[kind].leaves is None}
    return {
        "plain": {},
        "plain, again": {},
        "plain, a third time": {},
        "one number": {"groups": [{"name": "a", "agents": 50, "model": {"p_rep": 0.2}}, {"name": "b"}]},
        "one number, nearly": {"groups": [{"name": "a", "model": {"p_rep": p["p_rep"]}}]},
        "all of p": {"groups": [{"name": "a", "model": p}]},
        "all of p and b": {"groups": [{"name": "a", "model": p, "body": b}]},
        **{kind: {"faults": [entry]} for kind, entry in begun.items()},
        **{f"{kind}, void": {"faults": [{**due[kind], "at": 0.1, **numbers}]} for kind, numbers in VOID.items()},
        **{f"{kind}, due": {"faults": [due[kind]]} for kind in ("motor", "stuck", "battery", "fails")},
        "all kinds, due": {"faults": list(due.values())},
    }


def turns(names, given):
    """Least times of a step of flights in this process, µs, by the name of a row; they are opened in a drawn order."""
    found = cases()
    metrics = ["speed"] if given.blind else None
    asked = {name: airflock.load(PRESET, {"duration": END, **found[name]}, metrics=metrics) for name in names}
    due = random.Random(given.turns).sample(names * given.flights, len(names) * given.flights)
    flights = [(name, airflock.open(asked[name], 1)) for name in due]
    for _, flight in flights:
        flight.advance(steps=STEPS)
    took = [float("inf")] * len(flights)
    for _ in range(given.rounds):
        for place, (_, flight) in enumerate(flights):
            begun = time.thread_time()
            flight.advance(steps=STEPS)
            took[place] = min(took[place], 1e6 * (time.thread_time() - begun) / STEPS)
    return {name: [t for t, (who, _) in zip(took, flights, strict=True) if who == name] for name in names}


def measured(names, given):
    """Least times of a step of each process and each flight in it, µs, by the name of a row."""
    found = []
    for number in range(given.processes):
        call = [sys.executable, __file__, "--turns", str(number), "--rounds", str(given.rounds)]
        call += ["--flights", str(given.flights), "--only", *names]
        done = subprocess.run(call + ["--blind"] * given.blind, stdout=subprocess.PIPE, check=True, text=True)
        found.append(json.loads(done.stdout))
        print(f"process {number + 1} of {given.processes}: plain {min(found[-1]['plain']):.3f} µs a step", flush=True)
    return {name: [one[name] for one in found] for name in names}


def main():
    """Measure, and print a table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--processes", type=int, default=16)
    options.add_argument("--flights", type=int, default=6, help="of each row, in each process")
    options.add_argument("--rounds", type=int, default=6)
    options.add_argument("--only", nargs="*", default=[])
    options.add_argument("--blind", action="store_true", help="measure no collisions")
    options.add_argument("--turns", type=int, metavar="NUMBER", help="be one of the processes: this one")
    options.add_argument("--json", type=Path)
    given = options.parse_args()
    names = [name for name in cases() if name.startswith("plain") or not given.only or name in given.only]
    if given.turns is not None:
        print(json.dumps(turns(names, given)))
        return
    took = measured(names, given)
    print(f"{'':20s}  µs a step  of the least  of the means  error")
    rows = {}
    for name, times in took.items():
        ratios = [mean(t) / mean(of) for t, of in zip(times, took["plain"], strict=True)]
        error = stdev(ratios) / len(ratios) ** 0.5 if len(ratios) > 1 else 0.0
        least = [min(map(min, each)) for each in (times, took["plain"])]
        rows[name] = {"us": least[0], "least": least[0] / least[1], "mean": mean(ratios), "error": error}
        print(f"{name:20s} {least[0]:10.3f} {rows[name]['least']:13.3f} {mean(ratios):13.3f}  {error:.3f}")
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
