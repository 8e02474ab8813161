"""Bad input for boids is refused in one line that names key, value and range."""

import pytest

from airflock.scenarios.files import load
from airflock.support.errors import ScenarioError

BAD = {
    "model.r_s": (-0.1, "model.r_s = -0.1 m lies outside [0, 1000] m"),
    "model.r_a": (-0.1, "model.r_a = -0.1 m lies outside [0, 1000] m"),
    "model.r_c": (-0.1, "model.r_c = -0.1 m lies outside [0, 1000] m"),
    "model.r_floor": (-0.1, "model.r_floor = -0.1 m lies outside"),
    "model.rs": (0.1, "model.rs: unknown key; did you mean model.r_s?"),
    "model.w_c": (-1.0, "model.w_c = -1 lies outside [0, 1e+06]"),
    "model.w_s": (-1.0, "model.w_s = -1 lies outside [0, 1e+06]"),
    "model.w_a": (-1.0, "model.w_a = -1 lies outside [0, 1e+06]"),
    "model.fov_c_deg": (400.0, "model.fov_c_deg = 400 deg lies outside [0, 360] deg"),
    "model.fov_s_deg": (-1.0, "model.fov_s_deg = -1 deg lies outside [0, 360] deg"),
    "model.fov_a_deg": (361.0, "model.fov_a_deg = 361 deg lies outside [0, 360] deg"),
    "metrics.r_b": (0.0, "metrics.r_b = 0 m lies outside"),
    "world.side": (0.8, "the arena is smaller than the ball in which agents start"),
    "world.height": (0.8, "the arena is smaller than the ball in which agents start"),
    "metrics.k": (3.0, "metrics.k = 3 m lies outside [0, 2.25] m"),
    "metrics.sigma": (0.7, "metrics.sigma + metrics.gamma = 1.2 is not 1"),
    "metrics.count": ("all", "metrics.count = 'all' is none of each, program"),
    "radio.delay": (0.5, "update = 'sequential' needs ideal perception"),
    "update": ("random", "update = 'random' is none of synchronous, sequential"),
}


@pytest.mark.parametrize("key", BAD)
def test_bad_input_is_one_line(key):
    value, line = BAD[key]
    with pytest.raises(ScenarioError) as fault:
        load("zapotecatl_2016/best", {key: value})
    assert line in str(fault.value)
    assert len(str(fault.value).splitlines()) == 1


def test_largest_extension_comes_from_the_arena_or_is_asked_for():
    assert load("zapotecatl_2016/best").resolved_metrics().max_e == pytest.approx(2.25)
    notes = load("couzin_2002/torus", {"metrics.kind": "zapotecatl"}).notes
    assert any("metrics.max_e" in note for note in notes), notes
    assert load("couzin_2002/torus", {"metrics.kind": "zapotecatl", "metrics.max_e": 9.0}).resolved_metrics().k == 9.0


@pytest.mark.parametrize(
    ("preset", "key", "value", "line"),
    [
        ("vicsek_1995/transition", "model.eta", 7.0, "model.eta = 7 rad lies outside"),
        ("vicsek_1995/transition", "model.r", -1.0, "model.r = -1 m lies outside"),
        ("couzin_2002/torus", "model.dr_o", -1.0, "model.dr_o = -1 m lies outside"),
        ("couzin_2002/torus", "model.fov_deg", 400.0, "model.fov_deg = 400 deg lies outside [0, 360] deg"),
    ],
)
def test_bad_input_for_particles_and_schools_is_one_line(preset, key, value, line):
    with pytest.raises(ScenarioError) as fault:
        load(preset, {key: value})
    assert line in str(fault.value)
    assert len(str(fault.value).splitlines()) == 1


def test_the_programs_count_knows_no_images():
    with pytest.raises(ScenarioError, match=r"metrics\.count = 'program': the program knows no periodic box"):
        load("zapotecatl_2016/best", {"metrics.count": "program", "world.edges": "periodic"})


def test_order_parameters_over_all_pairs_of_a_large_flock_are_announced():
    def told(**settings):
        return " ".join(load("zapotecatl_2016/best", settings).notes)

    large = {"agents": 100_000, "update": "synchronous"}
    assert "metrics.kind = 'zapotecatl' looks at all pairs of 100000 agents (quality)" in told(agents=100_000)
    told_of = "looks at all pairs of 100000 agents (correlation, nearest, collisions)"
    assert told_of in told(agents=100_000, **{"metrics.kind": "vasarhelyi"})
    assert "all pairs" not in told(**large)  # by cells
    assert "all pairs" not in told(**large, **{"metrics.kind": "vasarhelyi"})
    assert "all pairs" not in told(agents=100_000, **{"metrics.kind": "order"})
    assert "all pairs" not in told()
