"""Scenery: which scene stands in a world, the keys `scene.*`. Positions are relative to the arena's centre."""

from dataclasses import dataclass

from airflock.core import Parameters as Record, choice, points, quantity, text

OURS = "our choice; the thesis's scenes are not available"


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """A city or a forest made from a seed, a mesh from a file, or given boxes. The ground is at height 0."""

    kind: str = choice("none", ("none", "city", "forest", "mesh", "boxes"), meaning="what the scene is made of")
    seed: float = quantity(0, "1", low=0, high=2**31, meaning="seed of the city or forest, a whole number")
    draw: str = choice(
        "once",
        ("once", "flight"),
        source="our choice",
        meaning="city, forest: the same for all flights, or each flight draws its own, with its free goals, from "
        "scene.seed and the flight's seed",
    )
    density: float = quantity(
        1.0, "1", low=0.0, high=5.0, source=OURS, meaning="share of the blocks or trees that are present"
    )
    ground: str = choice("yes", ("yes", "no"), meaning="whether there is ground below; never in a plane")
    blocks: float = quantity(
        10, "1", low=1, high=200, source=OURS, meaning="city: number of blocks along each side, a whole number"
    )
    block: float = quantity(30.0, "m", low=0.1, high=1e4, source=OURS, meaning="city: side of a block")
    street: float = quantity(15.0, "m", low=0.1, high=1e4, source=OURS, meaning="city: width of a street")
    low: float = quantity(15.0, "m", low=0.1, high=1e4, source=OURS, meaning="city: height of the lowest building")
    high: float = quantity(60.0, "m", low=0.1, high=1e4, source=OURS, meaning="city: height of the highest building")
    trees: float = quantity(400, "1", low=0, high=1e6, source=OURS, meaning="forest: number of trees at density 1")
    side: float = quantity(200.0, "m", low=0.1, high=1e5, source=OURS, meaning="forest: side of its square")
    later: float = quantity(
        0.0, "1", low=0.0, high=1.0, meaning="share of the buildings or trees that appear during the flight"
    )
    later_until: float = quantity(
        60.0,
        "s",
        low=0.0,
        high=1e6,
        source=OURS,
        meaning="time by which all of these have appeared; the seed draws when each does",
    )
    boxes: tuple[tuple[float, ...], ...] = points(
        "m and s", 2, axes=7, meaning="boxes: lowest and highest corner, and when it appears: [x, y, z, x, y, z, time]"
    )
    spheres: tuple[tuple[float, ...], ...] = points(
        "m and s",
        2,
        axes=5,
        meaning="boxes: balls beside them: centre, radius, and when it appears: [x, y, z, r, time]",
    )
    file: str = text(meaning="mesh: file of triangles (glTF, OBJ, STL and others), beside the scenario or absolute")
    unit: float = quantity(1.0, "m", low=1e-6, high=1e6, meaning="mesh: length of one unit of the file")
    up: str = choice(
        "standard", ("standard", "z", "y"), meaning="mesh: axis of the file that is up; by standard y in glTF, else z"
    )
