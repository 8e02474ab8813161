"""Corners: what a list of corners is as a polygon. Plain Python, as a drone carries it."""

from collections.abc import Sequence

Corners = Sequence[Sequence[float]]
STRAIGHT = 1e-9  # rad; by how much an outline at least turns at a corner


def signed_area(corners: Corners) -> float:
    """Signed area of a polygon, m²: positive if its corners run counter-clockwise."""
    pairs = zip(corners, [*corners[1:], corners[0]], strict=True)
    return 0.5 * sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs)


def counter_clockwise(corners: Corners) -> list[Sequence[float]]:
    """The corners in counter-clockwise order."""
    return list(corners) if signed_area(corners) > 0.0 else list(corners)[::-1]


def polygon_error(corners: Corners) -> str:
    """Why a list of corners is no simple polygon; empty if it is one."""
    if len(corners) < 3:
        return f"has {len(corners)} corners; a polygon needs at least 3"
    n = len(corners)
    for k in range(n):
        if tuple(corners[k][:2]) == tuple(corners[(k + 1) % n][:2]):
            return f"gives corner [{corners[k][0]:g}, {corners[k][1]:g}] twice in succession"
    edges = [(corners[k], corners[(k + 1) % n]) for k in range(n)]
    for k in range(n):
        if _folds(*edges[k], edges[(k + 1) % n][1]):
            return f"turns back on itself at [{edges[k][1][0]:g}, {edges[k][1][1]:g}]"
        for m in range(k + 2, n if k else n - 1):  # neighbours share a corner
            if _meet(*edges[k], *edges[m]):
                return f"crosses or touches itself near [{edges[m][0][0]:g}, {edges[m][0][1]:g}]"
    return "" if signed_area(corners) != 0.0 else "has no area"


def is_convex(corners: Corners) -> bool:
    """Whether a simple polygon turns one way only."""
    ring = counter_clockwise(corners)
    n = len(ring)
    return all(_turn(ring[k], ring[(k + 1) % n], ring[(k + 2) % n]) >= -1e-9 * abs(signed_area(ring)) for k in range(n))


def _turn(a: Sequence[float], b: Sequence[float], c: Sequence[float]) -> float:
    """Twice the signed area of a triangle, m²: positive for a turn to the left at b."""
    return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])


def without_straight_corners(corners: Corners) -> list[Sequence[float]]:
    """Corners of a simple polygon at which it turns, in order: a straight side is one side, however it is divided."""
    n = len(corners)
    return [b for k, b in enumerate(corners) if _turns(corners[k - 1], b, corners[(k + 1) % n])]


def _turns(a: Sequence[float], b: Sequence[float], c: Sequence[float]) -> bool:
    """Whether the way a b c does not go straight on at b."""
    across = abs(_turn(a, b, c))
    along = (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1])
    return along <= 0.0 or across > STRAIGHT * along


def _folds(a: Sequence[float], b: Sequence[float], c: Sequence[float]) -> bool:
    """Whether the way a b c goes back over itself."""
    return _turn(a, b, c) == 0.0 and (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]) < 0.0


def _meet(a: Sequence[float], b: Sequence[float], c: Sequence[float], d: Sequence[float]) -> bool:
    """Whether the segments a b and c d have a point in common."""
    for k in (0, 1):
        if max(a[k], b[k]) < min(c[k], d[k]) or max(c[k], d[k]) < min(a[k], b[k]):
            return False
    return _turn(a, b, c) * _turn(a, b, d) <= 0.0 and _turn(c, d, a) * _turn(c, d, b) <= 0.0
