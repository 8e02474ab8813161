"""Safety: every limit and every time-out of a flight on board, declared once with unit, range and source."""

from dataclasses import dataclass

from airflock.core import Parameters as Record, choice, quantity

OWN_CHOICE = "our choice"


@dataclass(frozen=True, kw_only=True)
class SafetyLimits(Record):
    """What the limiter allows, and when the mission gives up what it does."""

    speed_max: float = quantity(6.0, "m/s", low=0.1, high=60.0, source=OWN_CHOICE, meaning="largest commanded speed")
    climb_max: float = quantity(2.0, "m/s", low=0.1, high=10.0, source=OWN_CHOICE, meaning="largest vertical speed")
    accel: float = quantity(
        6.0, "m/s^2", low=0.1, high=50.0, source="Vásárhelyi et al. 2018, Table S5",
        meaning="a command differs from the own velocity by at most accel (response + tick)",
    )  # fmt: skip
    response: float = quantity(
        1.0, "s", low=0.01, high=60.0, source="Vásárhelyi et al. 2018, Table S5", meaning="relaxation time of the drone"
    )
    brake: float = quantity(
        2.5, "m/s^2", low=0.1, high=20.0, source=OWN_CHOICE, meaning="deceleration of the braking curve at the fence"
    )
    brake_gain: float = quantity(1.0, "1/s", low=0.05, high=10.0, source=OWN_CHOICE, meaning="its gain near the fence")
    soft_margin: float = quantity(
        3.0, "m", low=0.0, high=1000.0, source=OWN_CHOICE, meaning="distance from the fence at which outward speed is 0"
    )
    base: float = quantity(10.0, "m", low=2.0, high=500.0, source=OWN_CHOICE, meaning="height of the lowest layer")
    uneven: float = quantity(
        5.0, "m", low=0.5, high=500.0, source=OWN_CHOICE,
        meaning="largest height of a drone on the ground above or below the site",
    )  # fmt: skip
    layer: float = quantity(3.0, "m", low=0.5, high=50.0, source=OWN_CHOICE, meaning="distance of two layers")
    start_step: float = quantity(2.0, "s", low=0.0, high=60.0, source=OWN_CHOICE, meaning="from one start to the next")
    start_apart: float = quantity(
        3.0, "m", low=0.5, high=100.0, source=OWN_CHOICE, meaning="smallest distance on the ground"
    )
    home_radius: float = quantity(
        2.0, "m", low=0.5, high=50.0, source=OWN_CHOICE, meaning="within this distance: above home"
    )
    gather: float = quantity(
        200.0, "m", low=1.0, high=5000.0, source=OWN_CHOICE, meaning="farthest a member may be to flock"
    )
    yield_range: float = quantity(
        8.0, "m", low=0.5, high=100.0, source=OWN_CHOICE, meaning="on the way home, neighbours nearer than this repel"
    )
    near: float = quantity(
        2.0, "m", low=0.1, high=50.0, source=OWN_CHOICE, meaning="a take-off waits for a neighbour within"
    )
    stream: float = quantity(1.5, "s", low=1.0, high=10.0, source="PX4: more than 1 s", meaning="setpoints before use")
    arm_time: float = quantity(
        10.0, "s", low=2.0, high=120.0, source=OWN_CHOICE, meaning="for arming, before it gives up"
    )
    climb_time: float = quantity(5.0, "s", low=1.0, high=60.0, source=OWN_CHOICE, meaning="to begin climbing")
    stale: float = quantity(0.5, "s", low=0.1, high=5.0, source=OWN_CHOICE, meaning="age of the own position: hold")
    stale_land: float = quantity(5.0, "s", low=0.5, high=60.0, source=OWN_CHOICE, meaning="without a position: land")
    h_acc: float = quantity(3.0, "m", low=0.1, high=100.0, source=OWN_CHOICE, meaning="worst accuracy of a position")
    jump: float = quantity(
        5.0, "m", low=0.5, high=100.0, source=OWN_CHOICE, meaning="largest plausible jump of a position"
    )
    gnss_land: float = quantity(10.0, "s", low=1.0, high=120.0, source=OWN_CHOICE, meaning="with bad navigation: land")
    battery_low: float = quantity(
        25.0, "%", low=0.0, high=100.0, source=OWN_CHOICE, meaning="left when home is reached"
    )
    battery_critical: float = quantity(12.0, "%", low=0.0, high=100.0, source=OWN_CHOICE, meaning="land here")
    battery_way: float = quantity(
        10.0, "%/km", low=0.0, high=1000.0, source=OWN_CHOICE, meaning="what the way home takes"
    )
    outside_land: float = quantity(10.0, "s", low=1.0, high=300.0, source=OWN_CHOICE, meaning="beyond the fence: land")
    peers_least: float = quantity(1.0, "1", low=0.0, high=250.0, source=OWN_CHOICE, meaning="neighbours to be heard")
    peers_hold: float = quantity(10.0, "s", low=1.0, high=600.0, source=OWN_CHOICE, meaning="with fewer: hold")
    peers_return: float = quantity(30.0, "s", low=2.0, high=600.0, source=OWN_CHOICE, meaning="with fewer: return")
    deaf_return: float = quantity(
        20.0, "s", low=2.0, high=600.0, source=OWN_CHOICE, meaning="with nobody heard: return"
    )
    clock_error: float = quantity(
        0.2, "s", low=0.01, high=5.0, source=OWN_CHOICE, meaning="suspicious error of a clock"
    )
    clock_return: float = quantity(
        10.0, "s", low=1.0, high=300.0, source=OWN_CHOICE, meaning="with a bad clock: return"
    )
    clock_spread: float = quantity(
        1.0, "s", low=0.1, high=10.0, source=OWN_CHOICE, meaning="stamps farther off than this are refused"
    )
    late: float = quantity(1.0, "s", low=0.1, high=10.0, source=OWN_CHOICE, meaning="a tick this late is an overload")
    overloads: float = quantity(
        3.0, "1", low=1.0, high=100.0, source=OWN_CHOICE, meaning="overloads after which it returns"
    )
    calm: float = quantity(3.0, "s", low=0.5, high=60.0, source=OWN_CHOICE, meaning="all well for this long: go on")
    operator_time: float = quantity(
        10.0, "s", low=1.0, high=3600.0, source=OWN_CHOICE, meaning="silence that counts as lost"
    )
    operator_lost: str = choice("ignore", ("ignore", "hold", "return"), meaning="what to do without the operator")
    mission_time: float = quantity(
        600.0, "s", low=1.0, high=36000.0, source=OWN_CHOICE, meaning="in the air, then return"
    )
    status_period: float = quantity(
        0.1, "s", low=0.02, high=5.0, source=OWN_CHOICE, meaning="between packets, fast radio"
    )
    slow_period: float = quantity(
        1.0, "s", low=0.1, high=60.0, source=OWN_CHOICE, meaning="between packets, slow radio"
    )
    tick: float = quantity(0.05, "s", low=0.01, high=0.2, source=OWN_CHOICE, meaning="between setpoints")
