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
from .casts import WITHOUT_SPHERES as WITHOUT_SPHERES
from .edges import (
    nearest_image as nearest_image,
    wrap as wrap,
)
from .excursion import beyond_nothing as beyond_nothing
from .goals import glide as glide
from .inside import inside as inside
from .polygon import obstacle as obstacle
from .scenes.field_outlines import load_field as load_field
from .scenes.meshes import read_mesh as read_mesh
from .scenes.scene_builder import (
    FAR_AWAY as FAR_AWAY,
    SHAPES as SHAPES,
    Scene as Scene,
    clearance as clearance,
    in_mesh as in_mesh,
    make_scene as make_scene,
    prism_mesh as prism_mesh,
    scene_of as scene_of,
    waypoints as waypoints,
    without_appearing as without_appearing,
)
from .shapes import (
    BOX as BOX,
    COLUMNS as COLUMNS,
    CYLINDER as CYLINDER,
    GROUND as GROUND,
    SEGMENT as SEGMENT,
    SPHERE as SPHERE,
    TRIANGLE as TRIANGLE,
)
from .world_map import (
    EDGE_RULES as EDGE_RULES,
    Shapes as Shapes,
    WorldMap as WorldMap,
    arena_ray as arena_ray,
    arena_surfaces as arena_surfaces,
    counter_clockwise as counter_clockwise,
    edge_rows as edge_rows,
    face_rows as face_rows,
    half_sizes as half_sizes,
    inward_plane as inward_plane,
    is_convex as is_convex,
    is_off_centre as is_off_centre,
    obstacle_rule as obstacle_rule,
    polygon_error as polygon_error,
)
