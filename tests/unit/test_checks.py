"""The standing list: every shipped law, order parameter and body passes it, and it finds what is planted."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import pytest

import airflock
from airflock.check.models import check_model
from airflock.check.parts import check_body, check_fault, check_metric, check_radio, check_sensor, check_topology
from airflock.check.truths import CheckError, UnitScale, unit_factor
from airflock.core.body import body
from airflock.core.fault import fault
from airflock.core.metric import metric
from airflock.core.model import model
from airflock.core.radio import radio
from airflock.core.sensor import sensor
from airflock.core.topology import topology
from airflock.parts import BODIES, KINDS, LAWS, METRICS, SETS
from airflock.parts.laws import vasarhelyi_2018, viragh_2014
from airflock.parts.laws.vasarhelyi_2018 import Sums
from airflock.scenarios.named_code import MODELS, find_law
from airflock.support.errors import RuleError, ScenarioError


@pytest.mark.parametrize("name", [name for name in MODELS if name != "dimock_2003"])
def test_every_law_keeps_the_standing_list_or_says_what_it_breaks(name):
    """What a law says that it breaks, it does break, in a plane or in space: a reason is no cloak."""
    reports = [check_model(name, dimensions=dimensions) for dimensions in (2, 3)]
    assert {key for report in reports for key in report.broken} == set(find_law(name).violates)


def test_a_law_that_solves_for_the_flock_keeps_the_standing_list():
    assert set(check_model("dimock_2003").broken) == {"rotation", "units"}
    # the hidden number is the guard of Eq. 4's direction, and nothing else
    pairwise = replace(find_law("dimock_2003"), violates={"rotation": "forward is along x"})
    assert check_model(pairwise, {"avoidance": "pairwise", "gradient": "analytic"}).broken == ("rotation",)


@pytest.mark.parametrize("name", METRICS)
def test_every_order_parameter_keeps_the_standing_list_or_says_what_it_breaks(name):
    assert set(check_metric(METRICS[name]).broken) == set(METRICS[name].violates)


@pytest.mark.parametrize("name", SETS)
def test_every_fitness_keeps_the_standing_list_or_says_what_it_breaks(name):
    check_metric(name, dimensions=2)


@pytest.mark.parametrize(
    ("kind", "name"),
    [(kind, name) for kind in KINDS if kind not in (LAWS, METRICS, SETS) for name, part in kind.items() if part],
    ids=lambda value: getattr(value, "noun", value),
)
def test_every_part_keeps_the_standing_list_of_its_kind_or_says_what_it_breaks(kind, name):
    assert set(getattr(airflock, kind.check)(name).broken) == set(kind[name].violates)


def test_the_example_of_a_law_of_ones_own_keeps_the_standing_list():
    assert not check_model(str(Path(__file__).parents[2] / "examples" / "own_rule.py")).broken


@pytest.mark.parametrize(
    ("check", "name", "words"),
    [
        (check_model, "vasarhely", "did you mean vasarhelyi_2018"),
        (check_body, "multirotr", "did you mean multirotor"),
        (check_radio, "lnks", "did you mean links"),
        (check_sensor, "gns", "did you mean gnss"),
        (check_metric, "ordr", "did you mean order"),
        (check_metric, "nowhere.py", "no such file"),
    ],
)
def test_a_wrong_name_is_one_line(check, name, words):
    with pytest.raises(ScenarioError, match=words):
        check(name)


# ------------------------------------------------------------------------------------------------ what is planted

GAIN = 0.13  # 1/s, a gain that a rule holds and no parameter declares


@dataclass(frozen=True, kw_only=True)
class WrongUnit(vasarhelyi_2018.Parameters):
    """The gain of repulsion told in m/s."""

    p_rep: float = airflock.quantity(0.13, "m/s", low=0.0, high=10.0, meaning="gain")


def constant(dx, dy, dz, r, p):
    away = -GAIN * max(p.r0_rep - r, 0.0) / r
    return Sums(away * dx, away * dy, away * dz)


def eastwards(dx, dy, dz, r, p):
    away = -p.p_rep * max(p.r0_rep - r, 0.0) / r
    return Sums(away * dx + 0.1, away * dy, away * dz)


def one_handed(dx, dy, dz, r, p):
    away = -p.p_rep * max(p.r0_rep - r, 0.0) / r
    return Sums(away * (dx - 0.1 * dy), away * (dy + 0.1 * dx), away * dz)


def numbered(dx, dy, dz, r, lower, p):
    away = -p.p_rep * max(p.r0_rep - r, 0.0) / r * lower
    return Sums(away * dx, away * dy, away * dz)


def doubled(dx, dy, dz, r, p):
    k = p.p_rep * max(p.r0_rep - r, 0.0) / r
    away = -2 * k
    return Sums(away * dx, away * dy, away * dz)


def still(own, sums, walls, p):
    return 0.5 * own.vx + sums.x, 0.5 * own.vy + sums.y, 0.5 * own.vz + sums.z


def singular(dx, dy, dz, r, p):
    k = -p.p_rep / max(r - 1e-3, 0.0)
    return Sums(k * dx, k * dy, k * dz)


LAW = model(vasarhelyi_2018)
PLANTED = {
    "units": (replace(LAW, Parameters=WrongUnit), "a unit is declared wrong"),
    "rotation": (replace(LAW, neighbour=eastwards), "off by"),
    "mirror": (replace(LAW, neighbour=one_handed), "off by"),
    "renumbering": (replace(LAW, neighbour=numbered), "off by"),
    "lone agent": (replace(LAW, decide=still), "preferred_speed is 4 m/s"),
    "two agents": (replace(LAW, neighbour=singular), "division by zero"),
    "single precision": (replace(LAW, neighbour=doubled), ""),
}


@pytest.mark.parametrize("truth", PLANTED)
def test_a_planted_fault_of_a_law_is_found(truth):
    law, words = PLANTED[truth]
    with pytest.raises(CheckError) as fault:
        check_model(law)
    lines = [line for line in str(fault.value).splitlines() if f"BREAKS  {truth}:" in line]
    assert len(lines) == 1 and words in lines[0], str(fault.value)
    known = check_model(replace(law, violates=dict.fromkeys(("units", *PLANTED), "planted")))
    assert truth in known.broken and "as declared: planted" in str(known)


def test_a_hidden_constant_is_found_where_the_units_of_all_parameters_are_right():
    with pytest.raises(CheckError, match="BREAKS  units"):
        check_model(replace(model(viragh_2014), neighbour=constant))


def test_a_reason_for_no_truth_is_refused():
    with pytest.raises(RuleError, match="VIOLATES names mirorr; known: rotation"):
        check_model(replace(LAW, violates={"mirorr": "misspelled"}))


class Agent(NamedTuple):
    speed: float


class Sample(NamedTuple):
    phi_vel: float


def agent(speed):
    return Agent(speed)


def sample(agents, n):
    return Sample(agents.speed / n)


def test_a_planted_fault_of_an_order_parameter_is_found():
    space = {"Agent": Agent, "Sample": Sample, "agent": agent, "sample": sample, "NAME": "own"}
    check_metric(metric(space | {"REPORTS": {"phi_vel": ("m/s", "mean speed")}}))
    with pytest.raises(CheckError, match="BREAKS  units"):
        check_metric(metric(space | {"REPORTS": {"phi_vel": ("m", "mean speed")}}))
    with pytest.raises(CheckError, match="REPORTS tells nothing of phi_vel"):
        check_metric(metric(space))


def heavy(vx, vy, vz, cx, cy, cz, dt, b):
    k = dt / b.tau
    return vx + k * (cx - vx), vy + k * (cy - vy), vz + k * (cz - vz) - 9.81 * dt


def test_a_planted_fault_of_a_body_is_found():
    space = {**vars(BODIES["multirotor"]), "Parameters": BODIES["multirotor"].Parameters, "move": heavy}
    with pytest.raises(CheckError) as fault:
        check_body(body(space | {"ACCEPTS": "velocity", "INTEGRATION": "new"}, "heavy"))
    assert "body heavy: BREAKS  units" in str(fault.value) and len(str(fault.value).splitlines()) == 1


def test_units_are_products_of_powers():
    twice = UnitScale(2.0, 4.0)
    assert [unit_factor(u, twice) for u in ("m", "1/s", "m/s^2", "m^2/(N s)", "kg/m³", "m s^(1/2)", "1", "")] == [
        2.0, 0.25, 0.125, 8.0, 0.125, 4.0, 1.0, 1.0,
    ]  # fmt: skip
    with pytest.raises(RuleError, match="'ft'"):
        unit_factor("ft/s", twice)


def skewed(x, y, z, vx, vy, vz):
    return x + 0.3, y, z, vx, vy, vz


def beacon(x, y, z, vx, vy, vz, g0):
    return 1.01 * x, y, z, vx, vy, vz


def drifting(dx, dv, g, period):
    return 1.1 * dx + g * period * dv, dv + g


def liar(s):
    return True


@pytest.mark.parametrize(
    ("rules", "truth"),
    [({"measure": skewed}, "units"), ({"measure": beacon}, "place"), ({"error": drifting}, "bounded"),
     ({"measure": skewed, "exact": liar}, "exact")],
)  # fmt: skip
def test_what_is_planted_in_a_sensor_is_found(rules, truth):
    with pytest.raises(CheckError, match=f"BREAKS  {truth}:"):
        check_sensor(sensor(rules, "planted"))


def beyond(distance, k):
    return distance / k.range * 2.0


def short(distance):
    return 1.0 if distance > 30.0 else 0.0


def masted(x, y, z, age):
    return x * (1.0 + 0.01 * age), y, z


def stale(x, y, z, vx, vy, vz):
    return x + 0.1 * vx, y + 0.1 * vy, z


def always(u0):
    return 1.0


def drifts(x, y, z, vx, vy, vz, since):
    return x + 0.5 * since, y, z, vx, vy, vz


def anchored(x, y, z, vx, vy, vz):
    return 1.01 * x, y, z, vx, vy, vz


def endless(since):
    return 0.0 * since, 1.0


def late():
    return 60.0


def idle(cx, cy, cz):
    return cx, 2 * cy, cz


@pytest.mark.parametrize(
    ("rules", "truth"),
    [({"sense": drifts}, "units"), ({"tell": anchored}, "place"), ({"clock": endless}, "answers"),
     ({"leaves": late}, "units"), ({"overrule": idle}, "single precision")],
)  # fmt: skip
def test_what_is_planted_in_a_fault_is_found(rules, truth):
    with pytest.raises(CheckError, match=f"BREAKS  {truth}:"):
        check_fault(fault(rules, "planted"))


@pytest.mark.parametrize(
    ("rules", "truth"),
    [({"missed": beyond}, "chances"), ({"missed": short}, "units"), ({"receive": always, "carry": masted}, "place"),
     ({"receive": always, "carry": stale}, "fresh")],
)  # fmt: skip
def test_what_is_planted_in_a_radio_is_found(rules, truth):
    with pytest.raises(CheckError, match=f"BREAKS  {truth}:"):
        check_radio(radio(rules, "planted"))


def half(n, r2, met):
    for j in range(n):
        met[j] = 0.5 if r2[j] < 1e29 else 0.0


def everybody(n, met):
    for j in range(n):
        met[j] = 1.0


def first(n, r2, met):
    for j in range(n):
        met[j] = 1.0 if j == 0 and r2[j] < 1e29 else 0.0


def eastern(n, dx, r2, met):
    for j in range(n):
        met[j] = 1.0 if dx[j] > 0.0 and r2[j] < 1e29 else 0.0


def farthest(n, r2, met):
    for j in range(n):
        met[j] = 1.0 if r2[j] < 1e29 else 0.0
        for k in range(n):
            if r2[j] < r2[k] < 1e29:
                met[j] = 0.0


def yard(n, r2, met):
    for j in range(n):
        met[j] = 1.0 if r2[j] < 400.0 else 0.0


@pytest.mark.parametrize(
    ("rules", "truth"),
    [({"meet": half}, "heard"), ({"meet": everybody}, "heard"), ({"meet": first}, "order"),
     ({"meet": eastern}, "turned"), ({"meet": farthest, "NEAR": True}, "near"), ({"meet": yard}, "units")],
)  # fmt: skip
def test_what_is_planted_in_a_topology_is_found(rules, truth):
    with pytest.raises(CheckError, match=f"BREAKS  {truth}:"):
        check_topology(topology(rules, "planted"))
