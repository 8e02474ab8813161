"""What agents measured and heard, kept beside a recording: the same bits, and what `look` says at every decision."""

import numpy as np
import pytest

import airflock
from airflock.support.errors import FlightError

BASE = {"agents": 5, "duration": 3.0, "metrics.period": 0.1, "start.separation": 5.0}
RADIOS = {
    "constant": {"radio.range": 60.0, "radio.delay": 0.4},
    "lossy": {"radio.range": 70.0, "radio.delay": 0.2, "radio.loss": 0.5},
    "links": {"radio.kind": "links", "radio.delay": 0.4, "radio.received_near": 0.4, "radio.received_far": 0.2},
}


@pytest.mark.parametrize("kind", RADIOS)
def test_what_is_kept_is_what_look_says_and_changes_no_bit(kind):
    scenario = airflock.load("vasarhelyi_2018/real_4ms", {**BASE, **RADIOS[kind]})
    kept = airflock.simulate(scenario, seed=4, device="python", keep=("measured", "heard"))
    plain = airflock.simulate(scenario, seed=4, device="python")
    for name in plain:
        assert np.array_equal(kept[name].values, plain[name].values), name
    flight = airflock.open(scenario, seed=4, device="python")
    last = np.full((5, 5), np.nan)  # when what is known was sent
    for frame, time in enumerate(kept["time"].values[:-1]):
        if flight.step < round(time / 0.01):
            flight.advance(steps=round(time / 0.01) - flight.step)
        if not flight.decides:
            assert frame % 2 == 1  # frames come twice as often as decisions
        else:
            for i in range(5):
                seen = flight.look(i)
                measured = [kept[f"measured_{what}"].values[frame, :, 0, i] for what in ("position", "velocity")]
                assert np.array_equal(np.concatenate(measured), [*seen.own[:2], *seen.own[3:5]])
                for other in seen.heard:
                    last[i, other.who] = time - other.age
        ages = kept["age"].values[frame]
        # packets of those out of range count as known for as long as they are remembered
        known = np.isfinite(last)
        assert ages[known] == pytest.approx(time - last[known], abs=1e-5)
        assert np.isnan(ages[~known]).all() or kind == "links"
    assert np.isnan(np.diagonal(kept["age"].values, axis1=1, axis2=2)).all()


def test_kept_variables_are_saved_and_loaded(tmp_path):
    scenario = airflock.load("vasarhelyi_2018/real_4ms", BASE)
    kept = airflock.simulate(scenario, seed=1, device="python", keep=["heard"])
    airflock.save(kept, tmp_path / "kept.nc")
    again = airflock.load_recording(tmp_path / "kept.nc")
    assert np.array_equal(again["age"].values, kept["age"].values, equal_nan=True)


def test_what_cannot_be_kept_is_refused():
    scenario = airflock.load("vasarhelyi_2018/4ms", BASE)
    with pytest.raises(FlightError, match="none of measured, heard"):
        airflock.simulate(scenario, keep=["seen"])
    with pytest.raises(FlightError, match="cut by them already"):
        airflock.simulate(scenario, keep=["heard"], events=[{"step": 1, "kind": "push", "agent": 0}])
    boids = airflock.load("zapotecatl_2016/best", {"duration": 0.01})
    with pytest.raises(FlightError, match="sequential"):
        airflock.simulate(boids, keep=["heard"])
