"""Small fleets of imitated ArduPilots with what real ones and their wires do: each drone flies, or reports why not.

python tests/autopilot_faults.py FOLDER [FLIGHTS]

Three to five drones start by orders, flock and return. Their autopilots' clocks are off by up to 2 s and drift by up to
100 ppm, the first requests of their nodes are lost, and at random moments some reboot, or another ground station sets
their streams to 4 Hz. A row of FOLDER/flights.csv for each flight; flights that stand there are not flown again. Status
0 if all hold, 1 if not, 3 if the time (AIRFLOCK_LIMIT, s) is over: call it again to go on.
"""

import csv
import math
import os
import re
import sys
import time
from pathlib import Path
from random import Random

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from airflock.drones.mavlink.orders import OrderKind  # noqa: E402
from airflock.fleets.drone_faults import InjectedFault  # noqa: E402
from fleets import fleet, scenario  # noqa: E402

SEED, FLIGHTS = "autopilots as they are", 100
STARTS, RETURN, END = (15.0, 30.0, 60.0), 110.0, 240.0  # s; orders, and when everybody must stand
REPORT_TIME = 7.0  # s from a fault to the line that names it
GROUND, TOUCH, NEAR, FEW = 0.5, 1.0, 3.0, 3  # m, m, m, flights
FIELDS = ("flight", "drones", "least_m", "at_s", "one", "other", "flew", "refused", "fell", "faults", "errors")
# What a drone may report without a fault of its own. A peer that is not heard must have a fault.
FREE = (
    "ordered to", "is not heard", "too few neighbours", "lost neighbour", "a neighbour is near", "BATT_",
    "nobody has been heard", "nothing is missing", "something is missing", "start is due", "armed in our mode",
    "on the own layer", "gathered", "all is well again", "above home", "landed", "turn came", "clock is",
)  # fmt: skip
OF_STREAMS = (
    "Hz, 10 needed",
    "streams of the autopilot",
    "a reason to hold",
    "stands on the ground",
    "never left",
    "is armed already",
)
CAUSES = {
    "streams": OF_STREAMS,
    "reboot": (
        *OF_STREAMS, "rebooted", "no own position", "no valid position", "is disarmed", "disarmed on the ground",
        "before its mission", "has not reported", "navigation:", "battery: unknown", "does not report",
        "PreArm: Fence", "own checks before arming", "sent none", "not armed in time", "autopilot refuses",
    ),
}  # fmt: skip
BOOT_TIME = 6.0  # s in which a node learns what its autopilot is and says, its requests lost at first


def drawn(number):
    """Faults of one flight, and its number of drones."""
    rng, faults = Random(f"{SEED}, flight {number}"), []
    members = range(1, rng.randint(3, 5) + 1)
    for who in members:
        faults += [
            InjectedFault("autopilot_clock", (who,), amount=rng.uniform(-2.0, 2.0)),
            InjectedFault("clock_drift", (who,), amount=rng.uniform(-100.0, 100.0)),
            InjectedFault("uplink", (who,), 0.0, rng.uniform(0.1, 3.0)),
        ]
        for kind, amount in (("reboot", 0.0), ("streams", 4.0)):
            if rng.random() < 0.25:
                faults.append(InjectedFault(kind, (who,), rng.uniform(0.0, RETURN), amount=amount))
    return len(members), tuple(faults)


def flown(number):
    """One flight from the ground to the ground, all as drawn."""
    agents, faults = drawn(number)
    found = scenario(agents, END, True, **{"radio.delay": 0.2})
    made = fleet(found, number, faults=faults, autopilot="ardupilot", safety={"tick": 0.05, "status_period": 0.1})
    for v in made.vehicles:
        v.booted_at = -60.0
    for at in STARTS:
        made.advance(at - made.now)
        made.order(OrderKind.START, at=made.now)
    made.advance(RETURN - made.now)
    made.order(OrderKind.RETURN)
    while made.now < END and any(v.armed for v in made.vehicles):
        made.advance(2.0)
    return made


def errors(made):
    """What is wrong with a flight, one line each: a drone that does not fly and says no reason, or a false one."""
    wrong, reboots = [], {f.who[0]: f.begin for f in made.faults if f.kind == "reboot"}
    for who, vehicle in zip(made.card.members, made.vehicles, strict=True):
        lines = [(at, note) for at, one, note in made.log if one == who]
        own = {f.kind: f for f in made.faults if f.affects(who)}
        reboot, station = (own[kind].begin if kind in own else math.inf for kind in ("reboot", "streams"))
        if vehicle.armed:
            wrong.append(f"drone {who} is armed at the end")
        for at, note in lines:
            begun = [text for kind, texts in CAUSES.items() if kind in own and own[kind].begin <= at for text in texts]
            peer = re.search(r"drone (\d+) is not heard", note)
            is_false = peer is not None and at < reboots.get(int(peer[1]), math.inf)
            # One that rebooted in the air may have come down beside a drone that still stands.
            fallen = re.search(r"drone (\d+) stands", note)
            is_true = fallen is not None and at >= reboots.get(int(fallen[1]), math.inf)
            if at > BOOT_TIME and not is_true and (is_false or not any(text in note for text in (*FREE, *begun))):
                wrong.append(f"drone {who} at {at:.1f} s without a cause: {note}")
        # A message waits for a tick: of offsets next to the limit either side is right.
        off = abs(own["autopilot_clock"].amount) > made.card.safety.clock_error + made.card.safety.tick
        ended = min((at for at, note in lines if "→ DONE" in note or "→ MANUAL" in note), default=math.inf)
        # A node that has heard no stream yet misses none.
        rebooted = reboot if reboot > own["uplink"].end + 3.0 else math.inf
        # Shortly after a reboot there is no position whose rate could be seen; the station asks once more.
        seen = station < ended - REPORT_TIME and not -REPORT_TIME < station - reboot < 45.0
        expected = [
            ("its autopilot's clock", "clock", 0.0 if off else math.inf, 30.0),
            ("the reboot", r"rebooted|is disarmed", rebooted, REPORT_TIME),
            ("4 Hz", r"at [34]\.\d Hz", station if seen else math.inf, REPORT_TIME),
        ]
        for name, text, begin, within in expected:
            times = [at for at, note in lines if at >= begin and re.search(text, note)]
            if begin < math.inf and not (times and times[0] <= begin + within):
                wrong.append(f"drone {who} does not report {name} of {begin:.1f} s within {within:g} s")
        flew = any("→ GATHER" in note for _, note in lines)  # it waits there for the others
        if not flew and not any(at > BOOT_TIME and re.search(r"missing|→ HOLD|→ MANUAL", note) for at, note in lines):
            wrong.append(f"drone {who} does not fly, and does not say why")
    return wrong


def result(number):
    """The row of one flight."""
    made = flown(number)
    rows = made.array()[:, :, :3]
    gaps = np.linalg.norm(rows[:, :, None] - rows[:, None], axis=-1)
    down = rows[:, :, 2] < GROUND
    gaps[down[:, :, None] | down[:, None, :] | np.eye(rows.shape[1], dtype=bool)] = math.inf
    at, one, other = np.unravel_index(gaps.argmin(), gaps.shape)
    notes = {who: [note for _, one, note in made.log if one == who] for who in made.card.members}
    flew = [who for who, lines in notes.items() if any("→ GATHER" in note for note in lines)]
    up = [who for who, lines in notes.items() if any("→ TAKEOFF" in note for note in lines)]
    fell = [f.who[0] for f in made.faults if f.kind == "reboot" and f.who[0] in up and fell_at(notes[f.who[0]])]
    faults = " ".join(f"{f.kind}:{f.who[0]}@{f.begin:.0f}" for f in made.faults if f.kind in ("reboot", "streams"))
    refused = [who for who in made.card.members if who not in up]
    counts = (len(flew), len(refused), len(fell))
    place = (round(float(gaps.min()), 2), round(float(at) * made.card.period, 1), int(one) + 1, int(other) + 1)
    values = (number, len(made.card.members), *place, *counts, faults, "; ".join(errors(made)))
    return dict(zip(FIELDS, values, strict=True))


def fell_at(lines):
    """Whether a drone lost its motors in the air."""
    return any("MANUAL" in note and "disarmed" in note for note in lines)


def main():
    folder, count = Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else FLIGHTS
    folder.mkdir(parents=True, exist_ok=True)
    kept = folder / "flights.csv"
    rows = list(csv.DictReader(kept.open())) if kept.exists() else []
    until = time.monotonic() + float(os.environ.get("AIRFLOCK_LIMIT", "inf")) - 30.0
    with kept.open("a", newline="") as out:
        writer = csv.DictWriter(out, FIELDS)
        if not rows:
            writer.writeheader()
        while len(rows) < count and time.monotonic() < until:
            rows.append(result(len(rows)))
            writer.writerow(rows[-1])
            out.flush()
    near = [row for row in rows if float(row["least_m"]) < NEAR]
    touch = [row for row in rows if float(row["least_m"]) < TOUCH]
    wrong = [row for row in rows if row["errors"]]
    for row in dict.fromkeys(map(str, (*near, *wrong))):
        sys.stdout.write(f"{row}\n")
    if len(rows) < count:
        sys.stdout.write(f"{count - len(rows)} flights still to fly\n")
        return 3
    sums = {name: sum(int(row[name]) for row in rows) for name in ("drones", "flew", "refused", "fell")}
    words = ", ".join(f"{n} {name}" for name, n in sums.items())
    sys.stdout.write(
        f"{count} flights: {words}; {len(near)} below {NEAR:g} m, {len(touch)} below {TOUCH:g} m, {len(wrong)} wrong\n"
    )
    return int(bool(touch or wrong) or len(near) > FEW)


if __name__ == "__main__":
    sys.exit(main())
