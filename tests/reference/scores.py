"""Order parameters: pairs, clusters, members and agents of one instant in plain loops, and their sums over time."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from airflock.check.models import FlockSolver, rule_solver
from airflock.core.agent import START, reduce_records, reduce_values
from airflock.core.contract import State, call_rule
from airflock.core.maths import TINY, norm
from airflock.core.metric import Metric
from airflock.core.vocabulary import Mean
from airflock.engine.text.probe import scratch_shapes
from airflock.scenarios.flight_world import FlightWorld

Record = Any  # a NamedTuple of floats that a metric declares


class Scores:
    """Running sums of the order parameters of one flight.

    metrics   : what is measured; q : their parameters
    place     : the world of the flight: excursion of a position, touches on a way, offsets to nearest images
    wing      : parameters of the wing, for metrics that survey the whole flock
    """

    def __init__(
        self,
        metrics: Sequence[Metric],
        q: Any,
        place: FlightWorld,
        dimensions: int = 2,
        wing: Any = None,
    ):
        self.wing = wing
        self.surveys: dict[str, FlockSolver | None] = {}
        self.place = place
        self.image = place.image_offset
        self.dimensions = float(dimensions)
        self.metrics = tuple(metrics)
        self.q = q
        self.before: dict[int, State] = {}
        self.who: Sequence[int] = ()
        self.rays: Sequence[float] = ()
        self.memories: dict[str, dict[int, Record]] = {}
        self.sums = {
            name: START[how if how in ("min", "max") else "sum"] for m in self.metrics for name, how in _over_time(m)
        }
        self.counts = {"sample": 0, "collision": 0}

    def look(
        self, clock: str, flock: Sequence[State], time: float, rays: Sequence[float] = (), *,
        who: Sequence[int] | None = None, count: bool = True,
    ) -> dict[str, float]:  # fmt: skip
        """Measure the flock now by the metrics of one clock, add to the sums, and return the values.

        time : since the start, s; rays : cast by each agent at its last decision
        who : numbers of those who are there, by default all; count : whether this instant counts
        """
        values: dict[str, float] = {}
        self.counts[clock] += count
        who = range(len(flock)) if who is None else who
        if list(who) != list(self.who):
            self.surveys, self.who = {}, who
        self.time, self.rays = time, rays or [0.0] * len(flock)
        for metric in self.metrics:
            if metric.clock != clock:
                continue
            sample = self._sample(metric, flock)
            for (name, how), value in zip(_over_time(metric), sample, strict=True):
                if count:
                    self.sums[name] = reduce_values("sum" if how == "mean" else how, self.sums[name], value)
                values[name] = value
        if clock == "collision":
            self.before = dict(zip(who, flock, strict=True))
        return values

    def totals(self) -> dict[str, float]:
        """Named order parameters of the whole flight."""
        found: dict[str, float] = {}
        for metric in self.metrics:
            count = max(self.counts[metric.clock], 1)
            own = {
                name: self.sums[name] / count if how == "mean" else self.sums[name] for name, how in _over_time(metric)
            }
            found |= metric.total(own) if metric.total is not None else own
        return found

    def _sample(self, metric: Metric, flock: Sequence[State]) -> Record:
        given: dict[str, Any] = {"n": float(len(flock)), "mean": mean_of(flock), "q": self.q}
        given |= {"dimensions": self.dimensions, "time": self.time, "wing": self.wing}
        if metric.agent is not None:
            given["agents"] = self._agents(metric, metric.agent, flock, given["mean"])
        if metric.cluster is not None:
            given["clusters"] = self._clusters(metric, metric.cluster, flock)
        return call_rule(metric.sample, "sample", given, metric.name)

    def _survey(self, metric: Metric, agents: int) -> FlockSolver | None:
        """A metric's rule of the whole flock, with scratch that lasts for the flight; None if it has none."""
        if metric.survey is None:
            return None
        given = {"q": self.q, "wing": self.wing}
        shapes = scratch_shapes(metric.workspace, agents, given)
        return rule_solver(metric.survey, "survey", metric.Shared, shapes, given, metric.name)

    def _agents(self, metric: Metric, rule: Callable[..., Any], flock: Sequence[State], mean: Mean) -> Record:
        if metric.Memory is not None:
            self.memories.setdefault(metric.name, {})
        if metric.name not in self.surveys:
            self.surveys[metric.name] = self._survey(metric, len(flock))
        survey = self.surveys[metric.name]
        shared = survey(flock) if survey else [None] * len(flock)
        terms = []
        for i, state in enumerate(flock):
            speed = norm(state.vx, state.vy, state.vz)
            given: dict[str, Any] = {
                **state._asdict(),
                **dict(zip(("hx", "hy", "hz"), heading(state), strict=True)),
                "speed": speed,
                "excursion": self.place.excursion(state.x, state.y, state.z),
                "touches": self._touches(metric, state, i),
                "rays": self.rays[i],
                "pair": self._pairs(metric, flock, i),
                "mean": mean,
                "shared": shared[i],
                "wing": self.wing,
                "q": self.q,
            }
            if metric.Memory is None:
                terms.append(call_rule(rule, "agent", given, metric.name))
            else:
                memories, number = self.memories[metric.name], self.who[i]
                given["memory"] = memories.get(number, metric.Memory())
                term, memories[number] = call_rule(rule, "agent", given, metric.name)
                terms.append(term)
        assert metric.Agent is not None
        return reduce_records(metric.Agent, metric.reduce, terms)

    def _touches(self, metric: Metric, state: State, i: int) -> float:
        if metric.clock != "collision":
            return 0.0
        return self.place.touches(self.before.get(self.who[i], state), state, self.q.r_body)

    def _pairs(self, metric: Metric, flock: Sequence[State], i: int) -> Record:
        if metric.pair is None:
            return None
        terms = []
        for j in range(len(flock)):
            if j == i:
                continue
            dx, dy, dz, r2 = self._offset(flock[i], flock[j])
            given = {"dx": dx, "dy": dy, "dz": dz, "r2": r2, "r": norm(dx, dy, dz), "q": self.q}
            given["lower"] = 1.0 if j < i else 0.0
            terms.append(call_rule(metric.pair, "pair", given, metric.name))
        assert metric.Pair is not None
        return reduce_records(metric.Pair, metric.reduce, terms)

    def _clusters(self, metric: Metric, rule: Callable[..., Any], flock: Sequence[State]) -> Record:
        def linked(i: int, j: int) -> bool:
            dx, dy, dz, r2 = self._offset(flock[i], flock[j])
            given = {"r": norm(dx, dy, dz), "r2": r2, "q": self.q}
            assert metric.linked is not None
            return bool(call_rule(metric.linked, "linked", given, metric.name))

        terms = []
        for members in connected(len(flock), linked):
            headings = [heading(flock[i]) for i in members]
            hx, hy, hz = (sum(h[axis] for h in headings) for axis in range(3))
            hh = sum(x * x + y * y + z * z for x, y, z in headings)
            given = {"n": float(len(members)), "hx": hx, "hy": hy, "hz": hz, "hh": hh, "q": self.q}
            if metric.member is not None:
                given |= self._members(metric, metric.member, flock, members)
            terms.append(call_rule(rule, "cluster", given, metric.name))
        assert metric.Cluster is not None
        return reduce_records(metric.Cluster, metric.reduce, terms)

    def _members(
        self, metric: Metric, rule: Callable[..., Any], flock: Sequence[State], members: list[int]
    ) -> dict[str, Any]:
        mean = mean_of([flock[i] for i in members])
        terms = []
        for i in members:
            hx, hy, hz = heading(flock[i])
            given = {**flock[i]._asdict(), "hx": hx, "hy": hy, "hz": hz, "mean": mean, "q": self.q}
            given |= {"speed": norm(*flock[i][3:]), "pair": self._pairs(metric, flock, i)}
            terms.append(call_rule(rule, "member", given, metric.name))
        assert metric.Member is not None
        return {"mean": mean, "members": reduce_records(metric.Member, metric.reduce, terms)}

    def _offset(self, own: State, other: State) -> tuple[float, float, float, float]:
        """Other minus own, m, and the squared distance, m²."""
        dx, dy, dz = self.image(other.x - own.x, other.y - own.y, other.z - own.z)
        return dx, dy, dz, dx * dx + dy * dy + dz * dz + TINY


def _over_time(metric: Metric) -> list[tuple[str, str]]:
    """Name of each value that a metric samples, and how its samples combine."""
    return [(name, metric.over_time.get(name, "mean")) for name in metric.Sample._fields]  # type: ignore[attr-defined]


def heading(state: State) -> tuple[float, float, float]:
    """Unit vector of the velocity; zero at rest."""
    f = 1.0 / norm(state.vx, state.vy, state.vz)
    return f * state.vx, f * state.vy, f * state.vz


def mean_of(flock: Sequence[State]) -> Mean:
    """Means over a flock."""
    n = float(len(flock))
    columns: list[Iterable[float]] = [*zip(*flock, strict=True), *zip(*map(heading, flock), strict=True)]
    return Mean._make([*(sum(column) / n for column in columns), n])


def connected(n: int, linked: Callable[[int, int], bool]) -> list[list[int]]:
    """Agents 0 to n-1 as groups: two agents are in one group if a chain of links joins them."""
    left, groups = set(range(n)), []
    while left:
        group = [min(left)]
        left -= set(group)
        for i in group:  # grows while it is walked along
            fresh = [j for j in sorted(left) if linked(i, j)]
            group += fresh
            left -= set(fresh)
        groups.append(group)
    return groups
