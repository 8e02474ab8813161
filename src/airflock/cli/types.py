"""Verb types: what a type checker finds in rule files."""

from pathlib import Path
from typing import Annotated

import typer

from airflock.cli import options, tables
from airflock.errors import AirflockError


def types(
    files: Annotated[
        list[str], typer.Argument(metavar="FILE.py...", help="Laws, bodies, sensors, radios, order parameters, faults.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Also write the typed copies, for an editor or another type checker."),
    ] = None,
    as_json: options.Json = False,
) -> None:
    r"""Find misspelled parameters and wrong records in rules of your own; no code in the files is run.

    The argument names of a rule say what it is given, so no annotations are needed. Needs mypy: pip install
    'airflock\[types]'.

    Example: airflock types mine.py
    """
    from airflock.checking.types import check_types

    report = check_types(files, out=out)
    if as_json:
        tables.emit_json({"rules": report.rules, "faults": [fault._asdict() for fault in report.faults]})
    else:
        for name, rules in report.rules.items():
            count = sum(fault.file == name for fault in report.faults)
            faults = f"{count} fault{'s' if count > 1 else ''}" if count else "no fault"
            typer.echo(f"{name}: {faults} in {', '.join(rules)}")
    if report.faults:
        raise AirflockError("\n".join(map(str, report.faults)))
