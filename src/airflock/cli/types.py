"""The removed verb types, which names what replaces it; for one version."""

from pathlib import Path
from typing import Annotated

import typer

from airflock.cli import options


def types(
    files: Annotated[list[str] | None, typer.Argument(metavar="FILE.py...", help="Not read.")] = None,
    out: Annotated[Path | None, typer.Option(metavar="FOLDER", help="Not written.")] = None,
    as_json: options.Json = False,
) -> None:
    """Removed: use mypy, and airflock.check_model in Python.

    Example: airflock types mine.py
    """
    from airflock.check import check_types

    check_types(files or (), out=out)
