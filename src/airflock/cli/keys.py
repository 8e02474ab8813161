"""Verb keys: every key that a scenario file may hold."""

from typing import TYPE_CHECKING, Annotated

import typer

from airflock.cli import options, tables

if TYPE_CHECKING:
    from airflock.scenarios import Key


def keys(
    section: Annotated[
        str | None,
        typer.Argument(
            metavar="SECTION|KIND|KEY",
            help="For instance radio, couzin_2002, faults, motor, top, or delay.",
            show_default=False,
        ),
    ] = None,
    as_json: options.Json = False,
) -> None:
    """List the sections of a scenario file, or every key of one: meaning, unit, range, default and source.

    Example: airflock keys radio
    """
    from airflock.scenarios import keys as known

    listed_keys = known.keys(section)
    if as_json:
        tables.print_json([{**key._asdict(), "options": list(key.options)} for key in listed_keys])
        return
    if section is None:
        width = max(map(len, known.sections()))
        for name, listed in known.sections().items():
            count = len(listed.keys)
            typer.echo(f"{name:<{width}}  {count:>2} key{'s' if count != 1 else ' '}  {listed.about}")
        return
    _print(listed_keys)


def _print(listed_keys: "list[Key]") -> None:
    from rich.console import Console
    from rich.padding import Padding
    from rich.text import Text

    console = Console()
    width = max(len(key.name) for key in listed_keys)
    for key in listed_keys:
        owner = f"   ({key.of})" if len({key.of for key in listed_keys}) > 1 and key.of else ""
        line = Text.assemble((f"{key.name:<{width}}", "bold"), f"   {key.standard}   [{key.allowed}]", (owner, "cyan"))
        source = f" ({key.source})" if key.source else ""
        console.print(line)
        console.print(Padding(Text.assemble(key.meaning, (source, "dim")), (0, 0, 0, 4)))
