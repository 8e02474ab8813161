"""The kinds of fault that a scenario can name: the key `kind` of an entry of [[faults]]."""

from airflock.core import FAULT_RULES, Fault, fault, find_members

KINDS: dict[str, Fault] = find_members("airflock.parts.faults", FAULT_RULES, fault)
