"""What a flight needs is counted before it flies, and refused with what would fit."""

import re

import numpy as np
import pytest

import airflock
from airflock.engine import DriverState, plan_of
from airflock.scenarios import cost
from airflock.support.errors import FlightError, ParameterError, ScenarioError
from inside import driver_of, needs, tables


@pytest.mark.parametrize("agents", [50, 400])
@pytest.mark.parametrize("name", ["vasarhelyi_2018/4ms", "vasarhelyi_2018/real_gnss", "couzin_2002/torus"])
def test_what_is_counted_is_what_a_flight_takes(name, agents):
    """The buffer of a state, which holds what grows with the flock, within a factor of two and 100 kB."""
    scenario = airflock.load(name, {"agents": agents, "start.side": 3000.0, "world.side": 4000.0, "duration": 10.0})
    plan = plan_of(scenario).built(grid=False, bits=64)
    taken = DriverState(plan, tables(scenario, plan, 0), driver_of(plan, "python")).buffer.nbytes
    counted = needs.estimated_bytes(scenario, plan, agents)
    assert 0.5 * taken - 1e5 <= counted <= 2.0 * taken + 1e5


def test_frames_are_counted_once_flown_and_once_handed_over():
    scenario = airflock.load("vasarhelyi_2018/4ms", {"duration": 10.0})
    flown, recorded = (plan_of(scenario, record=record) for record in (False, True))
    more = needs.estimated_bytes(scenario, recorded, 100) - needs.estimated_bytes(scenario, flown, 100)
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
    assert needs.estimated_bytes(scenario, plan, fit) <= 0.9 * free < needs.estimated_bytes(scenario, plan, fit + 1)


def test_a_recording_that_is_too_long_is_told_how_long_one_fits(monkeypatch):
    monkeypatch.setattr(needs, "free_memory", lambda: 10**8)
    scenario = airflock.load("vasarhelyi_2018/4ms", {"duration": 1e6})
    with pytest.raises(FlightError, match=r"or a recording of (\S+) s") as told:
        airflock.simulate(scenario, 0)
    fits = float(re.search(r"or a recording of (\S+) s", str(told.value))[1])
    plan = plan_of(airflock.load("vasarhelyi_2018/4ms", {"duration": 0.99 * fits}), record=True)
    assert (
        needs.estimated_bytes(airflock.load("vasarhelyi_2018/4ms", {"duration": 0.99 * fits}), plan, 100) <= 0.9 * 10**8
    )


def test_a_machine_tells_what_is_free():
    free = needs.free_memory()
    assert free is None or np.isfinite(free) and free > 10**7


def test_a_flight_that_nobody_can_wait_for_is_refused_with_what_fits():
    settings = {"agents": 200_000, "duration": 1e6, "start.side": 9e5, "world.side": 1e6}
    scenario = airflock.load("vasarhelyi_2018/real_4ms", settings)
    with pytest.raises(FlightError, match=r"takes about \S+ days of a processor, more than 30") as told:
        airflock.score(scenario, seeds=1)
    agents = int(re.search(r"about (\d+) agents fit", str(told.value))[1])
    duration = float(re.search(r"a duration of about (\S+) s", str(told.value))[1])
    for change in ({"agents": agents}, {"duration": 0.99 * duration}):
        assert cost.estimated_seconds(airflock.load("vasarhelyi_2018/real_4ms", settings | change)) <= cost.LONGEST
    more = airflock.load("vasarhelyi_2018/real_4ms", settings | {"agents": agents + 1})
    assert cost.estimated_seconds(more) > cost.LONGEST


def test_the_time_of_flights_is_told_once_it_is_worth_telling():
    scenario = airflock.load("vasarhelyi_2018/4ms")
    count = round(2 * 3 * 3600.0 / cost.estimated_seconds(scenario))
    assert cost.run_time_note([scenario] * 3, 1) == ""
    assert cost.run_time_note([scenario] * count, 2) == f"{count} flights will take about 3 h"


def test_what_loads_has_all_the_numbers_that_follow_from_it():
    with pytest.raises(
        ScenarioError, match=r"metrics.collision_period = 1e-05 s lies outside .* follows from the other"
    ):
        airflock.load("vasarhelyi_2018/4ms", {"dt": 1e-5, "duration": 1.0})
    assert (
        airflock.load("vasarhelyi_2018/4ms", {"dt": 1e-5, "duration": 1.0, "metrics.collision_period": 1e-3})
        .resolved_metrics()
        .collision_period
        == 1e-3
    )


@pytest.mark.parametrize("trees", [300_000, 1_000_000])
def test_a_forest_that_takes_minutes_to_build_is_refused_at_once(trees):
    with pytest.raises(ScenarioError, match="at most 200000 fit, for instance scene.trees = 200000"):
        airflock.load("kidger/forest", {"scene.trees": trees, "scene.density": 1.0, "scene.side": 1e5})


def test_so_many_flights_are_refused_before_their_seeds_are_listed():
    with pytest.raises(ParameterError, match="seeds = 1000000000: more than 10000000 flights at a time"):
        airflock.score("vasarhelyi_2018/4ms", seeds=10**9)
