"""The order parameters that flights are scored with: metric sets by the key metrics.kind, ours and a user's."""

from collections.abc import Mapping, Sequence
from dataclasses import is_dataclass, make_dataclass
from types import ModuleType
from typing import Any

from airflock.core import Kind, Metric, MetricSet, Parameters as Record, declarations, metric, namespace_names
from airflock.parts.kinds import BODIES, FAULTS, LAWS, RADIOS, SENSORS, TOPOLOGIES
from airflock.parts.metrics import parameters
from airflock.support import RuleError

METRICS = Kind("airflock.parts.metrics", "metric", metric, Metric, ("sample",), check="check_metric")


def named(*names: str) -> tuple[Metric, ...]:
    """Return metrics of the package by their names."""
    return tuple(METRICS[name] for name in names)


POWER_SETTINGS = {"metrics.kind": "dimock", "metrics.fitness": "sound"}  # settings that measure the power of wings

# what the engine itself keeps of a flight with goals
GOALS = {
    "goals_reached": ("", "goals reached by the flock's centre"),
    "goals": ("", "goals given"),
    "time_to_goal": ("s", "time at which each was reached"),
}


def metric_set(namespace: Any, name: str = "") -> MetricSet:
    """Gather a metric set from a module, a class or a mapping of names such as globals().

    Parameters
    ----------
    namespace : module, class or mapping
        Holds METRICS, a list of metrics (names of ours, or what `airflock.metric` gives), or the rules of one metric,
        or both; if it likes, Parameters (keys of its own beside ours), `fitness` with REPORTS of what it gives, and
        BEST, the order parameter that is larger in a better flight.
    name : str, optional
        How the set is called; by default the namespace's.

    Returns
    -------
    MetricSet
        To be given to `airflock.load(..., metrics=...)`.

    Raises
    ------
    RuleError
        If it measures nothing, or a rule requests an unknown argument.

    Examples
    --------
    >>> import airflock
    >>> class Fast:
    ...     METRICS = ["speed", "polarisation"]
    ...     def fitness(values):
    ...         return {"fitness": values["phi_vel"]}
    >>> airflock.metric_set(Fast).best
    'fitness'
    """
    found, name = namespace_names(namespace, name)
    metrics = [_metric(item, name) for item in found.get("METRICS", ())]
    if "sample" in found:
        metrics.append(metric(found, name))
    if not metrics:
        raise RuleError(f"metric set {name} measures nothing; give METRICS = [...], or a rule sample")
    fitness = found.get("fitness")
    own = found.get("REPORTS", {}) if fitness else {}
    reports = {key: about for key, about in own.items() if "sample" not in found or key.startswith(("f_", "fitness"))}
    if fitness and "fitness" not in reports:
        reports["fitness"] = ("", (fitness.__doc__ or "fitness").partition("\n")[0])
    best = str(found.get("BEST") or ("fitness" if "fitness" in reports else ""))
    return MetricSet(
        name,
        tuple(metrics),
        _parameters([found.get("Parameters"), *(each.Parameters for each in metrics)], name),
        found.get("chosen"),
        fitness,
        reports,
        best,
        found.get("errors", found.get("faults")),  # as it was called before
        dict(found.get("VIOLATES", {})),
        _joined(metrics, "formulas") | found.get("FORMULAS", {}),
        _joined(metrics, "needs") | found.get("NEEDS", {}),
    )


def to_metric_set(source: Any) -> MetricSet:
    """A metric set from a set, its name, a metric, several of them, or a namespace."""
    if isinstance(source, MetricSet):
        return source
    if isinstance(source, Metric):
        return metric_set({"METRICS": [source]}, source.name)
    if isinstance(source, str) and source in SETS:
        return SETS[source]
    if isinstance(source, Sequence) and not isinstance(source, str):
        return metric_set({"METRICS": source}, "own")
    if isinstance(source, Mapping) or hasattr(source, "__dict__"):
        return metric_set(source)
    raise RuleError(
        f"metrics = {source!r} is not a metric set; give a metric, a list of them, or one of {', '.join(SETS)}"
    )


def _metric(item: Any, owner: str) -> Metric:
    if isinstance(item, Metric):
        return item
    if isinstance(item, ModuleType):
        return metric(item)
    if isinstance(item, str) and item in METRICS:
        return METRICS[item]
    raise RuleError(f"metric set {owner}: {item!r} is not a metric; known: {', '.join(METRICS)}")


def _parameters(records: Sequence[Any], owner: str) -> type:
    """Return the record of the numbers that every set has, with those of a set and of its metrics."""
    own: list[type] = []
    for record in dict.fromkeys(record for record in records if record is not None):
        if not (isinstance(record, type) and issubclass(record, Record) and is_dataclass(record)):
            raise RuleError(
                f"metric set {owner}: Parameters is not a frozen dataclass derived from airflock.Parameters"
            )
        own.append(record)
    declared: dict[str, Any] = {}
    for record in (parameters.Parameters, *own):
        for name, declaration, default in declarations(record):
            if declared.setdefault(name, (declaration, default)) != (declaration, default):
                raise RuleError(f"metric set {owner}: two of its metrics declare metrics.{name} otherwise")
    if len(own) == 1 and issubclass(own[0], parameters.Parameters):
        return own[0]
    bases = (parameters.Parameters, *own)
    return make_dataclass("Parameters", [], bases=bases, frozen=True, kw_only=True) if own else bases[0]


def _joined(metrics: Sequence[Metric], field: str) -> dict[str, Any]:
    """Return what several metrics say of their order parameters."""
    return {name: about for each in metrics for name, about in getattr(each, field).items()}


def scalar_names(metric_set_: MetricSet, q: Any, goals: bool = False) -> tuple[str, ...]:
    """Names of the order parameters that are one number, of flights scored by a set, with goals or not.

    Partial fitnesses and fitness come last; time_to_goal, one number for each goal, is left out.
    """
    own = [name for each in metric_set_.of(q) for name in each.reports]
    own += [name for name in GOALS if goals and name != "time_to_goal"]
    return tuple(dict.fromkeys((*own, *metric_set_.reports)))


SETS = Kind(
    "airflock.parts.metric_sets", "set of order parameters", metric_set, MetricSet, ("METRICS",), "metrics",
    "vasarhelyi", shared=None, take=to_metric_set, check="check_metric",
)  # fmt: skip
KINDS: tuple[Kind[Any], ...] = (LAWS, BODIES, SENSORS, RADIOS, TOPOLOGIES, FAULTS, METRICS, SETS)  # all

FORMULAS = {  # as those of a metric, of what the engine keeps
    "goals_reached": (
        r"\textrm{goals that the centre of the flock came to}",
        "0 to goals",
        "Kidger's drones follow goals.",
    ),
    "goals": (r"\textrm{goals given}", "1 and more", "Kidger; section `[goals]` of the scenario."),
    "time_to_goal": (r"t_1, t_2, \ldots", "0 to the duration; nan if never", "Kidger."),
    "present": (
        r"\left\langle \frac{N(t)}{N} \right\rangle_t",
        "0 to 1",
        "Ours. Only reported where agents come and go; $N(t)$ are those that are there.",
    ),
}
PRESENCE = {"present": ("", "share of all individuals and instants for which the recording has data")}


def reported_values(metric_set_: MetricSet) -> dict[str, tuple[str, str]]:
    """Unit and meaning of every order parameter that flights scored by a set report."""
    own = {name: about for each in metric_set_.metrics for name, about in each.reports.items()}
    return own | dict(metric_set_.reports) | GOALS | PRESENCE


def formulas(metric_set_: MetricSet) -> dict[str, tuple[str, ...]]:
    """Return formula (LaTeX), range and perhaps a sentence of every order parameter that a set reports."""
    return dict(metric_set_.formulas) | FORMULAS
