"""Control a show: assign agents to points, send them there, and lead them round what is in the way."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from airflock.engine import Flight
from airflock.parts.bodies import fall
from airflock.scenarios import Scenario, rebuilt
from airflock.support import AirflockError
from airflock.world import glide

BLOCKED = 1e9  # m²; the cost of a point that nobody shall fly to while others are free

Positions = NDArray[np.float64]  # (drone, 3) or (point, 3), m
ExtraLengths = NDArray[np.float64] | float  # (drone, point), m


# Least squared ways: straight lines flown in equal time then keep the spacing over the root of 2
# (Turpin et al. 2014).
def assign_points(
    drones: Positions, points: Positions, blocked: NDArray[np.bool_], extra_lengths: ExtraLengths = 0.0
) -> NDArray[np.int64]:
    """Assign a point to each drone: positions (drone, 3) and points (point, 3) in m; optimal (scipy).

    blocked : of each point, whether something stands in its place
    longer  : how much longer (drone, point) a way is than the straight one, m

    With squared ways no two straight ways come nearer than the drones and the points are apart,
    divided by the root of 2, if all take the same time (Turpin, Michael and Kumar 2014). Raises
    AirflockError for more drones than points.
    """
    if len(drones) > len(points):
        raise AirflockError(f"{len(drones)} drones are more than {len(points)} points")
    return np.asarray(linear_sum_assignment(_squares(drones, points, extra_lengths) + BLOCKED * blocked[None, :])[1])


def is_better_assignment(
    drones: Positions,
    points: Positions,
    current: NDArray[np.int64],
    proposed: NDArray[np.int64],
    extra_lengths: ExtraLengths = 0.0,
) -> bool:
    """Return True if another assignment saves more than a tenth, and more than 1 m², of the squared ways."""
    squares, who = _squares(drones, points, extra_lengths), np.arange(len(drones))
    old, new = (float(squares[who, each].sum()) for each in (current, proposed))
    return new < 0.9 * old and old - new > 1.0


def _squares(drones: Positions, points: Positions, longer: ExtraLengths) -> Positions:
    """Return squares (drone, point) of the lengths of all ways, m²."""
    straight = ((drones[:, None, :] - points[None, :, :]) ** 2).sum(axis=2)
    return straight if isinstance(longer, float) else np.asarray((np.sqrt(straight) + longer) ** 2)


# Detours past drones that hover. A drone flies straight for its point and is repelled by what it
# comes near. Where pull and push balance it stays: a side of a box across the way stops it for
# good. The control sees that it makes no progress, and first sends it to a point beside the
# obstacle.
CLEARANCE = 1.6  # m; a point, or a way, that comes nearer than this to a drone that hovers is not free
BESIDE = 3.0  # m from a drone that hovers: there its push has ended
ROOM = 2.4  # m; nearer to others a drone is pushed (`formation.r0_rep`)
SIDES = 9  # points of the upper half of a circle
STUCK = 3.0  # s without progress
STEP = 1.0  # m; who has moved less meanwhile, with a goal farther ahead than that, is held up: it asks for 1 m/s


def hulls_in_the_way(positions: Positions, points: Positions, hulls: Positions) -> NDArray[np.bool_]:
    """Return which hulls stand near ways from places to points (both (n, 3)): (n, hull); not those that a way leads
    off.
    """
    way = points - positions
    length2 = np.maximum((way**2).sum(axis=1), 1e-12)[:, None]
    off = hulls[None, :, :] - positions[:, None, :]
    share = np.clip((off * way[:, None, :]).sum(axis=2) / length2, 0.0, 1.0)
    near = np.linalg.norm(off - share[:, :, None] * way[:, None, :], axis=2) < CLEARANCE
    return np.asarray(near & (share > 0.0))


def detour_lengths(positions: Positions, points: Positions, hulls: Positions) -> ExtraLengths:
    """Return the extra length (drone, point) of ways that lead around a drone that hovers, m."""
    found = np.zeros((len(positions), len(points)))
    # One point after another: all pairs of drones, points and hulls at once would be a large table.
    for number, point in enumerate(points):
        found[:, number] = hulls_in_the_way(positions, np.broadcast_to(point, positions.shape), hulls).any(axis=1)
    return 2.0 * BESIDE * found


def detour_point(
    position: Positions, point: Positions, hulls: Positions, other_positions: Positions, tried_points: Positions
) -> Positions:
    """Return a point (3,) beside the first hull on the way from a place to a point (both (3,)), level with that or
    above it.

    others : places (n, 3) of drones that fly, beside most of which there is room; tried : points
             (n, 3) of no avail
    """
    met = hulls[hulls_in_the_way(position[None], point[None], hulls)[0]]
    first = met[np.linalg.norm(met - position, axis=1).argmin()]
    along = (point - position) / max(float(np.linalg.norm(point - position)), 1e-9)
    side = np.cross(along, (0.0, 0.0, 1.0))
    side = side / np.linalg.norm(side) if np.linalg.norm(side) > 1e-6 else np.array([1.0, 0.0, 0.0])
    # Points of the upper half of a circle across the way, from one side over the top to the other.
    turn = np.linspace(0.0, np.pi, SIDES)[:, None]
    found = first + BESIDE * (np.cos(turn) * side + np.sin(turn) * np.cross(side, along))
    from_here, onwards = np.broadcast_to(position, found.shape), np.broadcast_to(point, found.shape)
    # Weights are ordered, not tuned: a tried point is worse than a blocked one, that worse than a
    # crowded one, that than any length.
    bad = 1e3 * _nearer(found, tried_points, 1.0) + 1e2 * _nearer(found, hulls, CLEARANCE)
    bad += 1e2 * (
        hulls_in_the_way(from_here, found, hulls).sum(axis=1) + hulls_in_the_way(found, onwards, hulls).sum(axis=1)
    )
    bad += 10.0 * _nearer(found, other_positions, ROOM)
    ways = np.linalg.norm(found - position, axis=1) + np.linalg.norm(found - point, axis=1)
    return np.asarray(found[int((bad + ways).argmin())])


def _nearer(points: Positions, others: Positions, distance: float) -> NDArray[np.int64]:
    """Count the others that lie nearer than a distance (m) to each point."""
    return np.asarray((np.linalg.norm(points[:, None] - others[None], axis=2) < distance).sum(axis=1))


class StuckDetector:
    """Detector of drones without progress: compares places and current goals over a window of time.

    period : between two looks, s
    """

    def __init__(self, period: float):
        self.period, self.seen = period, list[tuple[Positions, NDArray[np.bool_]]]()

    def begin(self) -> None:
        """Forget all observations: everybody sets out."""
        self.seen = []

    def look(self, positions: Positions, goals: Positions) -> NDArray[np.bool_]:
        """Return which drones are stuck: places and goals (drone, 3), m; nan for an absent one."""
        behind = np.linalg.norm(goals - positions, axis=1) > STEP
        self.seen = [*self.seen, (positions.copy(), behind)][-1 - round(STUCK / self.period) :]
        if len(self.seen) <= round(STUCK / self.period):
            return np.zeros(len(positions), bool)
        moved = np.linalg.norm(positions - self.seen[0][0], axis=1)
        return np.asarray(np.all([each for _, each in self.seen], axis=0) & (moved < STEP))

    def standing(self, positions: Positions) -> NDArray[np.bool_]:
        """Return which drones have hardly moved since the first observation."""
        return np.asarray(np.linalg.norm(positions - self.seen[0][0], axis=1) < STEP)


NEAR = 1.0  # m; a drone is placed within
CHECK = 5.0  # s; how often the master looks once all should be there
LOOK = 1.0  # s; how often it looks for drones that make no progress
# On the flat side of a box the pull to the goal and the push off it balance stably: one shape of 25
# was never completed.
PATIENCE = 60.0  # s; how long it waits for a shape at most
HALF = 0.35  # m; half side of the box that stands for a drone that hovers

FrameArray = NDArray[np.float64]


@dataclass
class ShapeReport:
    """Report on how one shape was formed.

    time     : until every surviving drone was within 1 m of its point, s; nan if never
    error, worst : mean and largest distance of a surviving drone from its point at the end, m
    drones   : surviving; collisions : of two drones; struck : by one that falls; hulls : with one
               that hovers
    reassigned : number of reassignments; detours : how often a drone was sent around what held it
                 up
    """

    time: float
    error: float
    worst: float
    drones: int
    collisions: int
    struck: int
    hulls: int
    reassignment_count: int
    detour_count: int


class ShowControl:
    """Controller that assigns points to the drones, and supervises their progress.

    flight  : of all drones, from the first shape to the last
    target  : of each drone the number of its point, also of those that have failed
    way, left : where all set out and where to (drone, 3), m; when, and how long they are under way,
                s
    around  : by drone: where it flies first, for something stands in its way; tried : all such
              points of this shape
    failing : whether some will fail: one driver then flies the whole show
    hulls   : places of those that hover; falling : position and velocity (6,) of those that fall
    """

    def __init__(self, scenario: Scenario, waiting_points: Positions, points: Positions, seed: int, *, failing: bool):
        self.scenario, self.period, self.points = scenario, scenario.metrics.period, points
        self.target = assign_points(waiting_points, points, np.zeros(len(points), bool))
        self.around: dict[int, Positions] = {}
        self.tried: dict[int, list[Positions]] = {}
        self.hulls: list[NDArray[np.float64]] = []
        self.falling_drones: list[NDArray[np.float64]] = []
        self.shape_reports: list[ShapeReport] = []
        self.struck = self.reassignment_count = self.detour_count = 0
        self.score_windows: list[int] = []  # how many windows of scores had been closed when a shape was begun
        start = np.zeros((6, len(waiting_points)))
        start[:3] = waiting_points.T
        keys: dict[str, Any] = {"goals.points": self._aims(), "duration": PATIENCE}
        self.flight = Flight(rebuilt(scenario, keys), seed, precision=64, record=True, start=start, absence=failing)
        self.progress, self.last_look_time = StuckDetector(LOOK), 0.0
        self.last_way, self.left = (np.zeros((0, 3)), np.zeros((0, 3))), (0.0, 0.0)
        self._set_out()

    def form(self, points: FrameArray, failures: list[tuple[int, str, float]]) -> None:
        """Fly until the shape stands; failures: who, how, and when as a share of the way."""
        self.points, self.begun, self.placed = points, self.flight.time, float("nan")
        self.struck = self.reassignment_count = self.detour_count = 0
        self.around, self.tried = {}, {}
        if self.shape_reports:
            self._assign(first=True)
        self.score_windows.append(len(self.flight.windows))
        planned = self._under_way()
        for who, how, share in sorted(failures, key=lambda f: f[2]):
            self._fly(max(share * planned - (self.flight.time - self.begun), 0.0))
            self._fail(who, how)
        self._fly(max(self._under_way(), 1.0))
        until = self.flight.time + PATIENCE
        while self.flight.time < until and not self._stands():
            self._fly(self._under_way() + CHECK if self._assign() else CHECK)
        far = self._distances()
        # collisions and contacts are known when the flight is closed
        counts = (len(far), 0, self.struck, 0, self.reassignment_count, self.detour_count)
        self.shape_reports.append(ShapeReport(self.placed, float(far.mean()), float(far.max()), *counts))

    def finish(self) -> list[ShapeReport]:
        """End the flight with its last sample; the figures of all shapes, with the collisions of their windows."""
        self.flight.change({"duration": self.flight.time})
        scores = [window.scores for window in self.flight.windows] + [self.flight.finish()]
        for formed, first, last in zip(
            self.shape_reports, self.score_windows, [*self.score_windows[1:], len(scores)], strict=True
        ):
            formed.collisions = int(sum(found["n_coll"] for found in scores[first:last]))
            formed.hulls = int(sum(found["n_env_coll"] for found in scores[first:last]))
        return self.shape_reports

    def _assign(self, *, first: bool = False, failed: bool = False) -> bool:
        """Assign points again where that saves way; whether it did. What stands in the way is sent in any case."""
        there, blocked = self.flight.present, np.zeros(len(self.points), bool)
        for hull in self.hulls:
            blocked |= np.linalg.norm(self.points - hull, axis=1) < CLEARANCE
        places = self.flight.state[:3, there].T
        more: ExtraLengths = (
            detour_lengths(places, self.points, np.array(self.hulls)) if self.tried and self.hulls else 0.0
        )
        found = assign_points(places, self.points, blocked, more)
        changed = first or bool(blocked[self.target[there]].any())
        changed = changed or is_better_assignment(places, self.points, self.target[there], found, more)
        if changed:
            self.reassignment_count += 0 if first else 1
            self.target[there] = found
        self.target[~there] = self.target[there][0]  # who has failed goes nowhere: any point that is free will do
        if changed or failed:
            self._tell()
        return changed

    def _tell(self) -> None:
        """Send each drone its goal, and the hulls that stand in the way."""
        boxes = [[*(hull - HALF), *(hull + HALF), 0.0] for hull in self.hulls]
        self.flight.change({"goals.points": self._aims(), "scene.boxes": boxes})
        self._set_out()

    def _set_out(self) -> None:
        """Note when and where all set out for their aims; to the same aims they go on."""
        aims, places = np.array(self._aims()), self.flight.state[:3].T
        if not np.array_equal(aims, self.last_way[1]):
            far = np.linalg.norm(aims - places, axis=1)[self.flight.present].max()
            self.last_way, self.left = (places.copy(), aims), (self.flight.time, 1.5 * far / self.scenario.goals.speed)
            self.progress.begin()

    def _mind(self) -> None:
        """Send drones out again that make no progress; those past an obstacle go on to their points."""
        there = self.flight.present
        places = np.where(there, self.flight.state[:3], np.nan).T
        past = [who for who, first in self.around.items() if not np.linalg.norm(places[who] - first) > NEAR]
        for who in past:  # or who has failed on the way
            del self.around[who]
        since, lasts = self.flight.time - self.left[0], self.left[1]
        held = np.flatnonzero(self.progress.look(places, glide(*self.last_way, since, lasts)))
        if len(held):
            self._send_out(held, places)
        elif past:
            self._tell()

    def _send_out(self, held: NDArray[np.int64], places: Positions) -> None:
        """Give those who are held up another point where that saves way, or a way around who hovers or waits."""
        standing = self.progress.standing(places)
        self.tried = {int(who): [] for who in held} | self.tried
        self._assign()
        # Another point may be the simplest way out, so points are assigned again before detours are
        # planned.
        for who in held:
            met = np.array([*self.hulls, *places[standing & (np.arange(len(places)) != who)]]).reshape(-1, 3)
            point = self.points[self.target[who]]
            if not hulls_in_the_way(places[who][None], point[None], met).any():
                self.around.pop(int(who), None)
                continue
            others = np.delete(places, who, axis=0)
            tried = np.array(self.tried[int(who)]).reshape(-1, 3)
            self.around[int(who)] = detour_point(places[who], point, met, others, tried)
            self.tried[int(who)].append(self.around[int(who)])
            self.detour_count += 1
        self._tell()

    def _aims(self) -> list[list[float]]:
        """Return the goal of each drone: its point, or a detour round what stands in its way."""
        aims = [self.around.get(who, self.points[k]) for who, k in enumerate(self.target)]
        return [list(map(float, aim)) for aim in aims]

    def _under_way(self) -> float:
        """Return the time (s) that all have to reach their points."""
        return 1.5 * float(self._distances().max()) / self.scenario.goals.speed + 4.0

    def _distances(self) -> FrameArray:
        there = self.flight.present
        away = self.flight.state[:3, there].T - self.points[self.target[there]]
        return np.asarray(np.linalg.norm(away, axis=1))

    def _stands(self) -> bool:
        return bool(self._distances().max() <= NEAR)

    def _fail(self, who: int, how: str) -> None:
        """Take one drone out of the flock: it falls, or stands in the way; the others are given points again."""
        state = self.flight.state[:, who].copy()
        self.flight.remove(who, f"fails: {how}")
        if how == "hover":
            self.hulls.append(state[:3])
        else:
            self.falling_drones.append(state)
        self._assign(failed=how == "hover")

    def _fly(self, seconds: float) -> None:
        """Fly for a while, and look at each sample."""
        flight = self.flight
        samples = round(seconds / self.period)
        if flight.time + samples * self.period > flight.scenario.flight.duration:
            flight.change({"duration": flight.time + samples * self.period + PATIENCE})
        # The flight runs sample by sample, because assignments react to what has just happened.
        for _ in range(samples):
            flight.advance(self.period)
            if flight.time > self.last_look_time + LOOK - 0.5 * self.period:
                self.last_look_time = flight.time
                self._mind()
            self._drop(flight.state[:3, flight.present])
            if not self._stands():
                self.placed = float("nan")
            elif np.isnan(self.placed):
                self.placed = flight.time - self.begun

    def _drop(self, places: FrameArray) -> None:
        """Move the drones that fall, and count those that they strike; places (3, drone) of those that fly."""
        reach, left = self.scenario.metrics.r_coll, []
        # A failed drone has left the flock, so its fall is integrated here.
        for body in self.falling_drones:
            touching = np.zeros(places.shape[1], bool)
            for _ in range(10):  # a fall of 10 m/s takes 10 cm in a tenth of a frame
                body = np.array(fall(body[0], body[1], body[2], body[3], body[4], body[5], 0.1 * self.period))
                near = np.linalg.norm(places.T - body[:3], axis=1) < reach
                self.struck += int((near & ~touching).sum())
                touching = near
            if body[2] > 0.0:
                left.append(body)
        self.falling_drones = left
