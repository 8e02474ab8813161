"""MAVSDK flies a vehicle in software as it flies PX4 and ArduPilot: an independent reading of the same protocol.

    python tests/nightly/mavsdk_client.py [PYTHON]

PYTHON is an interpreter that has `mavsdk>=4.1,<5`; by default the one that runs this, or AIRFLOCK_MAVSDK. The vehicle
calls at a port as each vehicle of `airflock fleet --mode tasks` does, and MAVSDK joins there. Ends with status 0 if
both flights, as PX4 and as ArduPilot, are whole.
"""

import asyncio
import os
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from airflock.drones.onboard.node_program import UdpAddresses, UdpPort  # noqa: E402
from airflock.fleets import compare  # noqa: E402
from airflock.fleets.drone_faults import InjectedFault  # noqa: E402
from airflock.fleets.realtime import (  # noqa: E402
    LOCAL_HOST,
    FleetPorts,
    RealtimePlan,
    run_in_event_loop,
    vehicle_task,
)
from fleets import scenario  # noqa: E402

FLIGHT = Path(__file__).with_name("mavsdk_flight.py")
LONGEST = 300.0  # s of one flight


def free():
    """A port where nobody listens."""
    port = UdpPort(UdpAddresses((LOCAL_HOST, 0), None))
    number = port.here[1]
    port.close()
    return number


async def flown(kind, python, patience):
    """What MAVSDK says of its flight with one vehicle, and the status that it ends with."""
    found, join = scenario(1, 60.0), free()
    card = compare.software_card(found, vehicle=kind, realtime=True)
    ports, now = FleetPorts.open(1, (LOCAL_HOST, join)), time.monotonic()
    epoch = time.time_ns() // 1000 - round(now * 1e6)
    # MAVSDK requests no streams, and ArduPilot sends none by itself: a station beside it requests them.
    station = (InjectedFault("streams", amount=10.0),) if kind == "ardupilot" else ()
    plan = RealtimePlan(found, card, 0, None, station, ports, [now, now + LONGEST, 0.0], [0.0] * 4, epoch)
    vehicle = asyncio.create_task(run_in_event_loop(vehicle_task(plan, 0)))
    try:
        client = await asyncio.create_subprocess_exec(
            python, str(FLIGHT), str(join), str(patience), stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        told, _ = await client.communicate()
        return told.decode(errors="replace"), client.returncode
    finally:
        plan.clock[1] = time.monotonic()
        await vehicle
        ports.close()


def main():
    python = sys.argv[1] if len(sys.argv) > 1 else os.environ.get("AIRFLOCK_MAVSDK", sys.executable)
    if subprocess.run([python, "-c", "import mavsdk.asyncio"], capture_output=True).returncode:
        print(f"{python} has no mavsdk: pip install 'mavsdk>=4.1,<5', or set AIRFLOCK_MAVSDK to an interpreter with it")
        return 1
    patience, worst = max(1.0, os.getloadavg()[0]), 0
    for kind in ("px4", "ardupilot"):
        told, status = asyncio.run(flown(kind, python, patience))
        print(f"{kind}:\n{told}", end="", flush=True)
        worst = max(worst, abs(status))
    print("MAVSDK flew px4 and ardupilot" if not worst else "a flight is not whole")
    return 1 if worst else 0


if __name__ == "__main__":
    sys.exit(main())
