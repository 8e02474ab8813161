"""Any law flies any robot: commands are converted where the body takes another kind than the law gives."""

import math
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import pytest

import airflock
from against_reference import compared
from airflock.core import Own
from airflock.drones.onboard.card import CardError, card_hash, parse_card
from airflock.engine import fly_world
from airflock.fleets.card_document import make_card_document
from airflock.parts import BODIES, SENSORS
from airflock.parts.steering import NO_LIMIT, STEERING, Parameters, law_for_command
from airflock.scenarios import build_scenario
from airflock.scenarios.named_code import MODELS, find_law
from airflock.support import RuleError, ScenarioError
from scenarios_drawn import Draw


def flown(law, body, **more):
    """A flight of a law on a body of a preset."""
    settings = {"agents": 10, "duration": 60.0, "body.kind": body, "world.side": 400.0, **more}
    return airflock.load("vasarhelyi_2018/4ms", settings, law=law)


def converted(rule, command, **given):
    """A command as a rule converts it."""
    values = given | dict(zip(("cx", "cy", "cz"), command, strict=True))
    return rule(*(values[name] for name in rule.__code__.co_varnames[: rule.__code__.co_argcount]))


@pytest.mark.parametrize(
    ("pair", "rule"), STEERING.items(), ids=lambda value: "-".join(value) if isinstance(value, tuple) else ""
)
def test_a_conversion_there_and_back_is_the_command_itself(pair, rule):
    own, steer = (
        Own(1.0, 2.0, 0.0, 0.4472135954999579, 0.8944271909999159, 0.0),
        Parameters(speed=4.0, turn=NO_LIMIT, response=0.5),
    )
    back = STEERING[pair[::-1]]
    command = {"heading": (0.6, 0.8, 0.0), "velocity": (2.4, 3.2, 0.0), "acceleration": (1.0, -1.0, 0.0)}[pair[0]]
    given = {"own": own, "period": 0.1, "steer": steer}

    again = converted(back, converted(rule, command, **given), **given)
    if "heading" not in pair or pair[0] == "heading":
        assert again == pytest.approx(command, abs=1e-6)
    else:  # a heading keeps the direction of what was wanted, and no more
        wanted = np.array(command) if pair[0] == "velocity" else np.array(own[:3]) + 0.5 * np.array(command)
        found = np.array(again) if pair[0] == "velocity" else np.array(own[:3]) + 0.5 * np.array(again)
        assert found / np.linalg.norm(found) == pytest.approx(wanted / np.linalg.norm(wanted), abs=1e-6)


@pytest.mark.parametrize(
    ("pair", "rule"), STEERING.items(), ids=lambda value: "-".join(value) if isinstance(value, tuple) else ""
)
def test_a_conversion_is_the_same_in_other_units(pair, rule):
    """Lengths in feet and times in minutes: no number is hidden in a rule."""
    length, time = 1.0 / 0.3048, 1.0 / 60.0
    factor = {"heading": 1.0, "velocity": length / time, "acceleration": length / time**2}
    own, p = Own(1.0, 2.0, 0.5, 2.0 / 3.0, 2.0 / 3.0, 1.0 / 3.0), Parameters(speed=3.0, turn=0.4, response=0.5)
    command = {"heading": (0.6, 0.8, 0.0), "velocity": (2.4, -3.2, 1.0), "acceleration": (1.0, -1.0, 0.3)}[pair[0]]
    v = factor["velocity"]
    scaled = Parameters(speed=3.0 * v, turn=0.4 / time, response=0.5 * time)
    there = Own(1.0 * v, 2.0 * v, 0.5 * v, *own[3:])
    here = converted(rule, command, own=own, period=0.1, steer=p)
    again = converted(rule, [c * factor[pair[0]] for c in command], own=there, period=0.1 * time, steer=scaled)
    assert again == pytest.approx([c * factor[pair[1]] for c in here], rel=1e-6)


def test_a_heading_turns_by_at_most_the_largest_rate():
    rule, own = STEERING["heading", "velocity"], Own(2.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    x, y, z = rule(0.0, 1.0, 0.0, own, 0.1, Parameters(speed=3.0, turn=2.0, response=1.0))
    assert math.atan2(y, x) == pytest.approx(0.2) and math.hypot(x, y) == pytest.approx(3.0) and z == 0.0


@pytest.mark.parametrize(("law", "body"), [("couzin_2002", "multirotor"), ("reynolds_1987", "quadrotor"),
                                           ("vasarhelyi_2018", "heading"), ("viragh_2014", "steered")])  # fmt: skip
def test_a_steered_flight_is_that_of_the_pilots(law, body):
    scenario = flown(law, body, agents=6, duration=4.0)
    assert scenario.model.steer is not None
    assert compared(Draw(scenario, 3, None, {})).agrees


def test_a_group_of_another_law_and_command_is_that_of_the_pilots():
    fish = [{"name": "fish", "agents": 2, "model": {"kind": "couzin_2002"}}]
    scenario = airflock.load("vasarhelyi_2018/4ms", {"agents": 6, "duration": 4.0, "groups": fish})
    assert scenario.laws[1].model.steer is not None
    assert compared(Draw(scenario, 3, None, {})).agrees


FLOWN = [name for name in MODELS if name not in ("formation", "network")]
OWN_BODIES = {"chen_2014": "direct", "dimock_2003": "direct", "reynolds_1987": "steered"}  # of laws that come to rest


@pytest.mark.parametrize("name", FLOWN)
def test_every_law_flies_multirotors_and_quadrotors_at_more_than_half_of_its_speed(name):
    """A law without a preferred speed is compared with the same flight on a body without inertia."""
    law = next((each for each in (f"{name}/drones", f"{name}/natural") if each in airflock.presets()), name)

    def speed(body):
        settings = {"agents": 3, "duration": 16.0, "dt": 0.04, "metrics.period": 2.0, "start.kind": "ball"}
        settings |= {"start.radius": 25.0, "start.separation": 10.0, "start.speed": 2.0}
        more = {"body.speed_max": 4.0} if body == "steered" else {}
        scenario = airflock.load("vasarhelyi_2018/4ms", {**settings, "body.kind": body, **more}, law=law)
        recording = airflock.simulate(scenario, seed=1, device="python")
        assert np.isfinite(recording["position"].values).all()
        speeds = np.linalg.norm(recording["velocity"].values[4:], axis=1)  # without the first 8 s
        return float(speeds.mean()), scenario.resolved_metrics().v_flock

    own = speed(OWN_BODIES[name])[0] if name in OWN_BODIES else None
    for body in ("multirotor", "quadrotor"):
        mean, preferred = speed(body)
        assert mean > 0.5 * (preferred if own is None else own)


QUIET = {"couzin_2002": {"sigma": 0.0}, "couzin_2005": {"sigma": 0.0}, "vicsek_1995": {"eta": 0.0, "r": 6.0}}
CONVERTED = [name for name in FLOWN if find_law(name).command != "velocity"]


def pursued(name, agents, dt, steered, seed):
    """Where agents are after 10 s: on the body of the law, or converted on one that obeys at once."""
    rng = np.random.default_rng(seed)
    start = np.vstack([rng.uniform(-4.0, 4.0, (2, agents)), rng.normal(0.0, 2.0, (2, agents))])
    heading = find_law(name).command == "heading"
    keys = {f"model.{key}": value for key, value in QUIET.get(name, {}).items()}
    keys |= {"agents": agents, "duration": 10.0, "dt": dt, "world.arena": "none", "world.walls": "every_edge"}
    keys |= {"start.kind": "ball", "start.radius": 5.0, "start.separation": 0.0, "metrics.kind": "order"}
    keys |= {"sensors.kind": "perfect", "sensors.period": 0.0, "radio.delay": 0.0, "metrics.period": 1.0}
    limits = {"speed": 3.0, "turn": 0.7} if heading else {"speed": 1e3}
    own = limits if heading else {"speed_max": 1e3}
    keys |= {f"steer.{key}": value for key, value in limits.items()} if steered else {
        f"body.{key}": value for key, value in own.items()
    }  # fmt: skip
    keys["body.kind"] = "direct" if steered else "heading" if heading else "steered"
    scenario = build_scenario({"model": {"kind": name}}, "pursued", keys)
    return fly_world(scenario, 1, precision=64, record=True, start=start, device="python").frames[-1][:2]


@pytest.mark.parametrize("name", CONVERTED)
def test_on_an_ideal_body_a_converted_law_has_the_bits_of_its_own_body(name, seed):
    for agents in (2, 5):
        assert (pursued(name, agents, 0.1, True, seed) == pursued(name, agents, 0.1, False, seed)).all()


@pytest.mark.parametrize("agents", [2, 5])
def test_the_error_of_a_converted_law_falls_at_least_as_fast_as_the_time_step(agents):
    """Cucker and Smale's law, which is smooth: against a thirty-second of the longest step."""
    exact = pursued("cucker_smale_2007", agents, 0.003125, False, 5)
    errors = [np.abs(pursued("cucker_smale_2007", agents, dt, True, 5) - exact).max() for dt in (0.1, 0.05, 0.025)]
    assert min(np.log2(np.divide(errors[:-1], errors[1:]))) >= 0.9


def test_a_law_by_the_name_of_a_preset_brings_its_numbers_and_leaves_the_robot():
    scenario = airflock.load("vasarhelyi_2018/8ms", {"agents": 9}, law="couzin_2002/drones")
    taken = airflock.load("couzin_2002/drones")
    assert scenario.parameters == taken.parameters and scenario.steer == taken.steer
    assert scenario.world == airflock.load("vasarhelyi_2018/8ms").world and scenario.model.name == "couzin_2002"
    assert any("couzin_2002/drones" in note for note in scenario.notes)
    by_hand = airflock.load("vasarhelyi_2018/8ms", {"model.r_r": 9.0}, law="couzin_2002/drones")
    assert by_hand.parameters.r_r == 9.0 and by_hand.parameters.dr_o == taken.parameters.dr_o


def test_a_law_that_replaces_another_flies_its_body_at_its_speed():
    scenario = airflock.load("vasarhelyi_2018/8ms", {"body.tau": 0.7}, law="couzin_2002")
    assert scenario.body.rule.name == "multirotor" and scenario.body.tau == 0.7
    steer = scenario.resolved_steer()
    assert (steer.speed, steer.response) == (8.0, 0.7)
    assert any("[steer]" in note for note in scenario.notes)


def test_a_converted_group_law_is_noted_and_flies_from_a_card_as_from_its_scenario():
    fish = [{"name": "fish", "agents": 2, "model": {"kind": "couzin_2002"}}]
    scenario = airflock.load("vasarhelyi_2018/real_4ms", {"agents": 4, "groups": fish})
    assert scenario.model.steer is None and any("model couzin_2002 commands becomes" in n for n in scenario.notes)
    made = make_card_document(scenario, site=(47.5, 19.04, 120.0), members=[1, 2, 3, 4], mission=1, expires=1)
    card = parse_card({**made, "hash": card_hash(made)})
    steered = [law for law, _, _ in card.own if law.steer is not None]
    assert len(steered) == 2 and card.steer == scenario.resolved_steer()
    del made["steer"]
    with pytest.raises(CardError, match=r"steer\.speed is missing"):
        parse_card({**made, "hash": card_hash(made)})


def test_a_drag_descent_is_added_to_what_the_body_takes_or_refused():
    preset, few = "vasarhelyi_2018/fixed_wing", {"agents": 4, "duration": 2.0}
    fish = airflock.load(preset, few, law="couzin_2002").model
    assert fish.command == "velocity" and fish.added is not None and fish.steer is not None
    with pytest.raises(ScenarioError, match="drag_descent velocity: no sum of the two"):
        airflock.load(preset, few | {"body.kind": "heading"})
    with pytest.raises(RuleError, match="is a sum that commands a velocity; the body takes a heading"):
        law_for_command(airflock.load(preset, few).model, "heading")


def test_a_note_names_the_speed_at_which_a_converted_law_flies():
    """A body that takes a heading flies at its own speed, so the speed of [steer] is not named."""
    for law, body in (("vasarhelyi_2018", "heading"), ("couzin_2002", "multirotor")):
        scenario = flown(law, body, agents=9, duration=8.0)
        (note,) = (each for each in scenario.notes if "becomes the" in each)
        named = float(note.partition("speed = ")[2].split()[0])
        recording = airflock.simulate(scenario, seed=1, device="python")
        speeds = np.linalg.norm(recording["velocity"].values[-1], axis=0)
        assert float(np.median(speeds)) == pytest.approx(named, rel=0.1)


class Crawl:
    COMMAND, preferred_speed = "heading", lambda p: p.pace

    @dataclass(frozen=True, kw_only=True)
    class Parameters(airflock.Parameters):
        pace: float = airflock.quantity(2.0, "m/s", low=0.0, high=9.0, meaning="preferred speed")

    def decide(own):
        return own.hx, own.hy, own.hz


def test_the_speed_of_a_converted_heading_is_the_one_that_the_fitness_expects():
    for law in ("couzin_2002", airflock.model(Crawl)):
        scenario = airflock.load("vasarhelyi_2018/8ms", law=law)
        assert scenario.resolved_steer().speed == scenario.resolved_metrics().v_flock
    assert scenario.resolved_steer().speed == 2.0


@pytest.mark.parametrize("unsound", ["", "agents = 1000000\n", "[model]\np_repp = 3.0\n"])
def test_the_robot_stays_where_a_file_needs_the_callers_parts_and_settings(unsound, tmp_path):
    """Another law on a file that does not fly by itself: its body is still that of the file."""
    file = tmp_path / "mine.toml"
    file.write_text(f'extends = "vasarhelyi_2018/8ms"\n{unsound}')
    own = replace(next(iter(SENSORS.values())), name="own")
    scenario = airflock.load(file, {"agents": 9}, law="couzin_2002", sensor=own)
    assert scenario.body.rule.name == "multirotor"
    assert scenario.resolved_steer().speed == (1.0 if "p_repp" in unsound else 8.0)


def test_a_law_on_a_body_that_takes_its_command_is_not_steered():
    own = [name for name in airflock.presets() if not name.endswith("/drones")]  # those are there for other bodies
    assert all(airflock.load(name).model.steer is None for name in own)
    assert set(STEERING) == {
        pair for pair in product(("velocity", "acceleration", "heading"), repeat=2) if len(set(pair)) == 2
    }
    assert {BODIES[name].accepts for name in BODIES} <= {"velocity", "acceleration", "heading"}
