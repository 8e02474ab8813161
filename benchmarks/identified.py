"""Does a fleet fly like the scenario that was identified from its logs, and is what logs cannot tell refused?

python benchmarks/identified.py FOLDER --fleets 20 --first 190000

The fleets are those of identify.py: numbers drawn from a seed, 10 drones, 300 s at 20 Hz with 0.1 m/s of noise in the
log, 120 s of standing before. What is identified goes into the preset that the logs are read with, as `airflock
identify --out` writes it; a number that is refused stays as it is there. Both scenarios are flown with the same seeds
and each order parameter is compared by Welch's test and by the sharper one of pairs, Holm-corrected within a fleet.
Then each fleet's logs are put into six states that hide a number, such as a limit that is never reached, and each
number that is told all the same is counted. Status 0: no fleet differs by either test, and none is told. Goes on where
it stopped.
"""

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from identify import truth
from scipy.stats import ttest_ind, ttest_rel

import airflock
from airflock.engine import score_flights
from airflock.estimate.identification import (
    body_and_sensor as body,
    body_and_sensor as sensors,
    log_check as synthetic,
    radio_links as packets,
    vehicle_logs as periods,
)
from airflock.estimate.identification.vehicle_identification import identify
from airflock.estimate.identification.vehicle_logs import FlightLogs
from airflock.support.many_tests import holm_correction

PRESET, DRONES, SECONDS, STEP, GROUND = "vasarhelyi_2018/real_6ms", 10, 300.0, 0.05, 120.0
SAME = {"agents": DRONES, "duration": SECONDS, "radio.kind": "links", "radio.range": 250.0}
LOGGER = synthetic.LogDisturbance(white=0.1, stamp_jitter=0.02)
SEEDS = range(60)
NEVER = 60.0  # m/s²; no command of these fleets asks for so much
NEAR = 10.0  # m; nearer than any distance at which packets of these fleets begin to be lost


def logs_of(seed, **changed):
    """A fleet's scenario, its logs with the standing before take-off, its packets."""
    generator, numbers = truth(seed)
    scenario = airflock.load(PRESET, {**SAME, "metrics.period": STEP, **numbers, **changed})
    logs, heard, _ = synthetic.fly_logs(scenario, seed, LOGGER, generator)
    ground = synthetic.standing_logs(seed + 1_000_000, DRONES, GROUND, scenario.sensors.numbers, LOGGER, generator)
    return scenario, joined(ground, logs), heard


def joined(ground, logs):
    """Logs of drones that first stood and then flew."""
    before = replace(ground, time=ground.time - GROUND - 10.0)
    parts = {name: np.concatenate([getattr(each, name) for each in (before, logs)])
             for name in ("time", "position", "velocity", "command", "who", "new", "standing")}  # fmt: skip
    order = np.argsort(parts["who"], kind="stable")
    return FlightLogs(**{name: values[order] for name, values in parts.items()}, names=logs.names)


def flown(seed):
    """One fleet: what was told, and of each order parameter both means, and z and p of both tests."""
    scenario, logs, heard = logs_of(seed)
    found = identify(logs, airflock.load(PRESET, SAME), heard=heard)
    told = {key: [number.value, _value(scenario, key)] for key, number in found.numbers.items() if number.told}
    true = airflock.load(PRESET, {**SAME, **truth(seed)[1]})
    rows = [score_flights([what] * len(SEEDS), SEEDS) for what in (true, found.scenario())]
    scores = {}
    for name in rows[0][0]:
        a, b = (np.array([row[name] for row in part], float) for part in rows)
        if np.isfinite(a).all() and np.isfinite(b).all() and (b - a).std() > 0.0:
            tests = ttest_ind(b, a, equal_var=False), ttest_rel(b, a)
            scores[name] = [a.mean(), b.mean(), *(float(value) for test in tests for value in test)]
    refused = {key: number.reason for key, number in found.numbers.items() if not number.told}
    return {"seed": seed, "told": told, "refused": refused, "scores": scores}


def _value(scenario, key):
    section, _, name = key.partition(".")
    return getattr(scenario.records[section], name)


def silent(seed):
    """One fleet in six states that hide a number: each number that is told all the same."""
    scenario, logs, heard = logs_of(seed, **{"body.a_max": NEVER})
    generator, _ = truth(seed)
    walk = scenario.sensors.noise * scenario.sensors.damping
    ahead = replace(logs, velocity=logs.command + generator.normal(0.0, 0.05, logs.command.shape))
    period = scenario.sensors.period
    short = synthetic.standing_logs(seed, 2, 10.0, scenario.sensors.numbers, LOGGER, generator)
    slow = logs_of(seed, **{"metrics.period": period})[1]
    one_way = heard[heard["receiver"] < heard["sender"]]
    near = heard[heard["distance"] < NEAR]
    tries = {
        "limit never reached": (("a_max",), body.fit_body(logs, scenario.flight.dt, walk).refused),
        "runs ahead of its commands": (("tau", "a_max", "noise"), body.fit_body(ahead, scenario.flight.dt).refused),
        "10 s of standing": (("noise", "damping", "scale"), sensors.fit_sensors(short, period).refused),
        "packets one way": (("delay",), {"delay": packets.fit_delay(one_way).reason}),
        "all pairs near": (("near", "far", "received_far"),
                           packets.fit_links(near, period, scenario.radio.numbers).refused),
        "logged once a decision": (("period",), {"period": periods.decision_period(slow)[2]}),
    }  # fmt: skip
    told = [f"{state}: {name}" for state, (names, reasons) in tries.items() for name in names if not reasons.get(name)]
    return {"seed": seed, "asked": sum(len(names) for names, _ in tries.values()), "silent": told}


def judged(rows):
    """Whether fleets fly like what was identified; a line for each and each test."""
    held = True
    for test, at in (("Welch", 2), ("pairs", 4)):
        for row in rows:
            name, far = max(((name, found[at]) for name, found in row["scores"].items()), key=lambda each: abs(each[1]))
            least = min(holm_correction([found[at + 1] for found in row["scores"].values()]))
            held &= least > 0.05 and abs(far) < 3.0
            refused = ", ".join(row["refused"])
            print(f"{test}: {row['seed']}: farthest {name} {far:+.1f}; least p {least:.2g}; refused {refused}")
    return held


def main():
    """Each fleet in turn, a line of JSON each; then what they say together."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("folder", type=Path)
    ask.add_argument("--fleets", type=int, default=20)
    ask.add_argument("--first", type=int, default=190_000)
    given = ask.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    found = {}
    for what in (flown, silent):
        file = given.folder / f"{what.__name__}.jsonl"
        rows = found[what] = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
        for seed in range(given.first, given.first + given.fleets):
            if all(row["seed"] != seed for row in rows):
                rows.append(what(seed))
                with file.open("a") as out:
                    out.write(json.dumps(rows[-1]) + "\n")
                print(json.dumps(rows[-1]), flush=True)
    held, told = judged(found[flown]), sum(len(row["silent"]) for row in found[silent])
    asked = sum(row["asked"] for row in found[silent])
    print(f"{'no fleet differs' if held else 'some differ'}; {told} of {asked} hidden numbers told all the same")
    return 0 if held and told == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
