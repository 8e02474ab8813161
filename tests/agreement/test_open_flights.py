"""An open flight has the bits of the closed one, whatever its cuts, and goes back, branches and changes truthfully."""

import signal

import numba
import numpy as np
import pytest

import airflock
from airflock.engine import fly_world, plan_of
from airflock.scenarios.files import load, presets
from airflock.support.errors import FlightError, ScenarioError

SMALL = {"agents": 8, "duration": 8.0}
FLIGHTS = {
    "vasarhelyi_2018/4ms": SMALL,
    "vasarhelyi_2018/real_gnss": SMALL,
    "zapotecatl_2016/best": SMALL,
    "kidger/city": SMALL,
    "dimock_2003/published": {"agents": 4, "duration": 4.0},
}


@pytest.fixture
def scenario():
    return load("vasarhelyi_2018/4ms", {"agents": 30, "duration": 40.0})


def whole(flight):
    """Everything that a flight carries and has told, as bytes."""
    return flight._state.buffer.tobytes(), repr(flight.scores()), flight.step


# ------------------------------------------------------------------------------------------------------------ cuts


def one_of_each_plan():
    """Presets whose small flights have drivers of their own, those of FLIGHTS first."""
    found = {}
    for name in (*FLIGHTS, *sorted(presets())):
        scenario = few(name)
        found.setdefault(plan_of(scenario), name)
    return list(found.values())


def few(name):
    """A short flight of few agents of a preset."""
    scenario = load(name, FLIGHTS.get(name))
    if name in FLIGHTS or scenario.goals.kind == "own":
        return scenario
    return load(name, {"agents": min(scenario.agents, 8), "duration": 400.0 * scenario.flight.dt})


@pytest.mark.parametrize("steps", [1, 7, 100])
def test_any_cuts_give_the_bits_of_the_whole(steps):
    cut_and_whole("vasarhelyi_2018/4ms", steps)


@pytest.mark.nightly
@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("name", one_of_each_plan())
def test_any_cuts_of_any_plan_give_the_bits_of_the_whole(name, threads):
    most = numba.get_num_threads()
    numba.set_num_threads(min(threads, most))
    try:
        for steps in (1, 7, 100):
            cut_and_whole(name, steps)
    finally:
        numba.set_num_threads(most)


def cut_and_whole(name, steps):
    scenario = few(name)
    closed = fly_world(scenario, 3, record=True)
    flight = airflock.open(scenario, 3, record=True)
    while not flight.over:
        flight.advance(steps=steps)
    scores = flight.finish()
    assert flight.frames.tobytes() == closed.frames.tobytes()
    assert flight.state.tobytes() == closed.state.tobytes()
    assert repr(scores) == repr(scenario.judged(closed.values))


@pytest.mark.parametrize("name", sorted(presets()))
def test_every_preset_flies_the_same_in_parts(name):
    """Interpreted: the same stages as compiled, without a compiler."""
    scenario = load(name)
    few = {"agents": min(scenario.agents, 4), "duration": 40.0 * scenario.flight.dt}
    scenario = load(name, few if scenario.goals.kind != "own" else {"duration": 0.1})
    flown = []
    for steps in (40, 7, 1):
        flight = airflock.open(scenario, 3, device="python")
        while not flight.over:
            flight.advance(steps=steps)
        flown.append((flight.state.tobytes(), repr(flight.finish())))
    assert flown[0] == flown[1] == flown[2]


def test_a_flight_that_ends_at_a_collision_ends_there_in_parts_too():
    crowded = {"agents": 40, "duration": 60.0, "metrics.stop": "collision", "metrics.r_coll": 12.0}
    scenario = load("vasarhelyi_2018/4ms", crowded)
    closed = fly_world(scenario, 1, record=True, device="python")
    flight = airflock.open(scenario, 1, record=True, device="python")
    while not flight.over:
        flight.advance(steps=37)
    assert flight.scores()["n_coll"] > 0.0 and flight.time < 60.0
    assert flight.frames.tobytes() == closed.frames.tobytes()
    assert repr(flight.finish()) == repr(scenario.judged(closed.values))
    with pytest.raises(FlightError, match=r"the flight is over at t = "):
        flight.advance(1.0)


def test_what_is_not_kept_in_the_state_carries_nothing_from_step_to_step():
    for name, settings in FLIGHTS.items():
        scenario = load(name, settings)
        quiet, poisoned = (airflock.open(scenario, 5, device="python") for _ in range(2))
        for _ in range(5):
            quiet.advance(steps=7)
            poisoned.advance(steps=7)
            state = poisoned._state
            for name, rubbish in {"words": 12345, "near": -7, "labels": 3}.items():
                state.arrays[name][:] = rubbish
            for array in (array for part in state.solvers for array in part):
                if not np.shares_memory(array, state.buffer):
                    array[...] = 1e3
        for name in ("words", "near", "labels"):
            quiet._state.arrays[name][:] = poisoned._state.arrays[name][:] = 0
        assert whole(quiet) == whole(poisoned), scenario.name


def test_sensing_first_gives_the_same_flight(scenario):
    straight, cut = airflock.open(scenario, 2), airflock.open(scenario, 2)
    straight.advance(4.0)
    while cut.time < 4.0:
        cut.sense()
        for agent in (0, 7):  # what the law itself decided
            cut.command(agent, cut.commands[:, agent])
        cut.advance(steps=20)
    assert np.array_equal(cut.state, straight.state) and repr(cut.scores()) == repr(straight.scores())


def test_an_agent_that_is_commanded_flies_there(scenario):
    flight = airflock.open(scenario, 2).advance(2.0)
    before = flight.state
    for _ in range(100):
        flight.sense().command(5, [4.0, 0.0]).advance(steps=20)
    way = flight.state[:2, 5] - before[:2, 5]
    assert way == pytest.approx([4.0 * 20.0, 0.0], abs=8.0)  # its lag of 1 s, and its noise


# --------------------------------------------------------------------------------------------- going back, branching


def test_going_back_flies_the_same_again(scenario):
    flight = airflock.open(scenario, 4).advance(3.0)
    moment = flight.snapshot()
    flight.advance(5.0)
    first = whole(flight)
    assert whole(flight.restore(moment).advance(5.0)) == first
    flight.change({"radio.delay": 0.4, "sensors.noise": 0.0}).advance(1.0)  # another driver
    assert whole(flight.restore(moment).advance(2.0).advance(3.0)) == first
    assert flight.events == []


def test_a_branch_of_the_same_world_is_the_same_flight(scenario):
    flight = airflock.open(scenario, 4).advance(2.0)
    twin = flight.branch()
    assert whole(twin.advance(5.0)) == whole(flight.advance(5.0))


def test_branches_of_other_worlds_have_independent_noise():
    still = {"agents": 30, "sensors.noise": 0.0, "model.v_flock": 4.0}
    flight = airflock.open(load("vasarhelyi_2018/4ms", still), 9).advance(0.1)
    gains = []
    for world in range(400):
        twin = flight.branch(world)
        before = twin.state[2:]
        gains.append((twin.advance(steps=2).state[2:] - before).ravel())
    gains = np.array(gains[1:]) - np.mean(gains[1:], axis=0)
    scenario = flight.scenario
    expected = np.sqrt(2.0 * 2.0 * scenario.body.noise * scenario.flight.dt)  # two steps
    assert gains.std() == pytest.approx(expected, rel=0.05)
    following = np.mean(gains[1:] * gains[:-1]) / gains.var()
    assert abs(following) < 4.0 / np.sqrt(gains.size)


def test_moments_of_other_flights_are_refused(scenario):
    flight = airflock.open(scenario, 4).advance(1.0)
    moment = flight.snapshot()
    alike = airflock.open(scenario, 4).restore(moment)  # by the same scenario, seed, precision and start
    assert np.array_equal(alike.advance(1.0).state, flight.advance(1.0).state)
    start = np.arange(4.0 * scenario.agents).reshape(4, -1)
    others = (
        airflock.open(scenario, 5),
        airflock.open(scenario, 4, precision=64),
        airflock.open(scenario, 4, start=start),
    )
    for other in others:
        with pytest.raises(FlightError, match="not of this flight"):
            other.restore(moment)
    with pytest.raises(FlightError, match="not of this flight"):
        airflock.open(load("vasarhelyi_2018/4ms", {"model.p_rep": 0.3}), 4).restore(moment)
    for other in (None, 3, "moment", (1, 2)):
        with pytest.raises(FlightError, match="is not what snapshot\\(\\) of a flight returns"):
            airflock.open(scenario, 3).restore(other)


# ---------------------------------------------------------------------------------------------------------- changes


def test_scenario_seed_and_events_are_the_same_bits(scenario):
    flight = airflock.open(scenario, 6, record=True)
    flight.advance(2.0).change({"model.p_rep": 0.3}).advance(1.5).push(3, [2.0, -1.0])
    flight.advance(1.0).change({"radio.delay": 0.4}).advance(0.2).place(0, [0.0, 5.0]).advance(0.7)
    flight.sense().command(2, [1.0, 1.0]).advance(2.0)
    again = airflock.open(scenario, 6, record=True, events=[event.plain() for event in flight.events])
    while again.step < flight.step:
        again.advance(steps=min(13, flight.step - again.step))
    assert whole(again) == whole(flight) and again.events == flight.events
    assert again.frames.tobytes() == flight.frames.tobytes()
    assert [repr(window.scores) for window in again.windows] == [repr(window.scores) for window in flight.windows]


def test_a_flight_of_another_world_starts_elsewhere_and_flies_again(scenario):
    flight = airflock.open(scenario, 6, world=7).advance(1.0)
    assert not np.array_equal(flight.state, airflock.open(scenario, 6).advance(1.0).state)
    again = airflock.open(scenario, 6, events=flight.events)
    assert whole(again.advance(1.0)) == whole(flight)


def test_a_change_to_the_same_numbers_changes_no_bit(scenario):
    straight, changed = airflock.open(scenario, 6).advance(6.0), airflock.open(scenario, 6)
    changed.advance(2.0).change({"model.p_rep": scenario.parameters.p_rep}).advance(4.0)
    assert np.array_equal(straight.state, changed.state)


@pytest.mark.parametrize(("delay", "device"), [(0.0, "python"), (0.4, "cpu"), (1.0, "cpu"), (1.7, "cpu")])
def test_after_a_change_of_the_delay_states_of_so_long_ago_are_heard(delay, device):
    """Without a delay another driver goes on; compiled, one hands over in `test_going_back_flies_the_same_again`."""
    quiet = load("vasarhelyi_2018/4ms", {"agents": 10, "sensors.noise": 0.0, "radio.range": 1e4})
    flight, past = airflock.open(quiet, 1, device=device), {}
    for step in range(0, 1000, 20):
        past[step] = flight.state
        if step == 500:
            flight.change({"radio.delay": delay})
        late = round(delay / 0.01) if step >= 500 else 100
        if step >= 100 and not 500 <= step < 500 + late:
            view = flight.look(0)
            assert [other.age for other in view.heard] == pytest.approx([late * 0.01] * 9)
            for other in view.heard:
                source = past[step - late] if (step - late) % 20 == 0 else None
                if source is not None:
                    assert other.state[:2] == pytest.approx(source[:2, other.who], abs=1e-5)
        flight.advance(steps=20)


@pytest.mark.parametrize(("device", "precision"), [("python", 64), ("cpu", 32), ("cpu", 64)])
def test_commands_that_wait_belong_to_the_flight(device, precision):
    """In parts, gone back, branched, overruled by what was decided anyway, and set to the same dead time again."""
    keys = {"agents": 6, "duration": 5.0, "dt": 0.05, "body.delay": 0.35}
    late = load("vasarhelyi_2018/4ms", keys | {"sensors.period": 0.1})

    def opened():
        return airflock.open(late, 5, device=device, precision=precision)

    straight, flight = opened().advance(5.0), opened().advance(1.65)
    moment = flight.snapshot()
    twin = flight.branch().advance(3.35)
    changed = opened().advance(1.65).change({"body.delay": 0.35}).advance(3.35)
    again = flight.advance(2.0).restore(moment).advance(1.0).advance(2.35)
    told = opened()
    while told.time < 5.0 - 1e-6:
        told.sense().command([0, 3], told.commands[:, [0, 3]].T).advance(steps=2)
    for each in (twin, again, told, changed):
        assert np.array_equal(each.state, straight.state)


@pytest.mark.parametrize("device", ["python", "cpu"])
@pytest.mark.parametrize(("before", "after"), [(0.0, 0.4), (0.3, 0.1), (0.1, 0.5), (0.4, 0.0)])
def test_after_a_change_of_the_dead_time_commands_of_so_long_ago_are_followed(device, before, after):
    """Of a body that is where its command says at once: its velocities are the commands of a dead time ago."""
    keys = {"agents": 4, "duration": 6.0, "dt": 0.05, "sensors.period": 0.1, "sensors.noise": 0.0}
    late = load("vasarhelyi_2018/4ms", keys | {"body.kind": "direct", "body.delay": before})
    flight, told = airflock.open(late, 5, device=device, precision=64), []
    for step in range(0, 80, 2):
        if step == 40:
            flight.change({"body.delay": after})
        told.append(flight.sense().commands)
        flight.advance(steps=1)
        lag = round((after if step >= 40 else before) / 0.1)
        if len(told) > lag and not 40 <= step < 40 + 2 * lag:
            np.testing.assert_allclose(flight.state[2:], told[-1 - lag], atol=1e-12)
        elif step >= 40 and after > before:  # the oldest that is known meanwhile
            np.testing.assert_allclose(flight.state[2:], told[20 - round(before / 0.1) - 1], atol=1e-12)
        flight.advance(steps=1)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_wider_collision_distance_misses_no_contact(seed):
    """The bound on how near pairs can have come was found for the old distance."""
    scenario = load("vasarhelyi_2018/4ms", {"agents": 60, "duration": 90.0})
    flight = airflock.open(scenario, seed).advance(60.0).change({"metrics.r_coll": 14.0})
    contacts = []
    for _ in range(150):
        x, y = flight.state[:2].astype(float)
        contacts.append((np.hypot(x[:, None] - x, y[:, None] - y) < 14.0).sum() - 60)
        flight.advance(steps=1)
    assert sum(contacts) > 0
    assert flight.scores()["phi_coll"] == pytest.approx(np.mean(contacts) / (60.0 * 59.0), rel=1e-6)


def test_a_change_is_refused_in_one_line_each_and_leaves_the_flight_as_it_was(scenario):
    flight, twin = airflock.open(scenario, 6).advance(2.0), airflock.open(scenario, 6).advance(2.0)
    for settings, said in {
        ("model.p_rep", -1.0): r"model\.p_rep = -1 1/s lies outside",
        ("agents", 31): "agents = 31: the number of agents cannot change in flight",
        ("dt", 0.02): "the motion step cannot change in flight",
        ("world.dimensions", "3"): "cannot change in flight",
        ("start.speed", 3.0): "the flight has started",
        ("model.prep", 0.1): "did you mean model.p_rep",
        ("duration", 1.0): "the flight is at t = 2 s already",
    }.items():
        with pytest.raises((ScenarioError, FlightError), match=said):
            flight.change(dict([settings]))
    for settings in ("x", 3, [1], {3: 4}):
        with pytest.raises(ScenarioError, match="are no keys with values"):
            flight.change(settings)
        with pytest.raises(ScenarioError, match="are no keys with values"):
            airflock.load("vasarhelyi_2018/4ms", settings)
    assert whole(flight.advance(1.0)) == whole(twin.advance(1.0)) and flight.events == []


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda f: f.command(30, [0, 0]), "agent = 30: this flight has the agents 0 to 29"),
        (lambda f: f.command(0, [0.0]), r"is not \[east, north\] in m/s"),
        (lambda f: f.push(0, [float("nan"), 0.0]), "each finite"),
        (lambda f: f.advance(-1.0), "is not at least one motion step"),
        (lambda f: f.advance(), "give seconds or steps"),
        (lambda f: f.advance(steps=3).sense(), "the next decision is at step 220, this is 203"),
        (lambda f: f.branch(-1), "not a whole number from 0"),
        (lambda f: f.event("branch"), "world = None is not a whole number from 0"),
        (lambda f: f.event("explode"), "known kinds: change, command, push, place, fault, remove, add, branch"),
        (lambda f: f.frames, "record=True"),
    ],
)
def test_what_makes_no_sense_is_one_line(scenario, call, said):
    flight = airflock.open(scenario, 6).advance(2.0)
    with pytest.raises(FlightError, match=said) as fault:
        call(flight)
    assert "\n" not in str(fault.value)


# ---------------------------------------------------------------------------------------------------------- looking


@pytest.mark.parametrize(
    ("name", "device"),
    [("vasarhelyi_2018/4ms", "cpu"), ("vasarhelyi_2018/real_gnss", "python")],  # its sensor, compiled: covering.PLANS
)
def test_what_an_agent_perceives_makes_up_its_command(name, device):
    from airflock.core.contract import call_rule

    scenario = load(name, {"agents": 12, "duration": 20.0, "radio.range": 200.0})
    flight = airflock.open(scenario, 3, precision=64, device=device).advance(5.0)
    before = whole(flight)
    views = [flight.look(agent) for agent in range(12)]
    assert whole(flight) == before
    flight.sense()
    for view in views:
        assert np.allclose(np.sum(view.terms, axis=0), view.sums, atol=1e-9)
        v = view.own
        norm = np.hypot(v.vx, v.vy)
        from airflock.core.vocabulary import Own

        own = Own(v.vx, v.vy, 0.0, v.vx / norm, v.vy / norm, 0.0)
        given = {"own": own, "sums": view.sums, "walls": view.walls, "p": scenario.parameters}
        wished = call_rule(scenario.model.decide, "decide", given, "law")
        assert wished[:2] == pytest.approx(view.command, abs=1e-9)
        assert flight.commands[:, view.agent] == pytest.approx(view.command)


# ------------------------------------------------------------------------------------------------------ given starts


@pytest.mark.parametrize(
    ("start", "said"),
    [
        (np.zeros((4, 7)), r"its shape is \(4, 7\); give \(4, 30\), the rows x, y, vx, vy of 30 agents in m and m/s"),
        (np.zeros((6, 30)), r"its shape is \(6, 30\)"),
        (np.full((4, 30), np.nan), "x of agent 0 is nan, not a finite number"),
        ("here", "not an array of numbers"),
    ],
)
def test_a_start_of_a_wrong_shape_is_refused(scenario, start, said):
    for flown in (airflock.simulate, airflock.open):
        with pytest.raises(FlightError, match=said):
            flown(scenario, 1, start=start)


def test_an_interruption_ends_one_long_flight():
    scenario = load("vasarhelyi_2018/4ms", {"agents": 100, "duration": 1e6})

    def interrupt(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.5)
    try:
        with pytest.raises(KeyboardInterrupt):
            fly_world(scenario, 1)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_a_flight_says_which_it_is_and_how_far(scenario):
    flight = airflock.open(scenario, 7).advance(0.5)
    assert (
        repr(flight)
        == f"<Flight {scenario.name}, seed 7: 0.5 of {scenario.flight.duration:g} s, {scenario.agents} agents>"
    )


# ------------------------------------------------------------------------------------------- rules of the start


@pytest.mark.parametrize(
    ("base", "keys", "settings"),
    [
        ("vasarhelyi_2018/4ms", {"world.side": 60.0}, {"model.v_flock": 100.0}),  # twice that is start.separation
        ("vasarhelyi_2018/4ms", {"start.separation": 5.0}, {"world.side": 10.0}),
        ("vasarhelyi_2018/4ms", {"start.kind": "ball", "start.radius": 20.0}, {"world.side": 30.0}),
        (
            "vasarhelyi_2018/fixed_wing",
            {"body.kind": "fixed_wing", "start.speed": 10.0},
            {"wing.weight": 80.0},
        ),  # it stalls at more than start.speed
    ],
    ids=lambda given: str(given),
)
def test_a_flight_in_the_air_is_not_judged_by_rules_of_its_start(base, keys, settings):
    """A file with the same keys is refused; a flight that has begun takes them, and flies again to the same bits."""
    small = load(base, {"agents": 6, "duration": 2.0, **keys})
    with pytest.raises(ScenarioError, match=r"start\.\w+ = "):
        load(base, {"agents": 6, "duration": 2.0, **keys, **settings})
    flight = airflock.open(small, 6, device="python", record=True).advance(0.5).change(settings)
    flight.restore(flight.snapshot()).advance(0.5).change({"duration": 1.5}).finish()
    again = airflock.simulate(small, 6, device="python", events=flight.events)
    theirs = airflock.recording_of(flight)
    assert np.array_equal(again.position, theirs.position) and len(flight.events) == 2


# ------------------------------------------------------------------------------------------- several agents at once


def acted(flight, agents, many):
    """A flight in which the same is done to agents, all at once or one after another."""
    rows = [[0.5 * agent, -1.0] for agent in agents]
    spots = [[8.0 * agent, 3.0] for agent in agents]
    for act, values in (("push", rows), ("place", spots), ("command", rows)):
        if many:
            getattr(flight, act)(agents, np.array(values))
        else:
            for agent, value in zip(agents, values, strict=True):
                getattr(flight, act)(agent, value)
    return flight


@pytest.mark.parametrize("precision", [32, 64])
def test_what_is_done_to_several_agents_is_what_is_done_to_each(precision):
    small = load("vasarhelyi_2018/4ms", {"agents": 6, "duration": 3.0})
    start = airflock.open(small, 2, precision=precision, device="python").advance(0.2)
    start.remove(5)  # agents lie in slots from here on
    agents = [4, 0, 3]
    once, each = (acted(start.branch(), agents, many).advance(1.0) for many in (True, False))
    assert np.array_equal(once.state, each.state, equal_nan=True)
    assert not np.array_equal(once.state, start.branch().advance(1.0).state, equal_nan=True)
    assert [event.data["agent"] for event in once.events[1:]] == [agents] * 3
    again = airflock.open(small, 2, precision=precision, device="python", events=[e.plain() for e in once.events])
    assert np.array_equal(again.advance(1.2).state, once.state, equal_nan=True)
    fewer, one_by_one = start.branch().remove([4, 1]), start.branch().remove(4).remove(1)
    assert np.array_equal(fewer.advance(0.5).state, one_by_one.advance(0.5).state, equal_nan=True)
    assert fewer.present.tolist() == [True, False, True, True, False, False]
    pushed = start.branch().push((1, 2), [3.0, -2.0])  # one velocity for both
    assert np.allclose((pushed.state - start.state)[2:, :5], np.outer([3.0, -2.0], [0, 1, 1, 0, 0]))


BOUNCING = {"agents": 3, "world.edges": "bounce", "world.side": 40.0, "start.separation": 1.0}
CITY = {"agents": 3, "scene.kind": "boxes", "scene.boxes": [[-5, -5, 0, 5, 5, 50, 0]], "world.dimensions": "3"}


@pytest.mark.parametrize(
    ("keys", "act", "said"),
    [
        ({"agents": 3}, lambda f: f.place(0, [1e9, 0.0]), r"position = \[1000000000.0, 0.0\] m lies outside"),
        ({"agents": 3}, lambda f: f.place([0, 1], [[0.0, 0.0], [0.0, -2e6]]), r"position = \[0.0, -2000000.0\] m lies"),
        ({"agents": 3}, lambda f: f.place(0, [float("inf"), 0.0]), "each finite"),
        ({"agents": 3}, lambda f: f.place([0, 1], [5.0, 5.0]), "2 agents in one place; give one row for each"),
        ({"agents": 3}, lambda f: f.place([0, 1], [[5.0, 5.0]]), "1 rows for 2 agents"),
        ({"agents": 3}, lambda f: f.push([0, 3], [5.0, 5.0]), "agent = 3: this flight has the agents 0 to 2"),
        ({"agents": 3}, lambda f: f.push([0, 0], [5.0, 5.0]), r"agent = \[0, 0\]: 0 is named twice"),
        ({"agents": 3}, lambda f: f.push([], [5.0, 5.0]), "names no agent"),
        ({"agents": 3}, lambda f: f.push("01", [5.0, 5.0]), "agent = '01': this flight has the agents"),
        ({"agents": 3}, lambda f: f.push(0, [5.0, 1e9]), r"velocity = \[5.0, 1000000000.0\] m/s lies outside"),
        (
            {"agents": 3},
            lambda f: f.push([0, 1], [[5.0, 1.0], [5.0]]),
            r"velocity\[1\] = \[5.0\] is not \[east, north\]",
        ),
        ({"agents": 3}, lambda f: f.remove(1).push([0, 1], [5.0, 1.0]), "agent = 1: it is absent"),
        ({"agents": 3}, lambda f: f.remove(1).add(1, [1e9, 1.0]), "position = .* lies outside"),
        (BOUNCING, lambda f: f.place(2, [25.0, 0.0]), "place: agent 2 lies 5 m outside the arena, from whose faces"),
        (BOUNCING, lambda f: f.remove(1).add(1, [25.0, 0.0]), "add: agent 1 lies 5 m outside the arena"),
        (CITY, lambda f: f.place([0, 2], [[9.0, 9.0, 9.0], [0.0, 1.0, 9.0]]), "place: agent 2 lies 4 m inside what"),
    ],
)
def test_agents_cannot_be_put_where_a_flight_cannot_hold_them(keys, act, said):
    flight = airflock.open(load("vasarhelyi_2018/4ms", {"duration": 3.0, **keys}), 2, device="python").advance(0.1)
    with pytest.raises(FlightError, match=said) as fault:
        act(flight)
    assert "\n" not in str(fault.value)
    assert all(event.kind == "remove" for event in flight.events)


def test_a_place_beyond_a_periodic_box_is_the_same_place_in_it_and_beyond_soft_walls_one_may_be_put():
    box = {"agents": 3, "duration": 3.0, "world.edges": "periodic", "world.side": 40.0}
    flights = [airflock.open(load("vicsek_1995/ordered", box), 2, device="python") for _ in range(2)]
    for flight, spot in zip(flights, ([13.0, -5.0], [53.0, 35.0]), strict=True):
        flight.place(0, spot).advance(1.0)
    assert np.array_equal(flights[0].state, flights[1].state)
    soft = airflock.open(load("vasarhelyi_2018/4ms", {"agents": 3}), 2, device="python").place(1, [300.0, 0.0])
    assert soft.state[0, 1] == 300.0


def test_nobody_joins_faster_than_a_flight_can_hold():
    flight = airflock.open("vasarhelyi_2018/4ms", 1, device="python").remove(3)
    with pytest.raises(FlightError, match="lies outside"):
        flight.add(3, [500.0, 500.0], [1e39, 0.0])
    assert not flight.present[3]
