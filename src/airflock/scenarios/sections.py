"""The sections of a scenario in one list.

The tables of a scenario file, the fields of a `Scenario`, the keys of a search space, the records
that rules receive and the columns of the row that a driver reads are all made from `ORDER`, each by
name.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

from airflock.core import Parameters as Record, choice, quantity, silence
from airflock.parts import steering
from airflock.parts.aero import descent, wing
from airflock.parts.bodies import dryden, motion, wind
from airflock.parts.metrics import parameters as metrics
from airflock.parts.radios import links
from airflock.parts.sensors import langevin
from airflock.parts.topologies import parameters as topology
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
        meaning="all agents decide, then all move; or one after another, each seeing how those before it moved",
    )
    dt: float = quantity(
        0.01, "s", low=1e-6, high=10.0, source="authors' program of Vásárhelyi et al. 2018", meaning="motion step"
    )


class Geometry(NamedTuple):
    """The numbers that drivers read of world, start and goals, derived at set-up, m and m/s.

    half_*   : half sizes of the arena; extent_*: of the box about the origin from which starts are
               drawn
    speed    : at the start; clearance: from the shapes of the scene; wall_clearance: from those,
               walls and obstacles
    goal_*   : radius in which a goal counts as reached, speed, spread, distance of a shepherd
    spacing_*, jitter : of a start formation
    """

    half_x: float
    half_y: float
    half_z: float
    extent_x: float
    extent_y: float
    extent_z: float
    separation: float
    speed: float
    clearance: float
    wall_clearance: float
    goal_radius: float
    goal_speed: float
    goal_spread: float
    goal_behind: float
    spacing_x: float
    spacing_y: float
    spacing_z: float
    jitter: float


class StepTimes(NamedTuple):
    """The times that drivers read: motion step and time between two decisions, s."""

    dt: float
    period: float


class Section(NamedTuple):
    """One section of a scenario.

    key     : its table in a scenario file; empty for the keys at the top
    record  : its parameters; None where the model brings them. Body, sensor, radio and metric set
              may bring others
    letter  : name of its numbers in rules and drivers; empty where no driver reads any
    driver_record : record that drivers read instead of the section's own
    """

    key: str
    record: type[Record] | None
    letter: str = ""
    driver_record: type[Any] | None = None

    @property
    def field(self) -> str:
        """Field of a Scenario that holds the section's record."""
        return {"model": "parameters", "": "flight"}.get(self.key, self.key)


# One tuple feeds file tables, Scenario, search space and driver columns. When five lists were
# matched by position, two swapped entries would have flown with wrong numbers and no error. The
# order is that of the columns of a driver's row; everything finds its numbers by letter and name.
ORDER = (
    Section("model", None, "p"),
    Section("body", motion.Parameters, "b"),
    Section("sensors", langevin.Parameters, "s"),
    Section("radio", links.Parameters, "k"),
    Section("wind", wind.Parameters, "a", wind.Steady),
    Section("world", arena.Parameters, "w", Geometry),
    Section("scene", scenery.Parameters),
    Section("goals", goals.Parameters),
    Section("start", start.Parameters),
    Section("metrics", metrics.Parameters, "q"),
    Section("", Flight, "c", StepTimes),
    Section("wing", wing.Parameters, "wing"),
    Section("aero", descent.Parameters, "aero"),
    # The wind stands here twice: its mean and its turbulence are two records of the driver, each
    # derived from the same section.
    Section("wind", wind.Parameters, "air", dryden.Numbers),
    Section("topology", topology.Parameters, "topology"),
    Section("silence", silence.Parameters, "silence"),
    Section("steer", steering.Parameters, "steer"),
)
SECTIONS: dict[str, type[Record]] = {each.key: each.record for each in ORDER if each.key and each.record is not None}
