"""The contract of a fault: plain rules, each for the stage of a flight that it disturbs.

A kind of fault is a module with `Parameters` and one or more of seven rules. Its argument names are
the declaration, as of every rule (`core.vocabulary`). A driver calls a rule only while the fault
lasts, and contains it only if a scenario names its kind.
"""

from collections import namedtuple
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import inf
from typing import Any

from airflock.core.body import COMMAND, MOTION, STATE
from airflock.core.contract import along_axes, argument_names, call_rule, gather, namespace_names
from airflock.core.parameters import Parameters, choices, number_names
from airflock.support import RuleError

ONSET = {
    "since": "time since the fault began, s",
    **{f"at_{name}": f"true {text}, when the fault began" for name, text in STATE.items()},
    **{f"at_{name}": f"{text}, when the fault began" for name, text in COMMAND.items()},
}
LAST = {f"at_{name}": f"{text}, as it was last before the fault began" for name, text in STATE.items()}
RULES = {
    "sense": {**STATE, **ONSET, **LAST, "f": "the fault's parameters"},
    "tell": {**STATE, **ONSET, **LAST, "f": "the fault's parameters"},
    "radio": {"reach": "radio.range, m", "since": ONSET["since"], "f": "the fault's parameters"},
    "clock": {"since": ONSET["since"], "f": "the fault's parameters"},
    "overrule": {**COMMAND, **ONSET, "f": "the fault's parameters"},
    "motion": {
        **{name: MOTION[name] for name in ("vx", "vy", "vz", "cx", "cy", "cz", "dt")},
        **along_axes("n", "velocity after the step as the body flew it", "m/s"),
        **ONSET,
        "f": "the fault's parameters",
    },
    "leaves": {"f": "the fault's parameters"},
}


# rule → how many numbers it returns, and what they are
FAULT_RULES: Mapping[str, tuple[int, str]] = {
    "sense": (6, "position (m) and velocity (m/s) that the agent believes and sends"),
    "tell": (6, "position (m) and velocity (m/s) that it sends instead"),
    "radio": (2, "how far its packets carry and how far it hears, m; negative for not at all"),
    "clock": (1, "how far its clock is ahead, s"),
    "overrule": (3, "the command that reaches its body"),
    "motion": (3, "its velocity after the step, m/s"),
    "leaves": (1, "time from the fault's beginning until it is absent, s"),
}
AT_NAMES = tuple(f"at_{letter}{axis}" for letter in ("", "v") for axis in "xyz")  # "at_x" to "at_vz"
# State that `sense` or `tell` disturbs: the one believed, the one sent of it, and the one sent
# instead.
DISTURBED_STATES: Mapping[str, str] = {"believed": "sense", "sent": "sense", "told": "tell"}
ENTRY_KEYS = ("kind", "at", "until", "lasts", "per_hour", "agents", "group", "number")  # of an entry of [[faults]]


@dataclass(frozen=True)
class Fault:
    """A kind of fault: parameters and rules, gathered from a module or any namespace.

    name       : how scenarios refer to it
    Parameters : record of its numbers (`core.parameters.Parameters`)
    sense      : what it makes of the own state as measured, which the law acts on and others are
                 sent
    tell       : what it makes of the state that is sent, after `sense`
    radio      : what is left of the radio's range, outwards and inwards
    clock      : how far the clock is ahead, which stamps packets and dates the packets of others
    overrule   : what it makes of a command, after the law
    motion     : what it makes of a motion step, after the body
    leaves     : when the agent drops out of the flight for good
    violates   : truths of `airflock.check_fault` that do not hold for it, and why (VIOLATES)
    """

    name: str
    Parameters: type
    sense: Callable[..., Any] | None = None
    tell: Callable[..., Any] | None = None
    radio: Callable[..., Any] | None = None
    clock: Callable[..., float] | None = None
    overrule: Callable[..., Any] | None = None
    motion: Callable[..., Any] | None = None
    leaves: Callable[..., float] | None = None
    doc: str = ""
    violates: Mapping[str, str] = field(default_factory=dict)

    def __hash__(self) -> int:
        return hash((self.name, *(getattr(self, kind) for kind in FAULT_RULES)))

    @property
    def rules(self) -> dict[str, Callable[..., Any]]:
        """Rules by the stage that calls them."""
        return {kind: getattr(self, kind) for kind in FAULT_RULES if getattr(self, kind) is not None}

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of its numbers, in declared order."""
        return number_names(self.Parameters)

    def __getstate__(self) -> dict[str, Any]:
        """Return the state to pickle, without the record, which is built again on demand."""
        return {name: value for name, value in vars(self).items() if name != "record"}

    @cached_property
    def record(self) -> type:
        """NamedTuple of its numbers, which its rules are handed as `f`."""
        return namedtuple(self.name.title().replace("_", ""), self.fields)

    @property
    def onset_names(self) -> tuple[str, ...]:
        """Return the names of the true state and command at the onset of the fault that its rules request."""
        requests = {(kind, name) for kind, rule in self.rules.items() for name in argument_names(rule, kind, self.name)}
        requests -= {(kind, name) for kind in DISTURBED_STATES.values() for name in AT_NAMES}
        return tuple(sorted({name for _, name in requests if name.startswith("at_")}))

    def time_to_absence(self, numbers: Any) -> float:
        """Time from its beginning until the agent leaves the flight, s; inf for never. numbers : its `Parameters`."""
        if self.leaves is None:
            return inf
        given = {"f": self.record(*(getattr(numbers, name) for name in self.fields))}
        return float(call_rule(self.leaves, "leaves", given, self.name))

    def kept(self, state: str) -> tuple[str, ...]:
        """Return the names of the disturbed state, as it was last before the fault, that a rule requests ("at_x").

        state : a key of DISTURBED_STATES
        """
        rule = self.rules.get(DISTURBED_STATES[state])
        names = () if rule is None else argument_names(rule, DISTURBED_STATES[state], self.name)
        return tuple(name for name in AT_NAMES if name in names)


def fault(namespace: Any, name: str = "") -> Fault:
    """Gather a kind of fault from a module, a class or a mapping of names; refuse what the contract does not know.

    Parameters
    ----------
    namespace : module, class or mapping
        Holds any of the rules sense, tell, radio, clock, overrule, motion and leaves, and Parameters if they need any
        numbers.
    name : str, optional
        How the kind is called; by default the namespace's.

    Returns
    -------
    Fault
        To be given to `airflock.load(..., faults=...)`.

    Raises
    ------
    RuleError
        If it has no rule, or a rule requests an unknown argument.

    Examples
    --------
    >>> import airflock
    >>> class Sluggish:
    ...     def motion(vx, vy, vz, nx, ny, nz):
    ...         return vx + 0.5 * (nx - vx), vy + 0.5 * (ny - vy), vz + 0.5 * (nz - vz)
    >>> sorted(airflock.fault(Sluggish).rules)
    ['motion']
    """
    found, name = namespace_names(namespace, name)
    rules = {kind: found[kind] for kind in FAULT_RULES if callable(found.get(kind))}
    if not rules:
        raise RuleError(f"fault {name} has no rule; give one or more of {', '.join(FAULT_RULES)}")
    for kind, rule in rules.items():
        argument_names(rule, kind, name)
    record = found.get("Parameters", Parameters)
    taken = [key for key in number_names(record) if key in ENTRY_KEYS]
    if taken:
        raise RuleError(f"fault {name}: Parameters.{taken[0]}: the name has a meaning of its own in [[faults]]")
    made = gather(
        Fault, found, name=name, Parameters=record, doc=str(found.get("__doc__") or ""),
        **{kind: rules.get(kind) for kind in FAULT_RULES},
    )  # fmt: skip
    # A driver keeps the onset and the disturbed states of an agent in columns of these names.
    kept = [
        key
        for key in number_names(record)
        if key == "onset" or key.startswith(("at_", *(f"{a}_" for a in DISTURBED_STATES)))
    ]
    if kept:
        raise RuleError(f"fault {name}: Parameters.{kept[0]}: a flight keeps something else of that name; give another")
    # Numbers become columns of the table that a driver reads; a choice would need a driver of its
    # own.
    if choices(record()):
        raise RuleError(f"fault {name}: Parameters holds a choice; make a kind of its own for each")
    return made
