"""N pilots that hear as a card says and carry its map fly what the simulator flies, and what a pilot is.

That pilots fly any valid scenario as the simulator does is in `test_random_scenarios.py`: the reference is N pilots.
"""

import json
import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import airflock
from airflock.core.contract import State, call_rule
from airflock.core.model import model
from airflock.core.parameters import choices
from airflock.core.pilot import PacketPolicy, Pilot
from airflock.core.silence import Parameters as Silence, could_be_near, counts, for_standing_neighbour, with_defaults
from airflock.drones.onboard.card import to_tuples
from airflock.fleets.card_document import to_json_table
from airflock.parts import BODIES, RADIOS
from airflock.parts.laws import dimock_2003, vasarhelyi_2018, vicsek_1995
from airflock.support.errors import RuleError
from airflock.world import arena
from airflock.world.world_map import Shapes, WorldMap, counter_clockwise, polygon_error
from flocks import ISLANDS, PENTAGON

QUIET = {"sensors.noise": 0.0, "body.noise": 0.0, "duration": 10.0, "metrics.period": 0.2}
FLIGHTS = {
    "square": ("vasarhelyi_2018/real_4ms", {"agents": 8, "world.side": 90.0}),
    "islands": ("vasarhelyi_2018/obstacles", {"agents": 7, "world.side": 130.0, "world.obstacles": ISLANDS}),
    "silo": ("viragh_2014/4ms", {
        "world.walls": "every_edge",
        "agents": 6, "world.dimensions": "3", "world.arena": "circle", "world.radius": 48.0, "world.height": 50.0,
    }),
    "pentagon": ("vasarhelyi_2018/4ms", {
        "agents": 6, "world.arena": "polygon", "world.corners": PENTAGON, "world.walls": "every_edge",
        "radio.kind": "links", "radio.delay": 0.3, "radio.near": 500.0, "radio.far": 600.0,
        "radio.received_near": 1.0, "radio.fast_rate": 50.0,
    }),
    "forest": ("kidger/forest", {"agents": 3, "body.noise": None, "duration": 0.7, "goals.kind": "none"}),
    "boids": ("zapotecatl_2016/best", {"agents": 8, "body.noise": None, "duration": 0.5, "update": "synchronous"}),
    "nearest": ("vasarhelyi_2018/4ms", {"agents": 8, "topology.kind": "nearest", "topology.k": 2, "duration": 4.0}),
    "seen": ("vasarhelyi_2018/4ms", {
        "agents": 8, "world.obstacles": ISLANDS, "topology.kind": "visible", "topology.radius": 3.0,
        "duration": 4.0,
    }),
    "swarm": ("couzin_2002/torus", {"agents": 10, "body.noise": None, "duration": 3.0}),
}  # fmt: skip
PLAIN = PacketPolicy.simulated(RADIOS["constant"], RADIOS["constant"].Parameters())


def place_of(scenario):
    """The world of a scenario as a drone carries it: read from the text of a card."""
    stands, rule = scenario.stands(), scenario.model.wall_reach
    tables = {"shapes": stands.shapes.tolist(), "nodes": stands.nodes.tolist(), "links": stands.links.tolist()}
    text = json.dumps({"world": to_json_table(scenario.world), "shapes": tables})
    read = json.loads(text)
    look = 1e30 if rule is None else rule(scenario.parameters)
    world = arena.Parameters(**to_tuples(read["world"]))
    return WorldMap(world, Shapes(**read["shapes"]), look=look, casts=scenario.model.sight is not None)


@cache
def build(name):
    preset, changed = FLIGHTS[name]
    return airflock.load(preset, {k: v for k, v in (QUIET | changed).items() if v is not None})


def fly(scenario, start, seed):
    """Positions (time, agent, axis) of N pilots and their bodies; packets arrive after the delay, all of them."""
    n, dims, dt, k = scenario.agents, scenario.dimensions, scenario.flight.dt, scenario.radio.numbers
    every, late = max(1, round(scenario.sensors.period / dt)), round(k.delay / dt)
    period, sampled = every * dt, max(1, round(scenario.resolved_metrics().period / dt))
    hearing = PacketPolicy(extrapolate=k.kind == "links", forget=late * dt + 0.5 * period)
    pilots = [
        Pilot(
            scenario.model, scenario.parameters, place_of(scenario), index=i, period=period, hearing=hearing,
            body=scenario.body.rule, b=scenario.body.numbers, flat=dims == 2, seed=seed,
            topology=scenario.topology.rule, t=scenario.topology.numbers,
        )
        for i in range(n)
    ]  # fmt: skip
    pad = (0.0,) * (3 - dims)
    now = [State(*map(float, start[:dims, i]), *pad, *map(float, start[dims:, i]), *pad) for i in range(n)]
    past, frames, commands = [now], [], [(0.0, 0.0, 0.0)] * n
    for step in range(round(scenario.flight.duration / dt) + 1):
        if step % every == 0:
            said = past[max(step - late, 0)]
            for i, pilot in enumerate(pilots):
                for j in range(n):
                    if math.dist(now[i][:3], now[j][:3]) <= k.range:
                        pilot.receive(j, said[j], (step - late) * dt, step * dt)
                    else:
                        pilot.forget(j)
                commands[i] = pilot.decide(now[i], step * dt).command
        if step % sampled == 0:
            frames.append([s[:dims] for s in now])
        now = [moved(scenario, s, c, dt) for s, c in zip(now, commands, strict=True)]
        past.append(now)
    return np.array(frames)


def moved(scenario, s, c, dt):
    body = scenario.body.rule
    known = {"v": s[3:], "m": s[3:], "c": c, "g": (0.0,) * 3, "w": (0.0,) * 3}
    given = {a + axis: v[k] for a, v in known.items() for k, axis in enumerate("xyz")}
    velocity = call_rule(body.move, "move", given | {"dt": dt, "b": scenario.body.numbers}, body.name)
    old = choices(scenario.body.numbers).get("integration", body.integration) == "old"
    vx, vy, vz = s[3:] if old else velocity
    x, y, z = s.x + vx * dt, s.y + vy * dt, s.z + vz * dt
    if scenario.world.edges == "bounce":
        half = 0.5 * scenario.world.side
        flip = [-1.0 if abs(a) > half else 1.0 for a in (x, y)]
        x, y = (min(max(a, -half), half) for a in (x, y))
        velocity = (flip[0] * velocity[0], flip[1] * velocity[1], velocity[2])
    return State(x, y, z, *velocity)


@pytest.mark.parametrize("name", FLIGHTS)
def test_pilots_fly_what_the_simulator_flies(name):
    scenario, seed = build(name), 3
    begun = airflock.simulate(scenario, seed, precision=64, device="python")
    dims = scenario.dimensions
    first = begun.isel(time=0)
    axes = [first.position.values, first.velocity.values]
    start = np.concatenate([a.reshape(dims, -1)[:, : scenario.agents] for a in axes])
    theirs = begun.position.transpose("time", "individual", "space", ...).values.reshape(-1, scenario.agents, dims)
    ours = fly(scenario, start, seed)
    assert ours.shape == theirs.shape
    assert np.abs(ours - theirs).max() < 1e-9


@pytest.mark.parametrize("name", ["square", "islands", "silo", "pentagon", "forest"])
@given(at=st.tuples(st.floats(-150, 150), st.floats(-150, 150), st.floats(-60, 60)), turn=st.floats(0, 6.28))
@settings(max_examples=60, deadline=None)
def test_a_place_read_from_a_card_is_the_world_of_the_flight(name, at, turn):
    from airflock.scenarios.flight_world import FlightWorld as Engine

    scenario = build(name)
    ours, theirs = place_of(scenario), Engine(scenario)
    x, y, z = at if scenario.dimensions == 3 else (*at[:2], 0.0)
    u = (math.cos(turn), math.sin(turn), 0.0)
    assert list(ours.surfaces(x, y, z)) == list(theirs.surfaces(x, y, z))
    assert ours.excursion(x, y, z) == theirs.excursion(x, y, z)
    assert ours.ray(x, y, z, *u, 70.0) == theirs.ray(x, y, z, *u, 70.0)
    assert ours.cast(x, y, z, *u, 70.0, 0.5) == theirs.cast(x, y, z, *u, 70.0, 0.5)


@given(st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=3, max_size=7))
@settings(max_examples=200)
def test_polygons_are_judged_as_shapely_judges_them(corners):
    from shapely.geometry import Polygon

    from airflock.scenarios.scenario_checks import polygon_error as theirs

    whole = [(round(x, 1), round(y, 1)) for x, y in corners]
    shape = Polygon(whole)
    if len(set(whole)) < len(whole) or (shape.is_valid and shape.area < 1.0):
        return  # repeated corners and slivers: a matter of rounding
    assert bool(polygon_error(whole)) == bool(theirs(whole)), whole
    if not theirs(whole):
        assert Polygon(counter_clockwise(whole)).exterior.is_ccw


# ------------------------------------------------------------------------------------------------ what a pilot is


def pilot(**more):
    law = model(vasarhelyi_2018)
    return Pilot(
        law, law.Parameters(), WorldMap(arena.Parameters()), **({"index": 0, "period": 0.2, "flat": True} | more)
    )


def test_a_law_that_no_single_drone_can_fly_is_refused_when_the_pilot_is_made():
    flock = model(dimock_2003)
    with pytest.raises(RuleError, match="whole flock"):
        Pilot(flock, flock.Parameters(), WorldMap(arena.Parameters()), index=0, period=0.2)
    heading = model(vicsek_1995)
    with pytest.raises(RuleError, match="give a body"):
        Pilot(heading, heading.Parameters(), WorldMap(arena.Parameters()), index=0, period=0.2)
    with pytest.raises(RuleError, match="not positive"):
        pilot(period=0.0)


def test_only_the_newest_sound_packet_counts():
    one = pilot()
    assert one.receive(3, State(1.0, 2.0, 0.0, 1.0, 0.0, 0.0), 5.0, 5.1)
    assert not one.receive(3, State(9.0, 9.0, 0.0, 0.0, 0.0, 0.0), 4.9, 5.2)
    assert not one.receive(3, State(9.0, 9.0, 0.0, 0.0, 0.0, 0.0), 5.0, 5.2)
    assert not one.receive(3, State(9.0, 9.0, 0.0, 0.0, 0.0, 0.0), 5.9, 5.2)
    assert not one.receive(3, State(math.nan, 9.0, 0.0, 0.0, 0.0, 0.0), 5.15, 5.2)
    assert not one.receive(4, State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), math.nan, 5.2)
    assert not one.receive(0, State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 5.1, 5.2)
    (heard,) = one.heard(7.0)
    assert heard.state == State(3.0, 2.0, 0.0, 1.0, 0.0, 0.0) and heard.age == 2.0
    assert not one.heard(10.1)


def test_a_simulated_radio_of_one_delay_is_heard_once_and_believes_every_clock():
    one = pilot(hearing=PLAIN)
    own, east = State(0.0, 0.0, 0.0, 2.0, 0.0, 0.0), State(9.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    assert one.receive(1, east, 7.0, 5.0), "its clock is 2 s ahead"
    assert one.receive(1, east._replace(x=8.0), 4.0, 5.0), "now it is right again"
    (heard,) = one.heard(5.0)
    assert heard.state.x == 8.0 and heard.age == 1.0
    met, alone = one.decide(own, 5.0).command, one.decide(own, 5.2).command
    assert met != alone and not one.heard(5.2)
    links = pilot(hearing=PacketPolicy.simulated(RADIOS["links"], RADIOS["links"].Parameters()))
    links.receive(1, east, 4.0, 5.0)
    links.decide(own, 5.0)
    assert links.heard(500.0)[0].state.x == 9.0 + 496.0


def test_who_is_out_of_sight_does_not_count():
    one, own = pilot(), State(0.0, 0.0, 0.0, 2.0, 0.0, 0.0)
    alone = one.decide(own, 1.0).command
    one.receive(1, State(9.0, 0.0, 0.0, 1.0, 0.0, 0.0), 1.0, 1.0)
    assert one.decide(own, 1.0, visible=()).command == alone != one.decide(own, 1.0, visible={1}).command


def test_an_autopilot_is_asked_for_a_velocity_whatever_the_law_commands():
    law, turning = model(vicsek_1995), BODIES["heading"]
    b = turning.Parameters()
    one = Pilot(law, law.Parameters(), WorldMap(arena.Parameters()), index=0, period=0.2, flat=True, body=turning, b=b)
    own = State(0.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    assert math.hypot(*one.steer(own, 0.0)) == pytest.approx(b.speed)


@given(st.floats(0, 200), st.floats(0, 60), st.floats(0, 60))
def test_a_lost_neighbour_comes_nearer_with_silence_and_is_given_up(distance, age, longer):
    s = with_defaults(Silence(rule="stop"), 4.0)
    if could_be_near(distance, age, s) and age + longer < s.forget:
        assert could_be_near(distance, age + longer, s), "silence never makes it safe before it is given up"
    assert not could_be_near(distance, s.forget, s)
    assert not could_be_near(distance, min(age, s.patience), s), "data younger than the patience stop nobody"


@given(st.floats(0, 200), st.floats(0, 60), st.floats(0, 1), st.floats(0, 20))
def test_who_said_that_it_holds_may_have_flown_on_with_the_flock_unnoticed_no_nearer_than_is_kept(
    distance, age, share, speed
):  # fmt: skip
    """Whatever part of the time it has flown towards here at up to the flock's speed: within `keep` it stops us."""
    s = with_defaults(Silence(rule="stop"), speed)
    slow = for_standing_neighbour(s)
    flown = (speed or 4.0) * share * age
    if s.patience < age < s.forget and distance - flown < s.keep - 1e-6:
        assert could_be_near(distance, age, slow)
    if could_be_near(distance, age, slow):
        assert could_be_near(distance, age, s), "who said nothing of that kind is feared at least as much"


def test_a_pilot_stops_later_for_whom_it_lost_when_it_held():
    """At 60 m: a neighbour that flew with the flock could be near after 7 s, one that hovered not before 14 s."""
    stops = []
    for stands in (False, True):
        one, own = pilot(silence=Silence(rule="stop", closing=8.0)), State(0.0, 0.0, 0.0, 2.0, 0.0, 0.0)
        one.receive(1, State(60.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.0, 0.0, is_standing=stands)
        stops.append([age for age in range(1, 20) if one.lost_near(own, float(age))][0])
    assert stops == [7, 14]
    one.receive(1, State(60.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.5, 0.5)
    assert one.lost_near(own, 8.0), "its last word counts"


@given(st.floats(0, 60), st.floats(0, 200))
def test_a_neighbour_counts_as_heard_or_as_lost_but_never_as_both(age, distance):
    s = with_defaults(Silence(rule="stop"), 4.0, delay=1.0)
    assert not (counts(age, s) and could_be_near(distance, age, s))
    if age < s.forget:
        assert counts(age, s) or could_be_near(0.0, age, s)


def test_a_missing_packet_does_not_make_a_pilot_forget_who_sent_the_last():
    """With the rule of silence the law hears it until it is lost; without, it is gone at the next decision."""
    hearing, own = (
        PLAIN,
        State(0.0, 0.0, 0.0, 2.0, 0.0, 0.0),
    )
    for rule, known in ((Silence(rule="stop", patience=1.5), True), (None, False)):
        one = pilot(silence=rule, hearing=hearing)
        one.receive(1, State(6.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.0, 1.0)
        assert one.heard(1.0)
        one.decide(own, 1.0)
        assert bool(one.heard(1.4)) is known and not one.heard(1.6)


def test_who_is_lost_when_its_packet_comes_is_not_heard():
    """A patience shorter than the delay: the simulator hears nobody then, and so does its pilot."""
    one = pilot(silence=Silence(rule="stop", patience=0.3), hearing=PLAIN)
    one.receive(1, State(6.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.0, 0.35)
    assert not one.heard(0.35) and one.heard(0.25)


def test_a_pilot_stops_for_whom_it_has_lost_and_flies_on_when_heard_again():
    one, own = pilot(silence=Silence(rule="stop", patience=2.0)), State(0.0, 0.0, 0.0, 2.0, 0.0, 0.0)
    one.receive(1, State(20.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.0, 0.0)
    assert math.hypot(*one.decide(own, 1.9).command[:2]) > 1.0
    assert one.decide(own, 4.0).command == (0.0, 0.0, 0.0)
    away = own._replace(x=1.5, y=-2.0)
    assert one.decide(away, 4.05).command == pytest.approx((-0.75, 1.0, 0.0)), "back to where it stopped"
    one.receive(1, State(20.0, 0.0, 0.0, 0.0, 0.0, 0.0), 4.0, 4.1)
    assert one.decide(away, 4.2).command == pytest.approx((-0.75, 1.0, 0.0)), "it stands for a second more"
    assert math.hypot(*one.decide(own, 5.1).command[:2]) > 1.0
    assert one.steer(own, 9.0) == (0.0, 0.0, 0.0)
    one.forget(1)
    assert not one.lost_near(own, 9.0)
