"""Every part of every show flies noise of its own."""

from itertools import product

from airflock.display import fly_show, show


def test_no_two_parts_of_any_shows_have_one_seed():
    """Ten shapes further on is not the next show, and a hundred parts further on is not the next shape."""
    parts = list(product((0, 1, 2, 2**63), range(12), range(120)))
    assert len({show.segment_seed(*part) for part in parts}) == len(parts)
    assert all(0 <= show.segment_seed(*part) < 2**64 for part in parts)


def test_a_show_flies_with_the_seeds_of_its_parts(monkeypatch):
    flown, fly = [], show.fly

    def watched(part, seed, **given):
        flown.append(seed)
        return fly(part, seed, **given | {"device": "python"})

    monkeypatch.setattr(show, "fly", watched)
    monkeypatch.setattr(show, "PATIENCE", 0.0)
    shapes = [show.ranks(3, height=height) for height in (10.5, 11.0)]
    for seed in (0, 1):
        fly_show(shapes, 3, seed=seed, settings={"duration": 1.0})
    assert flown == [show.segment_seed(seed, leg, 0) for seed in (0, 1) for leg in (0, 1)]
