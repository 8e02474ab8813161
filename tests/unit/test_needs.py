"""What a flight needs is counted before it flies, and refused with what would fit."""

import re

import numpy as np
import pytest

import airflock
from airflock.engine import needs
from airflock.engine.cpu import driver_of
from airflock.engine.simulate import plan_of
from airflock.engine.state import State
from airflock.engine.tables import tables
from airflock.errors import FlightError


@pytest.mark.parametrize("agents", [50, 400])
@pytest.mark.parametrize("name", ["vasarhelyi_2018/4ms", "vasarhelyi_2018/real_gnss", "couzin_2002/torus"])
def test_what_is_counted_is_what_a_flight_takes(name, agents):
    """The buffer of a state, which holds what grows with the flock, within a factor of two and 100 kB."""
    scenario = airflock.load(name, {"agents": agents, "start.side": 3000.0, "world.side": 4000.0, "duration": 10.0})
    plan = plan_of(scenario).built(grid=False, bits=64)
    taken = State(plan, tables(scenario, plan, 0), driver_of(plan, "python")).buffer.nbytes
    counted = needs.bytes_of(scenario, plan, agents)
    assert 0.5 * taken - 1e5 <= counted <= 2.0 * taken + 1e5


def test_frames_are_counted_once_flown_and_once_handed_over():
    scenario = airflock.load("vasarhelyi_2018/4ms", {"duration": 10.0})
    flown, recorded = (plan_of(scenario, record=record) for record in (False, True))
    more = needs.bytes_of(scenario, recorded, 100) - needs.bytes_of(scenario, flown, 100)
    times = round(10.0 / scenario.metrics.period) + 1
    assert more == 2 * times * 6 * 100 * 4


@pytest.mark.parametrize("free", [10**8, 10**9])
def test_what_does_not_fit_is_refused_with_the_number_that_does(monkeypatch, free):
    monkeypatch.setattr(needs, "free_memory", lambda: free)
    settings = {"agents": 100_000, "start.side": 30_000.0, "world.side": 40_000.0}
    scenario = airflock.load("vasarhelyi_2018/real_gnss", settings)
    with pytest.raises(FlightError, match=r"agents = 100000 needs about \S+ GB of memory and \S+ GB are free") as told:
        airflock.score(scenario, seeds=1)
    fit = int(re.search(r"about (\d+) agents fit", str(told.value))[1])
    plan = plan_of(scenario)
    assert needs.bytes_of(scenario, plan, fit) <= 0.9 * free < needs.bytes_of(scenario, plan, fit + 1)


def test_a_recording_that_is_too_long_is_told_how_long_one_fits(monkeypatch):
    monkeypatch.setattr(needs, "free_memory", lambda: 10**8)
    scenario = airflock.load("vasarhelyi_2018/4ms", {"duration": 1e6})
    with pytest.raises(FlightError, match=r"or a recording of (\S+) s") as told:
        airflock.simulate(scenario, 0)
    fits = float(re.search(r"or a recording of (\S+) s", str(told.value))[1])
    plan = plan_of(airflock.load("vasarhelyi_2018/4ms", {"duration": 0.99 * fits}), record=True)
    assert needs.bytes_of(airflock.load("vasarhelyi_2018/4ms", {"duration": 0.99 * fits}), plan, 100) <= 0.9 * 10**8


def test_a_machine_tells_what_is_free():
    free = needs.free_memory()
    assert free is None or np.isfinite(free) and free > 10**7
