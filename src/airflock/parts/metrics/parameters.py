"""Parameters of the order parameters: the keys `metrics.*`."""

from dataclasses import dataclass

from airflock.core import Parameters as Record, choice, quantity, text

ZAPOTECATL = "Zapotecatl et al. 2016"
METHODS = "Vásárhelyi et al. 2018, Methods"


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Parameters of the order parameters; None means "from the scenario"."""

    kind: str = text(
        "vasarhelyi",
        source="our choice",
        meaning="set of order parameters, or a file of your own that ends in .py. vasarhelyi, dimock, zapotecatl and "
        "kidger: those of the paper; groups: zapotecatl, with sub-groups told apart; contacts: "
        "collisions and contacts with walls and obstacles; order: polarisation, milling, speed and shape; swarmlab: "
        "vasarhelyi, with order, safety, union and connectivity",
    )
    stop: str = choice(
        "never", ("never", "collision"), source="Dimock & Selig 2003: a collision halts the simulation",
        meaning="what ends a flight early; order parameters are then measured up to that moment",
    )  # fmt: skip
    fitness: str = choice(
        "paper", ("paper", "sound"), source="Dimock & Selig 2003, Eq. 10, and its future work",
        meaning="fitness of kind = dimock: minus power; or with penalties for closeness, oscillation, no formation",
    )  # fmt: skip
    count: str = choice(
        "each", ("each", "program"), source="Zapotecatl et al. 2016, Eq. 18, or the authors' program",
        meaning="agents in collision that quality counts: each that has another within r_b; or those that the authors' "
        "program marks, which skips the pairs of agents marked before and so misses some in chains",
    )  # fmt: skip
    t_settle: float = quantity(
        10.0, "s", low=0.0, high=1e6, source="our choice", meaning="time by which a formation counts as settled"
    )
    v_settle: float = quantity(
        0.25, "m/s", low=0.0, high=100.0, source="our choice", meaning="unrest below which a formation counts as stable"
    )
    r_safe: float = quantity(
        1.0,
        "m",
        low=0.0,
        high=1e4,
        source="our choice: two thirds of a span",
        meaning="distance below which birds crowd each other",
    )
    period: float = quantity(
        0.2, "s", low=0.0, high=600.0, meaning="time between samples; 0: every step dt", source="our choice"
    )
    collision_period: float | None = quantity(
        None, "s", low=0.0001, high=600.0, meaning="time between checks for collisions; by default every step dt"
    )
    r_coll: float = quantity(
        3.0, "m", low=0.0, high=1000.0, source=METHODS, meaning="distance below which two agents collide"
    )
    r_flock: float = quantity(
        20.0, "m", low=0.0, high=1e6, source="our choice, because Kidger halves a diameter without a number",
        meaning="an agent is flocked within this distance of the flock's centre",
    )  # fmt: skip
    r_body: float = quantity(
        0.5, "m", low=0.0, high=1e3, source="our choice",
        meaning="radius of an agent that must not touch walls, obstacles or the scene",
    )  # fmt: skip
    r_cluster: float | None = quantity(
        None,
        "m",
        low=0.0,
        high=1e6,
        source="Eq. 12",
        meaning="distance below which two agents belong to one cluster; by default the model's",
    )
    r_comm: float | None = quantity(
        None,
        "m",
        low=0.0,
        high=1e8,
        source=METHODS,
        meaning="an agent with no neighbour within this distance is disconnected; by default radio.range",
    )
    v_flock: float | None = quantity(
        None,
        "m/s",
        low=0.01,
        high=1000.0,
        source="Eq. 22",
        meaning="speed that f_speed asks for; by default the model's",
    )
    v_tol: float | None = quantity(
        None, "m/s", low=0.001, high=1000.0, source="Eq. 22", meaning="tolerance of the speed; by default 0.375 v_flock"
    )
    r_b: float = quantity(
        0.05,
        "m",
        low=1e-6,
        high=1000.0,
        source=f"{ZAPOTECATL}, Eq. 18",
        meaning="distance of centres below which boids collide",
    )
    max_e: float | None = quantity(
        None,
        "m",
        low=1e-6,
        high=1e7,
        source=f"{ZAPOTECATL}, Eq. 21",
        meaning="largest extension; by default half the distance between extreme points of the arena",
    )
    k: float | None = quantity(
        None,
        "m",
        low=0.0,
        high=1e7,
        source=f"{ZAPOTECATL}, Eq. 21",
        meaning="distance penalty of a collision; by default max_e",
    )
    rho: float = quantity(
        3.141592653589793, "rad", low=0.0, high=3.1415927, source=f"{ZAPOTECATL}, Eq. 22: 180°", meaning="angle penalty"
    )
    sigma: float = quantity(0.5, "1", low=0.0, high=1.0, source=f"{ZAPOTECATL}, Eq. 23", meaning="weight of cns_ext")
    gamma: float = quantity(
        0.5, "1", low=0.0, high=1.0, source=f"{ZAPOTECATL}, Eq. 23", meaning="weight of cns_pol; sigma + gamma = 1"
    )
    a_tol: float = quantity(3e-5, "1", low=1e-9, high=1.0, source="Eq. 22", meaning="tolerance of the collision risk")
    r_tol: float = quantity(2.0, "m", low=0.001, high=1000.0, source="Eq. 22", meaning="tolerance of the excursion")
    centre_x: float = quantity(0.0, "m", low=-1e6, high=1e6, source="Eq. 1", meaning="centre for phi_lap, east")
    centre_y: float = quantity(0.0, "m", low=-1e6, high=1e6, source="Eq. 1", meaning="centre for phi_lap, north")
