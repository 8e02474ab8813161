"""Are planted causes named, and is nothing named where chance decides? 200 drawn flights of each.

    python tests/nightly/causes.py FOLDER [--flights 200] [--seed 1]

Planted: a small flock whose flights seldom have a collision suffers one drawn thing (a silent, deaf or frozen radio, a
frozen, offset or drifting receiver, a weak motor, a stuck command, late packets), and has a collision in a flight that
has none without it. Flights whose own ensembles show less than 0.2 of difference are drawn anew. Must hold: it is named
first, or in a set that is named first, in at least 9 of 10.

By chance: a close flock with noise, in which three faults are planted that change next to nothing (an offset of a
centimetre, a drift of a millimetre per second, a motor that lacks a thousandth), and whose collisions are explained by
these alone. Must hold: one of them is named in at most 1 of 20. Goes on where it stopped; a line of JSON per flight.
"""

import argparse
import json
import random
import sys
from pathlib import Path
from typing import Any

import airflock

BASE = {
    "agents": 6, "duration": 90.0, "world.side": 70.0, "sensors.kind": "perfect", "body.noise": 0.05,
    "radio.delay": 0.2,
}  # fmt: skip
CLOSE = {"agents": 10, "duration": 90.0, "world.side": 80.0, "body.noise": 0.3, "radio.delay": 1.2}
KINDS = (
    "radio_silent", "radio_deaf", "radio_frozen", "gnss_frozen", "gnss_offset", "gnss_drift", "motor", "stuck", "delay",
)  # fmt: skip
FUTURES, SEEDS, DIFFERENCE = 100, 200, 0.2
PRESET = "vasarhelyi_2018/4ms"


def planted(rng: random.Random) -> tuple[str, dict[str, Any], str]:
    """Return a kind, the keys that plant it, and the name of the cause."""
    kind = rng.choice(KINDS)
    if kind == "delay":
        return kind, {"radio.delay": rng.uniform(1.5, 3.5)}, "radio.delay"
    entry: dict[str, Any] = {"kind": kind, "agents": [rng.randrange(6)], "at": round(rng.uniform(5.0, 40.0), 1)}
    if kind == "gnss_offset":
        entry["east"] = rng.choice([-1, 1]) * round(rng.uniform(6.0, 14.0), 1)
    if kind == "gnss_drift":
        entry["east"] = rng.choice([-1, 1]) * round(rng.uniform(0.2, 0.8), 2)
    if kind == "motor":
        entry["share"] = round(rng.uniform(0.1, 0.4), 2)
    return kind, {"faults": [entry]}, "faults[0]"


def explain_planted(number: int, seed: int, without: list[bool]) -> dict[str, Any] | None:
    """Draw one planted flight and explain it; None where the rule draws anew."""
    rng = random.Random(f"{seed} planted {number}")
    kind, keys, name = planted(rng)
    flight = rng.randrange(SEEDS)
    scenario = airflock.load(PRESET, BASE | keys)
    if without[flight] or not airflock.score(scenario, seeds=[flight])["n_coll"].iloc[0] > 0:
        return None
    found = airflock.why(scenario, flight, futures=FUTURES)
    bare = {row.lead: row.share for row in found.rows if row.without == "nothing"}
    if max((bare[row.lead] - row.share for row in found.rows if row.without == name), default=0.0) < DIFFERENCE:
        return None
    names = [row.without for row in found.causes]
    return {"kind": kind, "flight": flight, "first": bool(names) and name in names[0].split(" + "), "text": found.text}


def explain_chance(number: int, seed: int) -> dict[str, Any] | None:
    """Draw one flight with faults that change next to nothing and explain it by them; None without a collision."""
    rng = random.Random(f"{seed} chance {number}")
    tiny = {"gnss_offset": {"east": 0.01}, "gnss_drift": {"east": 0.001}, "motor": {"share": 0.999}}
    faults = [{"kind": kind, "agents": [rng.randrange(10)], "at": 1.0, **how} for kind, how in tiny.items()]
    scenario, flight = airflock.load(PRESET, CLOSE | {"faults": faults}), rng.randrange(1 << 20)
    if not airflock.score(scenario, seeds=[flight])["n_coll"].iloc[0] > 0:
        return None
    try:
        found = airflock.why(scenario, flight, futures=FUTURES, interventions=[f"faults[{k}]" for k in range(3)])
    except airflock.AirflockError:  # at the start
        return None
    return {"flight": flight, "named": [row.without for row in found.causes], "text": found.text}


def main() -> int:
    """Draw until there are enough flights of each kind; the status is 1 where too few or too many are named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--flights", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    bare = airflock.score(airflock.load(PRESET, BASE), seeds=range(SEEDS))["n_coll"]
    without = [events > 0 for events in bare]
    counts = {}
    for part, explain in (
        ("planted", lambda k: explain_planted(k, options.seed, without)),
        ("chance", lambda k: explain_chance(k, options.seed)),
    ):
        file = options.folder / f"{part}.jsonl"
        rows = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
        number = rows[-1]["number"] + 1 if rows else 0
        while len(rows) < options.flights:
            if (row := explain(number)) is not None:
                rows.append({"number": number, **row})
                with file.open("a") as lines:
                    lines.write(json.dumps(rows[-1]) + "\n")
            number += 1
        counts[part] = sum(row["first"] if part == "planted" else bool(row["named"]) for row in rows), len(rows), number
    (first, n, drawn), (named, m, tried) = counts["planted"], counts["chance"]
    print(f"planted: first in {first} of {n} ({drawn} drawn); by chance: named in {named} of {m} ({tried} drawn)")
    return int(first < 0.9 * n or named > 0.05 * m)


if __name__ == "__main__":
    sys.exit(main())
