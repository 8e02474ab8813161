"""Environments: what agents observe is what they measured and heard, and rewards add up to the fitness."""

import warnings

import numpy as np
import pytest

import airflock
from airflock.support.errors import AirflockError, FlightError

gymnasium = pytest.importorskip("gymnasium")
pytest.importorskip("pettingzoo")
from gymnasium.utils.env_checker import check_env  # noqa: E402
from pettingzoo.test import parallel_api_test, parallel_seed_test  # noqa: E402

import airflock.learn as learn  # noqa: E402

BASE = {"agents": 12, "duration": 8.0, "world.side": 60.0, "start.separation": 3.0}
LAW = "vasarhelyi_2018/4ms"  # one driver for all that is compiled here
FEW = {"agents": 6, "duration": 3.0, "start.separation": 3.0}
OTHER = {"model": {"kind": "viragh_2014"}}
SEEN = {  # a preset, and what is changed in it
    "delay and noise": (LAW, {**FEW, "world.side": 60.0}),
    "some packets are lost": (LAW, {**FEW, "world.side": 60.0, "radio.loss": 0.5}),
    "links that keep packets": (LAW, {**FEW, "radio.kind": "links", "radio.received_near": 0.5, "world.side": 60.0}),
    "the two nearest are met": (LAW, {**FEW, "topology.kind": "nearest", "topology.k": 2, "world.side": 60.0}),
    "a periodic box": ("vicsek_1995/ordered", {"agents": 6, "duration": 10.0}),
    "a city in space": ("vasarhelyi_2018/city", {**FEW, "start.separation": 6.0}),
    "two laws": (LAW, {**FEW, "world.side": 60.0, "groups": [{"name": "a", "agents": 2, **OTHER}, {"name": "b"}]}),
    "two drop out": (LAW, {**FEW, "world.side": 60.0, "faults": [{"kind": "fails", "number": 2, "at": 1.0}]}),
}


def beside(scenario, own, other):
    """Offset to another state, to its nearest image in a periodic box."""
    offset = np.subtract(other[:3], own[:3])
    sides = np.array([scenario.world.side, scenario.world.side, scenario.world.height or 1.0])
    return offset - sides * np.round(offset / sides) if scenario.world.edges == "periodic" else offset


@pytest.mark.parametrize("case", SEEN)
def test_percepts_are_what_look_says_and_change_no_bit(case, seed):
    preset, settings = SEEN[case]
    scenario = airflock.load(preset, settings)
    open_ = {"seed": seed, "device": "python"}
    flight, plain = airflock.open(scenario, **open_, neighbours=4), airflock.open(scenario, **open_)
    every, d = round((scenario.sensors.period or scenario.flight.dt) / scenario.flight.dt), scenario.dimensions
    for _ in range(6):
        seen = flight.perceived()
        for i in np.flatnonzero(plain.present):
            view = plain.look(i)
            met = [other for other, meets in zip(view.heard, view.met, strict=True) if meets]
            offsets = [beside(scenario, view.own, other.state)[:d] for other in met]
            order = np.argsort([np.hypot.reduce(offset) for offset in offsets], kind="stable")[:4]
            count = len(order)
            assert seen.heard[i].tolist() == [1.0] * count + [0.0] * (4 - count)
            for place, k in enumerate(order):
                assert seen.offset[i, place] == pytest.approx(offsets[k], abs=1e-9)
                closing = np.subtract(met[k].state[3 : 3 + d], view.own[3 : 3 + d])
                assert seen.closing[i, place] == pytest.approx(closing, abs=1e-9)
                assert seen.age[i, place] == pytest.approx(met[k].age, abs=1e-9)
            assert seen.velocity[i] == pytest.approx(view.own[3 : 3 + d], abs=1e-9)
            assert not seen.offset[i, count:].any() and not seen.age[i, count:].any()
        for one in (flight, plain):
            one.advance(steps=every)
        assert np.array_equal(flight.state, plain.state, equal_nan=True)


def test_agents_of_a_law_that_asks_for_nobody_hear_what_arrives(seed):
    class Straight:
        """A law without neighbours."""

        COMMAND = "velocity"

        class Parameters(airflock.Parameters):
            """None."""

        def decide(own):  # noqa: N805
            return own.vx, own.vy, own.vz

    links = {"radio.kind": "links", "radio.received_near": 1.0, "radio.received_far": 1.0, "sensors.noise": 0.0}
    scenario = airflock.load(LAW, {**FEW, "world.side": 60.0, "radio.delay": 0.0, **links}, law=Straight)
    flight = airflock.open(scenario, seed=seed, device="python", neighbours=5).advance(0.4)
    seen, (x, y) = flight.perceived(), flight.measured[:2]
    apart = np.sort(np.hypot(x - x[:, None], y - y[:, None]), axis=1)[:, 1:]
    assert seen.heard.all() and np.hypot(*np.moveaxis(seen.offset, -1, 0)) == pytest.approx(apart, abs=0.2)


def test_rays_end_at_the_walls(seed):
    scenario = airflock.load(LAW, {**FEW, "world.side": 60.0, "sensors.noise": 0.0})
    flight = airflock.open(scenario, seed=seed, device="python", neighbours=0, rays=4)
    free, (x, y) = flight.perceived().free, flight.measured[:2]
    inside = [30.0 - x, 30.0 - y, 30.0 + x, 30.0 + y]  # east, north, west, south
    assert free == pytest.approx(np.maximum(inside, 0.0).T, abs=1e-6)


def test_offsets_lead_to_the_goal_and_rays_to_the_walls_of_a_corridor(seed):
    preset, settings, law = learn.SCENARIOS["Corridor"]
    scenario = airflock.load(preset, {**settings, "agents": 4, "start.separation": 3.0}, law=law)
    flight = airflock.open(scenario, seed=seed, device="python", neighbours=3, rays=4)
    seen, (x, y) = flight.perceived(), flight.measured[:2]
    assert seen.goal == pytest.approx(np.stack([130.0 - x, -y], axis=1), abs=1e-6)
    inside = np.abs(y) < 20.0
    assert inside.any() and seen.free[inside][:, 1] == pytest.approx(20.0 - y[inside], abs=1e-6)
    assert seen.free[inside][:, 0] == pytest.approx(np.minimum(150.0 - x[inside], 100.0), abs=1e-6)


def test_a_stuck_drone_flies_on_whatever_a_policy_commands(seed):
    calm = {**FEW, "world.side": 60.0, "body.noise": 0.0, "faults": [{"kind": "stuck", "agents": [0], "at": 1.0}]}
    flights = airflock.open_many(airflock.load(LAW, calm), [seed], neighbours=2, device="python")
    for step in range(15):
        flights.commands[0] = [1.0, 0.1 * step]
        flights.advance()
    north = flights.courses[0].state.motion[3]
    assert 0.2 < north[0] < 0.4  # what was commanded last before, from below
    assert north[1:] == pytest.approx(1.0, abs=0.1)  # behind 1.4 by the response of 1 s


def episode(env, seed, policy=lambda observations, info: info["law"]):
    """Fly an episode; rewards and the last info."""
    observations, info = env.reset(seed=seed)
    rewards, over = [], False
    while not over:
        observations, reward, ended, cut, info = env.step(policy(observations, info))
        rewards.append(reward)
        over = ended or cut
    return rewards, info


def test_a_law_as_policy_flies_the_closed_flight_and_earns_its_fitness(seed):
    env = learn.FlockEnv(LAW, BASE)
    closed = airflock.open(env.episodes.scenario, seed=seed)
    scores = closed.finish()
    rewards, info = episode(env, seed)
    assert np.array_equal(env.episodes.flights.courses[0].state.motion, closed.state)
    assert sum(rewards) == pytest.approx(scores["fitness"], abs=1e-12) == info["fitness"]
    assert len(rewards) == 40  # decisions of 0.2 s
    with pytest.raises(FlightError, match="the episode is over"):
        env.step(info["law"])


def test_flights_side_by_side_in_threads_have_the_bits_of_each_alone(seed):
    envs = learn.make_vec(LAW, 5, settings=BASE, threads=3)
    rng, totals = np.random.default_rng(seed), np.zeros(5)
    (_, info), over, flown = envs.reset(seed=seed), np.zeros(5, bool), []
    while not over.any():
        flown.append(rng.uniform(-4.0, 4.0, envs.action_space.shape).astype(np.float32))
        observations, rewards, _, over, info = envs.step(flown[-1])
        totals += rewards
    assert over.all() and totals == pytest.approx(info["fitness"], abs=1e-12)
    for number in range(5):
        flight = airflock.open(envs.episodes.scenario, seed=seed + number)
        for actions in flown:
            flight.command(range(12), actions[number]).advance(0.2)
        assert np.array_equal(flight.state, envs.episodes.flights.courses[number].state.motion)
    began, rewards, _, over, _ = envs.step(flown[0])  # the next episode begins, and nothing is earned
    assert not over.any() and not rewards.any() and not np.array_equal(began, observations)


def test_interfaces_keep_the_rules_of_gymnasium_and_pettingzoo(seed):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that observations have no bounds, and are not symmetric
        check_env(learn.FlockEnv(LAW, BASE), skip_render_check=True)
        parallel_api_test(learn.parallel_env(LAW, settings=BASE), num_cycles=60)
        parallel_seed_test(lambda: learn.parallel_env(LAW, settings=BASE), num_cycles=10)
        envs = gymnasium.make_vec("airflock/Flock-v0", num_envs=2, settings=BASE)
    assert {"airflock/Flock-v0", "airflock/Corridor-v0", "airflock/City-v0"} <= set(gymnasium.registry)
    assert envs.reset(seed=seed)[0].shape == envs.observation_space.shape == (2, 12, 52)


@pytest.mark.parametrize("name", learn.SCENARIOS)
def test_each_registered_scenario_has_a_fitness_and_bounded_commands(name):
    preset, settings, law = learn.SCENARIOS[name]
    scenario = airflock.load(preset, settings, law=law)
    assert scenario.metrics.rule.best == "fitness" and 0.0 < learn.largest_command(scenario) < 100.0


def test_an_agent_that_drops_out_is_terminated_and_the_others_fly_on(seed):
    faults = [{"kind": "fails", "agents": [2], "at": 1.0}]
    env = learn.parallel_env(LAW, agents=6, seed=seed, settings={**FEW, "faults": faults}, device="python")
    env.reset()
    left = {}
    while env.agents:
        *_, ended, cut, infos = env.step({agent: env.action_space(agent).sample() for agent in env.agents})
        left |= {agent: env.episodes.flights.courses[0].time for agent in ended if ended[agent]}
    assert left == {"agent_2": pytest.approx(1.0, abs=0.21)} and all(cut.values()) and len(infos) == 5


def test_a_collision_terminates_where_the_scenario_says_so(seed):
    env = learn.FlockEnv(LAW, {**FEW, "duration": 60.0, "metrics.stop": "collision"}, device="python", neighbours=1)
    _, info = env.reset(seed=seed)
    total, ended, cut = 0.0, False, False
    while not (ended or cut):
        x = env.episodes.flights.courses[0].state.motion[:2]
        to_middle = np.clip(x.mean(axis=1) - x.T, -4.0, 4.0)  # all fly to one place
        _, reward, ended, cut, info = env.step(to_middle.astype(np.float32))
        total += reward
    assert ended and not cut and env.episodes.flights.scores(0)["n_coll"] > 0.0
    assert total == pytest.approx(info["fitness"], abs=1e-12)


@pytest.mark.parametrize(
    "action, match",
    [
        (np.zeros((12, 3)), r"its shape is \(12, 3\); give \(12, 2\)"),
        (np.full((12, 2), np.nan), r"agent_0: action \[nan, nan\] is not in Box"),
        (np.full((12, 2), 6.1), "agent_0: action .* is not in Box"),
        ("fly", "its shape"),
    ],
)
def test_an_action_that_does_not_fit_is_refused_in_one_line(action, match):
    env = learn.FlockEnv(LAW, BASE)
    env.reset(seed=1)
    with pytest.raises(FlightError, match=match) as caught:
        env.step(action)
    assert "\n" not in str(caught.value)


def test_what_cannot_be_observed_or_rewarded_is_refused():
    env = learn.parallel_env(LAW, settings=BASE)
    with pytest.raises(FlightError, match="reset"):
        env.step({})
    env.reset()
    with pytest.raises(FlightError, match="agent_3: None; each of env.agents acts, in Box"):
        env.step({agent: env.action_space(agent).sample() for agent in env.agents if agent != "agent_3"})
    with pytest.raises(FlightError, match="agent_12: .* each of env.agents"):
        env.step({f"agent_{i}": np.zeros(2) for i in range(13)})
    with pytest.raises(FlightError, match="agent_0: .* each of env.agents"):
        env.step({agent: ["a", "b"] for agent in env.agents})
    with pytest.raises(FlightError, match="2 seeds for 1 flights"):
        learn.make_vec(LAW, settings=BASE).reset(seed=[1, 2])
    with pytest.raises(FlightError, match="largest = -1.0: give a positive number"):
        learn.parallel_env(LAW, settings=BASE, largest=-1.0)
    with pytest.raises(FlightError, match="neighbours = 12: give 0 to 11; of 12 agents"):
        learn.parallel_env(LAW, settings=BASE, neighbours=12)
    with pytest.raises(AirflockError, match="agents = 0 lies outside"):
        learn.parallel_env(LAW, agents=0, settings=BASE)
    with pytest.raises(FlightError, match="metrics.kind = 'order' has no fitness"):
        learn.parallel_env("couzin_2002/torus")
    with pytest.raises(FlightError, match="before all have observed"):
        airflock.open("zapotecatl_2016/best", neighbours=3)
    with pytest.raises(FlightError, match="nothing stands in this world"):
        airflock.open("vicsek_1995/ordered", rays=8)
    with pytest.raises(FlightError, match="nobody observes"):
        airflock.open(LAW).perceived()
    with pytest.raises(AirflockError, match="2 scenarios for 3 seeds"):
        airflock.open_many([LAW, LAW], range(3))


@pytest.mark.parametrize(
    "open_", [lambda **keys: airflock.open(LAW, **keys), lambda **k: airflock.open_many(LAW, 1, **k)]
)
@pytest.mark.parametrize(
    ("keys", "match"),
    [
        ({"device": "cuda"}, "device = 'cuda': an open flight flies on cpu or python"),
        ({"neighbours": 2.5}, "neighbours = 2.5: give 0 to 32"),
        ({"neighbours": 1, "rays": "8"}, "rays = '8': give 0 to 32"),
    ],
)
def test_one_flight_and_many_refuse_the_same_devices_and_observers(open_, keys, match):
    with pytest.raises(FlightError, match=match):
        open_(**keys)


def test_seeds_of_many_flights_are_one_or_a_list_or_an_array_of_whole_numbers():
    envs = learn.make_vec(LAW, 2, settings=BASE)
    first, _ = envs.reset(seed=4)
    for seeds in ([4, 5], (4, 5), np.array([4, 5])):
        assert np.array_equal(envs.reset(seed=seeds)[0], first)
    for seeds in (1.5, "4", [4, 5.5], -1):
        with pytest.raises(AirflockError, match="seed = "):
            envs.reset(seed=seeds)
