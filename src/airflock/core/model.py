"""The contract of a flocking law: its vocabulary, its rules gathered from a namespace, and the sum of two laws."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from inspect import signature
from typing import Any

from airflock.core.contract import COMMANDS, REDUCTIONS, along_axes, argument_names, gather, namespace_names
from airflock.core.parameters import declarations
from airflock.support import RuleError

PAIR = {
    **along_axes("d", "offset to the neighbour as heard", "m"),
    "r": "length of the offset, m",
    "r2": "its square, m²; cheaper than r",
    **along_axes("dv", "velocity of the neighbour minus own", "m/s"),
    "dv": "length of the velocity difference, m/s",
    **along_axes("v", "own velocity as measured", "m/s"),
    **along_axes("h", "own heading (unit vector)"),
    **along_axes("nh", "heading of the neighbour as heard"),
    "age": "age of the neighbour's data, s",
    "lower": "1.0 if the neighbour has the lower index, else 0.0",
    "kin": "1.0 if the neighbour is of the own group, else 0.0",
    "group": "number of the neighbour's group in [[groups]], the first being 0.0; -1.0 if it is in none",
}
SURFACE = {
    "distance": "distance to the surface, m; negative on its far side",
    **along_axes("n", "unit normal of the surface, pointing to where flying is allowed"),
    **along_axes("v", "own velocity as measured", "m/s"),
}
FLOCK = {
    "n": "number of agents",
    "x": "true positions of all agents, east, m; x[i] is that of agent i",
    "y": "true positions of all agents, north, m; y[i] is that of agent i",
    "z": "true positions of all agents, up, m; z[i] is that of agent i",
    **along_axes("v", "their velocities", "m/s"),
    "wing": "parameters of the wing (aero.wing)",
    "aero": "parameters of the drag descent (aero.descent)",
    "work": "scratch arrays in the shapes that `workspace` gives, kept from call to call; work.name[row][column]",
    "shared": "columns of Shared to fill: shared.name[i] for every agent i",
}
AGENT = {
    "own": "Own: velocity vx vy vz (m/s) and heading hx hy hz as measured",
    "sums": "what `neighbour` summed up over all neighbours",
    "walls": "what `boundary` summed up over all surfaces",
    "memory": "the model's Memory of this agent",
    "percept": "Percept: time (s), the offsets centre_x centre_y centre_z to the arena's centre "
    "and goal_x goal_y goal_z to the goal (m), rays and noise",
    "period": "time between two decisions, s",
    "shared": "what `flock` found for this agent",
    "wing": "parameters of the wing (aero.wing)",
    "aero": "parameters of the drag descent (aero.descent)",
}
STEER = {
    "cx": "the law's command, east; a heading, m/s or m/s² as its COMMAND says",
    "cy": "the law's command, north",
    "cz": "the law's command, up",
    "own": AGENT["own"],
    "period": AGENT["period"],
    "steer": "numbers of the section [steer]",
}
RULES = {
    "reach": {"p": "parameters"},
    "sight": {"p": "parameters"},
    "wall_reach": {"p": "parameters"},
    "neighbour": {**PAIR, "p": "the model's parameters"},
    "boundary": {**SURFACE, "p": "the model's parameters"},
    "flock": {**FLOCK, "p": "the model's parameters"},
    "decide": {**AGENT, "p": "the model's parameters"},
    "steer": STEER,
}


NEEDED = {  # what each law brings, and what it is
    "Parameters": "a record of its numbers, derived from airflock.Parameters",
    "COMMAND": f"what decide returns, one of {', '.join(COMMANDS)}",
    "decide": "the rule itself",
}
RECORDS = {  # what a rule of this kind brings beside itself
    "Sums": "a NamedTuple of this name with what neighbour returns, which decide gets added up as sums",
    "Walls": "a NamedTuple of this name with what boundary returns, which decide gets added up as walls",
    "Shared": "a NamedTuple of this name with what flock finds for each agent, which decide gets as shared",
    "workspace": "the shapes of the scratch that flock fills",
}


@dataclass(frozen=True)
class Model:
    """A published flocking law: parameters and rules, gathered from a module or any namespace.

    name         : how scenarios refer to it
    Parameters   : record of parameters (`core.parameters.Parameters`)
    command      : "velocity" (m/s), "acceleration" (m/s²) or "heading" (unit vector)
    reach        : `reach(p)`, largest interaction radius, m; without it the radio alone decides who
                   is heard
    sight        : `sight(p)`, how far percept.cast looks, m
    neighbour    : pair rule → Sums; Sums its NamedTuple; reduce: how fields combine where not by a
                   sum
    boundary     : surface rule → Walls
    flock        : the one rule of the whole flock: fills the columns of Shared, which `decide` may
                   read as `shared`
    workspace    : `workspace` of any of n, p, wing, aero → NamedTuple of (rows, columns), the
                   scratch of `flock`
    wall_reach   : `wall_reach(p)`, m: surfaces of the scene farther away have no effect; without it
                   all are evaluated
    decide       : → command x, y, z and a Memory if the model declares one
    added        : a law whose command is added to that of `decide` (`add_laws`)
    steer        : makes of the command of `decide` one of the kind `command`, which the body takes
                   (`steered_law`)
    usual   : numbers that are compiled in where a scenario leaves them so; a rule that tests for
              them gets faster
    preferred_speed, interaction_range : plain functions of the parameters, used by the metrics
    violates : truths of `airflock.check_model` that do not hold for it, and why (VIOLATES)
    terms    : vectors among its Sums (their fields without x, y, z) → what the law calls them, and
               their unit (TERMS)
    parts    : parts of the law in the paper's order → names of the parameters of each; a page sorts
               sliders so (PARTS)
    """

    name: str
    Parameters: type
    command: str
    decide: Callable[..., Any]
    reach: Callable[..., float] | None = None
    sight: Callable[..., float] | None = None
    neighbour: Callable[..., Any] | None = None
    Sums: type[Any] | None = None
    boundary: Callable[..., Any] | None = None
    Walls: type[Any] | None = None
    wall_reach: Callable[..., float] | None = None
    Memory: type[Any] | None = None
    flock: Callable[..., None] | None = None
    Shared: type[Any] | None = None
    workspace: Callable[..., Any] | None = None
    reduce: Mapping[str, str] = field(default_factory=dict)
    usual: Mapping[str, float] = field(default_factory=dict)
    preferred_speed: Callable[..., float] | None = None
    interaction_range: Callable[..., float] | None = None
    doc: str = ""
    violates: Mapping[str, str] = field(default_factory=dict)
    terms: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    parts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    added: "Model | None" = None
    steer: Callable[..., Any] | None = None

    @property
    def decide_rules(self) -> tuple[Callable[..., Any], ...]:
        """Rules whose commands add up."""
        return (self.decide,) if self.added is None else (self.decide, self.added.decide)

    def speed(self, p: Any) -> float:
        """Its preferred speed with these parameters, m/s; 0 where it has none."""
        return 0.0 if self.preferred_speed is None else float(self.preferred_speed(p))

    def __hash__(self) -> int:
        return hash((self.name, self.decide, self.neighbour, self.boundary, self.flock))


def model(namespace: Any, name: str = "") -> Model:
    """Gather a model from a module, a class or a mapping of names; refuse what the contract does not know.

    Parameters
    ----------
    namespace : module, class or mapping
        Holds COMMAND, Parameters, decide, and any of neighbour, Sums, boundary, Walls, reach and the others that
        `Model` lists. The argument names of a rule are its requests (`airflock.core.vocabulary`).
    name : str, optional
        How the model is called; by default the namespace's.

    Returns
    -------
    Model
        To be given to `airflock.load(..., law=...)`.

    Raises
    ------
    RuleError
        If something is missing, or a rule requests an unknown argument; names the nearest word.

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
    found, name = namespace_names(namespace, name)
    if missing := [f"{needed} ({what})" for needed, what in NEEDED.items() if needed not in found]:
        raise RuleError(f"model {name} lacks {', '.join(missing)}")
    if found["COMMAND"] not in COMMANDS:
        raise RuleError(f"model {name}: COMMAND = {found['COMMAND']!r} is none of {', '.join(COMMANDS)}")
    for rule, record in (("neighbour", "Sums"), ("boundary", "Walls"), ("flock", "Shared"), ("flock", "workspace")):
        if rule in found and record not in found:
            raise RuleError(f"model {name} has a rule {rule} but no {record} ({RECORDS[record]})")
    for kind in RULES:
        if kind in found and kind != "steer":
            argument_names(found[kind], kind, name)
    for key, how in found.get("REDUCE", {}).items():
        if key not in getattr(found.get("Sums"), "_fields", ()) or how not in REDUCTIONS:
            raise RuleError(f"model {name}: REDUCE[{key!r}] = {how!r}; give a field of Sums and one of {REDUCTIONS}")
    return gather(
        Model,
        found,
        name=name,
        command=found["COMMAND"],
        doc=str(found.get("__doc__") or ""),
        terms=_terms(found.get("TERMS", {}), found.get("Sums"), name),
        parts=_parts(found.get("PARTS", {}), found["Parameters"], name),
        added=None,  # made of laws, not read of one
        steer=None,
    )


def _parts(given: Any, parameters: type, name: str) -> dict[str, tuple[str, ...]]:
    """Parts of a law; each names parameters that there are."""
    known = {parameter for parameter, _, _ in declarations(parameters)} if given else set()
    for part, names in dict(given).items():
        unknown = [each for each in names if each not in known]
        if isinstance(names, str) or unknown:
            raise RuleError(f"model {name}: PARTS[{part!r}] = {names!r}; give names of its parameters")
    return {part: tuple(names) for part, names in dict(given).items()}


def _terms(given: Any, sums: Any, name: str) -> dict[str, tuple[str, str]]:
    """Words of a law for its vectors; each stands for fields that there are."""
    fields = getattr(sums, "_fields", ())
    for stem, words in dict(given).items():
        if not any(f"{stem}{joint}x" in fields for joint in ("", "_")):
            raise RuleError(f"model {name}: TERMS[{stem!r}]: Sums has no field {stem}x")
        if not (isinstance(words, tuple) and len(words) == 2 and all(isinstance(word, str) for word in words)):
            raise RuleError(f"model {name}: TERMS[{stem!r}] = {words!r}; give a word and a unit")
    return dict(given)


def steered_law(law: Model, command: str, steer: Callable[..., Any]) -> Model:
    """Return a law whose command a rule turns into one of another kind: a velocity, an acceleration or a heading."""
    if law.added is not None:
        raise RuleError(f"model {law.name} is a sum that commands a {law.command}; the body takes a {command}")
    return replace(law, command=command, steer=steer)


FIRST_ONLY_ARGUMENTS = ("p", "sums", "walls", "memory")  # what only the first law can have: there is one record of each
FIRST_ONLY_RULES = ("neighbour", "boundary", "Memory", "reach", "sight", "wall_reach")


def add_laws(base: Model, extra: Model) -> Model:
    """The law `base` with the command of `extra` added to its own.

    `extra` may have a rule of the whole flock where `base` has none; its `decide` takes no
    parameters `p` of the model, only records that a scenario has once. Raises RuleError where the
    two do not fit. Equal arguments give the same rules, and so the same driver.
    """
    for error in composition_errors(base, extra):
        raise RuleError(error)
    # A list of laws was rejected: two records of parameters would need names of their own in every
    # rule.
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
    """Return the reasons why two laws cannot be added, one line each."""
    found = []
    if base.command != extra.command:
        found.append(f"model {base.name} commands {base.command}, and {extra.name} {extra.command}: no sum of the two")
    if base.flock is not None and extra.flock is not None:
        found.append(f"model {base.name} solves for the whole flock itself; {extra.name} cannot do so beside it")
    if base.added is not None or extra.added is not None:
        found.append(f"model {base.name} or {extra.name} is a sum already")
    more = [name for name in FIRST_ONLY_RULES if getattr(extra, name) is not None]
    more += [name for name in signature(extra.decide).parameters if name in FIRST_ONLY_ARGUMENTS]
    if more:
        found.append(f"{extra.name} is added to another model and can have no {', '.join(more)} of its own")
    return found
