"""Random fleets: what `airflock identify` finds against the truth, and how often its intervals hold it.

python benchmarks/identify.py --fleets 20 --first 5000 --white 0.1 [--out fleets.csv]     (resumes what is there)
"""

import argparse
import time
from pathlib import Path

import numpy as np
import pandas as pd

import airflock
from airflock.estimate.identification import (
    body_and_sensor as body,
    body_and_sensor as sensors,
    log_check as synthetic,
    radio_links as packets,
)
from airflock.estimate.identification.radio_links import CURVE_PARAMETERS

KEYS = {"tau": "body.tau", "a_max": "body.a_max", "noise": "body.noise"}


def truth(seed):
    """Numbers of one random fleet."""
    g = np.random.default_rng(seed)
    return g, {
        "body.tau": g.uniform(0.3, 1.5), "body.a_max": g.uniform(2.0, 8.0), "body.noise": 10.0 ** g.uniform(-1.7, -0.4),
        "sensors.noise": 10.0 ** g.uniform(-3.0, -1.5), "radio.delay": round(g.uniform(0.1, 1.5), 2),
        "radio.near": g.uniform(10.0, 30.0), "radio.far": g.uniform(40.0, 70.0),
        "radio.received_near": g.uniform(0.9, 0.99), "radio.received_far": g.uniform(0.2, 0.6),
    }  # fmt: skip


def fleet(seed, white, rate, duration, only_body):
    """One row: truth, estimate, interval and verdict of each number; processor seconds."""
    generator, numbers = truth(seed)
    extra = {
        "agents": 10,
        "duration": duration,
        "radio.kind": "links",
        "radio.range": 250.0,
        "metrics.period": 1 / rate,
    }
    scenario = airflock.load("vasarhelyi_2018/real_6ms", {**extra, **numbers})
    logger = synthetic.LogDisturbance(white=white, stamp_jitter=0.02)
    logs, heard, _ = synthetic.fly_logs(scenario, seed, logger, generator)
    begin = time.process_time()
    walk = scenario.sensors.noise * scenario.sensors.damping
    if not only_body:
        ground = synthetic.standing_logs(seed + 1_000_000, 10, 120.0, scenario.sensors.numbers, logger, generator)
        still = sensors.fit_sensors(ground, scenario.sensors.period)
        walk = still.value["noise"] * still.value["damping"]
    middle = time.process_time()
    found = body.fit_body(logs, scenario.flight.dt, walk)
    row = {
        "seed": seed, "saturated": found.saturated_rows, "gain": found.gain, "second_tau": found.second_tau,
        "white": found.value["white"], "dead_time": found.value["delay"],
    }  # fmt: skip
    rows = {key: (found.value[n], found.intervals[n], found.refused.get(n, "")) for n, key in KEYS.items()}
    row["seconds_body"] = time.process_time() - middle
    if not only_body:
        rows["sensors.noise"] = still.value["noise"], still.intervals["noise"], still.refused.get("noise", "")
        late = packets.fit_delay(heard)
        rows["radio.delay"] = late.value, late.interval, late.reason
        links = packets.fit_links(heard, scenario.sensors.period, scenario.radio.numbers)
        rows |= {f"radio.{n}": (links.value[n], links.intervals[n], links.refused.get(n, "")) for n in CURVE_PARAMETERS}
        row["seconds"] = time.process_time() - begin
    for key, (value, (low, high), reason) in rows.items():
        row |= {
            key: numbers[key],
            f"{key}.found": value,
            f"{key}.low": low,
            f"{key}.high": high,
            f"{key}.refused": reason,
        }
    return row


def report(table):
    """Rms and worst relative error, and share of intervals that hold the truth, of what was not refused."""
    for key in [c[:-6] for c in table if c.endswith(".found")]:
        told = table[table[f"{key}.refused"].fillna("") == ""]
        off = told[f"{key}.found"] / told[key] - 1.0
        held = ((told[f"{key}.low"] <= told[key]) & (told[key] <= told[f"{key}.high"])).sum()
        print(
            f"{key:22s} rms {100 * np.sqrt((off**2).mean()):5.1f} %  worst {100 * off.abs().max():5.1f} %  "
            f"mean {100 * off.mean():+5.1f} %  held {held}/{len(told)}  refused {len(table) - len(told)}"
        )


def main():
    """Fly, fit, write each row at once, report."""
    ask = argparse.ArgumentParser(description=__doc__)
    ask.add_argument("--fleets", type=int, default=20)
    ask.add_argument("--first", type=int, default=5000)
    ask.add_argument("--white", type=float, default=0.1)
    ask.add_argument("--rate", type=float, default=20.0)
    ask.add_argument("--duration", type=float, default=300.0)
    ask.add_argument("--body", action="store_true", help="only the body")
    ask.add_argument("--out", type=Path, default=Path("fleets.csv"))
    given = ask.parse_args()
    done = pd.read_csv(given.out) if given.out.exists() else pd.DataFrame()
    for seed in range(given.first, given.first + given.fleets):
        if len(done) and seed in set(done["seed"]):
            continue
        row = fleet(seed, given.white, given.rate, given.duration, given.body)
        done = pd.concat([done, pd.DataFrame([row])], ignore_index=True)
        done.to_csv(given.out, index=False)
        shown = {
            k: f"{row[k]:.3f} {row[k + '.found']:.3f} [{row[k + '.low']:.3f}, {row[k + '.high']:.3f}]"
            for k in KEYS.values()
        }
        print(seed, shown, row["body.a_max.refused"][:30], f"{row['seconds_body']:.1f} s", flush=True)
    report(done)


if __name__ == "__main__":
    main()
