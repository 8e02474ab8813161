"""Scenes, goals, starts and displays that cannot be meant end with a clear line, or a note of what was done."""

import json
import random
import re

import numpy as np
import pytest

import airflock
from airflock.displays import fly_show, shape_points, show_control as assignment
from airflock.engine import driver_text, fly_world
from airflock.support.errors import AirflockError, FlightError, ScenarioError
from airflock.world.scenery import Parameters
from airflock.world.scenes import meshes
from airflock.world.scenes.scene_builder import SHAPES, in_mesh, scene_of
from airflock.world.shapes import TRIANGLE, from_shape
from needed import needed

trimesh = needed("trimesh")


@pytest.fixture
def hall(tmp_path):
    """A closed hall of 40 x 20 x 10 m as a file."""
    path = tmp_path / "hall.stl"
    trimesh.creation.box(bounds=[[0.0, 0.0, 0.0], [40.0, 20.0, 10.0]]).export(path)
    return path


def fly_in(path, **settings):
    return airflock.load("kidger/city", {"scene.kind": "mesh", "scene.file": str(path), **settings})


def refused(*words, preset="kidger/city", **settings):
    with pytest.raises(ScenarioError) as caught:
        airflock.load(preset, {key.replace("__", "."): value for key, value in settings.items()})
    text = str(caught.value)
    assert all(word in text for word in words), text
    assert all(line.startswith(f"{preset}: ") for line in text.splitlines())


def test_a_goal_inside_a_building_is_named_with_its_depth():
    points = [[0.0, 0.0, 10.0], [22.0, 22.0, 5.0]]
    refused("goals.points[1] = [22, 22, 5] m", "inside", goals__kind="points", goals__points=points)
    refused("lies 5 m inside", goals__kind="points", goals__points=[[0.0, 0.0, -5.0]])


def test_points_are_asked_for_where_they_are_missing():
    refused("goals.points, [[east, north, up], ...]", goals__kind="points")
    refused("1 goals.points are not one for each of 10 agents", goals__kind="own", goals__points=[[0.0, 0.0, 9.0]])


def test_a_mesh_without_a_file_says_what_is_missing():
    refused("scene.kind = 'mesh' needs scene.file", scene__kind="mesh")


def test_boxes_that_are_none_are_refused():
    refused("scene.boxes is not a list of rows of 7 numbers", "when it appears", scene__boxes=[[5.0, 5.0, 0.0, 9.0]])
    boxes = [[5.0, 5.0, 0.0, 9.0, 9.0, 9.0, 0.0], [5.0, 5.0, 0.0, -5.0, 9.0, 10.0, 0.0]]
    refused("scene.boxes[1]: its first corner does not lie below", scene__kind="boxes", scene__boxes=boxes)


def test_only_cities_and_forests_are_drawn_anew():
    refused("scene.draw = 'flight' with scene.kind = 'none'", scene__kind="none", scene__draw="flight")


def test_a_start_inside_an_obstacle_is_refused():
    shut = {"scene__blocks": 9, "start__side": 12.0, "start__separation": 0.5, "world__dimensions": "2"}
    refused("start: the whole region", "start.clearance", **shut)
    found = airflock.load("kidger/city", {"agents": 2})
    start = np.array([[0.0, 22.0], [0.0, 22.0], [20.0, 5.0], [1.0, 1.0], [0.0, 0.0], [0.0, 0.0]])
    with pytest.raises(FlightError, match="start: agent 1 lies"):
        airflock.simulate(found, start=start)


def test_a_start_region_full_of_obstacles_is_noted():
    found = airflock.load("kidger/city", {"scene.street": 2.5, "world.dimensions": "2", "goals.kind": "none"})
    assert any("agents start only in the rest" in note for note in found.notes)


def test_a_goal_inside_a_closed_mesh_is_refused(hall):
    with pytest.raises(ScenarioError, match=r"goals.points\[0\]"):
        fly_in(hall, **{"goals.kind": "points", "goals.points": [[20.0, 10.0, 5.0]]})
    place = scene_of(Parameters(kind="mesh", file=str(hall)), 3)
    spots = np.random.default_rng(5).uniform((-10.0, -10.0, 0.5), (50.0, 30.0, 20.0), (300, 3))
    truth = ((spots > 0.0) & (spots < (40.0, 20.0, 10.0))).all(axis=1)
    assert [in_mesh(place, spot) for spot in spots] == truth.tolist()


def test_inside_means_closed_all_around(tmp_path, seed):
    """Two balls that overlap, one of them inside out; a hollow ball's cavity, a roof and a bowl have nothing inside."""
    balls = [trimesh.creation.icosphere(subdivisions=3, radius=10.0) for _ in range(5)]
    balls[1].apply_translation((12.0, 0.0, 0.0))
    balls[2].apply_translation((60.0, 0.0, 0.0))
    balls[2].invert()
    balls[3].apply_translation((0.0, 60.0, 0.0))
    cavity = trimesh.creation.icosphere(subdivisions=3, radius=6.0)
    cavity.apply_translation((0.0, 60.0, 0.0))
    cavity.invert()
    balls[4].apply_translation((60.0, 60.0, 0.0))
    bowl = balls[4].slice_plane((60.0, 60.0, 2.0), (0.0, 0.0, -1.0))
    trimesh.util.concatenate([*balls[:4], cavity, bowl]).export(tmp_path / "bodies.stl")
    place = scene_of(Parameters(kind="mesh", file=str(tmp_path / "bodies.stl"), ground="no"), 3)
    spots = np.random.default_rng(seed).uniform((-12.0, -12.0, -12.0), (72.0, 72.0, 12.0), (3000, 3))
    distances = np.linalg.norm(spots - np.array([[[0.0, 0, 0]], [[12, 0, 0]], [[60, 0, 0]], [[0, 60, 0]]]), axis=2)
    truth = (distances < 10.0).any(axis=0) & (distances[3] > 6.0)
    clear = (np.abs(distances - 10.0) > 0.2).all(axis=0) & (np.abs(distances[3] - 6.0) > 0.2)  # balls with facets
    assert truth.sum() > 100
    assert [in_mesh(place, spot) for spot in spots[clear]] == truth[clear].tolist()


def test_free_goals_and_starts_lie_outside_a_closed_mesh(tmp_path, seed):
    """A ball around the middle of the start region, deeper than any clearance; once in space, once cut by the plane."""
    trimesh.creation.icosphere(subdivisions=2, radius=24.0).export(tmp_path / "ball.stl")
    for dims in ("3", "2"):
        keys = {"start.side": 50.0, "world.dimensions": dims, "goals.high": 20.0, "goals.apart": 1.0, "agents": 8}
        found = fly_in(tmp_path / "ball.stl", **keys, **{"scene.ground": "no", "goals.count": 8, "duration": 0.02})
        assert np.linalg.norm(found.waypoints(), axis=1).min() > 23.0
        for number in range(seed, seed + 3):
            start = airflock.simulate(found, number, device="python")["position"].values[0, :, 0]
            assert np.linalg.norm(start, axis=0).min() > 23.0


def test_a_start_region_inside_a_closed_mesh_is_refused(tmp_path):
    trimesh.creation.icosphere(subdivisions=2, radius=60.0).export(tmp_path / "dome.stl")
    with pytest.raises(ScenarioError, match="the whole region in which agents start"):
        fly_in(tmp_path / "dome.stl", **{"scene.ground": "no", "goals.kind": "none"})
    found = fly_in(tmp_path / "dome.stl", **{"scene.ground": "no", "goals.kind": "none", "start.side": 100.0})
    with pytest.raises(FlightError, match="start: agent 0 lies"):
        airflock.simulate(found, start=np.zeros((6, 10)))


def test_open_and_inverted_meshes_are_noted(tmp_path):
    box = trimesh.creation.box(extents=[30.0, 30.0, 30.0])
    box.update_faces(np.arange(len(box.faces)) > 1)
    box.export(tmp_path / "open.stl")
    inverted = trimesh.creation.box(extents=[30.0, 30.0, 30.0])
    inverted.invert()
    inverted.export(tmp_path / "inverted.obj")
    for name, word in (("open.stl", "the mesh is open"), ("inverted.obj", "the mesh is inverted")):
        found = fly_in(tmp_path / name, **{"goals.kind": "none", "start.side": 200.0})
        assert any(word in note for note in found.notes), found.notes


@pytest.mark.parametrize(("size", "unit"), [(0.005, "1000"), (2e6, "0.001")])
def test_a_scene_in_the_wrong_unit_is_refused_with_a_guess(tmp_path, size, unit):
    path = tmp_path / "city.stl"
    trimesh.creation.box(extents=[size] * 3).export(path)
    with pytest.raises(ScenarioError, match="may be in another unit, try scene.unit"):
        fly_in(path)


MISTAKES = {  # of a mesh: how its corners are changed, and what a note or an error then says
    "none": (lambda c, rng: c, ""),
    "mm": (lambda c, rng: 1000.0 * c, r"scene.unit = 0.001"),
    "cm": (lambda c, rng: 100.0 * c, r"scene.unit = 0.01 it is"),
    "inches": (lambda c, rng: c / 0.0254, r"scene.unit = (0.0254|0.01) it is"),
    "map": (lambda c, rng: c + [rng.uniform(2e5, 8e5), rng.uniform(1e6, 9e6), 0.0], "map coordinates .UTM."),
    "altitude": (lambda c, rng: c + [0.0, 0.0, rng.uniform(200.0, 2000.0)], "heights above sea level"),
    "y up": (lambda c, rng: np.stack([c[:, 0], c[:, 2], -c[:, 1]], axis=1), "scene.up = 'y'"),
}
DOUBTS = "times as wide|map coordinates|point up in the file"


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mesh_that_hardly_fits_its_arena_is_questioned_and_a_sound_one_is_not(tmp_path, seed, mistake):
    """Sites of a plate and some towers, drawn at random, in all formats; the same sites with one mistake each."""
    rng = random.Random(f"{seed} {mistake}")
    change, said = MISTAKES[mistake]
    for number in range(50):
        side = rng.uniform(60.0, 300.0)
        parts = [trimesh.creation.box(bounds=[[-0.5 * side, -0.5 * side, -1.0], [0.5 * side, 0.5 * side, 0.0]])]
        for _ in range(rng.randint(1, 5)):
            x, y = (rng.uniform(-0.4, 0.35) * side for _ in range(2))
            w, top = rng.uniform(2.0, 0.05 * side), rng.uniform(5.0, 60.0)
            parts.append(trimesh.creation.box(bounds=[[x, y, 0.0], [x + w, y + w, top]]))
        site = trimesh.util.concatenate(parts)
        truth = site.bounds.copy()
        kind = rng.choice(["stl", "obj", "ply"] + (["glb"] if mistake != "y up" else []))
        site.vertices = change(np.asarray(site.vertices, float), rng)
        if kind == "glb":  # whose y is up
            site.vertices = np.stack([site.vertices[:, 0], site.vertices[:, 2], -site.vertices[:, 1]], axis=1)
        site.export(tmp_path / f"{number}.{kind}")
        keys = {"scene.kind": "mesh", "scene.file": str(tmp_path / f"{number}.{kind}"), "world.walls": "every_edge"}
        keys |= {"world.dimensions": "3", "world.side": rng.uniform(0.5, 1.5) * side, "world.floor": 0.0, "agents": 4}
        try:
            found = airflock.load("vasarhelyi_2018/real_4ms", {**keys, "start.separation": 3.0, "world.ceiling": 80.0})
            lines = "\n".join(found.notes)
        except ScenarioError as error:
            lines = str(error)
            assert mistake != "none", lines
        assert re.search(said, lines) if said else not re.search(DOUBTS, lines), (kind, lines)
        if not said:
            rows = scene_of(found.scene, 3).shapes
            rows = rows[rows[:, 6] == TRIANGLE]
            assert np.allclose(rows[:, :3].min(axis=0), truth[0], atol=0.01), "upright, whatever the format"
            assert np.allclose(rows[:, 3:6].max(axis=0), truth[1], atol=0.01)


@pytest.mark.parametrize("unit", [0.01, 0.001])
def test_a_building_in_a_smaller_unit_beside_its_arena_is_asked_about_the_unit(tmp_path, seed, unit):
    """It is no wider than some arenas, so that only its place shows the unit; map coordinates stay map coordinates."""
    rng = random.Random(f"{seed} {unit}")
    for number in range(10):
        side, wide = rng.uniform(100.0, 200.0), rng.uniform(4.0, 10.0)
        corner = [rng.choice([-1.0, 1.0]) * rng.uniform(0.2, 0.4) * side, rng.uniform(-0.3, 0.3) * side]
        box = np.array([[*corner, 0.0], [corner[0] + wide, corner[1] + wide, 12.0]])
        keys = {"scene.kind": "mesh", "world.walls": "every_edge", "world.dimensions": "3", "world.side": side}
        keys |= {"world.floor": 0.0, "agents": 4, "start.separation": 3.0, "world.ceiling": 80.0}
        for name, bounds in (("small", box / unit), ("map", box + [rng.uniform(2e5, 8e5), rng.uniform(1e6, 9e6), 0.0])):
            path = tmp_path / f"{name}{number}.stl"
            trimesh.creation.box(bounds=bounds).export(path)
            notes = "\n".join(airflock.load("vasarhelyi_2018/real_4ms", {**keys, "scene.file": str(path)}).notes)
            asked = re.search("the unit of the file.* with .*(0.0254|0.01|0.001) it", notes)
            assert (asked is not None) == (name == "small"), notes


def test_an_arena_inside_a_solid_is_no_place_to_start(tmp_path, seed):
    """Of random places in a region that is shut none may look free: each would be found by drawing again."""
    rng = random.Random(seed)
    for number in range(5):
        half = rng.uniform(500.0, 5000.0)
        path = tmp_path / f"{number}.stl"
        tower = trimesh.creation.box(bounds=[[-half, -half, 0.0], [half, half, half]])
        plate = trimesh.creation.box(bounds=[[-9.0 * half, -9.0 * half, -50.0], [9.0 * half, 9.0 * half, 0.0]])
        trimesh.util.concatenate([tower, plate]).export(path)
        keys = {"scene.kind": "mesh", "scene.file": str(path), "world.dimensions": "3", "world.walls": "every_edge"}
        with pytest.raises(ScenarioError, match="the whole region in which agents start lies inside"):
            airflock.load("vasarhelyi_2018/real_4ms", {**keys, "agents": 4, "world.side": 100.0, "world.height": 60.0})


def test_damaged_and_strange_mesh_files_are_refused(tmp_path, hall, monkeypatch):
    short = tmp_path / "short.stl"
    short.write_bytes(hall.read_bytes()[:-60])
    code = tmp_path / "mesh.py"
    code.write_text("raise SystemExit('run')")
    garbage = tmp_path / "garbage.glb"
    garbage.write_bytes(b"glTF" + bytes(range(200)))
    for path, words in (
        (short, "cut short"),
        (code, "is none of"),
        (garbage, "damaged"),
        (tmp_path / "no.obj", "no such"),
    ):
        with pytest.raises(ScenarioError, match=words):
            fly_in(path)
    monkeypatch.setattr(meshes, "MOST_BYTES", 100)
    with pytest.raises(ScenarioError, match="simplify the mesh"):
        fly_in(hall, **{"start.speed": 1.0})  # a scene of its own: the one above is kept


def gltf(points=3, places=1):
    """A glTF document of one triangle whose arrays announce so many corners, at so many places."""
    corners = {"componentType": 5126, "count": points, "type": "VEC3", "min": [0, 0, 0], "max": [50, 50, 0]}
    numbers = {"componentType": 5125, "count": points, "type": "SCALAR"}
    return {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(places))}],
        "nodes": [{"mesh": 0}] * places, "accessors": [corners, numbers],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    }  # fmt: skip


def test_what_a_gltf_file_announces_is_checked_before_room_is_made_for_it(tmp_path):
    """Arrays without data, which would be zeros of any size, and one mesh at ever so many places."""
    path = tmp_path / "mesh.gltf"
    cases = ((gltf(1_500_000_000), "more than 2000000"), (gltf(30_000, 1000), "10000000 triangles"), ([], "damaged"))
    for document, words in (*cases, ({"accessors": [{}]}, "damaged"), ({"nodes": [{"mesh": 9}]}, "damaged")):
        path.write_text(json.dumps(document))
        with pytest.raises(ScenarioError, match=words):
            fly_in(path, **{"start.speed": 1.0})
    trimesh.creation.box(extents=[30.0] * 3).export(tmp_path / "box.glb")
    sound = (tmp_path / "box.glb").read_bytes()
    (tmp_path / "box.glb").write_bytes(sound[:8] + (len(sound) + 64).to_bytes(4, "little") + sound[12:])
    with pytest.raises(ScenarioError, match=f"cut short: {len(sound)} of {len(sound) + 64} bytes"):
        fly_in(tmp_path / "box.glb")


def test_a_mesh_beside_its_scenario_file_is_found(hall):
    path = hall.parent / "mine.toml"
    path.write_text('agents = 3\n[model]\nkind = "kidger"\n[world]\ndimensions = "3"\narena = "none"\n'
                    '[scene]\nkind = "mesh"\nfile = "hall.stl"\n[start]\nkind = "box"\nside = 90.0\n')  # fmt: skip
    assert len(airflock.load(path).stands().shapes) == 13  # and the ground


def test_more_drones_than_points_is_one_clear_line():
    with pytest.raises(AirflockError, match="shape 1 has 10 points, fewer than 20 drones"):
        fly_show([np.zeros((10, 3))], 20)
    with pytest.raises(AirflockError, match="3 drones are more than 2 points"):
        assignment.assign_points(np.zeros((3, 3)), np.zeros((2, 3)), np.zeros(2, bool))
    with pytest.raises(AirflockError, match=r"failing = 1.5"):
        fly_show([np.zeros((10, 3))], 5, 1.5)


def test_pictures_that_show_nothing_are_refused(tmp_path):
    import imageio.v3 as iio

    iio.imwrite(tmp_path / "white.png", np.full((20, 20), 255, np.uint8))
    (tmp_path / "torn.png").write_bytes((tmp_path / "white.png").read_bytes()[:30])
    (tmp_path / "torn.stl").write_bytes(bytes(80) + (9).to_bytes(4, "little"))
    cases = (("white.png", "nothing in it"), ("torn.png", "damaged"), ("none.png", "no such file"))
    for shape, words in (*cases, ("torn.stl", f"{tmp_path / 'torn.stl'}: the file is cut short")):
        with pytest.raises(AirflockError, match=re.escape(words)) as caught:
            shape_points(str(tmp_path / shape), 10)
        assert str(caught.value).startswith(str(tmp_path / shape))  # and names no key that a display lacks


@pytest.mark.parametrize("shape", ["heart.pgn", "drawing.svg", "my drawing.SVG", "there.1"])
def test_a_file_of_another_kind_is_not_flown_as_text(tmp_path, monkeypatch, shape):
    monkeypatch.chdir(tmp_path)
    if shape in ("drawing.svg", "there.1"):
        (tmp_path / shape).write_text("<svg/>")
    with pytest.raises(AirflockError, match=r"no such file|neither a picture nor a mesh") as caught:
        shape_points(shape, 10)
    assert str(caught.value).startswith(f"{shape}: ") and ".png" in str(caught.value) and ".stl" in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("text", ["2.0", "U.S.A", "GO ... NOW", "heart.pgn ", "A" * 300 + "."])
def test_a_text_with_a_point_in_it_is_still_a_text(monkeypatch, text):
    from airflock.displays import shows as shapes

    monkeypatch.setattr(shapes, "_pixels_of_text", lambda _: np.ones((50, 50), bool))
    assert shape_points(text, 10).shape == (10, 3)


BALLS = {
    "scene.kind": "boxes", "scene.spheres": [[0.0, 0.0, 20.0, 15.0, 0.0], [40.0, -30.0, 30.0, 12.0, 1.0]], "agents": 6,
    "scene.boxes": [[50.0, 50.0, 0.0, 60.0, 60.0, 30.0, 0.0]], "goals.kind": "points", "duration": 2.0,
    "goals.points": [[30.0, 0.0, 20.0], [-40.0, 0.0, 20.0]],
}  # fmt: skip


def test_balls_are_in_the_text_of_a_driver_only_where_they_stand_and_fly_as_in_plain_python():
    scenario = airflock.load("kidger/city", BALLS)
    without = airflock.load("kidger/city", {**BALLS, "scene.spheres": []})
    assert "from_sphere" in driver_text(scenario) and "sphere(" not in driver_text(without).replace("_sphere_to_", "")
    plain = fly_world(scenario, 5, precision=64, record=True, device="python").frames
    np.testing.assert_allclose(fly_world(scenario, 5, precision=64, record=True).frames, plain, atol=1e-5)
    flown = airflock.simulate(scenario, 5, device="python")
    apart = np.linalg.norm(flown.position.isel(keypoint=0).values - np.array([0.0, 0.0, 20.0])[:, None], axis=1)
    assert np.nanmin(apart) > 15.0


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"scene.spheres": [[0.0, 0.0, 20.0, -1.0, 0.0]]}, "its radius is -1 m; give more than 0 m"),
        ({"scene.spheres": [[0.0, 0.0, 20.0, 1.0]]}, "is not a list of rows of 5 numbers in m and s"),
        ({"world.dimensions": "2"}, "balls stand beside boxes in space"),
        ({"scene.kind": "city"}, "balls stand beside boxes in space"),
        ({"goals.points": [[0.0, 0.0, 20.0]]}, "lies 15 m inside what stands in the scene"),
    ],
)
def test_wrong_balls_are_said_in_one_line(keys, said):
    with pytest.raises(ScenarioError, match=said):
        airflock.load("kidger/city", {**BALLS, **keys})


@pytest.mark.parametrize("kind", SHAPES)
def test_shape_is_drawn_within_its_bounds_and_by_triangles_on_its_surface(kind, seed):
    rng = np.random.default_rng(seed)
    numbers = {0.0: [0, 0, 0, 2, 3, 4], 1.0: [1, 2, 3, 0, 5], 2.0: rng.normal(size=9), 3.0: [0, 0, 3, 4]}
    numbers |= {5.0: [1, 2, 3, 4]}
    shape = SHAPES[kind]
    (row,) = shape.rows(np.array([numbers[kind]], float))
    vertices, faces = shape.mesh(row[None])
    assert faces.max() < len(vertices) and len(faces)
    plan = shape.plan(row)
    for points in (vertices, *shape.lines(row), np.column_stack([plan, np.full(len(plan), row[2])])):
        assert (np.asarray(points) >= row[:3] - 1e-4).all() and (np.asarray(points) <= row[3:6] + 1e-4).all()
    for vertex in np.asarray(vertices, float):
        assert abs(from_shape(*vertex, [row.tolist()], 0).distance) < 1e-4
