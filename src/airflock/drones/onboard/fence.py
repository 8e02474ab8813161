"""The fence: a polygon that no drone leaves, convex or not."""

from collections.abc import Sequence

from airflock.core import FAR
from airflock.world import counter_clockwise, inward_plane, is_convex, polygon

FenceSide = tuple[float, float, float, float]


class Fence:
    """Sides of a polygon as the limiter reads them.

    corners : of a simple polygon, m
    """

    def __init__(self, corners: Sequence[Sequence[float]]):
        ring = counter_clockwise(corners)
        pairs = list(zip(ring, [*ring[1:], ring[0]], strict=True))
        self.edges = [[*a[:2], *b[:2]] for a, b in pairs]
        self.convex_planes = [inward_plane(a, b) for a, b in pairs] if is_convex(corners) else []

    def sides(self, x: float, y: float) -> list[FenceSide]:
        """Distance (m, negative beyond) and inward unit normal of each side that can be met from a position.

        All of a convex fence; of any other those that can be seen, and the nearest point for who is outside.
        """
        if self.convex_planes:
            return [(a * x + b * y + d, a, b, 0.0) for a, b, _, d in self.convex_planes]
        count = len(self.edges)
        found = [polygon.wall(x, y, 0.0, self.edges, e, count, FAR) for e in range(count)]
        found.append(polygon.outside(x, y, 0.0, self.edges, count))
        return [(s.distance, s.nx, s.ny, 0.0) for s in found if s.distance < FAR]

    def outside(self, x: float, y: float) -> float:
        """Distance beyond the fence, m; negative inside."""
        if self.convex_planes:
            return -min([a * x + b * y + d for a, b, _, d in self.convex_planes])
        return float(polygon.obstacle(x, y, 0.0, self.edges, 0, len(self.edges)).distance)
