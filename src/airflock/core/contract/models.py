"""The contract of a model: a published flocking law, gathered from a module or any namespace."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from airflock.core.contract.declared import COMMANDS, REDUCTIONS
from airflock.core.contract.namespaces import namespace_names
from airflock.core.parameters import declarations
from airflock.core.vocabulary import argument_names
from airflock.core.vocabulary.laws import RULES
from airflock.support import RuleError

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
    reach        : `reach(p)`, largest interaction radius, m; without it the radio alone decides who is heard
    sight        : `sight(p)`, how far percept.cast looks, m
    neighbour    : pair rule → Sums; Sums its NamedTuple; reduce: how fields combine where not by a sum
    boundary     : surface rule → Walls
    flock        : the one rule of the whole flock: fills the columns of Shared, which `decide` may read as `shared`
    workspace    : `workspace` of any of n, p, wing, aero → NamedTuple of (rows, columns), the scratch of `flock`
    wall_reach   : `wall_reach(p)`, m: surfaces of the scene farther away say nothing; without it all are asked
    decide       : → command x, y, z and a Memory if the model declares one
    added        : a law whose command is added to that of `decide` (`core.composition`)
    usual   : numbers that are compiled in where a scenario leaves them so; a rule that tests for them gets faster
    preferred_speed, interaction_range : plain functions of the parameters, used by the metrics
    violates : truths of `airflock.check_model` that do not hold for it, and why (VIOLATES)
    terms    : vectors among its Sums (their fields without x, y, z) → what the law calls them, and their unit (TERMS)
    parts    : parts of the law in the paper's order → names of the parameters of each; a page sorts sliders so (PARTS)
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
    found, name = namespace_names(namespace, name)
    if missing := [f"{needed} ({what})" for needed, what in NEEDED.items() if needed not in found]:
        raise RuleError(f"model {name} lacks {', '.join(missing)}")
    if found["COMMAND"] not in COMMANDS:
        raise RuleError(f"model {name}: COMMAND = {found['COMMAND']!r} is none of {', '.join(COMMANDS)}")
    for rule, record in (("neighbour", "Sums"), ("boundary", "Walls"), ("flock", "Shared"), ("flock", "workspace")):
        if rule in found and record not in found:
            raise RuleError(f"model {name} has a rule {rule} but no {record} ({RECORDS[record]})")
    for kind in RULES:
        if kind in found:
            argument_names(found[kind], kind, name)
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
        parts=_parts(found.get("PARTS", {}), found["Parameters"], name),
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
