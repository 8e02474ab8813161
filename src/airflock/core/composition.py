"""Composition: two laws as one, the commands of both added up.

What comes out is a model like any other, so whatever flies a model flies it: drivers, plain Python, a drone. Its
`decide` is that of the first law, and `add_laws` holds the second one, whose command whoever asks for a command adds.
"""

from dataclasses import replace
from inspect import signature

from airflock.core.contract import Model
from airflock.support import RuleError

OWN = ("p", "sums", "walls", "memory")  # what only the first law can have: there is one record of each
RULES = ("neighbour", "boundary", "Memory", "reach", "sight", "wall_reach")


def add_laws(base: Model, extra: Model) -> Model:
    """The law `base` with the command of `extra` added to its own.

    `extra` may have a rule of the whole flock where `base` has none; its `decide` takes no parameters `p` of the model,
    only records that a scenario has once. Raises RuleError where the two do not fit. Equal arguments give the same
    rules, and so the same driver.
    """
    for fault in composition_errors(base, extra):
        raise RuleError(fault)
    return replace(
        base,
        name=f"{base.name}_and_{extra.name}",
        added=extra,
        flock=extra.flock or base.flock,
        Shared=extra.Shared or base.Shared,
        workspace=extra.workspace or base.workspace,
        doc=f"{base.doc}\n\n{extra.doc}",
    )


def composition_errors(base: Model, extra: Model) -> list[str]:
    """Why two laws cannot be added, one line each."""
    found = []
    if base.command != extra.command:
        found.append(f"model {base.name} commands {base.command}, and {extra.name} {extra.command}: no sum of the two")
    if base.flock is not None and extra.flock is not None:
        found.append(f"model {base.name} solves for the whole flock itself; {extra.name} cannot do so beside it")
    if base.added is not None or extra.added is not None:
        found.append(f"model {base.name} or {extra.name} is a sum already")
    more = [name for name in RULES if getattr(extra, name) is not None]
    more += [name for name in signature(extra.decide).parameters if name in OWN]
    if more:
        found.append(f"{extra.name} is added to another model and can have no {', '.join(more)} of its own")
    return found
