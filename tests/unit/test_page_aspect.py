"""A narrow page, as of a telephone, shows as much of a field from side to side as others do."""

import math

import pytest

from airflock.studio.browser_view import FULL_ASPECT, camera_for_aspect

AIM = {"position": (10.0, -3.0, 200.0), "look_at": (10.0, 5.0, 0.0), "fov": 0.8, "near": 2.0, "far": 4000.0}


def seen(aim, aspect):
    """Half of what is seen from side to side where the camera looks at, m; the field of view is that of the height."""
    return math.dist(aim["position"], aim["look_at"]) * math.tan(0.5 * aim["fov"]) * aspect


@pytest.mark.parametrize("aspect", [0.2, 390 / 800, 1.0])
def test_a_narrow_page_sees_as_far_sideways_as_others(aspect):
    narrow = camera_for_aspect(AIM, aspect)
    assert seen(narrow, aspect) == pytest.approx(seen(AIM, FULL_ASPECT))
    way = [a - b for a, b in zip(AIM["position"], AIM["look_at"], strict=True)]
    back = [a - b for a, b in zip(narrow["position"], narrow["look_at"], strict=True)]
    assert back == pytest.approx([c * FULL_ASPECT / aspect for c in way])  # along the same line of sight
    assert list(narrow) == list(AIM)  # the position first


@pytest.mark.parametrize("aspect", [FULL_ASPECT, 1.6, 0.0])
def test_other_pages_see_what_they_saw(aspect):
    assert camera_for_aspect(AIM, aspect) == AIM
    assert camera_for_aspect({}, 0.5) == {}
