# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from . import (
    arena as arena,
    bvh as bvh,
    edges as edges,
    goals as goals,
    polygon as polygon,
    rays as rays,
    scenery as scenery,
    start as start,
)
from .arena import heights_of as heights_of
from .corners import (
    counter_clockwise as counter_clockwise,
    is_convex as is_convex,
    polygon_error as polygon_error,
)
from .edges import (
    nearest_image as nearest_image,
    wrap as wrap,
)
from .excursion import beyond_nothing as beyond_nothing
from .goals import glide as glide
from .inside import inside as inside
from .place import (
    Shapes as Shapes,
    WorldMap as WorldMap,
    edge_rows as edge_rows,
    half_sizes as half_sizes,
    inward_plane as inward_plane,
    is_off_centre as is_off_centre,
    obstacle_rule as obstacle_rule,
)
from .polygon import obstacle as obstacle
from .scenes.build import (
    Scene as Scene,
    clearance as clearance,
    in_mesh as in_mesh,
    scene_of as scene_of,
    waypoints as waypoints,
)
from .scenes.meshes import read_mesh as read_mesh
from .scenes.outlines import load_field as load_field
from .scenes.tree import (
    FAR_AWAY as FAR_AWAY,
    make_scene as make_scene,
    without_appearing as without_appearing,
)
from .shapes import (
    BOX as BOX,
    COLUMNS as COLUMNS,
    CYLINDER as CYLINDER,
    SEGMENT as SEGMENT,
    TRIANGLE as TRIANGLE,
)
from .surfaces import (
    EDGE_RULES as EDGE_RULES,
    arena_ray as arena_ray,
    arena_surfaces as arena_surfaces,
    face_rows as face_rows,
)
