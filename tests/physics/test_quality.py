"""Metrics of Zapotecatl et al. 2016, of sub-groups and of shape, on made-up flocks whose values are known."""

import math

import numpy as np
import pytest

from airflock.engine import measure_frames
from airflock.scenarios.files import load

MAX_E = 2.25  # half the diagonal of the pond, m


def measured(positions, headings, **settings):
    """Order parameters of one instant; positions (agent, axis) m, headings (agent, axis)."""
    positions, headings = np.asarray(positions, float), np.asarray(headings, float)
    keys = {"metrics.kind": "groups", "metrics.r_cluster": 0.5, "agents": len(positions), **settings}
    found = load("zapotecatl_2016/literal", keys)
    frames = np.concatenate([positions.T, headings.T])[None]
    device = "python" if len(positions) <= 40 else "cpu"  # interpreted, but for large flocks
    return measure_frames(found, frames, 0.0, device=device)[0]


def lattice(side=3, step=0.2):
    axis = (np.arange(side) - (side - 1) / 2) * step
    return np.stack(np.meshgrid(axis, axis, axis), -1).reshape(-1, 3)


def alike(n):
    return np.tile([0.6, 0.0, 0.8], (n, 1))


def test_a_rigid_aligned_lattice_has_its_own_extension_and_no_polarization():
    grid = lattice()
    found = measured(grid, alike(len(grid)))
    assert found["extension_cm"] == pytest.approx(100.0 * np.linalg.norm(grid, axis=1).mean(), rel=1e-9)
    assert found["polarization_deg"] == pytest.approx(0.0, abs=2e-4)  # arc of a cosine that is 1 to rounding
    assert found["f_collision"] == 0.0
    assert found["polarisation"] == pytest.approx(1.0)
    assert found["cns_ext"] == pytest.approx(1.0 - np.linalg.norm(grid, axis=1).mean() / MAX_E, rel=1e-9)


def test_random_headings_in_space_approach_a_right_angle(seed):
    rng = np.random.default_rng(seed)
    n = 4000
    found = measured(rng.uniform(-0.7, 0.7, (n, 3)), rng.normal(size=(n, 3)))
    assert found["polarization_deg"] == pytest.approx(90.0, abs=3.0)


def test_quality_of_a_hand_made_flock():
    # two boids touch at 2 cm, two fly alone at 0.5 m from the centre, one of them crosswise
    place = [[0.01, 0, 0], [-0.01, 0, 0], [0, 0.5, 0], [0, -0.5, 0]]
    ahead = [[1, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0]]
    found = measured(place, ahead)
    mean = np.array([3.0, 1.0, 0.0]) / math.hypot(3.0, 1.0)
    turn = np.arccos(np.clip(np.array(ahead, float) @ mean, -1, 1))
    ext = 1.0 - (2 * 0.5 + 2 * MAX_E) / (4 * MAX_E)
    pol = 1.0 - (turn[2] + turn[3] + 2 * math.pi) / (4 * math.pi)
    assert found["f_collision"] == 0.5
    assert found["cns_ext"] == pytest.approx(ext, abs=1e-9)
    assert found["cns_pol"] == pytest.approx(pol, abs=1e-7)
    assert found["quality"] == pytest.approx(0.5 * (ext + pol), abs=1e-7)
    assert found["polarization_deg"] == pytest.approx(np.degrees(turn.mean()), abs=1e-5)


PROGRAM = {"metrics.kind": "zapotecatl", "metrics.count": "program"}


def row_of(order):
    """Boids 4 cm apart in a row, each touching the next, numbered in this order."""
    place = np.zeros((len(order), 3))
    place[order, 0] = 0.04 * np.arange(len(order))
    return place


@pytest.mark.parametrize(
    ("order", "marked"),
    [
        ([0, 1, 2], 2),  # 0 marks 1; 1 is marked already, so that the pair 1 2 is never looked at
        ([1, 0, 2], 3),  # the middle one comes first and marks both
        ([0, 1, 2, 3], 4),  # 0 marks 1, 2 marks 3
        ([0, 2, 4, 1, 3], 5),  # 0 marks 2, 1 marks 4 and 3
        ([0, 1, 2, 3, 4], 4),  # 4 is left
    ],
)
def test_the_program_misses_the_end_of_a_chain_and_eq_18_does_not(order, marked):
    place = row_of(order)
    n = len(order)
    assert measured(place, alike(n))["f_collision"] == 1.0
    found = measured(place, alike(n), **PROGRAM)
    assert found["f_collision"] == pytest.approx(marked / n)
    assert found["cns_pol"] == pytest.approx(1.0 - marked / n, abs=1e-6)  # the others fly alike


def marks(place, r_b=0.05):
    """The program's loop over pairs, as a person would write it down."""
    found = [False] * len(place)
    for i in range(len(place)):
        if not found[i]:
            for j in range(i + 1, len(place)):
                if math.dist(place[i], place[j]) < r_b:
                    found[i] = found[j] = True
    return found


def test_the_program_counts_at_most_those_that_collide(seed):
    rng = np.random.default_rng(seed)
    missed = 0
    for _ in range(20):
        place, ahead = rng.uniform(0.0, 0.2, (40, 3)), rng.normal(size=(40, 3))
        each, program = measured(place, ahead), measured(place, ahead, **PROGRAM)
        assert program["f_collision"] == pytest.approx(sum(marks(place)) / 40)
        assert program["f_collision"] <= each["f_collision"]
        assert program["extension_cm"] == pytest.approx(each["extension_cm"], rel=1e-12)
        missed += round(40 * (each["f_collision"] - program["f_collision"]))
    assert missed > 0  # so dense a flock has chains


def test_all_in_collision_is_no_quality_and_one_agent_is_perfect():
    assert measured(np.zeros((5, 3)), alike(5))["quality"] == pytest.approx(0.0, abs=1e-9)
    alone = measured([[0.3, 0.2, 0.1]], alike(1))
    assert alone["extension_cm"] == 0.0
    assert alone["quality"] == pytest.approx(1.0, abs=1e-6)
    assert all(math.isfinite(value) for value in alone.values())


def test_metrics_do_not_see_order_place_or_direction(seed):
    rng = np.random.default_rng(seed)
    place, ahead = rng.uniform(-0.5, 0.5, (30, 3)), rng.normal(size=(30, 3))
    one = measured(place, ahead)
    order = rng.permutation(30)
    c, s = math.cos(0.7), math.sin(0.7)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    for other in (measured(place[order], ahead[order]), measured(place @ turn.T + [0.1, -0.2, 0.15], ahead @ turn.T)):
        for name, value in one.items():
            assert other[name] == pytest.approx(value, rel=1e-6, abs=1e-9), name


def two_camps():
    camp = lattice(3, 0.15)
    return np.concatenate([camp + [1.0, 0, 0], camp - [1.0, 0, 0]])


def scattered():
    """As far from their centre, on average, as the two camps, but everybody alone."""
    camps = two_camps()
    n = len(camps)
    golden = math.pi * (3.0 - math.sqrt(5.0))
    z = 1.0 - 2.0 * (np.arange(n) + 0.5) / n
    ring = np.sqrt(1.0 - z * z)
    ball = np.stack([ring * np.cos(golden * np.arange(n)), ring * np.sin(golden * np.arange(n)), z], -1)
    return ball * np.linalg.norm(camps, axis=1).mean()


def test_tight_groups_are_told_from_a_dispersed_flock():
    camps, dust = two_camps(), scattered()
    split, spread = (measured(place, alike(len(place)), **{"metrics.r_cluster": 0.25}) for place in (camps, dust))
    assert split["cns_ext"] == pytest.approx(spread["cns_ext"], abs=0.01)  # what the paper's metric cannot tell
    assert split["n_groups"] == 2.0
    assert split["share_largest"] == 0.5
    assert split["share_alone"] == 0.0
    assert spread["share_alone"] == 1.0
    assert spread["cns_ext_groups"] == pytest.approx(0.0, abs=1e-9)
    own = np.linalg.norm(lattice(3, 0.15), axis=1).mean()
    assert split["cns_ext_groups"] == pytest.approx(1.0 - own / MAX_E, rel=1e-9)
    assert split["extension_groups_cm"] == pytest.approx(100.0 * own, rel=1e-9)


def test_one_group_counts_as_the_whole_flock():
    found = measured(lattice(), alike(27))
    for name in ("cns_ext", "cns_pol", "quality"):
        assert found[f"{name}_groups"] == pytest.approx(found[name], rel=1e-9)


def test_local_density_counts_the_neighbours_in_reach():
    found = measured(lattice(3, 0.4), alike(27))  # 6, 5, 4 or 3 neighbours at 0.4 m, the next at 0.57 m
    links = 2 * 3 * 3 * 3 * 2
    assert found["local_density"] == pytest.approx(links / 27 / (4 / 3 * math.pi * 0.5**3), rel=1e-9)


def test_volume_and_area_of_a_filled_ellipsoid(seed):
    rng = np.random.default_rng(seed)
    v = rng.normal(size=(20000, 3))
    v *= (rng.uniform(size=20000) ** (1 / 3) / np.linalg.norm(v, axis=1))[:, None]
    found = measured(v * [0.8, 0.4, 0.3], alike(20000), **{"metrics.kind": "order"})
    assert found["volume"] == pytest.approx(4 / 3 * math.pi * 0.8 * 0.4 * 0.3, rel=0.03)
    assert found["area"] == pytest.approx(math.pi * 0.8 * 0.4, rel=0.03)
    assert found["elongation"] == pytest.approx(2.0, rel=0.03)


@pytest.mark.parametrize("n", [2, 3, 7])
def test_agents_on_one_plane_have_no_volume_and_on_one_line_no_area(n, seed):
    """However they lie in space: rounding gives a plane no depth (its root would be some 1e-8 of the size cubed)."""
    rng = np.random.default_rng(seed)
    for _ in range(20):
        across, along = rng.normal(size=(2, 3))
        on_line = 10.0 * rng.normal(size=3) + rng.normal(size=(n, 1)) * along
        on_plane = on_line + rng.normal(size=(n, 1)) * across
        assert measured(on_plane, alike(n), **{"metrics.kind": "order"})["volume"] == 0.0
        found = measured(on_line, alike(n), **{"metrics.kind": "order"})
        assert found["volume"] == found["area"] == 0.0
        assert found["elongation"] == pytest.approx(math.sqrt(2e12), rel=1e-6)


def test_elongation_of_a_nearly_round_group_is_exact():
    """Half axes 1 + 1e-9 and 1: a difference of large numbers would lose it."""
    angle = np.arange(12) * math.pi / 6
    ring = np.stack([(1.0 + 1e-9) * np.cos(angle), np.sin(angle), 0.0 * angle], 1)
    found = measured(ring, alike(12), **{"metrics.kind": "order"})
    assert found["elongation"] - 1.0 == pytest.approx(1e-9, rel=1e-5)
