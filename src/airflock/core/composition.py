"""Composition: two laws as one, the commands of both added up.

What comes out is a model like any other, so whatever flies a model flies it: drivers, plain Python, a drone. The text
of its `decide` is written here, because rules ask for what they need by name, and is kept where `inspect` finds it.
"""

import linecache
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from inspect import signature
from typing import Any

from airflock.core.contract import Model
from airflock.errors import RuleError

OWN = ("p", "sums", "walls", "memory")  # what only the first law can have: there is one record of each
RULES = ("neighbour", "boundary", "Memory", "reach", "sight", "wall_reach")


@cache
def added(base: Model, extra: Model) -> Model:
    """The law `base` with the command of `extra` added to its own.

    `extra` may have a rule of the whole flock where `base` has none; its `decide` takes no parameters `p` of the model,
    only records that a scenario has once. Raises RuleError where the two do not fit. Equal arguments give the same
    functions, and so the same driver.
    """
    for fault in faults(base, extra):
        raise RuleError(fault)
    return replace(
        base,
        name=f"{base.name}_and_{extra.name}",
        decide=_sum(base, extra),
        flock=extra.flock or base.flock,
        Shared=extra.Shared or base.Shared,
        workspace=extra.workspace or base.workspace,
        doc=f"{base.doc}\n\n{extra.doc}",
    )


def faults(base: Model, extra: Model) -> list[str]:
    """Why two laws cannot be added, one line each."""
    found = []
    if base.command != extra.command:
        found.append(f"model {base.name} commands {base.command}, and {extra.name} {extra.command}: no sum of the two")
    if base.flock is not None and extra.flock is not None:
        found.append(f"model {base.name} solves for the whole flock itself; {extra.name} cannot do so beside it")
    more = [name for name in RULES if getattr(extra, name) is not None]
    more += [name for name in signature(extra.decide).parameters if name in OWN]
    if more:
        found.append(f"{extra.name} is added to another model and can have no {', '.join(more)} of its own")
    return found


def _sum(base: Model, extra: Model) -> Callable[..., Any]:
    """Rule `decide` that calls those of both and adds their commands; the first one's Memory goes on."""
    theirs = [tuple(signature(law.decide).parameters) for law in (base, extra)]
    asked = dict.fromkeys((*theirs[0], *theirs[1]))
    memory = ", first[3]" if base.Memory is not None else ""
    text = (
        f"def decide({', '.join(asked)}):\n"
        f'    """Command of {base.name} plus that of {extra.name}."""\n'
        f"    first = base({', '.join(theirs[0])})\n"
        f"    more = extra({', '.join(theirs[1])})\n"
        f"    return first[0] + more[0], first[1] + more[1], first[2] + more[2]{memory}\n"
    )
    name = f"<airflock: {base.name} and {extra.name}, {id(base.decide):x}>"
    linecache.cache[name] = (len(text), None, text.splitlines(keepends=True), name)
    space: dict[str, Any] = {"__name__": f"{base.name}_and_{extra.name}", "base": base.decide, "extra": extra.decide}
    exec(compile(text, name, "exec"), space)  # noqa: S102  our own text
    rule: Callable[..., Any] = space["decide"]
    return rule
