"""Our parts are found, are sound, and do what they are for."""

import numpy as np
from shoals.laws import springs

import airflock


def test_springs_pass_the_standing_list_of_truths():
    assert not airflock.check_model("springs").broken


def test_a_spring_at_rest_pulls_nobody_and_a_longer_one_pulls_together():
    p = springs.Parameters()
    assert springs.neighbour(p.rest, 0.0, 0.0, p.rest, 0.0, 0.0, 0.0, p) == (0.0, 0.0, 0.0)
    assert springs.neighbour(p.rest + 2.0, 0.0, 0.0, p.rest + 2.0, 0.0, 0.0, 0.0, p).x > 0.0


def test_springs_bring_a_pair_nearer_to_their_length_at_rest():
    def strain(stiffness):
        settings = {"agents": 2, "duration": 60.0, "model.longest": 100.0, "model.stiffness": stiffness}
        scenario = airflock.load("vasarhelyi_2018/4ms", {"world.side": 60.0, **settings}, law="springs")
        return abs(airflock.score(scenario, seeds=1, device="python")["r_min_mean"].item() - 15.0)

    assert strain(0.2) < strain(0.0)


def test_a_file_of_poses_becomes_a_recording(tmp_path):
    t = np.arange(200) / 50.0
    lines = [f"{name}, {s:.2f}, {x0 + 1.5 * s:.4f}, 2.0, 1.0" for s in t for name, x0 in (("ada", 0.0), ("bob", 5.0))]
    (tmp_path / "run7.poses").write_text("POSES\n" + "\n".join(lines) + "\n")
    tracks = airflock.load_tracks(tmp_path / "run7.poses", precision=64)
    assert list(tracks["individual"].values) == ["ada", "bob"]
    np.testing.assert_allclose(tracks["velocity"].sel(space="x"), 1.5, atol=1e-6)
