"""Records that a file of rules brings, checked when it is gathered: its Parameters, and what a rule remembers."""

from collections.abc import Collection
from dataclasses import make_dataclass
from typing import Any

from airflock.core.parameters import Parameters, number_names
from airflock.support import RuleError


def merge_parameters(common: type, record: Any, owner: str) -> type:
    """Parameters of a file's own together with the numbers that all of its kind have.

    common : record of those numbers; record : the file's, None where it has none; owner : such as "radio mine"
    """
    if record is None:
        return common
    if not (isinstance(record, type) and issubclass(record, Parameters)):
        raise RuleError(f"{owner}: Parameters is not a frozen dataclass derived from airflock.Parameters")
    if set(number_names(common)) <= set(number_names(record)):
        return record
    made = make_dataclass("Parameters", [], bases=(record, common), frozen=True, kw_only=True)
    made.__doc__, made.__module__ = record.__doc__, record.__module__
    return made


def check_memory_record(
    owner: str, rule: str, argument_names: Collection[str], record: Any, name: str = "Memory"
) -> None:
    """Refuse what a rule keeps from call to call, where it is no NamedTuple with the values of the start, or not asked.

    asked : names that the rule asks for; record : what the file holds under `name`, if anything
    """
    word = name.lower()
    if (word in argument_names) is (record is None):
        raise RuleError(f"{owner}: a rule {rule} that asks for {word} and a NamedTuple {name} come together")
    if record is not None and set(getattr(record, "_field_defaults", {})) != set(getattr(record, "_fields", "-")):
        raise RuleError(f"{owner}: {name} is a NamedTuple whose fields all have a value for the start")


def initial_values(record: type | None) -> tuple[float, ...]:
    """What each field of such a record is at the start of a flight; nothing without one."""
    return tuple(getattr(record, "_field_defaults", {}).values())
