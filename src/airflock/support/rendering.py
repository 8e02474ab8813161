"""Tables and lines of results for a terminal: what `__rich__` of a result returns; lines of work under way."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Group
    from rich.table import Table


def log(line: str) -> None:
    """Report a line of work under way to the logger `airflock`, which is silent until a program listens to it."""
    import logging  # not when the package is imported

    logger = logging.getLogger("airflock")
    if not logger.handlers:
        logger.addHandler(logging.NullHandler())
    logger.info(line)


def result_table(title: str, columns: str, rows: Sequence[Sequence[str]], **how: Any) -> "Table":
    """Return a table of texts.

    columns : their heads, separated by "; "; one that begins with ">" is set to the right, with "|"
              is not broken, with "*" in bold, with "~" in dim letters, with "+" in colour
    how     : of all columns, such as no_wrap=True
    """
    from rich import box
    from rich.table import Table

    table = Table(title=title or None, box=box.SIMPLE_HEAD, title_justify="left")
    for head in columns.split("; "):
        name = head.lstrip(">*|~+")
        marks = head.removesuffix(name)
        style = next((look for mark, look in (("*", "bold"), ("~", "dim"), ("+", "cyan")) if mark in marks), None)
        own = {"style": style, "no_wrap": "|" in marks}
        table.add_column(name, justify="right" if ">" in marks else "left", **own | how)
    for row in rows:
        table.add_row(*row)
    return table


def result_group(*parts: Any) -> "Group":
    """Return results, tables and lines one below the other; a line is not broken, and None is left out."""
    from rich.console import Group
    from rich.text import Text

    lines = (Text(part, no_wrap=True, overflow="ignore") if isinstance(part, str) else part for part in parts)
    return Group(*(line for line in lines if line is not None))


def format_cell(x: Any, missing: str = "never") -> str:
    """Format a number with four significant digits, `missing` where it is nan (a time's `never`); a list side by
    side.
    """
    if isinstance(x, (list, tuple)):
        return ", ".join(f"{v:.3g}" if v == v else missing for v in x)
    return f"{x:.4g}" if x == x else missing


def interval_lines(measures: Mapping[str, tuple[float, float, float]]) -> list[str]:
    """Return a line for each measure: its value, the ends of the simulated flights, and if it lies between them."""
    return [
        f"  {name} {own:.4g} in [{low:.4g}, {high:.4g}] {'ok' if low <= own <= high else 'OUTSIDE: not explained'}"
        for name, (own, low, high) in measures.items()
    ]
