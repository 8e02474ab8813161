"""The contract of a metric set: order parameters measured together, and what a flight is judged by."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from airflock.core.contract.metrics import Metric
from airflock.core.vocabulary import argument_names, call_rule
from airflock.support import RuleError


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
            argument_names(self.fitness, "fitness", self.name)
        if self.faults is not None:
            argument_names(self.faults, "faults", self.name)
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
