"""Fleets on the real clock: tasks and processes over UDP, clients that join, and what ends them.

Nothing here depends on how fast the computer is: a flight begins when all are there, and what is late is told.
"""

import asyncio
import multiprocessing
import os
import signal
import time

import numpy as np
import pytest

from airflock.drones.mavlink.autopilots import AUTOPILOTS, AutopilotCommands
from airflock.drones.mavlink.frames import frames_in
from airflock.drones.onboard.mission import AIRBORNE_PHASES
from airflock.drones.onboard.node_program import TaskRest, UdpAddresses, UdpPort
from airflock.fleets import compare, realtime
from airflock.fleets.drone_faults import InjectedFault
from airflock.fleets.realtime import (
    LOCAL_HOST,
    FleetPorts,
    RealtimePlan,
    fly_in_realtime,
    run_in_event_loop,
    vehicle_task,
)
from airflock.support.errors import LinkError, ScenarioError
from fleets import PRIVATE, card, scenario

SHORT = {"radio.delay": 0.1, "world.side": 120.0}


def flown(mode, agents=2, duration=1.0, faults=(), **more):
    found = compare.with_metric_period(scenario(agents, duration, **(SHORT | more)), 0.2)
    made = compare.software_card(found, stop_for_lost=True, realtime=True)
    return fly_in_realtime(found, made, 1, mode, start=compare.simulated_start(found, 1), faults=faults)


@pytest.mark.parametrize("mode", ["tasks", "processes"])
def test_a_fleet_on_the_real_clock_is_recorded_like_any_other(mode):
    f = flown(mode)
    rows, made = f.array(), compare.fleet_recording(f)
    assert rows.shape[1:] == (2, 15) and len(rows) >= 6 and np.isfinite(rows).all()
    np.testing.assert_allclose(rows[0, :, :2], [s[:2] for s in compare.simulated_start(f.scenario, 1)])
    assert set(made.position.dims) == {"time", "space", "keypoint", "individual"} and "own_position" in made
    ages = f.packet_ages()[-1][~np.eye(2, dtype=bool)]
    assert (ages >= 0.1).all(), "each has heard the other, and no packet comes before its delay"
    assert set(f.phases()) <= AIRBORNE_PHASES
    assert f.load.ticks >= 2 and f.load.cores > 0.0 and f.load.worst >= 0.0


def test_a_node_that_dies_stays_dead_and_its_last_word_is_kept():
    f = flown("tasks", faults=(InjectedFault("node", (2,), 0.3),))
    rows = f.array()
    assert (rows[3:, 1, 6:] == rows[3, 1, 6:]).all() and not (rows[3:, 0, 9:] == rows[3, 0, 9:]).all()


def test_from_the_ground_and_back_by_orders(monkeypatch):
    """One drone arms, takes off, comes home and lands; a low layer, so that it does not take long."""
    monkeypatch.setattr(realtime, "SECONDS_BEFORE_START", 1.0)
    found = compare.with_metric_period(scenario(1, 3.0, **SHORT), 0.2)
    made = card(found, safety={"base": 2.5, "tick": 0.05, "status_period": 0.1})
    f = fly_in_realtime(found, made, 0, "tasks", start=None, operator=PRIVATE)
    notes = [note.split(":")[0] for _, _, note in f.log]
    assert "CLEARED → ARMING" in notes and "ARMING → TAKEOFF" in notes, f.log
    heights = f.array()[:, 0, 2]
    assert heights.max() > 1.5 and heights[-1] < 0.3


def test_a_client_joins_where_a_vehicle_calls():
    """It hears a heartbeat twice a second; once it has spoken, everything; and it is answered."""
    found = scenario(1)
    made, client = compare.software_card(found, realtime=True), UdpPort(UdpAddresses((LOCAL_HOST, 0), None))
    ports, now = FleetPorts.open(1, client.here), time.monotonic()
    client.answer(bool, lambda line: None)
    plan = RealtimePlan(found, made, 0, None, (), ports, [now, now + 60.0, 0.0], [0.0] * 4, 1_800_000_000_000_000)

    async def joined():
        life = asyncio.create_task(run_in_event_loop(vehicle_task(plan, 0)))
        heard = []

        async def hear(count):
            while len(heard) < count:
                await asyncio.sleep(0.02)
                heard.extend(frame for data in client.read() for frame in frames_in(data))

        await hear(2)
        assert {frame.message for frame in heard} == {0}
        client.write(AutopilotCommands(AUTOPILOTS["px4"], 1).arm(True))
        await hear(40)
        plan.clock[1] = time.monotonic()
        await life
        return heard

    try:
        heard = asyncio.run(joined())
    finally:
        ports.close()
        client.close()
    assert {0, 24, 32, 33, 77, 245} <= {frame.message for frame in heard}
    assert [frame.values()["result"] for frame in heard if frame.message == 77] == [0]


def test_a_process_that_fails_ends_the_fleet_in_a_line(monkeypatch, capfd):
    def fails(plan, i):
        yield TaskRest(0.0)
        raise RuntimeError("a wing came off")

    monkeypatch.setattr(realtime, "vehicle_task", fails)
    with pytest.raises(LinkError, match="a process of the fleet ended with status 1"):
        flown("processes")
    assert "a wing came off" in capfd.readouterr().err


def test_a_process_that_is_killed_ends_the_others_without_a_word_of_theirs(monkeypatch, capfd):
    def killed(plan, i):
        yield TaskRest(0.0)
        os.kill(os.getpid(), signal.SIGKILL)

    def stop(number, _):
        raise KeyboardInterrupt

    monkeypatch.setattr(realtime, "vehicle_task", killed)
    before = signal.signal(signal.SIGTERM, stop)  # as the command has it; processes inherit it
    try:
        with pytest.raises(LinkError, match="a process of the fleet ended with status -9"):
            flown("processes")
        for process in multiprocessing.active_children():
            process.join(10.0)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert "KeyboardInterrupt" not in capfd.readouterr().err


def test_what_flies_in_lock_step_only_is_refused():
    with pytest.raises(ScenarioError, match="stays dead"):
        flown("tasks", faults=(InjectedFault("node", (2,), 0.3, 0.5),))
