"""Bad input for wings is refused in one line that names key, value and range."""

import pytest

from airflock.scenarios.files import load
from airflock.support.errors import ScenarioError

BAD = {
    "wing.span": (0.0, "wing.span = 0 m lies outside [0.01, 100] m"),
    "wing.weight": (0.0, "wing.weight = 0 N lies outside"),
    "wing.speed": (0.0, "wing.speed = 0 m/s lies outside [0.1, 300] m/s"),
    "wing.segments": ("2", "wing.segments = '2' is none of 1, 5, 9, 10, 20, 40, 80"),
    "wing.cl_max": (0.5, "the wing stalls, its lift coefficient of 0.925 is beyond wing.cl_max = 0.5"),
    "start.spacing_x": (0.2, "the wings of agents 0 and 1 overlap by"),
    "wing.positions": ("grid", "model.gradient = 'analytic' is a derivative; it needs wing.positions = 'free'"),
    "model.cohesion": ("C4", "model.cohesion = 'C4' is none of C1, C3"),
    "metrics.r_coll": (-1.0, "metrics.r_coll = -1 m lies outside"),
}


@pytest.mark.parametrize("key", BAD)
def test_bad_input_is_one_line(key):
    value, line = BAD[key]
    more = {"start.spacing_y": 1.0} if key == "start.spacing_x" else {}
    with pytest.raises(ScenarioError) as fault:
        load("dimock_2003/physical", {key: value, **more})
    assert line in str(fault.value)
    assert len(str(fault.value).splitlines()) == 1


def test_stall_of_the_paper_is_noted_not_refused():
    assert any("lift coefficient of 1.87" in note for note in load("dimock_2003/published").notes)
    with pytest.raises(ScenarioError, match=r"lift coefficient of 1\.87"):
        load("dimock_2003/published", {"wing.stall": "refused"})


def test_a_flight_without_collisions_to_count_cannot_stop_at_one():
    with pytest.raises(ScenarioError, match="metrics.stop"):
        load("dimock_2003/physical", {"metrics.kind": "order", "metrics.stop": "collision"})
