"""Detours: ways past what hovers, for drones that are held up behind it.

A drone flies straight for its point and is pushed off what it comes near. Where pull and push balance it stays: a side
of a box that lies just so across the way holds it for good. Who looks from above sees that it makes no progress, and
sends it to a point beside what is in its way first.
"""

import numpy as np
from numpy.typing import NDArray

from airflock.displays.assignment import ExtraLengths, Positions

CLEARANCE = 1.6  # m; a point, or a way, that comes nearer than this to a drone that hovers is not free
BESIDE = 3.0  # m from a drone that hovers: there its push has ended
ROOM = 2.4  # m; nearer to others a drone is pushed (`formation.r0_rep`)
SIDES = 9  # points of the upper half of a circle
STUCK = 3.0  # s without progress
STEP = 1.0  # m; who has moved less meanwhile, with a goal farther ahead than that, is held up: it asks for 1 m/s


def hulls_in_the_way(positions: Positions, points: Positions, hulls: Positions) -> NDArray[np.bool_]:
    """Which hulls stand near ways from places to points (both (n, 3)): (n, hull); not those that a way leads off."""
    way = points - positions
    length2 = np.maximum((way**2).sum(axis=1), 1e-12)[:, None]
    off = hulls[None, :, :] - positions[:, None, :]
    share = np.clip((off * way[:, None, :]).sum(axis=2) / length2, 0.0, 1.0)
    near = np.linalg.norm(off - share[:, :, None] * way[:, None, :], axis=2) < CLEARANCE
    return np.asarray(near & (share > 0.0))


def detour_lengths(positions: Positions, points: Positions, hulls: Positions) -> ExtraLengths:
    """How much longer (drone, point) ways are that lead around a drone that hovers, m."""
    found = np.zeros((len(positions), len(points)))
    for number, point in enumerate(points):
        found[:, number] = hulls_in_the_way(positions, np.broadcast_to(point, positions.shape), hulls).any(axis=1)
    return 2.0 * BESIDE * found


def detour_point(
    position: Positions, point: Positions, hulls: Positions, other_positions: Positions, tried_points: Positions
) -> Positions:
    """A point (3,) beside the first hull on the way from a place to a point (both (3,)), level with that or above it.

    others : places (n, 3) of drones that fly, beside most of which there is room; tried : points (n, 3) of no avail
    """
    met = hulls[hulls_in_the_way(position[None], point[None], hulls)[0]]
    first = met[np.linalg.norm(met - position, axis=1).argmin()]
    along = (point - position) / max(float(np.linalg.norm(point - position)), 1e-9)
    side = np.cross(along, (0.0, 0.0, 1.0))
    side = side / np.linalg.norm(side) if np.linalg.norm(side) > 1e-6 else np.array([1.0, 0.0, 0.0])
    turn = np.linspace(0.0, np.pi, SIDES)[:, None]
    found = first + BESIDE * (np.cos(turn) * side + np.sin(turn) * np.cross(side, along))
    from_here, onwards = np.broadcast_to(position, found.shape), np.broadcast_to(point, found.shape)
    bad = 1e3 * _nearer(found, tried_points, 1.0) + 1e2 * _nearer(found, hulls, CLEARANCE)
    bad += 1e2 * (
        hulls_in_the_way(from_here, found, hulls).sum(axis=1) + hulls_in_the_way(found, onwards, hulls).sum(axis=1)
    )
    bad += 10.0 * _nearer(found, other_positions, ROOM)
    ways = np.linalg.norm(found - position, axis=1) + np.linalg.norm(found - point, axis=1)
    return np.asarray(found[int((bad + ways).argmin())])


def _nearer(points: Positions, others: Positions, distance: float) -> NDArray[np.int64]:
    """How many of the others lie nearer than a distance (m) to each point."""
    return np.asarray((np.linalg.norm(points[:, None] - others[None], axis=2) < distance).sum(axis=1))


class StuckDetector:
    """Who makes none: looks at places and at goals that are under way, one after another.

    period : between two looks, s
    """

    def __init__(self, period: float):
        self.period, self.seen = period, list[tuple[Positions, NDArray[np.bool_]]]()

    def begin(self) -> None:
        """Forget what was seen: everybody sets out."""
        self.seen = []

    def look(self, positions: Positions, goals: Positions) -> NDArray[np.bool_]:
        """Who is held up: places and goals (drone, 3), m; nan for who is not there."""
        behind = np.linalg.norm(goals - positions, axis=1) > STEP
        self.seen = [*self.seen, (positions.copy(), behind)][-1 - round(STUCK / self.period) :]
        if len(self.seen) <= round(STUCK / self.period):
            return np.zeros(len(positions), bool)
        moved = np.linalg.norm(positions - self.seen[0][0], axis=1)
        return np.asarray(np.all([each for _, each in self.seen], axis=0) & (moved < STEP))

    def standing(self, positions: Positions) -> NDArray[np.bool_]:
        """Who has hardly moved since the first of the looks."""
        return np.asarray(np.linalg.norm(positions - self.seen[0][0], axis=1) < STEP)
