"""Ten flaws planted in a law: does the attack find them, and how much sooner than search at random?

    python tests/nightly/attack.py FOLDER [NUMBER ...] [--random 4000]

Each flaw is one sentence in the rules of Vásárhelyi et al. 2018: a wall rule that is blind in an angle, neighbours that
are ignored when near. Flights that are not disturbed never show it, and disturbances at random, up to the same largest
dose, show it in fewer than one flight of 500. Must hold: the attack finds 10 of 10, each within 5 minutes of two cores,
with at most a twentieth of the flights of a search at random (median). Flights are counted in durations: a branch that
flies half of one counts half. Goes on where it stopped; one JSON file per flaw in FOLDER.
"""

import argparse
import json
import math
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

import airflock
from airflock.certificates.causes import EVENTS, measured_by_contacts
from airflock.certificates.disturbances import MOMENTS, Candidate, disturbance
from airflock.engine import score_flights
from airflock.parts import laws
from airflock.scenarios import scenario_variant

LAW = Path(laws.__path__[0]) / "vasarhelyi_2018" / "law.py"
BASE = {
    "agents": 8, "duration": 120.0, "dt": 0.02, "world.side": 120.0, "sensors.kind": "perfect", "body.noise": 0.02,
    "radio.delay": 0.2, "model.r0_rep": 20.0, "model.p_rep": 0.3, "model.c_frict": 0.3, "start.wall_clearance": 10.0,
}  # fmt: skip
LIMIT = 3.0  # m
FIRST, BARE = 500_000, 200  # seeds of the search at random; undisturbed flights that must not show a flaw
REPULSION = "    away = -p.p_rep * max(p.r0_rep - r, 0.0) / r\n"
ALIGNMENT = "    k = excess(norm(sx, sy, sz), braking_curve(distance - p.r0_shill, p.a_shill, p.p_shill))\n"
DECISION = "    x = p.v_flock * own.hx + sums.x + walls.x\n    y = p.v_flock * own.hy + sums.y + walls.y\n"
HEARD = "    x = p.v_flock * own.hx + heard * sums.x + walls.x\n    y = p.v_flock * own.hy + heard * sums.y + walls.y\n"


class Flaw(NamedTuple):
    """A sentence that replaces one of the law, and the disturbance that may show it."""

    name: str
    old: str
    new: str
    kind: str
    event: str = "pair"


def cone(x: str, y: str, length: str, degrees: float, width: float) -> str:
    """A condition: a vector points within `width` degrees of a direction."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return f"({x}) * {c:.6f} + ({y}) * {s:.6f} > {math.cos(math.radians(width)):.6f} * {length}"


def unless(condition: str) -> str:
    """The repulsion, but for a condition."""
    return f"{REPULSION}    away = 0.0 if {condition} else away\n"


def deaf(condition: str) -> str:
    """The decision, without neighbours where a condition holds."""
    return f"    heard = 0.0 if {condition} else 1.0\n{HEARD}"


def blind(condition: str) -> str:
    """The wall rule, but for a condition."""
    return f"{ALIGNMENT}    k = 0.0 if {condition} else k\n"
FLAWS = ()
