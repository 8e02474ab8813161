"""Files that the commands of snapshots read: a scenario, tracks of animals, logs of drones and packets they heard."""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd

from autopilots import write_ulog
from haswell import airflock

MINE = """extends = "vasarhelyi_2018/real_6ms"
agents = 5
duration = "5 s"
"""
LAW = '''"""A law that pulls each agent along its heading."""

from dataclasses import dataclass
from typing import NamedTuple

import airflock

COMMAND = "velocity"


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """One number."""

    pull: float = airflock.quantity(1.0, "m/s", low=0.0, high=9.0, meaning="how fast it flies")


class Sums(NamedTuple):
    """Sums over neighbours."""

    x: float
    y: float


def neighbour(dx, dy):
    """Return what one neighbour adds."""
    return Sums(0.1 * dx, 0.1 * dy)


def decide(own, sums, p):
    """Return the velocity command, m/s."""
    return p.pull * own.hx + sums.x, p.pull * own.hy + sums.y, 0.0
'''
STANDING, FLYING, STEP = 120.0, 120.0, 0.2  # s


def circles(count):
    """Return tracks of some animals on circles about one middle: t, id, x, y in mm."""
    times = 0.1 * np.arange(300)
    parts = []
    for i in range(count):
        angle, radius = 0.5 * times + i, 100.0 + 20.0 * i
        parts.append(pd.DataFrame({"t": times, "id": i, "x": radius * np.cos(angle), "y": radius * np.sin(angle)}))
    return pd.concat(parts).sort_values(["t", "id"], ignore_index=True)


def flight(generator):
    """Return times (s), positions (m), velocities and commands (m/s), east and north, of a drone with a lag of 0.8 s.

    It stands for two minutes; then it follows commands that change every four seconds.
    """
    times = np.arange(0.0, STANDING + FLYING, STEP)
    wishes = generator.normal(0.0, 3.0, (len(times), 2))
    place, speed, error, rows = generator.uniform(0.0, 60.0, 2), np.zeros(2), np.zeros(2), []
    for i, now in enumerate(times):
        wish = wishes[i // 20] if now >= STANDING else np.zeros(2)
        error = 0.98 * error + generator.normal(0.0, 0.05, 2)
        rows.append((*(place + error), *(speed + generator.normal(0.0, 0.05, 2)), *wish))
        speed = speed + (wish - speed) * STEP / 0.8
        place = place + speed * STEP
    return times, *np.split(np.array(rows), 3, axis=1)


def packets(generator, flights):
    """Return what each drone heard of the others, with a delay of 0.4 s: at most half of what is sent from afar."""
    rows = []
    for i, (times, here, *_) in enumerate(flights):
        for j, (_, there, *_) in enumerate(flights):
            if i != j:
                distance = np.hypot(*(here - there).T)
                got = generator.random(len(times)) >= np.minimum(0.5, (distance / 120.0) ** 2)
                late = generator.normal(0.4, 0.01, len(times))
                rows.append(pd.DataFrame({"receiver": i, "sender": j, "t": times + late, "stamp": times,
                                          "distance": distance, "got": got.astype(int)}))  # fmt: skip
    return pd.concat(rows, ignore_index=True)


def write_files(folder: Path):
    """Write all files into a folder; the command itself makes the recordings among them."""
    generator = np.random.default_rng(44)
    (folder / "mine.toml").write_text(MINE, encoding="utf-8")
    (folder / "mine.py").write_text(LAW, encoding="utf-8")
    circles(6).to_csv(folder / "fish.csv", index=False)
    (folder / "logs").mkdir()
    flights = [flight(generator) for _ in range(3)]
    for i, (times, place, speed, wish) in enumerate(flights):
        table = pd.DataFrame({"time_us": 1e6 * times, "pos_e": place[:, 0], "pos_n": place[:, 1]})
        table.to_csv(folder / f"drone{i}.csv", index=False)
        table = table.assign(time_us=times).set_axis(["TIME", "EAST", "NORTH"], axis=1)
        table.to_csv(folder / "logs" / f"{i}.csv", index=False)
        down = [
            np.column_stack([v[:, 1], v[:, 0], np.full(len(v), z)])
            for v, z in zip((place, speed, wish), (-20, 0, 0), strict=True)
        ]
        for path in (folder / f"log_{i}.ulg", folder / "logs" / f"{i}.ulg"):
            write_ulog(path, 12.0 + times, *down, utc=1.7e9)
    packets(generator, flights).to_csv(folder / "heard.csv", index=False)
    airflock(folder, "import", "fish.csv", "--unit", "mm", "--save", "fish.nc")
    for name in ("trial1", "trial2", "trial3", "drones"):
        shutil.copyfile(folder / "fish.nc", folder / f"{name}.nc")
    airflock(folder, "run", "vasarhelyi_2018/real_6ms", "--agents", "4", "--duration", "5", "--save", "flight.nc")
