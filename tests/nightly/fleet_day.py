"""A day of fleets of ten with faults of every kind at random: how often drones collide, and what led to each collision.

    python tests/nightly/fleet_day.py FOLDER [HOURS]

240 flights of six minutes. Each kind of fault befalls every second flight: whom, when, for how long and how much is
drawn from its number. One line of FOLDER/flights.csv for each flight, and of FOLDER/collisions.csv for each
pair that came within 1 m in the air; flights that stand there are not flown again. Ends with status 0 if all hours are
flown, at least 100 faults of each kind fell, and no collision is of the class "other"; 1 if not; 3 if its time
(AIRFLOCK_LIMIT, s) is over: call it again to go on.

Classes, the first that holds within the 20 s before: a motor was off; the navigation of one was frozen; one had not
heard the other for longer than it counts as heard, or stood when they met because it had lost anybody (blind); one was
within 5 m of a wall (crowding); one was not flocking, but returned, landed, held or was in a pilot's hand (logic);
somebody with the key lied about one (impostor).
"""

import csv
import gc
import os
import sys
import time
from collections import Counter
from pathlib import Path
from random import Random

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from airflock.fleets import compare  # noqa: E402
from airflock.fleets.drone_faults import INJECTED_KINDS, InjectedFault  # noqa: E402
from fleets import scenario  # noqa: E402

HOURS, SECONDS, AGENTS, SIDE = 24.0, 360.0, 10, 120.0
APART, GROUND, WALL, BEFORE, LEAST = 1.0, 0.5, 5.0, 20.0, 100  # m, m, m, s, faults
SPARE = 120.0  # s before the limit at which no further flight is begun
# Those of an autopilot behind its wire have a part of their own: flights from the ground.
KINDS = tuple(INJECTED_KINDS)[: list(INJECTED_KINDS).index("reboot")]
LASTING = ("node", "motor", "battery", "pilot")  # what never ends
FEW = (*LASTING, "gnss", "clock", "rogue", "impostor")  # what befalls one drone
AMOUNTS = {
    "loss": (0.2, 0.9), "jitter": (0.1, 2.0), "duplicate": (0.2, 1.0), "corrupt": (0.05, 0.5), "battery": (5.0, 24.0),
    "clock": (-0.5, 0.5), "rogue": (-60.0, 60.0), "impostor": (-60.0, 60.0),
}  # fmt: skip
FLIGHTS = ("flight", "hours", "faults", "digest")
COLLISIONS = ("flight", "at_s", "one", "other", "distance_m", "class", "phases", "faults")
CLASSES = ("motor", "gnss", "blind", "crowding", "logic", "impostor", "other")


def drawn(number):
    """Faults of one flight."""
    rng, found = Random(f"a day of faults, flight {number}"), []
    for place, kind in enumerate(KINDS):
        if (number + place) % 2:
            continue
        count = 1 if kind in FEW else rng.randint(1, AGENTS)
        who = () if count == AGENTS else tuple(sorted(rng.sample(range(1, AGENTS + 1), count)))
        begin = 0.0 if kind == "clock" else rng.uniform(20.0, SECONDS - 60.0)
        end = 1e9 if kind in (*LASTING, "clock") else begin + rng.uniform(5.0, 60.0)
        found.append(InjectedFault(kind, who, begin, end, rng.uniform(*AMOUNTS.get(kind, (0.0, 0.0)))))
    return tuple(found)


def flown(number):
    """One flight: its row, and a row for each collision."""
    found, faults = (
        compare.with_metric_period(scenario(AGENTS, SECONDS, noisy=True, **{"world.side": SIDE}), 0.2),
        drawn(number),
    )
    card = compare.software_card(found, stop_for_lost=True)
    fleet = compare.fly_in_lockstep(found, card, number, faults=faults)
    kinds = " ".join(fault.kind for fault in faults)
    row = dict(zip(FLIGHTS, (number, SECONDS / 3600.0, kinds, fleet.digest()[:16]), strict=True))
    return row, [dict(zip(COLLISIONS, (number, *values), strict=True)) for values in collisions(fleet, faults)]


def nearest(rows):
    """(time, agent, agent): least distance (m) between one frame and the next, on straight lines; inf on the ground."""
    at = rows[:, :, :3]
    gap = at[:, :, None] - at[:, None]
    before, step = gap[:-1], gap[1:] - gap[:-1]
    along = np.clip(-(before * step).sum(-1) / np.maximum((step * step).sum(-1), 1e-12), 0.0, 1.0)
    least = np.linalg.norm(before + along[..., None] * step, axis=-1)
    down = at[:-1, :, 2] < GROUND
    least[down[:, :, None] | down[:, None, :] | np.eye(at.shape[1], dtype=bool)] = np.inf
    return least


def collisions(fleet, faults):
    """When (s), who (members), how near (m), of which class, in which phases, with which faults of the two."""
    rows, ages, period = fleet.array(), fleet.packet_ages(), fleet.card.period
    least, members = nearest(rows), fleet.card.members
    for a in range(AGENTS):
        for b in range(a):
            hits = np.flatnonzero(least[:, a, b] < APART)
            for k in [hit for i, hit in enumerate(hits) if i == 0 or hit - hits[i - 1] > BEFORE / period]:
                now = float(k * period)
                phases = [phase_at(fleet, members[x], now) for x in (a, b)]
                mine = [f for f in faults if f.begin <= now and now - BEFORE < f.end and touches(f, (a + 1, b + 1))]
                kind = classed(mine, ages, k, a, b, rows, phases, fleet, period)
                yield (
                    round(now, 1), members[b], members[a], round(float(least[k, a, b]), 2), kind, " ".join(phases),
                    " ".join(sorted({f.kind for f in mine})),
                )  # fmt: skip


def touches(fault, pair):
    """Whether a fault is of one of two drones."""
    return not fault.who or bool(set(pair) & set(fault.who))


def classed(mine, ages, k, a, b, rows, phases, fleet, period):
    """Class of one collision of agents a and b at frame k."""
    kinds, first = {f.kind for f in mine}, max(0, k - round(BEFORE / period))
    heard = np.maximum(ages[first : k + 1, a, b], ages[first : k + 1, b, a])
    lost = not (np.nan_to_num(heard, nan=np.inf) <= fleet.card.silence.patience + period).all()
    walls = SIDE / 2 - np.abs(rows[max(0, k - round(2.0 / period)) : k + 1, [a, b], :2]).max()
    for name, holds in (
        ("motor", "motor" in kinds), ("gnss", "gnss" in kinds),
        ("blind", lost or fleet.standing[k][a] or fleet.standing[k][b]),
        ("crowding", walls < WALL), ("logic", any(phase != "FLOCK" for phase in phases)),
        ("impostor", "impostor" in kinds),
    ):  # fmt: skip
        if holds:
            return name
    return "other"


def phase_at(fleet, member, now):
    """Phase of a drone at a time (s), from its notes."""
    changes = [note for t, who, note in fleet.log if who == member and t <= now and " → " in note]
    return changes[-1].split(" → ")[1].split(":")[0] if changes else "FLOCK"


def table(flights, hits):
    """Lines that tell the whole."""
    hours = sum(float(row["hours"]) for row in flights)
    kinds, classes = Counter(" ".join(row["faults"] for row in flights).split()), Counter(row["class"] for row in hits)
    yield f"{hours:.1f} hours of {AGENTS} drones: {len(hits)} collisions, {len(hits) / hours:.2f} in an hour of flight"
    yield "faults: " + ", ".join(f"{kind} {kinds[kind]}" for kind in KINDS)
    yield "collisions: " + ", ".join(f"{name} {classes[name]}" for name in CLASSES)


def read(path):
    """Rows of a table that may not stand there yet."""
    return list(csv.DictReader(path.open())) if path.exists() else []


def append(path, fields, rows):
    """Add rows to a table, with its first line if it is new."""
    new = not path.exists()
    with path.open("a", newline="") as out:
        writer = csv.DictWriter(out, fields)
        if new:
            writer.writeheader()
        writer.writerows(rows)


def main():
    folder, hours = Path(sys.argv[1]), float(sys.argv[2]) if len(sys.argv) > 2 else HOURS
    folder.mkdir(parents=True, exist_ok=True)
    gc.freeze()  # what is imported stays; to look through it takes a twentieth of the time
    kept, struck = folder / "flights.csv", folder / "collisions.csv"
    done, count = {int(row["flight"]) for row in read(kept)}, round(hours * 3600.0 / SECONDS)
    hits = [row for row in read(struck) if int(row["flight"]) in done]  # those of a flight that was cut off are gone
    if struck.exists():
        struck.unlink()
    append(struck, COLLISIONS, hits)
    until = time.monotonic() + float(os.environ.get("AIRFLOCK_LIMIT", "inf")) - SPARE
    waiting = [number for number in range(count) if number not in done]
    while waiting and time.monotonic() < until:
        row, found = flown(waiting.pop(0))
        append(struck, COLLISIONS, found)
        append(kept, FLIGHTS, [row])
        print(f"flight {row['flight']}: {', '.join(hit['class'] for hit in found) or 'no collision'}", flush=True)
    flights, hits = read(kept), read(struck)
    lines = list(table(flights, hits))
    (folder / "table.txt").write_text("\n".join(lines) + "\n")
    if waiting:
        print(*lines, f"{len(waiting)} flights still to fly", sep="\n")
        return 3
    print(*lines[::-1], sep="\n")
    few = [k for k in KINDS if sum(k in row["faults"].split() for row in flights) < LEAST]
    return 1 if any(row["class"] == "other" for row in hits) or few else 0


if __name__ == "__main__":
    sys.exit(main())
