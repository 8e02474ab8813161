"""Quadrotor without yaw: a velocity controller, an attitude that turns, motors that lag, and air.

The equations are the usual ones of a multirotor (Mahony, Kumar and Corke 2012, IEEE Robotics &
Automation Magazine 19(3)): thrust along the body's axis n, weight, drag. Yaw is left out, since
flocking never turns the nose; so attitude is the direction n and its turning rate w. Controllers
follow the commanded velocity one behind the other, as autopilots do: proportional and integral in
velocity, with limits of acceleration and tilt; then a turn of n towards the wanted direction,
proportional and damped, with a limited angular acceleration; then motors that lag.

Forces are per mass. Drag is relative to the air: a part proportional to the speed across n (rotor
drag, as in Faessler et al. 2018) and a part that grows with its square; both, and the largest
thrust, grow with the density of the air.

With body.battery = "lithium" energy is drawn as in `parts.bodies.battery`, the largest thrust falls
with it, and when the battery is empty the motors stop: in space the quadrotor falls, and on the
ground it is absent from then on; in a plane drag brings it to rest.

Integration: semi-implicit Euler, of first order in dt. In a plane the height is held by the plane
itself.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import BodyParameters, norm, quantity, shorten
from airflock.parts.bodies.battery import battery_end, battery_energy, battery_kind, hovering, lasting, left

ACCEPTS = "velocity"
INTEGRATION = "new"  # positions move by the velocity after the step
OURS = "our choice: a quadrotor of about 1 kg"
SEA_LEVEL = "ICAO standard atmosphere, sea level"


@dataclass(frozen=True, kw_only=True)
class Parameters(BodyParameters):
    """A quadrotor of about 1 kg behind a velocity controller."""

    tau: float = quantity(
        1.0, "s", low=0.05, high=60.0, source="as the multirotor, Vásárhelyi et al. 2018, Table S5",
        meaning="velocity controller: time constant of its proportional part",
    )  # fmt: skip
    integral: float = quantity(
        0.4, "1/s^2", low=0.0, high=50.0, source=OURS, meaning="velocity controller: gain of its integral part"
    )
    a_max: float = quantity(
        6.0,
        "m/s^2",
        low=0.1,
        high=100.0,
        source="Vásárhelyi et al. 2018, Table S5",
        meaning="largest commanded acceleration",
    )
    tilt_max: float = quantity(0.55, "rad", low=0.01, high=1.4, source=OURS, meaning="largest commanded tilt")
    stiffness: float = quantity(150.0, "1/s^2", low=1.0, high=1e4, source=OURS, meaning="attitude: proportional gain")
    damping: float = quantity(22.0, "1/s", low=0.1, high=500.0, source=OURS, meaning="attitude: damping of its rate")
    alpha: float = quantity(
        120.0, "rad/s^2", low=0.1, high=1e4, source=OURS, meaning="attitude: largest angular acceleration"
    )
    motor: float = quantity(0.04, "s", low=0.001, high=5.0, source=OURS, meaning="time constant of the motors")
    thrust_min: float = quantity(0.2, "1", low=0.0, high=1.0, source=OURS, meaning="least thrust over weight")
    thrust_max: float = quantity(
        2.0, "1", low=1.0, high=20.0, source=OURS, meaning="largest thrust over weight, in air of density rho_0"
    )
    rotor_drag: float = quantity(
        0.3, "1/s", low=0.0, high=20.0, source="of the size that Faessler et al. 2018 measured",
        meaning="drag across the rotors per speed and mass, in air of density rho_0",
    )  # fmt: skip
    drag: float = quantity(
        0.01, "1/m", low=0.0, high=5.0, source=OURS, meaning="drag per squared speed and mass, in air of density rho_0"
    )
    rho: float = quantity(1.225, "kg/m^3", low=0.1, high=5.0, source=SEA_LEVEL, meaning="density of the air")
    rho_0: float = quantity(
        1.225,
        "kg/m^3",
        low=0.1,
        high=5.0,
        source=SEA_LEVEL,
        meaning="air density to which thrust_max and the drags refer",
    )
    gravity: float = quantity(
        9.80665, "m/s^2", low=0.1, high=30.0, source="standard gravity", meaning="weight per mass"
    )
    battery: str = battery_kind()
    capacity: float = battery_energy(150e3, "our choice: 42 Wh, 17 min of hovering")
    hover_power: float = quantity(
        150.0, "W", low=0.0, high=1e6, source=OURS, meaning="power of hovering, in air of density rho_0"
    )
    weak: float = battery_end()


# Torque lags as well as thrust: with a lag of thrust alone the tilt differed by 2.3° from that of
# rotorpy after a sudden turn, now by 1.3°.
class Memory(NamedTuple):
    """State of a quadrotor from step to step.

    n : direction of thrust; w, a : its turning rate (rad/s) and angular acceleration (rad/s²),
                                    which the motors give
    thrust : over weight; i : integral of the velocity error, m/s²; used : energy drawn from the
             battery, J
    """

    nx: float = 0.0
    ny: float = 0.0
    nz: float = 1.0
    wx: float = 0.0
    wy: float = 0.0
    wz: float = 0.0
    ax: float = 0.0
    ay: float = 0.0
    az: float = 0.0
    thrust: float = 1.0
    ix: float = 0.0
    iy: float = 0.0
    iz: float = 0.0
    used: float = 0.0


def limits(b, dt):
    """Return what this body cannot fly, one line each: steps in which its attitude would swing up."""
    longest = min(1.0 / b.damping, 0.5 / math.sqrt(b.stiffness))
    if dt <= longest:
        return []
    return [f"dt = {dt:g} s: body quadrotor with these gains flies in steps of at most {longest:.3g} s"]


def endures(memory, b):
    """Time (s) for which the battery lasts at least: at the largest thrust."""
    air = b.rho / b.rho_0
    return lasting(memory.used, hovering(max(memory.thrust, b.thrust_max * air), air, b), b)


def wanted(ex, ey, ez, ix, iy, iz, b):
    """Acceleration that the velocity controller demands (m/s²), and 1.0 if it was not limited, else 0.0.

    e : velocity error, m/s; i : its integral, m/s². Limited to b.a_max.
    """
    ax = ex / b.tau + ix
    ay = ey / b.tau + iy
    az = ez / b.tau + iz
    free = 1.0 if norm(ax, ay, az) <= b.a_max else 0.0
    sx, sy, sz = shorten(ax, ay, az, b.a_max)
    return sx, sy, sz, free


def tilted(ax, ay, az, b):
    """Thrust per mass (m/s²) for an acceleration a (m/s²): with the weight, half of it at least, and limited tilt."""
    up = max(az + b.gravity, 0.5 * b.gravity)
    k = min(1.0, math.tan(b.tilt_max) * up / norm(ax, ay, 0.0))
    return k * ax, k * ay, up


def turned(m, fx, fy, fz, lag, dt, b):
    """Direction n of thrust after dt on its way to the direction of f, its turning rate and angular acceleration.

    lag : share of the way to the demand that the motors go in dt. Returns nx ny nz wx wy wz ax ay
          az.
    """
    k = b.stiffness / norm(fx, fy, fz)
    sx, sy, sz = shorten(
        k * (m.ny * fz - m.nz * fy) - b.damping * m.wx,
        k * (m.nz * fx - m.nx * fz) - b.damping * m.wy,
        k * (m.nx * fy - m.ny * fx) - b.damping * m.wz,
        b.alpha,
    )
    ax = m.ax + lag * (sx - m.ax)
    ay = m.ay + lag * (sy - m.ay)
    az = m.az + lag * (sz - m.az)
    wx = m.wx + ax * dt
    wy = m.wy + ay * dt
    wz = m.wz + az * dt
    nx = m.nx + (wy * m.nz - wz * m.ny) * dt
    ny = m.ny + (wz * m.nx - wx * m.nz) * dt
    nz = m.nz + (wx * m.ny - wy * m.nx) * dt
    u = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)  # never zero: a turn keeps the length or adds to it
    return u * nx, u * ny, u * nz, wx, wy, wz, ax, ay, az


def dragged(rx, ry, rz, nx, ny, nz, b):
    """Drag per mass (m/s²) at a velocity r (m/s) through the air, with thrust along n."""
    k = b.rho / b.rho_0
    along = rx * nx + ry * ny + rz * nz
    s = b.drag * norm(rx, ry, rz)
    return (
        -k * (b.rotor_drag * (rx - along * nx) + s * rx),
        -k * (b.rotor_drag * (ry - along * ny) + s * ry),
        -k * (b.rotor_drag * (rz - along * nz) + s * rz),
    )


def move(vx, vy, vz, mx, my, mz, cx, cy, cz, wx, wy, wz, memory, dt, b):
    """Velocity (m/s) and Memory after dt (s): the controllers see the measured velocity m, drag the true one."""
    ex = cx - mx
    ey = cy - my
    ez = cz - mz
    ax, ay, az, free = wanted(ex, ey, ez, memory.ix, memory.iy, memory.iz, b)
    h = b.integral * dt * free  # no wind-up while limited
    fx, fy, fz = tilted(ax, ay, az, b)
    lag = 1.0 - math.exp(-dt / b.motor)
    nx, ny, nz, ux, uy, uz, tx, ty, tz = turned(memory, fx, fy, fz, lag, dt, b)
    want = (fx * nx + fy * ny + fz * nz) / b.gravity
    possible = b.thrust_max * b.rho / b.rho_0
    used = memory.used
    if b.battery == "lithium":
        possible = possible * left(used, b)
        used = used + hovering(memory.thrust, b.rho / b.rho_0, b) * dt
    want = min(max(want, b.thrust_min), possible)
    thrust = memory.thrust + (want - memory.thrust) * lag
    dx, dy, dz = dragged(vx - wx, vy - wy, vz - wz, nx, ny, nz, b)
    g = b.gravity
    return (
        vx + (thrust * g * nx + dx) * dt,
        vy + (thrust * g * ny + dy) * dt,
        vz + (thrust * g * nz - g + dz) * dt,
        Memory(
            nx, ny, nz, ux, uy, uz, tx, ty, tz, thrust,
            memory.ix + h * ex, memory.iy + h * ey, memory.iz + h * ez, used,
        ),
    )  # fmt: skip
