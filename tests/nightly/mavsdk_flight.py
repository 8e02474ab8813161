"""A flight by MAVSDK, which knows nothing of this project: connect, health, arm, take-off, velocity, stop, land.

    python mavsdk_flight.py PORT

Needs `mavsdk>=4.1,<5`. One line for each step; ends with status 0 if every step is done in its time.
"""

import asyncio
import inspect
import sys
import time

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.offboard.offboard import VelocityNedYaw

STREAM = 1.3  # s of setpoints before they are to be flown: PX4 wants more than one
PATIENCE = float(sys.argv[2]) if len(sys.argv) > 2 else 1.0  # times as long as on an idle computer


async def step(name, doing, limit):
    """Do one step within its time (s), or end with what went wrong."""
    began = time.monotonic()
    try:
        found = await asyncio.wait_for(doing, limit * PATIENCE)
    except Exception as fault:
        raise SystemExit(f"{name}: {type(fault).__name__} {fault} after {time.monotonic() - began:.1f} s") from fault
    print(f"{name}: {time.monotonic() - began:.2f} s", flush=True)
    return found


async def first(values, holds):
    """The first of a stream of values for which something holds."""
    async for value in values:
        if holds(value):
            return value


async def wish(offboard, north, east):
    """Ask for a velocity, m/s."""
    made = offboard.set_velocity_ned(VelocityNedYaw(north, east, 0.0, 0.0))
    if inspect.isawaitable(made):
        await made


async def fly(port):
    """The flight."""
    async with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as client:
        await client.add_any_connection(f"udpin://127.0.0.1:{port}")
        system = await step("connect", client.first_autopilot(timeout_s=20.0 * PATIENCE), 20.0)
        if system is None:
            raise SystemExit("connect: nobody there")
        action, offboard, telemetry = ActionAsync(system), OffboardAsync(system), TelemetryAsync(system)
        await step("health", first(telemetry.subscribe_health_all_ok(), bool), 10.0)
        await step("arm", action.arm(), 5.0)
        await step("take off", action.takeoff(), 5.0)
        await step("in the air", first(telemetry.subscribe_in_air(), bool), 10.0)
        await step("climbed", first(telemetry.subscribe_position(), lambda at: at.relative_altitude_m > 1.8), 10.0)
        await wish(offboard, 0.0, 0.0)
        await asyncio.sleep(STREAM)
        await step("offboard", offboard.start(), 5.0)
        await wish(offboard, 3.0, 1.0)
        reached = first(telemetry.subscribe_velocity_ned(), lambda v: v.north_m_s > 2.5 and v.east_m_s > 0.8)
        await step("velocity reached", reached, 10.0)
        await step("offboard stopped", offboard.stop(), 5.0)
        await step("land", action.land(), 5.0)
        await step("on the ground", first(telemetry.subscribe_in_air(), lambda flies: not flies), 30.0)
        await step("disarmed", first(telemetry.subscribe_armed(), lambda armed: not armed), 10.0)


if __name__ == "__main__":
    asyncio.run(fly(int(sys.argv[1])))
