"""Sections of a scenario file and the record of parameters behind each."""

from dataclasses import dataclass

from airflock.aero import descent, wing
from airflock.body import motion, radio, sensors, wind
from airflock.core.parameters import Parameters as Record
from airflock.core.parameters import choice, quantity
from airflock.metrics import parameters as metrics
from airflock.world import arena, goals, scenery, start


@dataclass(frozen=True, kw_only=True)
class Flight(Record):
    """Keys at the top of a scenario file."""

    agents: float = quantity(100.0, "1", low=1, high=1e7, source="Results", meaning="number of agents, a whole number")
    duration: float = quantity(600.0, "s", low=0.0, high=1e6, source="Results", meaning="time flown")
    update: str = choice(
        "synchronous",
        ("synchronous", "sequential"),
        source="authors' program of Zapotecatl et al. 2016 (sequential)",
        meaning="all agents decide and then all move; or one after another, each seeing those before it moved",
    )
    dt: float = quantity(
        0.01, "s", low=1e-6, high=10.0, source="authors' program of Vásárhelyi et al. 2018", meaning="motion step"
    )


# body is read by its kind (`airflock.body.registry`); the record here is the one of velocity commands
SECTIONS: dict[str, type[Record]] = {
    "body": motion.Parameters,
    "sensors": sensors.Parameters,
    "radio": radio.Parameters,
    "wind": wind.Parameters,
    "world": arena.Parameters,
    "scene": scenery.Parameters,
    "goals": goals.Parameters,
    "start": start.Parameters,
    "wing": wing.Parameters,
    "aero": descent.Parameters,
    "metrics": metrics.Parameters,
}
