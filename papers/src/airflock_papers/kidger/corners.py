"""Thin walls and corners in a plane: boids that fly straight at them from everywhere (the thesis's bug 2)."""

import math

import pandas as pd

from airflock.scenarios import Scenario, load
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights

APPROACHES = 10_000  # boids over all flights, each with a random place and heading
BOIDS = 100
CASES = {
    "swept": ("swept", 60.0, "walls and corners, swept spheres"),
    "fast": ("swept", 1000.0, "walls and corners, swept spheres, 1000 m/s"),
    "thin": ("thin", 60.0, "walls and corners, the thesis's thin rays"),
}
LONE = {f"model.s_{name}": 0.0 for name in ("sep", "cohes", "align", "goal")}  # nothing but obstacles and straight on


def place(cast: str, speed: float, duration: float = 10.0) -> Scenario:
    """Walls of 1 cm, crosses of two of them and sharp corners on a field of 200 m."""
    walls = []
    for number in range(24):
        angle, x, y = number * 0.8, 160.0 * ((number * 0.618) % 1.0) - 80.0, 150.0 * (number / 23.0) - 75.0
        walls += [bar(x, y, angle), *([bar(x, y, angle + 1.1)] if number % 3 == 0 else [])]
        if number % 4 == 1:
            walls.append([[x + 12.0, y], [x + 22.0, y + 1.0], [x + 12.0, y + 2.0]])
    field = {"world.arena": "square", "world.side": 220.0, "world.obstacles": walls, "scene.kind": "none"}
    begin = {"agents": BOIDS, "start.side": 200.0, "start.separation": 0.0, "start.speed": min(speed, 200.0)}
    keys = {"duration": duration, "model.cast": cast, "model.speed": speed, "goals.kind": "none"}
    return load("kidger/final_2d", {**LONE, **field, **begin, **keys})


def bar(x: float, y: float, angle: float, half: float = 9.0, thick: float = 0.005) -> list[list[float]]:
    """Corners of a wall 2 half long (m) and 2 thick wide (m)."""
    c, s = math.cos(angle), math.sin(angle)
    ends = ((half, thick), (-half, thick), (-half, -thick), (half, -thick))
    return [[x + c * a - s * b, y + s * a + c * b] for a, b in ends]


def fly(flights: Flights) -> pd.DataFrame:
    """Fly them with swept spheres and with thin rays, at 1 m and at 16.7 m a frame; a ray reaches 20 m."""
    count = 5 if flights.quick else APPROACHES // BOIDS
    scenarios = {name: place(cast, speed) for name, (cast, speed, _) in CASES.items()}
    return flights.score("Thin walls and corners", scenarios, count)


def measured(table: pd.DataFrame) -> list[Measured]:
    """Contacts of a sphere of 0.5 m with anything, per flight."""
    found = []
    for name, (_, _, words) in CASES.items():
        rows = table.loc[name]
        total, events = float(rows["n_env_coll"].sum()), float(rows["n_avoid"].sum() * BOIDS)
        note = f"{total:.0f} contacts of {BOIDS * len(rows)} boids in {events:.0f} avoidances"
        found.append(Measured(f"corners.{name}", "n_env_coll", words, statistics.mean(rows["n_env_coll"]), note))
    return found
