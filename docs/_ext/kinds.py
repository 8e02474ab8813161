"""Pages of kinds: every fault and every topology with its rule and its numbers, every format of tracks and logs."""

from inspect import getdoc, getsource
from sys import modules

from writing import key_table, plain, prose, put, table


def faults() -> None:
    """A section for each kind of fault: what it does, the rules that disturb a flight, its numbers."""
    from airflock.core.fault import FAULT_RULES
    from airflock.parts import FAULTS as KINDS
    from airflock.scenarios.keys import sections

    known = sections()
    pieces = [
        "# Kinds of fault\n\nThe entries of `[[faults]]`; [how to write them](../faults.md). Every entry may say when "
        "it begins and ends, and whom it hits:\n\n",
        key_table(known["faults"].keys),
    ]
    for name, kind in KINDS.items():
        pieces.append(f'\n## kind = "{name}"\n\n{prose(kind.doc)}\n\n')
        for stage, rule in kind.rules.items():
            pieces.append(f"Its rule `{stage}` returns {FAULT_RULES[stage][1]}.\n\n")
            pieces.append(f"```python\n{getsource(rule)}```\n\n")
        pieces.append(key_table(known[name].keys) if known[name].keys else "It has no numbers of its own.\n")
    put("fault_kinds.md", "".join(pieces))


def formats() -> None:
    """Write a row for each format of tracks and logs: endings, what is read, packages beside those of Airflock."""
    from airflock.recordings.imports import formats as known

    heads = ("ending", "format", "read as", "needs")
    rows = [(", ".join(f"`{end}`" for end in one.suffixes), one.name, one.about, one.needs) for one in known()]
    text = "Every format that `airflock import` reads; [how to import](../tracks.md).\n\n"
    put("formats.md", f"# Formats of tracks and logs\n\n{text}{table(heads, rows)}")


def topologies() -> None:
    """A section for each topology: what it means, its rule, the numbers that it reads."""
    from airflock.parts import TOPOLOGIES
    from airflock.scenarios.keys import sections

    pieces = [
        "# Kinds of topology\n\nWhom an agent meets of those whom it hears; [the rules in full](../topology.md).\n"
    ]
    keys = sections()["topology"].keys
    for name, topology in TOPOLOGIES.items():
        pieces.append(f'\n## topology.kind = "{name}"\n\n')
        if topology is None:
            pieces.append("All whom it hears. It has no rule and no numbers.\n")
            continue
        module = modules[topology.meet.__module__]
        code = getsource(topology.meet)
        pieces.append(f"{prose(getdoc(module) or '')}\n\n```python\n{code}```\n\n")
        whole = getsource(module)
        read = [key for key in keys if f"t.{key.name.partition('.')[2]}" in whole]
        pieces.append(key_table(read) if read else "It has no numbers.\n")
    pieces.append(f"\n## All keys\n\n{plain(sections()['topology'].about)}\n\n{key_table(keys)}")
    put("topologies.md", "".join(pieces))
