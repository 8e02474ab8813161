"""What an open flight costs its user: short calls, snapshots, changes, and the gaps while another driver is compiled.

    python benchmarks/flight.py [--rounds 2000]

Short calls are the least of many. For a change of a choice a cache of its own is used, so that the compiler works; the
flight goes on 30 times a second meanwhile, and the gaps are those between the beginnings of two calls.
"""

import argparse
import os
import tempfile
import time

PRESET = "vasarhelyi_2018/4ms"
RATE = 30.0  # calls a second
CHOICES = ({"radio.kind": "links"}, {"sensors.kind": "gnss"}, {"topology.kind": "nearest"})


def least(do, rounds):
    """Shortest time of a call, µs."""
    best = float("inf")
    for _ in range(rounds):
        begun = time.perf_counter()
        do()
        best = min(best, time.perf_counter() - begun)
    return 1e6 * best


def short_calls(rounds):
    """Rows of what and µs."""
    import airflock

    flight = airflock.open(PRESET, seed=3).compile()
    flight.advance(1.0)
    begin = flight.snapshot()
    yield "advance 0.05 s", least(lambda: flight.advance(0.05), min(rounds, 10_000))
    flight.restore(begin)
    yield "snapshot", least(flight.snapshot, rounds)
    yield "snapshot and restore", least(lambda: flight.restore(flight.snapshot()), rounds)
    yield "change of a number", least(lambda: flight.change({"model.p_rep": 0.05}), min(rounds, 300))


def gaps(choice):
    """Gaps between calls (ms) from a change of a choice until its driver has taken over, and that time, s."""
    import airflock

    flight = airflock.open(PRESET, seed=3).compile()
    flight.advance(1.0)
    begun, times = time.perf_counter(), []
    flight.change(choice, wait=False)
    changed = time.perf_counter() - begun
    while flight.waiting:
        now = time.perf_counter()
        times.append(now)
        flight.advance(1 / RATE)
        time.sleep(max(0.0, now + 1 / RATE - time.perf_counter()))
    took = time.perf_counter() - begun
    return sorted(1e3 * (b - a) for a, b in zip(times, times[1:], strict=False)), 1e3 * changed, took


def at(share, ordered):
    """A quantile."""
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def main():
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=2000)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as cache:
        os.environ["AIRFLOCK_CACHE"] = cache
        for what, took in short_calls(asked.rounds):
            print(f"{what:24s} {took:9.2f} µs")
        head = "".join(f"{name:>7s}" for name in ("calls", "p50", "p99", "most"))
        print(f"\n{'change of a choice':26s}{'call':>9s}{head}  takes over after")
        for choice in CHOICES:
            found, changed, took = gaps(choice)
            said = ", ".join(f"{key} = {value}" for key, value in choice.items())
            times = f"{at(0.5, found):7.1f}{at(0.99, found):7.1f}{found[-1]:7.1f}"
            print(f"{said:26s}{changed:6.1f} ms{len(found):7d}{times}  {took:.1f} s")
        print(f"gaps in ms, {RATE:g} calls a second")


if __name__ == "__main__":
    main()
