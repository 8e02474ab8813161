"""What `airflock tune` promised, on flights that it never saw: speed, contacts, distances.

airflock tune benchmarks/l_field.toml --budget 20min --out FOLDER
python benchmarks/tuned.py FOLDER

Flies FOLDER/tuned.toml a thousand times and prints, beside what the certificate says: phi_vel (m/s) of the flock,
flights in which an agent was outside the fence or inside a solid, and flights in which two came nearer than the radius
of collision. Seeds begin at 7,000,000, where no search and no certificate has any.
"""

import argparse
import tomllib
from pathlib import Path

import numpy as np

from airflock.engine import score_flights
from airflock.scenarios.files import load

FIRST, FLIGHTS = 7_000_000, 1000


def main():
    """Fly, and print one table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--flights", type=int, default=FLIGHTS)
    asked = parser.parse_args()
    scenario = load(asked.folder / "tuned.toml")
    certificate = tomllib.loads((asked.folder / "certificate.toml").read_text())
    rows = score_flights([scenario] * asked.flights, range(FIRST, FIRST + asked.flights))
    speed, room, nearest = (np.array([row[key] for row in rows]) for key in ("phi_vel", "clearance", "r_min"))
    near = scenario.metrics.r_coll
    print("| what | in fresh flights |\n|---|---|")
    print(f"| phi_vel, mean and worst | {speed.mean():.2f} and {speed.min():.2f} m/s |")
    print(f"| flights with a contact | {int((room < 0.0).sum())} of {asked.flights:,} |")
    print(f"| flights nearer than {near:g} m | {int((nearest < near).sum())} of {asked.flights:,} |")
    print(f"| smallest distance of all | {nearest.min():.2f} m |")
    print("\nIts certificate:", *certificate["statements"], sep="\n- ")


if __name__ == "__main__":
    main()
