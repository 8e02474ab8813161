"""Text of a stage for one plan: its statements as lines, in the parts that a driver puts in different places."""

import ast
from dataclasses import dataclass


@dataclass(frozen=True)
class SpecialisedText:
    """Text of a stage for one plan.

    bindings : lines that bind rows, records and integers
    first    : what is done once per step
    rest     : what is done for all agents or, in a sequential update, for agent i
    answer   : what the stage returns
    """

    bindings: list[str]
    first: list[ast.stmt]
    agent_statements: list[ast.stmt]
    answer: str

    @property
    def once(self) -> list[str]:
        """Lines of what is done before anything is done for an agent."""
        return [*self.bindings, *lines_of(self.first)]

    @property
    def body(self) -> list[str]:
        """Lines of what is done for agents."""
        return lines_of(self.agent_statements)

    @property
    def lines(self) -> list[str]:
        """All of them, for a function that is no stage of its own."""
        return [*self.once, *self.body]


def lines_of(statements: list[ast.stmt]) -> list[str]:
    """Lines of statements."""
    return [line for statement in statements for line in ast.unparse(statement).splitlines()]
