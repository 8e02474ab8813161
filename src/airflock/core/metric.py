"""The contracts of an order parameter and of a set of them: vocabulary, rules and records.

The rules of an order parameter measure a flock at one instant; `OVER_TIME` says how instants
combine. A set holds order parameters that are measured together, and the fitness by which a flight
is judged.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from airflock.core.body import STATE
from airflock.core.contract import (
    CLOCKS,
    OVER_TIME,
    REDUCTIONS,
    along_axes,
    argument_names,
    call_rule,
    gather,
    namespace_names,
)
from airflock.core.model import FLOCK, PAIR
from airflock.support import RuleError

MEASURED = {
    **STATE,
    "speed": "length of the velocity, m/s",
    **along_axes("h", "heading (unit vector; zero at rest)"),
    "excursion": "distance outside the arena or inside an obstacle, m; negative where flying is allowed",
    "touches": "1.0 if a sphere of radius metrics.r_body met the scene on its last step of motion, else 0.0",
    "rays": "rays that the agent cast at its last decision; 0.0 in a recording",
    "pair": "what this metric's `pair` gathered for this agent",
    "memory": "this metric's Memory of this agent",
    "mean": "Mean over the flock: x y z (m), vx vy vz (m/s), hx hy hz, and number n",
    "shared": "what this metric's `survey` found for this agent",
    "wing": "parameters of the wing (aero.wing)",
}
MEMBER = {
    name: text
    for name, text in MEASURED.items()
    if name not in ("excursion", "touches", "rays", "memory", "mean", "shared", "wing")
} | {
    "mean": "Mean over the agent's own cluster",
}
CLUSTER = {
    "n": "members of the cluster",
    **along_axes("h", "sum of their headings"),
    "hh": "sum of the squared lengths of their headings: how many of them move",
    "members": "what `member` summed up over the members",
    "mean": "Mean over the members",
}
SAMPLE = {
    "n": "number of agents",
    "mean": "Mean over the flock",
    "agents": "what `agent` summed up over all agents",
    "clusters": "what `cluster` summed up over all clusters",
    "dimensions": "2.0 in a plane, 3.0 in space",
    "time": "since the start, s",
}
METRIC = {
    "pair": {name: PAIR[name] for name in ("dx", "dy", "dz", "r", "r2", "lower")} | {"q": "metric parameters"},
    "linked": {"r": "distance of two agents, m", "r2": "its square, m²; cheaper than r", "q": "metric parameters"},
    "agent": {**MEASURED, "q": "metric parameters"},
    "member": {**MEMBER, "q": "metric parameters"},
    "cluster": {**CLUSTER, "q": "metric parameters"},
    "sample": {**SAMPLE, "q": "metric parameters"},
    "survey": {**FLOCK, "q": "metric parameters"},
    "within": {"q": "metric parameters"},
    "linked_within": {"q": "metric parameters"},
    "settled": {
        "pair": "what the rule `pair` adds up to over all who are nearer than `beyond`, and perhaps some others",
        "beyond": "distance, m",
        "q": "metric parameters",
    },
}
METRIC_SET = {
    "fitness": {
        "values": "order parameters of one flight, by name",
        "agents": "number of agents",
        "duration": "time flown, s",
        "q": "metric parameters",
    },
    "errors": {
        "q": "metric parameters",
        "largest": "largest extension, m; 0.0 without an arena",
        "edges": "world.edges",
    },
}


ABSENCE = {  # by how instants combine, `contract.OVER_TIME`
    "mean": "mean over instants, each as that of a flock of those who are there",
    "sum": "counted over all instants, of those who are there",
    "min": "the smallest over all instants, of those who are there",
    "max": "the largest over all instants, of those who are there",
}


@dataclass(frozen=True)
class Metric:
    """An order parameter: rules that measure a flock at one instant, and how instants combine.

    within  : `within(q)`, m; the metric promises to contribute nothing, and to keep its Memory at
              its start values, while no two agents are nearer than that. A driver may then skip the
              pair loop.
    linked_within : `linked_within(q)`, m; the metric promises that no two agents farther apart than
                    that are linked.
              Large flocks then look for links among those who are near
    settled : whether nobody farther than `beyond` (m) can change what `pair` adds up to for an
              agent. Large flocks then look no farther than they must
    clock   : "sample" (metrics.period) or "collision" (metrics.collision_period)
    survey    : rule of the whole flock like a model's `flock`: fills the columns of Shared that
                `agent` may read;
              `workspace` of any of n, q, wing gives its scratch
    reports : of every order parameter that comes out: its unit and what it means
    formulas : of the same: formula (LaTeX), range, and how to read it where that needs a sentence
               (FORMULAS)
    needs   : of those that depend on them: numbers of the metric, such as lengths, that tracks
              alone do not say (NEEDS)
    Parameters : record of numbers of its own, which its rules read from q beside those that every
                 set has
    courses : the same of each field of Sample that is no order parameter by itself (COURSES)
    total   : from the combined values of a whole flight to named order parameters; by default they
              are these
    violates : truths of `airflock.check_metric` that do not hold for it, and why (VIOLATES)
    """

    name: str
    sample: Callable[..., Any]
    Sample: type[Any]
    pair: Callable[..., Any] | None = None
    Pair: type[Any] | None = None
    agent: Callable[..., Any] | None = None
    Agent: type[Any] | None = None
    linked: Callable[..., Any] | None = None
    member: Callable[..., Any] | None = None
    Member: type[Any] | None = None
    cluster: Callable[..., Any] | None = None
    Cluster: type[Any] | None = None
    Memory: type[Any] | None = None
    # A promise, not a hint: a metric that contributes beyond it is measured wrongly without any
    # error.
    within: Callable[..., float] | None = None
    settled: Callable[..., bool] | None = None
    linked_within: Callable[..., float] | None = None
    survey: Callable[..., None] | None = None
    Shared: type[Any] | None = None
    workspace: Callable[..., Any] | None = None
    reduce: Mapping[str, str] = field(default_factory=dict)
    over_time: Mapping[str, str] = field(default_factory=dict)
    clock: str = "sample"
    total: Callable[..., dict[str, float]] | None = None
    reports: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    violates: Mapping[str, str] = field(default_factory=dict)
    courses: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    formulas: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    needs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    Parameters: type | None = None

    def __hash__(self) -> int:
        return hash((self.name, self.sample, self.pair, self.agent, self.cluster))

    def absence(self, name: str) -> str:
        """Describe how an order parameter is computed while some agents are absent."""
        how = {self.over_time.get(field, "mean") for field in self.Sample._fields}
        how = {self.over_time.get(name, "mean")} if name in self.Sample._fields else how
        if name not in self.Sample._fields and "sum" in how:
            return "mean over agents and instants, of those who are there"
        return ABSENCE[how.pop() if len(how) == 1 else "mean"]


RULES_AND_RECORDS = (
    ("sample", "Sample"), ("pair", "Pair"), ("agent", "Agent"), ("member", "Member"), ("cluster", "Cluster"),
    ("cluster", "linked"), ("survey", "Shared"), ("survey", "workspace"),
)  # fmt: skip


def metric(namespace: Any, name: str = "") -> Metric:
    """Gather an order parameter from a module, a class or a mapping; refuse what the contract does not know.

    Parameters
    ----------
    namespace : module, class or mapping
        Holds sample and Sample, and any of pair, agent, linked, member, cluster, survey, their records and REPORTS, as
        `Metric` lists them. The argument names of a rule are its requests (`airflock.core.vocabulary`).
    name : str, optional
        How it is called; by default the namespace's.

    Returns
    -------
    Metric
        To be given to `airflock.load(..., metrics=...)`, alone or in a list.

    Raises
    ------
    RuleError
        If something is missing, or a rule requests an unknown argument.

    Examples
    --------
    >>> import airflock
    >>> from typing import NamedTuple
    >>> class Height:
    ...     REPORTS = {"height": ("m", "mean height of the flock")}
    ...     Agent = NamedTuple("Agent", [("z", float)])
    ...     Sample = NamedTuple("Sample", [("height", float)])
    ...     def agent(z):
    ...         return Agent(z)
    ...     def sample(agents, n):
    ...         return Sample(agents.z / n)
    >>> airflock.metric(Height).reports["height"]
    ('m', 'mean height of the flock')
    """
    found, name = namespace_names(namespace, name)
    if "sample" not in found:
        raise RuleError(f"metric {name} lacks sample")
    for rule, record in RULES_AND_RECORDS:
        if rule in found and record not in found:
            raise RuleError(f"metric {name} has a rule {rule} but no {record}")
    for kind in METRIC:
        if kind in found:
            argument_names(found[kind], kind, name)
    fields = {f for record in ("Pair", "Agent", "Member", "Cluster") for f in getattr(found.get(record), "_fields", ())}
    for key, how in found.get("REDUCE", {}).items():
        if key not in fields or how not in REDUCTIONS:
            raise RuleError(f"metric {name}: REDUCE[{key!r}] = {how!r}; give a field of a record, one of {REDUCTIONS}")
    for key, how in found.get("OVER_TIME", {}).items():
        if key not in found["Sample"]._fields or how not in OVER_TIME:
            raise RuleError(f"metric {name}: OVER_TIME[{key!r}] = {how!r}; give a field of Sample, one of {OVER_TIME}")
    if found.get("CLOCK", "sample") not in CLOCKS:
        raise RuleError(f"metric {name}: CLOCK = {found['CLOCK']!r}; give one of {CLOCKS}")
    return gather(Metric, found, name=name)


@dataclass(frozen=True)
class MetricSet:
    """Order parameters that are measured together, and what a flight is judged by.

    name       : how scenarios refer to it (metrics.kind)
    Parameters : record behind the section [metrics]
    chosen     : `chosen(q)` → the metrics, where a parameter decides; else `metrics`
    fitness    : of any of values, agents, duration (s), q → named numbers, from the order
                 parameters of one flight
    reports    : of what `fitness` gives: unit and meaning
    formulas, needs : as those of a metric, of all that it reports
    best       : the order parameter that is larger in a better flight; empty if none is
    violates   : truths of `airflock.check_metric` that its fitness breaks, and why (VIOLATES)
    errors     : of any of q, largest (extension, m), edges → what is wrong with the parameters, one
                 line each
    """

    name: str
    metrics: tuple[Metric, ...]
    Parameters: type
    chosen: Callable[[Any], tuple[Metric, ...]] | None = None
    fitness: Callable[..., Mapping[str, float]] | None = None
    reports: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    best: str = ""
    errors: Callable[..., list[str]] | None = None
    violates: Mapping[str, str] = field(default_factory=dict)
    formulas: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    needs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def __hash__(self) -> int:
        return hash((self.name, self.metrics, self.fitness))

    def __post_init__(self) -> None:
        if self.fitness is not None:
            argument_names(self.fitness, "fitness", self.name)
        if self.errors is not None:
            argument_names(self.errors, "errors", self.name)
        names = [item.name for item in self.metrics]
        values = [value for item in self.metrics for value in item.Sample._fields]
        for which, found in (("metric", names), ("value", values)):
            twice = sorted({name for name in found if found.count(name) > 1})
            if twice:
                raise RuleError(f"metric set {self.name}: the {which} {', '.join(twice)} comes twice")

    def of(self, q: Any) -> tuple[Metric, ...]:
        """Metrics for these parameters."""
        return self.metrics if self.chosen is None else self.chosen(q)

    def judged(self, values: Mapping[str, Any], agents: int, duration: float, q: Any) -> dict[str, Any]:
        """The order parameters of one flight with its fitness; q: parameters with everything filled in."""
        if self.fitness is None:
            return dict(values)
        given = {"values": values, "agents": agents, "duration": duration, "q": q}
        return {**values, **call_rule(self.fitness, "fitness", given, self.name)}

    def numbers(self, q: Any) -> tuple[str, ...]:
        """Names of the order parameters that are one number, fitness last."""
        return tuple(dict.fromkeys([*(name for each in self.of(q) for name in each.reports), *self.reports]))
