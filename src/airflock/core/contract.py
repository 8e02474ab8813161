"""The rule contract: what a model, a body, an order parameter and a set of them consist of.

A rule is a plain function of floats. Its argument names are the declaration: a driver computes and supplies only what
is asked for, in any order. `core.vocabulary` lists the names.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from airflock.core.vocabulary import CLOCKS, COMMANDS, OVER_TIME, REDUCTIONS, asks
from airflock.errors import RuleError


@dataclass(frozen=True)
class Model:
    """A published flocking law: parameters and rules, gathered from a module or any namespace.

    name         : how scenarios refer to it
    Parameters   : record of parameters (`core.parameters.Parameters`)
    command      : "velocity" (m/s), "acceleration" (m/s²) or "heading" (unit vector)
    reach        : `reach(p)`, largest interaction radius, m; without it the radio alone decides who is heard
    sight        : `sight(p)`, how far percept.cast looks, m
    neighbour    : pair rule → Sums; Sums its NamedTuple; reduce: how fields combine where not by a sum
    boundary     : surface rule → Walls
    flock        : the one rule of the whole flock: fills the columns of Shared, which `decide` may read as `shared`
    workspace    : `workspace` of any of n, p, wing, aero → NamedTuple of (rows, columns), the scratch of `flock`
    wall_reach   : `wall_reach(p)`, m: surfaces of the scene farther away say nothing; without it all are asked
    decide       : → command x, y, z and a Memory if the model declares one
    usual   : numbers that are compiled in where a scenario leaves them so; a rule that tests for them gets faster
    preferred_speed, interaction_range : plain functions of the parameters, used by the metrics
    violates : truths of `airflock.check_model` that do not hold for it, and why (VIOLATES)
    terms    : vectors among its Sums (their fields without x, y, z) → what the law calls them, and their unit (TERMS)
    """

    name: str
    Parameters: type
    command: str
    decide: Callable[..., Any]
    reach: Callable[..., float] | None = None
    sight: Callable[..., float] | None = None
    neighbour: Callable[..., Any] | None = None
    Sums: type | None = None
    boundary: Callable[..., Any] | None = None
    Walls: type | None = None
    wall_reach: Callable[..., float] | None = None
    Memory: type | None = None
    flock: Callable[..., None] | None = None
    Shared: type | None = None
    workspace: Callable[..., Any] | None = None
    reduce: Mapping[str, str] = field(default_factory=dict)
    usual: Mapping[str, float] = field(default_factory=dict)
    preferred_speed: Callable[..., float] | None = None
    interaction_range: Callable[..., float] | None = None
    doc: str = ""
    violates: Mapping[str, str] = field(default_factory=dict)
    terms: Mapping[str, tuple[str, str]] = field(default_factory=dict)

    def __hash__(self) -> int:
        return hash((self.name, self.decide, self.neighbour, self.boundary, self.flock))


def names_of(namespace: Any, name: str = "") -> tuple[dict[str, Any], str]:
    """What a module, a class or a mapping of names holds, and what it is called: `name`, its NAME, or its module's."""
    found = dict(namespace) if isinstance(namespace, Mapping) else dict(vars(namespace))
    return found, name or str(found.get("NAME") or found.get("__name__", "own")).rpartition(".")[2].strip("_")


def model(namespace: Any, name: str = "") -> Model:
    """Gather a model from a module, a class or a mapping of names; refuse what the contract does not know.

    Parameters
    ----------
    namespace : module, class or mapping
        Holds COMMAND, Parameters, decide, and any of neighbour, Sums, boundary, Walls, reach and the others that
        `Model` lists. The argument names of a rule say what it asks for (`airflock.core.vocabulary`).
    name : str, optional
        How the model is called; by default the namespace's.

    Returns
    -------
    Model
        To be given to `airflock.load(..., law=...)`.

    Raises
    ------
    RuleError
        If something is missing, or a rule asks for what there is not; names the nearest word.

    Examples
    --------
    >>> import airflock
    >>> class Straight:
    ...     COMMAND = "velocity"
    ...     class Parameters(airflock.Parameters):
    ...         pass
    ...     def decide(own):
    ...         return own.vx, own.vy, own.vz
    >>> airflock.model(Straight).command
    'velocity'
    """
    found, name = names_of(namespace, name)
    for needed in ("Parameters", "COMMAND", "decide"):
        if needed not in found:
            raise RuleError(f"model {name} lacks {needed}")
    if found["COMMAND"] not in COMMANDS:
        raise RuleError(f"model {name}: COMMAND = {found['COMMAND']!r} is none of {', '.join(COMMANDS)}")
    for rule, record in (("neighbour", "Sums"), ("boundary", "Walls"), ("flock", "Shared"), ("flock", "workspace")):
        if rule in found and record not in found:
            raise RuleError(f"model {name} has a rule {rule} but no {record}")
    for kind in ("reach", "sight", "wall_reach", "neighbour", "boundary", "flock", "decide"):
        if kind in found:
            asks(found[kind], kind, name)
    reduce = dict(found.get("REDUCE", {}))
    for key, how in reduce.items():
        if key not in getattr(found.get("Sums"), "_fields", ()) or how not in REDUCTIONS:
            raise RuleError(f"model {name}: REDUCE[{key!r}] = {how!r}; give a field of Sums and one of {REDUCTIONS}")
    return Model(
        name=name,
        Parameters=found["Parameters"],
        command=found["COMMAND"],
        decide=found["decide"],
        reach=found.get("reach"),
        sight=found.get("sight"),
        neighbour=found.get("neighbour"),
        Sums=found.get("Sums"),
        boundary=found.get("boundary"),
        Walls=found.get("Walls"),
        wall_reach=found.get("wall_reach"),
        Memory=found.get("Memory"),
        flock=found.get("flock"),
        Shared=found.get("Shared"),
        workspace=found.get("workspace"),
        reduce=reduce,
        usual=dict(found.get("USUAL", {})),
        preferred_speed=found.get("preferred_speed"),
        interaction_range=found.get("interaction_range"),
        doc=str(found.get("__doc__") or ""),
        violates=dict(found.get("VIOLATES", {})),
        terms=_terms(found.get("TERMS", {}), found.get("Sums"), name),
    )


def _terms(given: Any, sums: Any, name: str) -> dict[str, tuple[str, str]]:
    """Words of a law for its vectors; each stands for fields that there are."""
    fields = getattr(sums, "_fields", ())
    for stem, words in dict(given).items():
        if not any(f"{stem}{joint}x" in fields for joint in ("", "_")):
            raise RuleError(f"model {name}: TERMS[{stem!r}]: Sums has no field {stem}x")
        if not (isinstance(words, tuple) and len(words) == 2 and all(isinstance(word, str) for word in words)):
            raise RuleError(f"model {name}: TERMS[{stem!r}] = {words!r}; give a word and a unit")
    return dict(given)


@dataclass(frozen=True)
class Body:
    """What turns a command into a motion, gathered from its module.

    accepts     : the COMMAND of the models that it can carry
    integration : "old" if a position moves by the velocity before `move`, "new" if by the one after it
    Memory      : NamedTuple of what a body keeps from step to step, each field with its value at the start; `move` asks
                  for it as `memory` and returns it behind the velocity
    limits      : `limits` of any of b, dt, speed, start, wing → what of a scenario the body cannot fly, one line each
    violates    : truths of `airflock.check_body` that do not hold for it, and why (VIOLATES)
    """

    name: str
    Parameters: type
    accepts: str
    integration: str
    move: Callable[..., Any]
    violates: Mapping[str, str] = field(default_factory=dict)
    Memory: type | None = None
    limits: Callable[..., list[str]] | None = None

    def __hash__(self) -> int:
        return hash((self.name, self.move))

    @property
    def beginnings(self) -> tuple[float, ...]:
        """What each field of its Memory is at the start of a flight."""
        return tuple(getattr(self.Memory, "_field_defaults", {}).values())

    def lacks(self, **given: Any) -> list[str]:
        """What this body cannot fly, by what `limits` may ask for."""
        if self.limits is None:
            return []
        return self.limits(**{name: given[name] for name in asks(self.limits, "limits", self.name)})


def body(namespace: Any, name: str = "") -> Body:
    """Gather a body from a module, a class or a mapping of names; refuse what the contract does not know.

    Parameters
    ----------
    namespace : module, class or mapping
        Holds Parameters, ACCEPTS (the command that it takes: velocity, acceleration or heading), INTEGRATION (whether
        positions move with the "old" or the "new" velocity) and the rule move; if it likes, Memory (a NamedTuple whose
        fields have the values of the start), which move asks for as `memory` and returns as x, y, z, Memory(...).
    name : str, optional
        How the body is called; by default the namespace's.

    Returns
    -------
    Body
        To be given to `airflock.load(..., body=...)`.

    Raises
    ------
    RuleError
        If something is missing, or the rule asks for what there is not.

    Examples
    --------
    >>> import airflock
    >>> class Obedient:
    ...     ACCEPTS, INTEGRATION = "velocity", "new"
    ...     class Parameters(airflock.Parameters):
    ...         pass
    ...     def move(cx, cy, cz):
    ...         return cx, cy, cz
    >>> airflock.body(Obedient).accepts
    'velocity'
    """
    found, name = names_of(namespace, name)
    for needed in ("Parameters", "ACCEPTS", "INTEGRATION", "move"):
        if needed not in found:
            raise RuleError(f"body {name} lacks {needed}")
    asks(found["move"], "move", name)
    if found["ACCEPTS"] not in COMMANDS or found["INTEGRATION"] not in ("old", "new"):
        raise RuleError(f"body {name}: ACCEPTS is one of {', '.join(COMMANDS)}; INTEGRATION is old or new")
    memory = found.get("Memory")
    if ("memory" in asks(found["move"], "move", name)) is (memory is None):
        raise RuleError(f"body {name}: a rule move that asks for memory and a NamedTuple Memory come together")
    if memory is not None and set(getattr(memory, "_field_defaults", {})) != set(getattr(memory, "_fields", "-")):
        raise RuleError(f"body {name}: Memory is a NamedTuple whose fields all have a value for the start")
    if found.get("limits") is not None:
        asks(found["limits"], "limits", name)
    return Body(
        name, found["Parameters"], found["ACCEPTS"], found["INTEGRATION"], found["move"],
        dict(found.get("VIOLATES", {})), memory, found.get("limits"),
    )  # fmt: skip


@dataclass(frozen=True)
class Metric:
    """An order parameter: rules that measure a flock at one instant, and how instants combine.

    within  : `within(q)`, m; the metric promises to contribute nothing, and to keep its Memory at its start values,
              while no two agents are nearer than that. A driver may then skip the pair loop.
    clock   : "sample" (metrics.period) or "collision" (metrics.collision_period)
    survey    : rule of the whole flock like a model's `flock`: fills the columns of Shared that `agent` may read;
              `workspace` of any of n, q, wing gives its scratch
    reports : of every order parameter that comes out: its unit and what it means
    total   : from the combined values of a whole flight to named order parameters; by default they are these
    violates : truths of `airflock.check_metric` that do not hold for it, and why (VIOLATES)
    """

    name: str
    sample: Callable[..., Any]
    Sample: type
    pair: Callable[..., Any] | None = None
    Pair: type | None = None
    agent: Callable[..., Any] | None = None
    Agent: type | None = None
    linked: Callable[..., Any] | None = None
    member: Callable[..., Any] | None = None
    Member: type | None = None
    cluster: Callable[..., Any] | None = None
    Cluster: type | None = None
    Memory: type | None = None
    within: Callable[..., float] | None = None
    survey: Callable[..., None] | None = None
    Shared: type | None = None
    workspace: Callable[..., Any] | None = None
    reduce: Mapping[str, str] = field(default_factory=dict)
    over_time: Mapping[str, str] = field(default_factory=dict)
    clock: str = "sample"
    total: Callable[..., dict[str, float]] | None = None
    reports: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    violates: Mapping[str, str] = field(default_factory=dict)

    def __hash__(self) -> int:
        return hash((self.name, self.sample, self.pair, self.agent, self.cluster))


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
        `Metric` lists them. The argument names of a rule say what it asks for (`airflock.core.vocabulary`).
    name : str, optional
        How it is called; by default the namespace's.

    Returns
    -------
    Metric
        To be given to `airflock.load(..., metrics=...)`, alone or in a list.

    Raises
    ------
    RuleError
        If something is missing, or a rule asks for what there is not.

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
    found, name = names_of(namespace, name)
    if "sample" not in found:
        raise RuleError(f"metric {name} lacks sample")
    for rule, record in RULES_AND_RECORDS:
        if rule in found and record not in found:
            raise RuleError(f"metric {name} has a rule {rule} but no {record}")
    for kind in ("pair", "linked", "agent", "member", "cluster", "sample", "within", "survey"):
        if kind in found:
            asks(found[kind], kind, name)
    fields = {f for record in ("Pair", "Agent", "Member", "Cluster") for f in getattr(found.get(record), "_fields", ())}
    for key, how in found.get("REDUCE", {}).items():
        if key not in fields or how not in REDUCTIONS:
            raise RuleError(f"metric {name}: REDUCE[{key!r}] = {how!r}; give a field of a record, one of {REDUCTIONS}")
    for key, how in found.get("OVER_TIME", {}).items():
        if key not in found["Sample"]._fields or how not in OVER_TIME:
            raise RuleError(f"metric {name}: OVER_TIME[{key!r}] = {how!r}; give a field of Sample, one of {OVER_TIME}")
    clock = found.get("CLOCK", "sample")
    if clock not in CLOCKS:
        raise RuleError(f"metric {name}: CLOCK = {clock!r}; give one of {CLOCKS}")
    records = (
        "sample", "Sample", "pair", "Pair", "agent", "Agent", "linked", "member", "Member", "cluster", "Cluster",
        "Memory", "within", "total", "survey", "Shared", "workspace",
    )  # fmt: skip
    return Metric(
        name=name,
        reduce=dict(found.get("REDUCE", {})),
        over_time=dict(found.get("OVER_TIME", {})),
        reports=dict(found.get("REPORTS", {})),
        violates=dict(found.get("VIOLATES", {})),
        clock=clock,
        **{key: found[key] for key in records if key in found},
    )


@dataclass(frozen=True)
class MetricSet:
    """Order parameters that are measured together, and what a flight is judged by.

    name       : how scenarios refer to it (metrics.kind)
    Parameters : record behind the section [metrics]
    chosen     : `chosen(q)` → the metrics, where a parameter decides; else `metrics`
    fitness    : of any of values, agents, duration (s), q → named numbers, from the order parameters of one flight
    reports    : of what `fitness` gives: unit and meaning
    best       : the order parameter that is larger in a better flight; empty if none is
    violates   : truths of `airflock.check_metric` that its fitness breaks, and why (VIOLATES)
    faults     : of any of q, largest (extension, m), edges → what is wrong with the parameters, one line each
    """

    name: str
    metrics: tuple[Metric, ...]
    Parameters: type
    chosen: Callable[[Any], tuple[Metric, ...]] | None = None
    fitness: Callable[..., Mapping[str, float]] | None = None
    reports: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    best: str = ""
    faults: Callable[..., list[str]] | None = None
    violates: Mapping[str, str] = field(default_factory=dict)

    def __hash__(self) -> int:
        return hash((self.name, self.metrics, self.fitness))

    def __post_init__(self) -> None:
        if self.fitness is not None:
            asks(self.fitness, "fitness", self.name)
        if self.faults is not None:
            asks(self.faults, "faults", self.name)
        names = [item.name for item in self.metrics]
        values = [value for item in self.metrics for value in item.Sample._fields]  # type: ignore[attr-defined]
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
        return {**values, **self.fitness(**{name: given[name] for name in asks(self.fitness, "fitness", self.name)})}

    def numbers(self, q: Any) -> tuple[str, ...]:
        """Names of the order parameters that are one number, fitness last."""
        return tuple(dict.fromkeys([*(name for each in self.of(q) for name in each.reports), *self.reports]))
