"""Flock: rules that see all agents at once, a model's `flock` and a metric's `survey`, and the scratch they work in."""

from collections.abc import Callable
from functools import lru_cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.core.contract import Metric
from airflock.core.vectors import names_of, vectors_of
from airflock.core.vocabulary import asks
from airflock.engine.passes.build import Builder
from airflock.engine.plan import Plan
from airflock.engine.text.probe import shapes_of


class Owner(NamedTuple):
    """Who has a rule of the whole flock: the model or a metric, its rule, Shared and workspace, its parameters."""

    name: str
    kind: str
    rule: Callable[..., None]
    Shared: Any
    workspace: Callable[..., Any]
    letter: str


def owners(plan: Plan) -> list[Owner]:
    """All rules of the whole flock in a plan, in the order of their scratch."""
    model = plan.model
    first = []
    if model.flock is not None and model.workspace is not None:
        first = [Owner("model", "flock", model.flock, model.Shared, model.workspace, "p")]
    return first + surveys(plan)


def surveys(plan: Plan) -> list[Owner]:
    """Those of them that measure."""
    return [
        Owner(metric.name, "survey", metric.survey, metric.Shared, metric.workspace, "q")
        for metric in plan.metrics
        if metric.survey is not None and metric.workspace is not None
    ]


def flock(build: Builder) -> None:
    """Function flock: the model's rule, once per decision, on the true states."""
    owner = owners(build.plan)[0]
    records = "p wing aero" if "aero" in asks(owner.rule, owner.kind, owner.name) else "p wing"
    build.function("flock(n, row, work, scratch)", build.records(records), _call(build, owner), "return 0")


def survey(build: Builder, metric: Metric) -> list[str]:
    """Lines that run a metric's rule; `scratch` is at hand."""
    (owner,) = (owner for owner in surveys(build.plan) if owner.name == metric.name)
    return [*build.records("q wing"), *_call(build, owner), "return 0"]


def _call(build: Builder, owner: Owner) -> list[str]:
    plan = build.plan
    number = [each.name for each in owners(plan)].index(owner.name)
    work = build.source.name(_record(owner, plan))
    fields = _record(owner, plan)._fields
    given = {"work": f"scratch_{owner.name}", "shared": f"shared_{owner.name}"}
    flown = plan.motion
    used = asks(owner.rule, owner.kind, owner.name)
    lines = build.bind([name for name in flown if name in used])
    for name in ("x", "y", "z", "vx", "vy", "vz"):
        if name not in flown and name in used:
            lines += [f"{name} = work[{build.row('level_')}]"]
    parts = [f"scratch[{number}][{c}]" for c in range(len(fields))]
    lines += [f"scratch_{owner.name} = {work}({', '.join(parts)})"]
    columns = [f"work[{build.row(f'shared_{owner.name}_{name}')}]" for name in owner.Shared._fields]
    lines += [f"shared_{owner.name} = {build.source.name(owner.Shared)}({', '.join(columns)})"]
    build.source.solver(owner.rule)
    return [*lines, *build.once([build.call(owner.rule, owner.kind, given, owner.name)])]


def _record(owner: Owner, plan: Plan) -> Any:
    """NamedTuple class of the scratch: what `workspace` returns, whatever its shapes."""
    return type(shapes_of(owner.workspace, 1, _parameters(plan, owner, None)))


def _parameters(plan: Plan, owner: Owner, row: NDArray[Any] | None) -> dict[str, Any]:
    """Parameters of an owner, of the wing and of drag descent as plain records by name, from a row of numbers."""
    found = {}
    for letter in (owner.letter, "wing", "aero"):
        names = plan.records[letter]
        values = [0.0] * len(names) if row is None else row[plan.spans[letter]].tolist()
        numbers = dict(zip(names, values, strict=True))
        whole = {key: tuple(numbers[part] for part in names_of(key, n)) for key, n in vectors_of(names).items()}
        found[letter] = SimpleNamespace(**{**numbers, **plan.constants.get(letter, {}), **whole})
    return found


Named = tuple[tuple[tuple[str, tuple[int, int], bool], ...], ...]


def scratch_of(plan: Plan, row: NDArray[Any], agents: int) -> Named:
    """Scratch of every rule of the whole flock: a name, rows and columns, and whether nothing in it outlasts a call."""
    return _scratch(plan, row.dtype, row.tobytes(), agents) if owners(plan) else ()


@lru_cache(maxsize=64)
def _scratch(plan: Plan, real: Any, numbers: bytes, agents: int) -> Named:
    made = []
    sizes_of = scratch_sizes(plan, np.frombuffer(numbers, real), agents)
    for owner, sizes in zip(owners(plan), sizes_of, strict=True):
        record = _record(owner, plan)
        within = getattr(record, "WITHIN", ())
        fields = zip(record._fields, sizes, strict=True)
        made.append(tuple((f"{owner.name}.{name}", size, name in within) for name, size in fields))
    return tuple(made)


def scratch_sizes(plan: Plan, row: NDArray[Any] | None, agents: int) -> list[list[tuple[int, int]]]:
    """Rows and columns of the scratch arrays of every rule of the whole flock; without a row of numbers, with zeros."""
    return [list(shapes_of(owner.workspace, agents, _parameters(plan, owner, row))) for owner in owners(plan)]
