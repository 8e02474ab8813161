"""Fields from GeoJSON and KML: the same metres from both, true to the ellipsoid; what is wrong is one line each."""

import json
import math
import random
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from shapely.geometry import Point, Polygon, box

import airflock
from airflock.certificates.campaign import scenario_identity
from airflock.recordings.flown_scenario import scenario_of_recording
from airflock.scenarios import scenario_checks
from airflock.scenarios.files import load
from airflock.scenarios.scenario_builder import build_scenario
from airflock.support.coordinates import FlightSite
from airflock.support.errors import ScenarioError
from airflock.support.untrusted import TextError, parse_xml
from airflock.world.scenes.field_outlines import load_field

FIELDS = Path(__file__).parents[1] / "fields"
FEW = {"agents": 4, "start.separation": 4.0, "duration": 1.0}
SHELL = [[19.06, 47.47], [19.064, 47.47], [19.064, 47.473], [19.06, 47.473]]


def polygon(*rings, **properties):
    shape = {"type": "Polygon", "coordinates": [[*ring, ring[0]] for ring in rings]}
    return {"type": "Feature", "properties": properties, "geometry": shape}


def written(tmp_path, *features, name="a.geojson"):
    path = tmp_path / name
    path.write_text(json.dumps({"type": "FeatureCollection", "features": list(features)}))
    return path


def faults_of(path, **settings):
    with pytest.raises(ScenarioError) as caught:
        load("vasarhelyi_2018/4ms", FEW | {"world.file": str(path)} | settings)
    return str(caught.value).splitlines()


def test_a_field_in_an_l_with_a_pond_and_a_crane():
    found = load_field(FIELDS / "field.geojson", space=True)
    keys, site = found.keys, FlightSite(*found.origin, 0.0)
    assert found.origin == (47.4715, 19.062)
    assert len(keys["corners"]) == 6 and len(keys["obstacles"]) == 2
    assert (keys["floor"], keys["ceiling"]) == (5.0, 80.0) and keys["heights"] == [[-1e5, 1e5], [-1e5, 30.0]]
    for (x, y), (longitude, latitude) in zip(
        keys["corners"], [(19.06, 47.47), (19.064, 47.47), (19.064, 47.4715)], strict=False
    ):
        back = site.to_geodetic(x, y, 0.0)
        assert (back.latitude, back.longitude) == pytest.approx((latitude, longitude), abs=2e-8)
    north = 0.0015 * 111_181.0  # m; a degree of the meridian at 47.47° on WGS 84
    assert max(y for _, y in keys["corners"]) == pytest.approx(north, rel=1e-4)
    assert Polygon(keys["corners"]).contains(Polygon(keys["obstacles"][1]))


def test_kml_tells_the_same_field():
    ours, theirs = (load_field(FIELDS / f"field.{kind}") for kind in ("geojson", "kml"))
    assert ours.origin == theirs.origin and ours.keys == theirs.keys
    assert "field, 6 corners" in theirs.note and "latitude 47.4715000" in theirs.note


def test_a_flight_in_a_field_keeps_it_without_the_file(tmp_path, seed):
    (tmp_path / "here.geojson").write_text((FIELDS / "field.geojson").read_text())
    (tmp_path / "mine.toml").write_text(
        'extends = "vasarhelyi_2018/4ms"\nagents = 3\nduration = 1.0\n[world]\nfile = "here.geojson"\n'
    )
    scenario = load(tmp_path / "mine.toml", {"world.dimensions": "3"})
    assert scenario.world.floor == 5.0 and "heights" not in scenario.notes[0]
    assert "left out in a plane" in load(tmp_path / "mine.toml").notes[1]
    (tmp_path / "here.geojson").unlink()
    recording = airflock.simulate(scenario, seed, device="python")
    again = scenario_of_recording(recording)
    assert again.world == scenario.world and not again.world.file
    np.testing.assert_array_equal(airflock.simulate(again, seed, device="python").position, recording.position)


def test_fewer_corners_move_the_outline_by_no_more_than_asked(tmp_path):
    turn = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    ring = np.column_stack([19.06 + 0.002 * np.cos(turn), 47.47 + 0.001 * np.sin(turn)]).tolist()
    path = written(tmp_path, polygon(ring))
    whole, few = (load_field(path, simplify=s).keys["corners"] for s in (0.0, 2.0))
    assert len(few) < 40 < len(whole)
    assert Polygon(whole).exterior.hausdorff_distance(Polygon(few).exterior) <= 2.01


WRONG = {
    "crosses": ([polygon([SHELL[0], SHELL[2], SHELL[1], SHELL[3]], name="bow")], "bow crosses or touches itself"),
    "outside": ([polygon(SHELL), polygon([[20.0, 48.0], [20.001, 48.0], [20.0, 48.001]], name="pond")],
                "pond lies outside feature 1"),
    "hole": ([polygon(SHELL, [[19.065, 47.471], [19.066, 47.471], [19.066, 47.472]], name="meadow")],
             "a hole of meadow lies outside meadow"),
    "reaches": ([polygon(SHELL), polygon([[19.063, 47.471], [19.066, 47.471], [19.066, 47.472]])],
                "feature 2 reaches outside feature 1"),
    "none": ([{"type": "Feature", "geometry": {"type": "Point", "coordinates": [1.0, 2.0]}}], "holds no polygon"),
    "two": ([polygon(SHELL[:2])], "a ring of 2 corners"),
    "metres": ([polygon([[5e5, 5e6], [5.1e5, 5e6], [5e5, 5.1e6]])], "is not a longitude and latitude in degrees"),
    "small metres": ([polygon([[0, 0], [80, 0], [80, 60]])], "are its numbers metres instead of degrees?"),
    "exchanged": ([polygon([[-36.8, 174.7], [-36.9, 174.7], [-36.8, 174.8]])], "are they exchanged? longitude comes"),
    "unhashable": ([{"type": "Feature", "geometry": {"type": {"a": []}}}], "holds no polygon"),
    "open": ([{"type": "LineString", "coordinates": SHELL}], "(LineString) is not closed: its ends lie 334 m apart"),
    "text": ([polygon([["a", "b"], *SHELL[1:]])], "is not a point [longitude, latitude]"),
    "height": ([polygon(SHELL, floor="low")], "the property floor = 'low' is not a height in m"),
    "flat": ([{"type": "Feature", "geometry": {"type": "Polygon", "coordinates": 5}}], "coordinates is not a list"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_field_is_one_line(tmp_path, name):
    features, said = WRONG[name]
    (line,) = faults_of(written(tmp_path, *features))
    assert said in line and line.startswith("vasarhelyi_2018/4ms: world.file = ")


def test_faults_of_a_file_come_together_and_name_what_they_are_of(tmp_path):
    pond, bow = [[20.0, 48.0], [20.001, 48.0], [20.0, 48.001]], [SHELL[0], SHELL[2], SHELL[1], SHELL[3]]
    lines = faults_of(written(tmp_path, polygon(SHELL), polygon(pond, name="pond"), polygon(bow, name="bow")))
    assert len(lines) == 2 and "pond" in lines[0] and "bow" in lines[1]


@pytest.mark.parametrize(("name", "said"), [
    ("no.geojson", "no such file"), ("a.kmz", "unzip it first"),
    ("a.shp", "ends in none of .geojson, .json, .kml, .plan"),
])  # fmt: skip
def test_a_file_of_no_use_is_one_line(tmp_path, name, said):
    if name.startswith("a"):
        (tmp_path / name).write_text("{}")
    (line,) = faults_of(tmp_path / name)
    assert said in line


def test_a_field_without_a_polygon_hides_no_other_fault(tmp_path):
    """And brings no fault of its stand-in: four agents or four hundred have room."""
    keys = {"agents": 400, "faults": [{"kind": "motor", "at": 1.0, "agents": [400]}], "body.kind": "quadrotr"}
    lines = faults_of(written(tmp_path, *WRONG["none"][0]), **keys)
    assert [re.search(r"holds no polygon|body.kind|no agent 400", line) is not None for line in lines] == [True] * 3


def test_a_field_and_its_corners_are_not_given_twice():
    lines = faults_of(FIELDS / "field.kml", **{"world.corners": SHELL, "world.simplify": -1.0})
    assert (
        "world.corners: is given, and world.file as well" in lines[0]
        and "world.simplify = -1 m lies outside" in lines[1]
    )


BOMB = '<!DOCTYPE k [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><kml>&b;</kml>'
FETCH = '<!DOCTYPE k [<!ENTITY x SYSTEM "file:///etc/passwd">]><kml><name>&x;</name></kml>'


@pytest.mark.parametrize("text", [
    BOMB, FETCH, "<kml><Polygon></kml>", "", "<a>" * 40 + "</a>" * 40, "\x00", "<kml>&nbsp;</kml>",
    "<k>" + "<a/>" * 100_001 + "</k>",
])  # fmt: skip
def test_hostile_xml_ends_at_the_door(tmp_path, text):
    with pytest.raises(TextError):
        parse_xml(text)
    (tmp_path / "a.kml").write_text(text)
    (line,) = faults_of(tmp_path / "a.kml")
    assert line.startswith("vasarhelyi_2018/4ms: world.file = ") and len(line) < 500


def test_xml_is_read_without_namespaces():
    found = parse_xml('<k:kml xmlns:k="http://a/b"><k:name> x <b/>y</k:name></k:kml>')
    assert (found.tag, found.children[0].tag, found.children[0].children[0].tag) == ("kml", "name", "b")
    assert re.sub(r"\s+", " ", found.children[0].text) == "x y"


@pytest.mark.parametrize("text", [
    "[" * 5000, '{"type": "FeatureCollection", "features": 3}', '{"type": "Polygon", "coordinates": [[[1e400, 0]]]}',
    "{}",
    '{"type": "Polygon", "crs": {"name": "EPSG:3857"}, "coordinates": []}',
])  # fmt: skip
def test_hostile_geojson_is_one_line(tmp_path, text):
    (tmp_path / "a.geojson").write_text(text)
    (line,) = faults_of(tmp_path / "a.geojson")
    assert line.startswith("vasarhelyi_2018/4ms: world.file = ") and len(line) < 500


def test_what_is_not_loaded_reads_no_file():
    """Neither a recording's document nor a change of a flight."""
    table = {"model": {"kind": "vasarhelyi_2018"}, "world": {"file": "/etc/passwd"}}
    with pytest.raises(ScenarioError, match="a file is read where a scenario is loaded, and not here"):
        build_scenario(table, "recording")
    flight = airflock.open(load("vasarhelyi_2018/4ms", FEW), 1, device="python")
    with pytest.raises(ScenarioError, match="and not here"):
        flight.change({"world.file": str(FIELDS / "field.kml")})


@pytest.mark.parametrize("kind", ["scattered", "grid", "circle", "line"])
def test_the_largest_extension_is_that_of_all_pairs(kind):
    rng = random.Random(kind)
    for count in (0, 1, 2, 3, 4, 5, 7, 12, 40) * 20:
        points = {
            "scattered": [(rng.uniform(-9.0, 9.0), rng.uniform(-9.0, 9.0)) for _ in range(count)],
            "grid": [(float(rng.randint(-2, 2)), float(rng.randint(-2, 2))) for _ in range(count)],
            "circle": [(math.cos(math.tau * k / count), math.sin(math.tau * k / count)) for k in range(count)],
            "line": [(0.1 * k, 0.3 * k) for k in range(count)],
        }[kind]
        assert scenario_checks.diameter(points) == max((math.dist(a, b) for a in points for b in points), default=0.0)


def kml(tmp_path, *placemarks, name="a.kml"):
    path = tmp_path / name
    path.write_text(f'<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{"".join(placemarks)}</Document></kml>')
    return path


def boundary(tag, *rings):
    texts = [" ".join(f"{x},{y},0" for x, y in [*ring, ring[0]]) for ring in rings]
    lines = [f"<LinearRing><coordinates>{text}</coordinates></LinearRing>" for text in texts]
    return f"<{tag}>{''.join(lines)}</{tag}>"


POND = [[19.061, 47.471], [19.062, 47.471], [19.062, 47.472]]
TREE = [[19.063, 47.471], [19.0632, 47.471], [19.0632, 47.4712]]


def test_all_holes_of_one_inner_boundary_are_obstacles(tmp_path):
    """As Google Earth writes them: only the first one was kept, so that drones would have flown into the others."""
    outer = boundary("outerBoundaryIs", SHELL)
    one = f"<Placemark><Polygon>{outer}{boundary('innerBoundaryIs', POND, TREE)}</Polygon></Placemark>"
    each = boundary("innerBoundaryIs", POND) + boundary("innerBoundaryIs", TREE)
    two = f"<Placemark><MultiGeometry><Polygon>{outer}{each}</Polygon></MultiGeometry></Placemark>"
    assert len(load_field(kml(tmp_path, one)).keys["obstacles"]) == 2
    assert load_field(kml(tmp_path, one)).keys == load_field(kml(tmp_path, two)).keys


@pytest.mark.parametrize("wrapped", [
    '<Data name="floor"><value>{}</value></Data><Data name="other"><value>x</value></Data>',
    '<SchemaData schemaUrl="#f"><SimpleData name="floor">{}</SimpleData></SchemaData>',
])  # fmt: skip
def test_kml_tells_heights_as_geojson_does(tmp_path, wrapped):
    def placemark(shape, told):
        data = f"<ExtendedData>{wrapped.format(told)}</ExtendedData>"
        return f"<Placemark>{data}<Polygon>{boundary('outerBoundaryIs', shape)}</Polygon></Placemark>"

    path = kml(tmp_path, placemark(SHELL, 5), placemark(TREE, ""), placemark(POND, "-2.5"))
    theirs = written(tmp_path, polygon(SHELL, floor=5.0), polygon(TREE), polygon(POND, floor=-2.5))
    assert load_field(path, space=True).keys == load_field(theirs, space=True).keys
    (line,) = faults_of(kml(tmp_path, placemark(SHELL, "low")))
    assert "the property floor = 'low' is not a height in m" in line


def test_corners_that_say_nothing_are_left_out(tmp_path):
    """A point given twice up to rounding, a ring that is closed up to rounding, points along straight sides."""
    slanted = [[19.06, 47.47], [19.064, 47.4707], [19.0646, 47.473], [19.0605, 47.4733]]
    ends = zip(slanted, [*slanted[1:], slanted[0]], strict=True)
    fine = [[round(a[c] + (b[c] - a[c]) * k / 7.0, 7) for c in (0, 1)] for a, b in ends for k in range(7)]
    nearly = [[fine[2][0] + 1e-9, fine[2][1]]]
    whole, few = (load_field(written(tmp_path, polygon(ring))).keys for ring in (slanted, fine[3:] + fine[:3] + nearly))
    assert len(few["corners"]) == 4
    assert {tuple(c) for c in few["corners"]} == {tuple(c) for c in whole["corners"]}
    load(
        "vasarhelyi_2018/4ms", FEW | {"world.file": str(written(tmp_path, polygon([*slanted, [19.06 + 1e-9, 47.47]])))}
    )


@pytest.mark.parametrize("simplify", [0.0, 3.0])
def test_a_wood_that_ends_where_the_field_does_lies_inside(tmp_path, simplify):
    """On an edge that runs to no cardinal point rounding puts one of its two corners outside."""
    slanted = [[19.06, 47.47], [19.064, 47.4707], [19.0646, 47.473], [19.0605, 47.4733]]
    rng = random.Random(7)
    for _ in range(10):
        a, b = sorted((rng.uniform(0.1, 0.9), rng.uniform(0.1, 0.9)))
        edge = [[19.06 + 0.004 * k, 47.47 + 0.0007 * k] for k in (a, b)]
        path = written(tmp_path, polygon(slanted), polygon([*edge, [19.0622, 47.4715]], name="wood"))
        keys = load_field(path, simplify=simplify).keys
        assert Polygon(keys["corners"]).buffer(2e-3).covers(Polygon(keys["obstacles"][0]))
        load("vasarhelyi_2018/4ms", FEW | {"world.file": str(path), "world.simplify": simplify})


def test_what_is_no_polygon_is_told(tmp_path):
    tree = {"type": "Feature", "properties": {"name": "oak"}, "geometry": {"type": "Point", "coordinates": SHELL[0]}}
    fence = {"type": "LineString", "coordinates": SHELL[:2]}
    assert "; oak (Point), no polygon, is left out" in load_field(written(tmp_path, polygon(SHELL), tree)).note
    note = load_field(written(tmp_path, polygon(SHELL), tree, fence)).note
    assert "; oak (Point) and 1 more, no polygons, are left out" in note


def test_many_short_sides_are_told(tmp_path):
    turn = np.linspace(0.0, 2.0 * np.pi, 100, endpoint=False)
    ring = np.column_stack([19.06 + 0.002 * np.cos(turn), 47.47 + 0.001 * np.sin(turn)]).tolist()
    note = load_field(written(tmp_path, polygon(ring))).note
    few = len(load_field(written(tmp_path, polygon(ring)), simplify=1.0).keys["corners"])
    assert f"agents feel each of its sides for itself: world.simplify = 1 leaves {few} of them" in note
    assert "simplify" not in load_field(FIELDS / "field.geojson").note


@pytest.mark.parametrize("told", ["1 m", {"value": 1.0, "unit": "m", "source": "ours"}, "100 cm"])
def test_simplify_takes_units_as_every_key_does(told):
    file = {"world.file": str(FIELDS / "field.kml")}
    given = load("vasarhelyi_2018/4ms", FEW | file | {"world.simplify": told})
    assert given.world == load("vasarhelyi_2018/4ms", FEW | file | {"world.simplify": 1.0}).world
    (line,) = faults_of(FIELDS / "field.kml", **{"world.simplify": "1 s"})
    assert "world.simplify = 1 s: the unit is m" in line


def test_a_field_and_another_arena_are_not_given_together():
    """The circle was flown, and the field forgotten."""
    (line,) = faults_of(FIELDS / "field.kml", **{"world.arena": "circle"})
    assert "world.arena = 'circle': is given, and world.file as well" in line


# --- One field in all the ways in which people write it, at a place drawn at random ---


def ring_at(site, corners):
    places = [site.to_geodetic(x, y, 0.0) for x, y in corners]
    return [(place.longitude, place.latitude) for place in places]


def closed(ring):
    return [*ring, ring[0]]


def as_multipolygon(site, corners, rng):
    """Its other part lies apart, and is smaller."""
    other = ring_at(site, [(0.3 * x + 900.0, 0.3 * y) for x, y in corners])
    parts = [[closed(ring_at(site, corners))], [closed(other)]]
    rng.shuffle(parts)
    return ".geojson", json.dumps({"type": "MultiPolygon", "coordinates": parts})


def as_plan(site, corners, rng):
    """Latitude comes first."""
    fences = [{"inclusion": True, "polygon": [(y, x) for x, y in ring_at(site, corners)], "version": 1}]
    return ".plan", json.dumps({"fileType": "Plan", "geoFence": {"polygons": fences, "circles": [], "version": 2}})


def as_kml(site, corners, rng):
    text = " ".join(f"{x:.9f},{y:.9f},0" for x, y in closed(ring_at(site, corners)))
    ring = f"<LinearRing><coordinates>{text}</coordinates></LinearRing>"
    shape = rng.choice(
        [f"<Polygon><outerBoundaryIs>{ring}</outerBoundaryIs></Polygon>", ring.replace("Ring", "String")]
    )
    return ".kml", f"<kml><Placemark><name>field</name>{shape.replace('LinearString', 'LineString')}</Placemark></kml>"


def as_line(site, corners, rng):
    return ".geojson", json.dumps({"type": "LineString", "coordinates": closed(ring_at(site, corners))})


def as_turned(site, corners, rng):
    """Longitudes from 0 to 360."""
    ring = [(x % 360.0, y) for x, y in ring_at(site, corners)]
    return ".json", json.dumps({"type": "Polygon", "coordinates": [closed(ring)]})


def as_cut(site, corners, rng):
    """In two at 180°, as RFC 7946 wants it."""
    whole = Polygon([(x % 360.0, y) for x, y in ring_at(site, corners)])
    west, east = whole.intersection(box(170.0, -90.0, 180.0, 90.0)), whole.intersection(box(180.0, -90.0, 190.0, 90.0))
    rings = [[list(p) for p in west.exterior.coords], [[x - 360.0, y] for x, y in east.exterior.coords]]
    return ".geojson", json.dumps({"type": "MultiPolygon", "coordinates": [[ring] for ring in rings if len(ring) > 2]})


WAYS = (as_multipolygon, as_plan, as_kml, as_line, as_turned, as_cut)


def drawn_field(rng, longitude=None):
    """A site, and the corners (m) of a polygon about it, in a circle with random radii."""
    site = FlightSite(rng.uniform(-70.0, 70.0), rng.uniform(-179.9, 179.9) if longitude is None else longitude, 0.0)
    count = rng.randint(4, 12)
    turns = [2.0 * math.pi * (k + rng.uniform(0.0, 0.6)) / count for k in range(count)]
    return site, [(r * math.cos(a), r * math.sin(a)) for a in turns for r in [rng.uniform(60.0, 200.0)]]


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_a_field_is_the_same_in_whatever_way_it_is_written(tmp_path, seed, way):
    rng = random.Random(f"{seed} {way.__name__}")
    for _ in range(50):
        # a third of them, and all that are cut, lie across 180 degrees
        across = way is as_cut or rng.random() < 0.3
        site, corners = drawn_field(rng, rng.choice([-1, 1]) * (180.0 - rng.uniform(0.0, 3e-4)) if across else None)
        suffix, text = way(site, corners, rng)
        path = tmp_path / f"field{suffix}"
        path.write_text(text)
        found = load_field(path)
        assert abs(found.origin[1]) <= 180.0
        about = site.local(*found.origin, 0.0)
        got = Polygon([(x + about[0], y + about[1]) for x, y in found.keys["corners"]])
        assert got.symmetric_difference(Polygon(corners)).area < 0.001 * got.area, (site.origin, text)
        assert "obstacles" not in found.keys
        assert (found.keys["latitude"], found.keys["longitude"]) == found.origin


def test_fences_of_a_plan_are_the_field_and_what_must_not_be_entered(tmp_path):
    """Whichever is the largest: an exclusion is never the arena, and two fences are not one and an obstacle."""
    site, square = FlightSite(47.0, 19.0, 100.0), [(-100, -100), (100, -100), (100, 100), (-100, 100)]
    fence = [[y, x] for x, y in ring_at(site, square)]
    circle = {"circle": {"center": [47.0, 19.0], "radius": 20.0}, "inclusion": False}
    path = tmp_path / "field.plan"

    def planned(polygons, circles):
        path.write_text(json.dumps({"geoFence": {"polygons": polygons, "circles": circles}}))
        return load_field(path)

    inside, outside = ({"inclusion": inclusion, "polygon": fence} for inclusion in (True, False))
    keys = planned([inside], [circle]).keys
    assert Polygon(keys["corners"]).area == pytest.approx(200.0**2, rel=1e-4)
    assert Polygon(keys["obstacles"][0]).buffer(0.01).covers(Point(0.0, 0.0).buffer(20.0)), "around the circle"
    for polygons, circles, said in (
        ([outside], [], "holds no polygon"),
        ([inside, inside], [], "has several fences"),
        ([inside], [{**circle, "inclusion": True}], "has several fences"),
        ([{"polygon": fence}], [], "a fence without the key inclusion"),
        ([inside], [{"circle": {"center": [47.0, 19.0], "radius": -1.0}, "inclusion": False}], "radius = -1.0 is not"),
    ):
        with pytest.raises(ScenarioError, match=f"field.plan: .*{said}"):
            planned(polygons, circles)


@pytest.mark.parametrize("kind", ["circle", "star", "comb", "walk"])
def test_an_outline_of_very_many_corners_ends_in_one_line_or_a_field(tmp_path, kind, seed):
    """None of them may end the process: a comb of 10^5 teeth used up the stack."""
    rng, count = random.Random(seed), 99_000
    turns = [2.0 * math.pi * k / count for k in range(count)]
    radii = [rng.uniform(0.5, 1.0) if kind == "star" else 1.0 for _ in turns]
    ring = [(19.0 + 2e-3 * r * math.cos(a), 47.0 + 1e-3 * r * math.sin(a)) for r, a in zip(radii, turns, strict=True)]
    if kind == "comb":
        ring = [(19.0 + 4e-3 * k / count, 47.0 + (1e-3 if k % 2 else 2e-3)) for k in range(count)] + [(19.002, 46.999)]
    if kind == "walk":
        ring = [(19.0 + 1e-3 * rng.random(), 47.0 + 1e-3 * rng.random()) for _ in turns]
    path = written(tmp_path, polygon(ring))
    if kind == "circle":
        assert Polygon(load_field(path).keys["corners"]).area == pytest.approx(math.pi * 152.0 * 111.2, rel=3e-3)
    else:
        with pytest.raises(ScenarioError, match=r"an outline has \d+ corners, more than 500; world.simplify"):
            load_field(path)


def test_polygons_that_cross_are_one_line_each_and_no_warning_of_a_library(tmp_path, seed):
    rng = random.Random(seed)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(50):
            rings = [[[19.0 + 1e-3 * rng.random(), 47.0 + 1e-3 * rng.random()] for _ in range(rng.randint(4, 9))]
                     for _ in range(rng.randint(1, 3))]  # fmt: skip
            lines = []
            try:
                load_field(written(tmp_path, *map(polygon, rings)))
            except ScenarioError as error:
                lines = error.errors
            assert all(" crosses or touches itself " in line or " outside feature " in line for line in lines), lines


def test_a_place_decides_no_flight_and_so_no_certificate():
    place = {"world.latitude": 47.0, "world.longitude": 19.0}
    here, nowhere = (airflock.load("vasarhelyi_2018/4ms", keys) for keys in (place, {}))
    assert scenario_identity(here) == scenario_identity(nowhere) and here.world != nowhere.world
