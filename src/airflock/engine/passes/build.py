"""Builder: what all passes share while the text of one driver grows."""

import re
from collections.abc import Callable, Iterable, Mapping
from copy import copy
from itertools import groupby
from textwrap import indent
from typing import Any

from airflock.core import Metric, argument_names
from airflock.engine.plan import INTEGER_NAMES, Plan, field_names
from airflock.engine.replace import ReplacementError, checked_replace
from airflock.engine.specialise.known_values import StageFunction
from airflock.engine.stages.state import FAULT_PREFIX, NUMBER_PREFIX, SCENE_ARRAYS
from airflock.engine.text.generate import DriverSource
from airflock.engine.text.rewrite import law_suffix
from airflock.world import WITHOUT_SPHERES

JIT_DECORATOR = "@njit(**JIT)"
ONCE = "@njit(**ONCE)"
# what names of rows begin with that only numbers that differ need, and faults of motion, radio and
# clock
FEW = (FAULT_PREFIX, NUMBER_PREFIX, "unhindered_", "reach_", "clock", "sent_clock")


class Builder:
    """Names rules, rows of the work table and records of the parameter row for one plan.

    clusters : lines that find the clusters of a metric, where a device does it otherwise than one
               agent after another
    abreast  : whether two agents may go through the others of a pair rule together
    apart    : whether the rows that a stage reads can be arguments of a function
    ranges   : whether a loop over some of the lanes is one from the first of them to the last
    by_pairs : whether each pair of agents draws its random words by itself, not four receivers at
               once
    slots    : whether loops over agents run over slots, of which each holds agent order[i]
    drifts   : whether agents may be watched by how fast they are beside the drift of the flock
    trails   : whether rows of faults and of agents that differ come last in the work table
    drops    : whether the compiler drops an unread sum over agents
    """

    clusters: Callable[[Metric], list[str]] | None = None
    slots = False
    pairs_two_agents = True
    drops_unread_sums = True
    apart = True
    ranges = True
    draws_per_pair = False
    can_use_drift = True
    puts_rare_rows_last = True

    def __init__(self, plan: Plan):
        self.plan = plan
        self.source = DriverSource(JIT_DECORATOR, plan.constants, plan.vectors, {} if plan.spheres else WITHOUT_SPHERES)
        self.first: dict[str, int] = {}
        self.last: dict[str, int] = {}
        self.functions: list[str] = []
        self.stages: dict[str, Any] = {}  # functions of the driver by name, as other stages call them
        self.turns: dict[str, tuple[list[str], StageFunction]] = {}  # in a sequential step: what it reads, its call

    def bind_rows(self, names: Iterable[str]) -> list[str]:
        """Lines that bind rows of the work table to local names."""
        return [f"{name} = work[{self.row(name)}]" for name in names]

    def row(self, name: str) -> int:
        """Index of a row of the work table, from its end where it is negative.

        Unperturbed perception shares the rows of the truth. Rows of faults, of agents that differ
        and of who lies where come last, so that the others lie to each other as they do in a flight
        without: loops take a fortieth longer where rows that are written lie a page from rows that
        are read.
        """
        plan = self.plan
        if not plan.believes and name in {f"m{a}" for a in "xyz"} | {f"mv{a}" for a in "xyz"}:
            name = name[1:]
        if not plan.told and name in {f"h{a}" for a in "xyz"} | {f"hv{a}" for a in "xyz"}:
            name = name[1:]
        # Negative numbers count from the end of the table, whose length is known only when all
        # stages are made.
        if self.puts_rare_rows_last and (name.startswith(FEW) or (name == "order" and not plan.grid)):
            return self.last.setdefault(name, -1 - len(self.last))
        return self.first.setdefault(name, len(self.first))

    @property
    def rows(self) -> dict[str, int]:
        """Index of each row of the work table by its name."""
        count = len(self.first) + len(self.last)
        return self.first | {name: count + place for name, place in self.last.items()}

    @property
    def laws(self) -> list["Builder"]:
        """Of each law of the flock the builder of its stages; they write into the same driver."""
        if not self.plan.laws:
            return [self]
        found = []
        for law, plan in enumerate(self.plan.every):
            made = copy(self)
            made.plan, made.source = plan, self.source.of(law, plan.constants, plan.vectors)
            found.append(made)
        return found

    @property
    def mark(self) -> str:
        """Suffix of functions and records of one law of several."""
        return law_suffix(self.plan.law)

    def kind(self, letter: str, fields: tuple[str, ...]) -> str:
        """Name of the record of numbers behind a letter."""
        return self.source.record(letter.upper() * 2 + (self.mark if letter == "p" else ""), field_names(fields))

    @property
    def is_sequential(self) -> bool:
        """Return True if a loop over all agents is its body alone, for the agent in turn."""
        return self.plan.sequential

    @property
    def images(self) -> bool:
        """Return True if a stage takes offsets between agents to the nearest image."""
        return self.plan.periodic

    def order(self) -> list[str]:
        """Lines that bind `order`: whole numbers in a row of the work table, so that they move with all other rows."""
        return [f"order = work[{self.row('order')}].view(np.int{self.plan.bits})"] if self.slots else []

    def records(self, letters: str) -> list[str]:
        """Lines that read records of numbers (p, b, q, ...) from the parameter row."""
        return self.numbers(letters.split())

    def numbers(self, letters: Iterable[str], prefix: str = "") -> list[str]:
        """Lines that read records of numbers under names that begin with a prefix."""
        spans, wanted = self.plan.spans, set(letters)
        return [
            f"{prefix}{letter} = {self.kind(letter, fields)}({', '.join(_values(fields, spans[letter].start))})"
            for letter, fields in self.plan.records.items()
            if letter in wanted
        ]

    def whole(self, *names: str) -> list[str]:
        """Lines that read integers of this world."""
        return [f"{name} = whole[{INTEGER_NAMES.index(name)}]" for name in names]

    def scene(self, *names: str) -> list[str]:
        """Lines that take arrays out of the scene."""
        return [f"{name} = scene[{SCENE_ARRAYS.index(name)}]" for name in names]

    def call(self, rule: Callable[..., Any], kind: str, arguments: Mapping[str, str], owner: str = "") -> str:
        """Text of a call of a rule with the arguments that it takes."""
        names = argument_names(rule, kind, owner)
        return f"{self.source.name(rule)}({', '.join(arguments.get(name, name) for name in names)})"

    def rule_asks(self, rule: Callable[..., Any] | None, kind: str, *names: str) -> bool:
        """Return True if a rule exists and takes an argument of any of these names."""
        return rule is not None and bool(set(argument_names(rule, kind)) & set(names))

    def function(self, head: str, *bodies: Iterable[str] | str, parallel: bool = False, once: bool = False) -> None:
        """Add one compiled function of the driver; a parallel one spreads its prange over all cores.

        once : its machine code stands in the driver once, not wherever it is called
        """
        lines: list[str] = []
        for body in bodies:
            lines += [body] if isinstance(body, str) else list(body)
        name, _, parameters = head.rstrip(")").partition("(")
        self.stages[name] = StageFunction(name, tuple(parameters.split(", ")))
        decorator = "@njit(parallel=True, **JIT)" if parallel else ONCE if once else JIT_DECORATOR
        lines = ["alone()", *lines] if once else lines
        self.functions.append(f"{decorator}\ndef {head}:\n" + indent("\n".join(["wide_vectors()", *lines]), "    "))

    def stage(
        self, name: str, arguments: str, lines: list[str], body: list[str], answer: str = "0", apart: bool = False
    ) -> None:
        """One stage of a step: what it reads once, then its work for all agents or, sequentially, for agent i.

        apart : the rows that it reads once become arguments, which the compiler then knows to lie
                apart in memory
        """
        # Most stages are one function. Two cases split them: rows as arguments that lie apart, and
        # turns, where the bindings are shared by all agents and only the body is called once for
        # each.
        if not self.plan.sequential and not (apart and self.apart):
            spread = self.plan.grid and name == f"decide{self.mark}"
            body = checked_replace(body, "i in range(n)", "i in prange(n)") if spread else body
            self.function(f"{name}({arguments})", lines, body, f"return {answer}", parallel=spread)
            return
        first = [] if self.plan.sequential else ["apart()"]
        read = [line.partition(" = ")[0] for line in lines if " = " in line and line[0] != " " and ";" not in line]
        several = [part.partition(" = ")[0] for line in lines if line[0] != " " for part in line.split("; ")]
        used = set(re.findall(r"\w+", "\n".join(body)))
        read += [name for name in several if name not in read and name in used]
        turn = ["i"] if self.plan.sequential else []
        asked = [w for w in arguments.split(", ") if self.plan.sequential or w in used]
        given = ", ".join(dict.fromkeys([*turn, *asked, *(w for w in read if w.isidentifier() and w in used)]))
        self.function(f"{name}_of({given})", first, body, f"return {answer}")
        if self.plan.sequential:
            called = self.stages[f"{name}_of"]
            if self.mark:  # the stages of all turns share their names
                *lines, given = _marked([*lines, given], read, self.mark)
                called = StageFunction(called.name, tuple(given.split(", ")))
            self.turns[name] = lines, called
        else:
            self.function(f"{name}({arguments})", lines, f"return {name}_of({given})")

    def once(self, lines: Iterable[str]) -> list[str]:
        """Lines that run once for the whole flock, and see all that came before."""
        return list(lines)


def _values(fields: tuple[str, ...], first: int) -> list[str]:
    """Values of the fields of a record in the row from a place on: a number each, of a column all of its numbers."""
    found = []
    for (_, mark), part in groupby(enumerate(fields, first), lambda each: each[1].partition("[")[:2]):
        places = [place for place, _ in part]
        found.append(f"row[{places[0]}:{places[-1] + 1}]" if mark else f"row[{places[0]}]")
    return found


def _marked(lines: list[str], names: list[str], mark: str) -> list[str]:
    """Lines in which some variables end in a mark."""
    words = re.compile(rf"(?<![.\w])({'|'.join(names)})\b")
    return [words.sub(rf"\1{mark}", line) for line in lines] if names else lines


def inline_lines(lines: list[str], name: str, part: list[str]) -> list[str]:
    """Lines in which those of a function stand in place of its call. Raises ReplacementError where they do not fit."""
    (call,) = (line for line in lines if f"{name}(" in line)
    at, answer, margin = lines.index(call), call.strip().rpartition(" = ")[0] or "0", call[: -len(call.lstrip())]
    if part[-1] not in (f"return {answer}", f"return ({answer})"):
        raise ReplacementError(f"{name} ends with {part[-1]!r}, but is called as {call!r}")
    inner = [margin + line for text in part[:-1] for line in text.splitlines()]
    return [*lines[:at], *inner, *lines[at + 1 :]]


def loop_lines(iterable: str, lines: Iterable[str]) -> list[str]:
    """A for loop around lines."""
    return [f"for {iterable}:", *[f"    {line}" for text in lines for line in text.splitlines()]]


def branch_lines(test: str, lines: Iterable[str]) -> list[str]:
    """An if around lines."""
    return [f"if {test}:", *[f"    {line}" for text in lines for line in text.splitlines()]]


def sampled_columns(metrics: Iterable[Metric]) -> list[tuple[str, str, str]]:
    """Of every value that metrics sample: name, how it combines over time, and the clock that samples it."""
    return [
        (name, metric.over_time.get(name, "mean"), metric.clock) for metric in metrics for name in metric.Sample._fields
    ]
