"""Headers of mesh files: what a file announces, held against its size and our limits before anything is built from it.

A mesh file is untrusted. trimesh reads what is there of a file that was cut short, and makes room for what a glTF file
announces: arrays without data, and one mesh at a hundred thousand places.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from airflock.support import SceneError

STRIP = 5  # glTF: from this mode on every corner may begin a triangle; before, three corners make one


def check_header(path: Path, kind: str, size: int, max_triangles: int) -> None:
    """Raise SceneError for a file of `size` bytes that is cut short or has more than `max_triangles` triangles."""
    if kind == "stl":
        _stl(path, size)
    elif kind in ("gltf", "glb"):
        try:
            count = _triangles(_glb(path, size) if kind == "glb" else json.loads(path.read_bytes()))
        except SceneError:
            raise
        except Exception as fault:  # any part of the document may be missing or of another kind
            raise SceneError(f"scene.file = {path}: cannot be read, it is damaged or cut short: {fault}") from fault
        if count > max_triangles:
            raise SceneError(f"scene.file = {path}: {count} triangles are more than {max_triangles}; simplify the mesh")


def _stl(path: Path, size: int) -> None:
    with path.open("rb") as file:
        head = file.read(84)
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
