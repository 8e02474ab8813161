"""Flights and their moments go through a pickle, to another process too, and go on with the same bits."""

import pickle
import subprocess
import sys
from concurrent.futures import Future

import pytest

import airflock
from airflock.scenarios.files import load
from airflock.support.errors import FlightError

FLOWN = {
    "vasarhelyi_2018/faulty": {}, "vasarhelyi_2018/real_gnss": {}, "kidger/city": {}, "zapotecatl_2016/best": {},
    "dimock_2003/published": {"agents": 2}, "vicsek_1995/ordered": {}, "couzin_2005/informed": {},
    "vasarhelyi_2018/fixed_wing": {}, "chen_2014/hunt": {},
}  # fmt: skip


def opened(name, keys):
    return airflock.open(load(name, {"agents": 4} | keys), 1, device="python", record=True)


def bits(flight):
    return flight.snapshot().bytes.tobytes()


@pytest.mark.parametrize("name", FLOWN)
def test_a_pickled_flight_goes_on_as_the_flight_itself(name):
    flight = opened(name, FLOWN[name]).advance(steps=3)
    other, moment = pickle.loads(pickle.dumps((flight.branch(), flight.snapshot())))
    there = bits(flight.advance(steps=4))
    assert bits(other.advance(steps=4)) == there
    assert bits(other.restore(moment).advance(steps=4)) == there
    assert bits(flight.restore(pickle.loads(pickle.dumps(moment))).advance(steps=4)) == there
    with pytest.raises(FlightError, match="seed 1, precision = 32, device = python, record = True; not of this flight"):
        airflock.open(load(name, {"agents": 4} | FLOWN[name]), 2, device="python").restore(moment)


def test_a_motor_that_fails_goes_along_to_another_process(tmp_path):
    flight = opened("vasarhelyi_2018/4ms", {"agents": 3}).advance(steps=2)
    flight.fault("motor", 1, share=0.1)
    (tmp_path / "flight.pickle").write_bytes(pickle.dumps(flight))
    code = (
        "import pickle, sys; flight = pickle.load(open(sys.argv[1], 'rb')).advance(steps=5); "
        "sys.stdout.buffer.write(flight.snapshot().bytes.tobytes())"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "flight.pickle")]
    assert subprocess.run(command, capture_output=True, check=True).stdout == bits(flight.advance(steps=5))


def test_a_law_of_ones_own_is_refused_in_a_line_with_what_to_do():
    def decide(own, p):
        return 1.0, 0.0, 0.0

    class Parameters(airflock.Parameters):
        pass

    law = {"Parameters": Parameters, "COMMAND": "velocity", "decide": decide, "__name__": "mine"}
    flight = airflock.open(load("viragh_2014/4ms", {"agents": 3}, law=law), 1, device="python")
    for what in (flight, flight.snapshot()):
        with pytest.raises(FlightError, match="its own code cannot be sent to another process; open it there by its"):
            pickle.dumps(what)


def test_a_flight_whose_change_waits_for_its_compiler_is_not_pickled_without_it(monkeypatch):
    flight = opened("vasarhelyi_2018/4ms", {})
    monkeypatch.setattr("airflock.engine.flight.run_in_background", lambda _: Future())
    flight.fault("motor", [2], wait=False, share=0.1)
    with pytest.raises(FlightError, match="^a change waits for its compiler"):
        pickle.dumps(flight)


@pytest.mark.parametrize("other", [{"device": "cpu", "record": True}, {"device": "python", "record": False}])
def test_moments_stay_on_their_device_and_with_what_is_recorded(other):
    moment = opened("vasarhelyi_2018/4ms", {}).snapshot()
    flight = airflock.open(load("vasarhelyi_2018/4ms", {"agents": 4}), 1, **other)
    with pytest.raises(FlightError, match="device = python, record = True; not of this flight"):
        flight.restore(moment)


@pytest.mark.parametrize("first", ["course\nCourse", "snapshots\nSnapshot"])
def test_what_was_pickled_before_the_modules_moved_is_refused_in_one_line(first):
    with pytest.raises(ModuleNotFoundError, match="^a flight or moment that was pickled before .*; fly it again$"):
        pickle.loads(f"cairflock.engine.{first}\n.".encode())
