"""Kidger, An Investigation into Drone Swarms & Swarm Intelligence: shown there by videos, here by numbers.

Parts: readings (what the thesis leaves open about separation), conduct (collisions in four scenes, erratic and slow
flights), alone (one rule by itself, stragglers), schemes (five ways to recombine, in a city and a forest), corners
(thin walls), tuning (every radius and scale), presets (final, natural and poor), shepherd (the negative goal), cost
(time per boid and frame), learnt (its first wish: parameters learnt from its measures), display (its second).
"""

from airflock_papers.kidger import (
    alone,
    conduct,
    corners,
    cost,
    display,
    learnt,
    presets,
    readings,
    schemes,
    shepherd,
    tuning,
)
from airflock_papers.paper import Paper, by_modules

MODULES = {
    "readings": readings,
    "conduct": conduct,
    "alone": alone,
    "schemes": schemes,
    "corners": corners,
    "tuning": tuning,
    "presets": presets,
    "shepherd": shepherd,
    "cost": cost,
    "learnt": learnt,
    "display": display,
}
PAPER = Paper(
    "Kidger, An Investigation into Drone Swarms & Swarm Intelligence", __name__, tuple(MODULES), by_modules(MODULES)
)
