"""Fixed wing: a point mass on the wing of the section [wing], in coordinated turns: three freedoms and a bank.

The equations are those of a point mass without sideslip (Stengel 2004, Flight Dynamics, sections
2.6 and 3.1): with airspeed V, climb angle γ, course χ, bank φ and load factor n = lift / weight,

    dV/dt = (T - D) / m - g sin γ,    V dγ/dt = g (n cos φ - cos γ),    V cos γ dχ/dt = g n sin φ,
    D = q S cd0 + (n W)² / (q π e b²),    q = ρ V² / 2.

Lift is bounded by stall (cl_max) and by n_max, thrust by a largest force and a largest power.
Controllers: a bank for the error of course, a load factor for the error of climb, a thrust for the
error of speed; where thrust does not suffice the nose goes down and speed is kept, as total-energy
controllers do. Bank follows with a lag of first order and a largest rate of roll; there is no
sideslip, no pitch dynamics and no flap. All is relative to the air, which the aircraft is taken to
know: wind is a true airspeed, and a velocity over ground is followed with the nose into the wind.

Energy is the work of thrust over `use`. With body.battery = "lithium" the largest thrust falls with
it as in `parts.bodies.battery`; when the battery is empty the aircraft glides, and on the ground it
is absent from then on. In a plane, which holds its height, it only grows slower.

Integration: V, γ and χ one after another with the values after the step of the controllers, of
first order in dt; turns keep the speed exactly. In a plane the height is held by the plane itself.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import BodyParameters, arc_cosine, clamp, norm, quantity
from airflock.parts.bodies.battery import battery_end, battery_energy, battery_kind, lasting, left

ACCEPTS = "velocity"
INTEGRATION = "new"
OURS = "our choice: a small electric aircraft"


@dataclass(frozen=True, kw_only=True)
class Parameters(BodyParameters):
    """Controllers and engine of an aircraft; span, chord, weight, cd0, cl_max and air are those of the wing."""

    efficiency: float = quantity(
        0.96, "1", low=0.1, high=1.0, meaning="span efficiency e of the induced drag",
        source="lifting line of the aero package: 0.96 of a rectangular wing of aspect ratio 5, 0.92 of one of 10",
    )  # fmt: skip
    bank_max: float = quantity(0.87, "rad", low=0.05, high=1.4, source=OURS, meaning="largest bank")
    roll_max: float = quantity(1.5, "rad/s", low=0.05, high=20.0, source=OURS, meaning="largest rate of roll")
    tau_roll: float = quantity(0.3, "s", low=0.01, high=10.0, source=OURS, meaning="time constant of the bank")
    tau_turn: float = quantity(1.5, "s", low=0.05, high=60.0, source=OURS, meaning="time constant of the course")
    tau_climb: float = quantity(0.8, "s", low=0.05, high=60.0, source=OURS, meaning="time constant of the climb angle")
    tau_speed: float = quantity(1.0, "s", low=0.05, high=60.0, source=OURS, meaning="time constant of the airspeed")
    tau_thrust: float = quantity(0.3, "s", low=0.01, high=10.0, source=OURS, meaning="time constant of the thrust")
    n_max: float = quantity(3.0, "1", low=1.0, high=15.0, source=OURS, meaning="largest load factor")
    dive_max: float = quantity(0.35, "rad", low=0.01, high=1.4, source=OURS, meaning="steepest descent")
    margin: float = quantity(
        1.1,
        "1",
        low=1.0,
        high=3.0,
        source=OURS,
        meaning="smallest commanded airspeed, as a multiple of the stall speed",
    )
    v_max: float = quantity(30.0, "m/s", low=1.0, high=300.0, source=OURS, meaning="largest commanded airspeed")
    thrust_max: float = quantity(0.4, "1", low=0.0, high=5.0, source=OURS, meaning="largest thrust over weight")
    power_max: float = quantity(400.0, "W", low=0.0, high=1e7, source=OURS, meaning="largest thrust times airspeed")
    use: float = quantity(
        0.5,
        "1",
        low=0.01,
        high=1.0,
        source="our choice: propeller and motor",
        meaning="share of the energy that becomes thrust",
    )
    gravity: float = quantity(9.80665, "m/s^2", low=0.1, high=30.0, source="standard gravity", meaning="weight / mass")
    battery: str = battery_kind()
    capacity: float = battery_energy(540e3, "our choice: 150 Wh")
    weak: float = battery_end()


class Memory(NamedTuple):
    """Bank (rad, positive to the left), thrust over weight, energy used since the start (J)."""

    bank: float = 0.0
    thrust: float = 0.0
    energy: float = 0.0


def stall_speed(wing, n):
    """Airspeed (m/s) below which the wing does not carry n times its weight."""
    return math.sqrt(2.0 * n * wing.weight / (wing.density * wing.span * wing.chord * wing.cl_max))


def drag_of(v, n, wing, b):
    """Drag over weight at an airspeed v (m/s) and a load factor n."""
    q = 0.5 * wing.density * v * v
    induced = n * n * wing.weight / (q * math.pi * b.efficiency * wing.span * wing.span)
    return q * wing.span * wing.chord * wing.cd0 / wing.weight + induced


def limits(b, speed, start, wing):
    """Return what this body cannot fly, one line each: a law or a start slower than the stall."""
    stall = stall_speed(wing, 1.0)
    least, told = b.margin * stall, f"body fixed_wing stalls at {stall:.3g} m/s and flies no slower than"
    found = []
    if 0.0 < speed < least:
        found.append(f"{told} {least:.3g} m/s, but the law prefers {speed:g} m/s; raise that, or lower wing.weight")
    if start < stall:
        found.append(f"{told} that: start.speed = {start:g} m/s; set start.speed to {max(speed, least):.3g}")
    return found


def largest_thrust(v, used, wing, b):
    """Thrust over weight that engine and battery can give at an airspeed v (m/s); used : energy drawn, J."""
    possible = min(b.thrust_max, b.power_max / (v * wing.weight))
    if b.battery == "lithium":
        possible = possible * left(used, b)
    return possible


def endures(memory, b):
    """Time (s) for which the battery lasts at least: at the largest power."""
    return lasting(memory.energy, b.power_max / b.use, b)


def climbing(up, v, drag, slow, possible, b):
    """Sine of the commanded climb angle: for a vertical speed `up` (m/s), within what thrust and speed allow.

    slow : acceleration that the speed controller demands, over gravity; possible : largest thrust
           over weight
    """
    spare = possible - drag - slow
    low = -math.sin(b.dive_max)
    return clamp(up / v, low, clamp(spare, low, 1.0))


def steady_load(sine, bank, n_most):
    """Load factor that keeps the climb angle of this sine steady at a bank, as far as the wing carries it."""
    return min(math.sqrt(max(1.0 - sine * sine, 0.0)) / math.cos(bank), n_most)


def move(vx, vy, vz, cx, cy, cz, wx, wy, wz, memory, dt, b, wing):
    """Velocity over ground (m/s) and Memory after dt (s)."""
    ux = vx - wx
    uy = vy - wy
    uz = vz - wz
    v = norm(ux, uy, uz)
    level = norm(ux, uy, 0.0)
    hx = ux / level
    hy = uy / level
    ax = cx - wx
    ay = cy - wy
    az = cz - wz
    wish = clamp(norm(ax, ay, az), b.margin * stall_speed(wing, 1.0), b.v_max)
    # bank for the course
    error = math.atan2(hx * ay - hy * ax, hx * ax + hy * ay)
    carried = v / stall_speed(wing, 1.0)
    n_most = min(b.n_max, carried * carried)  # of stall
    steepest = min(b.bank_max, arc_cosine(1.0 / max(n_most, 1.0)))
    bank_wish = clamp(math.atan(v * error / (b.tau_turn * b.gravity)), -steepest, steepest)
    rate = (bank_wish - memory.bank) * min(1.0 / b.tau_roll, 1.0 / dt)
    bank = memory.bank + clamp(rate, -b.roll_max, b.roll_max) * dt
    # load factor for the climb
    sine = clamp(uz / v, -0.999, 0.999)
    angle = math.asin(sine)
    slow = (wish - v) / (b.tau_speed * b.gravity)
    drag = drag_of(v, steady_load(sine, bank, n_most), wing, b)
    possible = largest_thrust(v, memory.energy, wing, b)
    asked = math.asin(climbing(az, v, drag, slow, possible, b))
    n = clamp((math.cos(angle) + v * (asked - angle) / (b.tau_climb * b.gravity)) / math.cos(bank), 0.0, n_most)
    # thrust for the speed
    drag = drag_of(v, n, wing, b)
    thrust_wish = clamp(drag + sine + slow, 0.0, possible)
    thrust = memory.thrust + (thrust_wish - memory.thrust) * (1.0 - math.exp(-dt / b.tau_thrust))
    speed = max(v + b.gravity * (thrust - drag - sine) * dt, 0.1 * v)
    climb = clamp(angle + b.gravity / v * (n * math.cos(bank) - math.cos(angle)) * dt, -1.5, 1.5)
    turn = b.gravity * n * math.sin(bank) / (v * math.cos(angle)) * dt
    # The state is turned by angles, not pushed by forces, which would gain 0.18 m/s each second in
    # a turn of 1 g at 14 m/s with steps of 0.05 s.
    across = speed * math.cos(climb)
    c = math.cos(turn)
    s = math.sin(turn)
    energy = memory.energy + thrust * wing.weight * v / b.use * dt
    return (
        wx + across * (hx * c - hy * s),
        wy + across * (hx * s + hy * c),
        wz + speed * math.sin(climb),
        Memory(bank, thrust, energy),
    )
