"""What agents that differ or fail cost: processor time of a step beside the plain flight, N = 100.

    python benchmarks/individuals.py [--processes 12] [--rounds 40] [--only NAME ...] [--json FILE]

A process may be fast or slow by luck, by where its memory lies, and so may a flight in it by when it was opened. So
several fresh ones measure, one after another, and open the flights in orders of their own. In each, all are open at
once and take turns, 2,000 steps each, by the time of the thread; a flight's figure is the least of its turns. Told are
two ratios to the plain flight: of the least of all processes, and the median of those within a process, with the
quarters of these beside it. The plain flight stands there a second and a third time, as the noise floor: what differs
from 1 by no more than they do is not told apart from 1.

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
from statistics import median, quantiles

import airflock
from airflock.core.parameters import number_names
from airflock.faults.registry import KINDS

PRESET, STEPS, END = "vasarhelyi_2018/4ms", 2000, 1e5
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
    p, b = own(plain.parameters), own(plain.body)
    due = {kind: {"kind": kind, "at": END - 1.0, "agents": [3]} for kind in KINDS}
    begun = {kind: {**due[kind], "at": 0.1} for kind in KINDS if KINDS[kind].leaves is None}
    return {
        "plain": {},
        "plain, again": {},
        "plain, a third time": {},
        "one number": {"groups": [{"name": "a", "agents": 50, "model": {"p_rep": 0.2}}, {"name": "b"}]},
        "all of p": {"groups": [{"name": "a", "model": p}]},
        "all of p and b": {"groups": [{"name": "a", "model": p, "body": b}]},
        **{kind: {"faults": [entry]} for kind, entry in begun.items()},
        **{f"{kind}, void": {"faults": [{**due[kind], "at": 0.1, **numbers}]} for kind, numbers in VOID.items()},
        **{f"{kind}, due": {"faults": [due[kind]]} for kind in ("motor", "stuck", "battery", "fails")},
        "all kinds, due": {"faults": list(due.values())},
    }


def turns(names, rounds, blind, order):
    """Least times of a step in this process, µs, by the name of a row; flights are opened in a drawn order."""
    found = cases()
    metrics = ["speed"] if blind else None
    names = random.Random(order).sample(names, len(names))
    flights = {
        name: airflock.open(airflock.load(PRESET, {"duration": END, **found[name]}, metrics=metrics), 1)
        for name in names
    }
    for flight in flights.values():
        flight.advance(steps=STEPS)
    took = dict.fromkeys(names, float("inf"))
    for _ in range(rounds):
        for name, flight in flights.items():
            begun = time.thread_time()
            flight.advance(steps=STEPS)
            took[name] = min(took[name], 1e6 * (time.thread_time() - begun) / STEPS)
    return took


def measured(names, given):
    """Least times of a step of each process, µs, by the name of a row."""
    found = []
    for number in range(given.processes):
        call = [sys.executable, __file__, "--turns", str(number), "--rounds", str(given.rounds), "--only", *names]
        done = subprocess.run(call + ["--blind"] * given.blind, stdout=subprocess.PIPE, check=True, text=True)
        found.append(json.loads(done.stdout))
        print(f"process {number + 1} of {given.processes}: plain {found[-1]['plain']:.3f} µs a step", flush=True)
    return {name: [one[name] for one in found] for name in names}


def main():
    """Measure, and print a table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--processes", type=int, default=12)
    options.add_argument("--rounds", type=int, default=40)
    options.add_argument("--only", nargs="*", default=[])
    options.add_argument("--blind", action="store_true", help="measure no collisions")
    options.add_argument("--turns", type=int, metavar="NUMBER", help="be one of the processes: this one")
    options.add_argument("--json", type=Path)
    given = options.parse_args()
    names = [name for name in cases() if name.startswith("plain") or not given.only or name in given.only]
    if given.turns is not None:
        print(json.dumps(turns(names, given.rounds, given.blind, given.turns)))
        return
    took = measured(names, given)
    print(f"{'':20s}  µs a step  of the least  median  quarters")
    rows = {}
    for name, times in took.items():
        ratios = [t / of for t, of in zip(times, took["plain"], strict=True)]
        low, _, high = quantiles(ratios, n=4) if len(ratios) > 1 else 3 * ratios
        rows[name] = {"us": min(times), "least": min(times) / min(took["plain"]), "median": median(ratios)}
        rows[name] |= {"quarters": [low, high]}
        print(f"{name:20s} {min(times):10.3f} {rows[name]['least']:13.3f} {median(ratios):7.3f}  {low:.3f} {high:.3f}")
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
