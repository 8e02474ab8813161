"""Reports: one line a truth, and the error that lists what does not hold."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeVar

from airflock.support import AirflockError, RuleError, ScenarioError

# name → what it says, and a check that returns what is wrong, empty if nothing is
TruthTable = dict[str, tuple[str, Callable[[], str]]]
Part = TypeVar("Part")


class CheckError(AirflockError, AssertionError):
    """A law, an order parameter, a body, a sensor or a radio breaks a truth that it does not declare (VIOLATES)."""


@dataclass(frozen=True)
class Truth:
    """One truth: its name, what it says, what was found against it (empty: it holds), and the declared reason why."""

    name: str
    statement: str
    fault: str = ""
    reason: str = ""

    @property
    def is_broken(self) -> bool:
        """Whether it does not hold and nobody said so."""
        return bool(self.fault) and not self.reason

    def __str__(self) -> str:
        """One line for a person."""
        if not self.fault:
            return f"holds   {self.name}: {self.statement}"
        if self.reason:
            return f"breaks  {self.name}, as declared: {self.reason}"
        return f"BREAKS  {self.name}: {self.statement}; {self.fault}"


@dataclass(frozen=True)
class Report:
    """What was checked of one law, order parameter, body, sensor or radio."""

    name: str
    truths: tuple[Truth, ...]

    def __str__(self) -> str:
        """One line a truth."""
        return "\n".join([f"{self.name}:", *(f"  {truth}" for truth in self.truths)])

    @property
    def broken_names(self) -> tuple[str, ...]:
        """Names of the truths that do not hold, declared or not."""
        return tuple(truth.name for truth in self.truths if truth.fault)


def require_part(part_and_errors: tuple[Part | None, list[str]]) -> Part:
    """What was found, of it and its faults; raises a ScenarioError if there are any."""
    what, faults = part_and_errors
    if faults or what is None:
        raise ScenarioError(faults)
    return what


def run_truths(name: str, truths: TruthTable, violates: Mapping[str, str]) -> Report:
    """Run all truths and report them; raises CheckError where one breaks that is not declared.

    violates : name → why a truth does not hold here. One that no list knows is an error, so that none is misspelled.
    """
    unknown = sorted(set(violates) - set(truths))
    if unknown:
        raise RuleError(f"{name}: VIOLATES names {', '.join(unknown)}; known: {', '.join(truths)}")
    made = []
    for key, (says, check) in truths.items():
        try:
            fault = check()
        except RuleError as error:
            fault = str(error).splitlines()[0]
        except (ArithmeticError, ValueError) as error:  # of the rule itself: a division by zero, a root of -1
            fault = f"{type(error).__name__}: {error}"
        made.append(Truth(key, says, fault, violates.get(key, "")))
    report = Report(name, tuple(made))
    if any(truth.is_broken for truth in made):
        raise CheckError("\n".join(f"{name}: {truth}" for truth in made if truth.is_broken))
    return report
