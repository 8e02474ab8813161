"""Meshes of the user's: read by trimesh, checked, turned upright, as rows of triangles. A mesh file is untrusted."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.support import SceneError, as_error, expand_path
from airflock.world import scenery
from airflock.world.scenes.scene_builder import segment_rows, triangle_rows
from airflock.world.shapes import CLOSED

STRIP = 5  # glTF: from this mode on every corner may begin a triangle; before, three corners make one


@contextmanager
def _damaged(path: Path) -> Iterator[None]:
    """Turn whatever a parser raises into a SceneError."""
    try:
        yield
    except SceneError:
        raise
    except Exception as fault:
        raise SceneError(f"scene.file = {path}: cannot be read, it is damaged or cut short: {fault}") from fault


def _refuse_many(path: Path, count: int, most: int) -> None:
    if count > most:
        raise SceneError(f"scene.file = {path}: {count} triangles are more than {most}; simplify the mesh")


def check_header(path: Path, kind: str, size: int, max_triangles: int) -> None:
    """Raise SceneError for a file of `size` bytes that is cut short or has more than `max_triangles` triangles."""
    if kind == "stl":
        _stl(path, size)
    elif kind in ("gltf", "glb"):
        with _damaged(path):  # any part of the document may be missing or of another kind
            count = _triangles(_glb(path, size) if kind == "glb" else json.loads(path.read_bytes()))
        _refuse_many(path, count, max_triangles)


def _stl(path: Path, size: int) -> None:
    with path.open("rb") as file:
        head = file.read(84)
        # Some programs begin the header of a binary file with "solid", too; a line break in it
        # marks a text.
        if head[:5].lower() == b"solid" and b"\n" in head:
            file.seek(max(0, size - 512))
            if b"endsolid" not in file.read():
                raise SceneError(f"scene.file = {path}: the file is cut short: it does not end with endsolid")
            return
    announced = 84 + 50 * int.from_bytes(head[80:84], "little")
    if size < announced:
        raise SceneError(f"scene.file = {path}: the file is cut short: {size} of {announced} bytes")


def _glb(path: Path, size: int) -> Any:
    """The document inside a binary glTF file."""
    with path.open("rb") as file:
        head = file.read(20)
        announced, length = (int.from_bytes(head[k : k + 4], "little") for k in (8, 12))
        if head[:4] == b"glTF" and size < announced:
            raise SceneError(f"scene.file = {path}: the file is cut short: {size} of {announced} bytes")
        return json.loads(file.read(min(length, size)))


def _triangles(document: Any) -> int:
    """Triangles of all meshes at all places of a glTF document; those of an array that is nowhere count too."""
    counts = [abs(int(accessor["count"])) for accessor in document.get("accessors", ())]
    meshes = [
        sum(_of_primitive(primitive, counts) for primitive in mesh["primitives"]) for mesh in document.get("meshes", ())
    ]
    placed: int = sum(meshes[node["mesh"]] for node in document.get("nodes", ()) if "mesh" in node)
    return max(placed, *(count // 3 for count in counts), 0) if counts else placed


def _of_primitive(primitive: Mapping[str, Any], counts: list[int]) -> int:
    corners: int = counts[primitive["indices"] if "indices" in primitive else primitive["attributes"]["POSITION"]]
    return corners if primitive.get("mode", 0) >= STRIP else corners // 3


MOST_BYTES = 200_000_000  # a larger file is refused before it is opened
MOST_TRIANGLES = 2_000_000
FORMATS = ("glb", "gltf", "obj", "off", "ply", "stl")  # read by trimesh from nothing but the file and its parts
LEAST, MOST = 1.0, 1e5  # m; a world for drones is neither smaller nor larger


def load_mesh(p: scenery.Parameters, dimensions: int) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Triangles of scene.file, one a row, in m, z up; in a plane, its walls where it crosses height 0. And notes."""
    with as_error(f"scene.file = {p.file}", SceneError):  # what a damaged file holds may break at any later step
        return _loaded(p, dimensions)


def _loaded(p: scenery.Parameters, dimensions: int) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    mesh = read_mesh(expand_path(p.file))
    notes = []
    corners = np.asarray(mesh.vertices, float) * p.unit
    gltf = p.up == "standard" and Path(p.file).suffix.lower() in (".glb", ".gltf")
    if gltf:
        notes.append(
            f"scene.file = {p.file}: glTF has y up by its standard, and is turned upright; scene.up = 'z' leaves it"
        )
    if gltf or p.up == "y":
        # A quarter turn about x. Two axes that merely change places would mirror the mesh, and turn
        # its faces inside out.
        corners = np.stack([corners[:, 0], -corners[:, 2], corners[:, 1]], axis=1)
    faults = mesh_size_errors(p, corners)
    if faults:
        raise SceneError("\n".join(faults))
    mesh.vertices = corners
    closed = closed_faces(mesh)
    if not closed.all():
        notes.append(
            f"scene.file = {p.file}: the mesh is open, {int((~closed).sum())} of {len(closed)} triangles; these "
            "surfaces stop agents from both sides, but nothing is inside them"
        )
    if closed.any() and (not mesh.is_winding_consistent or mesh.submesh([closed], append=True).volume < 0.0):
        notes.append(
            f"scene.file = {p.file}: the mesh is inverted (its faces look inwards); "
            "its surfaces are taken from both sides"
        )
    found = triangle_rows(corners[np.asarray(mesh.faces)])
    found[:, CLOSED] = closed
    sound = mesh.area_faces > 1e-12
    if not sound.all():
        notes.append(f"scene.file = {p.file}: {int((~sound).sum())} triangles without area were left out")
        found = found[sound]
    if dimensions == 2:
        found = cut_at_ground(mesh, closed)
        if not len(found):
            raise SceneError(f"scene.file = {p.file}: in a plane the mesh is cut at height 0, but nothing stands there")
    return found, tuple(notes)


def closed_faces(mesh: Any) -> NDArray[np.bool_]:
    """Return a mask (face,) of the faces of closed surfaces: of connected parts without a free edge."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    faces = np.asarray(mesh.faces)
    sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    ends, uses = np.unique(sides, axis=0, return_counts=True)
    size = len(mesh.vertices)
    parts = connected_components(coo_array((np.ones(len(ends)), ends.T), (size, size)), directed=False)[1]
    closed = np.ones(size, bool)
    # An edge of an odd number of faces is free; a single one opens the whole part.
    closed[parts[ends[uses % 2 == 1, 0]]] = False
    found: NDArray[np.bool_] = closed[parts[faces[:, 0]]]
    return found


def cut_at_ground(mesh: Any, closed: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Walls where a mesh crosses height 0, as segments that have its outside on their right."""
    from trimesh import intersections

    crossings: Any = intersections.mesh_plane
    # A micrometre above 0, since the floor of a house often lies in the plane itself.
    lines, faces = crossings(mesh, (0.0, 0.0, 1.0), (0.0, 0.0, 1e-6), return_faces=True)
    a, b = np.asarray(lines).reshape(-1, 2, 3)[:, :, :2].transpose(1, 0, 2)
    out = mesh.face_normals[faces]
    turned = (b - a)[:, 1] * out[:, 0] - (b - a)[:, 0] * out[:, 1] < 0.0
    found = segment_rows(np.where(turned[:, None], np.hstack([b, a]), np.hstack([a, b])))
    found[:, CLOSED] = closed[faces]
    return found


def read_mesh(path: Path) -> Any:
    """Mesh of a file. Raises SceneError where it is missing, too large, of another format, empty or damaged."""
    try:
        import trimesh
    except ModuleNotFoundError as fault:
        raise SceneError(f"scene.file = {path}: meshes need trimesh: pip install 'airflock[scenes]'") from fault

    kind = path.suffix.lower().lstrip(".")
    if not path.is_file():
        raise SceneError(f"scene.file = {str(path)!r}: no such file")
    if kind not in FORMATS:
        raise SceneError(f"scene.file = {path}: .{kind} is none of {', '.join(FORMATS)}")
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise SceneError(
            f"scene.file = {path}: {size / 1e6:.0f} MB is more than {MOST_BYTES / 1e6:.0f} MB; simplify the mesh"
        )
    # Before trimesh opens it: a small file that places one mesh many times expands to all of them.
    check_header(path, kind, size, MOST_TRIANGLES)
    with _damaged(path):  # any parser may fail in any way on a damaged file
        mesh: Any = trimesh.load(path, force="mesh", process=True, skip_materials=True)
        faces, corners = np.asarray(mesh.faces), np.asarray(mesh.vertices, float)
    if not len(faces):
        raise SceneError(f"scene.file = {path}: no triangles in it; it is empty, damaged or cut short")
    _refuse_many(path, len(faces), MOST_TRIANGLES)
    if not np.isfinite(corners).all() or faces.max() >= len(corners):
        raise SceneError(
            f"scene.file = {path}: some corners are missing or not numbers; the file is damaged or cut short"
        )
    return mesh


def mesh_size_errors(p: scenery.Parameters, corners: NDArray[np.float64]) -> list[str]:
    """Return the errors of the size of a mesh, one line each."""
    size = float(np.ptp(corners, axis=0).max())
    if LEAST <= size <= MOST:
        return []
    guess = min(
        (1e-3, 0.01, 0.0254, 0.3048, 1.0, 1000.0), key=lambda u: abs(np.log(max(size, 1e-30) / p.unit * u / 300.0))
    )
    return [
        f"scene.file = {p.file}: the mesh is {size:.3g} m large with scene.unit = {p.unit:g} m, "
        f"outside [{LEAST:g}, {MOST:g}] m; it may be in another unit, try scene.unit = {guess:g}"
    ]
