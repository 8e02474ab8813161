"""A certificate on the terminal: verdicts, worst flights, tolerances, maps."""

from typing import Any

from airflock.cli import tables


def show(made: Any) -> None:
    """Print all that it says, and what it does not say."""
    from rich.console import Console

    from airflock.certify.certificate import NOT_SAID

    console = Console()

    def line(text: str, **how: Any) -> None:
        console.print(text, highlight=False, markup=False, soft_wrap=True, **how)

    _verdicts(console, made)
    for text in made.statements:
        line(text)
    for i, found in made.hazards.items():
        if found.events:
            early = f"{found.early} of {found.events} first events in the first half of flights"
            line(f"{made.campaign.limits[i].event}: {early}, {100.0 * found.expected:.0f} % if even: {found.verdict}")
    _worst(console, made)
    _tolerances(console, made.tolerance)
    _map(console, made.over)
    for text in made.splitting.get("statements", ()):
        line(text)
    line(f"Not said: {'; '.join(NOT_SAID)}.", style="dim")


def _verdicts(console: Any, made: Any) -> None:
    """One row a limit."""
    from rich import box
    from rich.table import Table

    from airflock.certify.certificate import bound

    campaign = made.campaign
    sure = f"{100.0 * campaign.confidence:g} %"
    title = f"{campaign.scenario.name}: {len(made.rows):,} flights of {campaign.scenario.flight.duration:g} s"
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
    for name in ("limit", "events", "flights", f"at most ({sure})", "verdict"):
        table.add_column(name, justify="right" if name in ("events", "flights") else "left")
    for verdict in made.verdicts:
        said = "shown" if verdict.shown else "refuted" if verdict.refuted else "not shown"
        table.add_row(verdict.limit.text, f"{verdict.events:,}", f"{verdict.flights:,}", bound(campaign, verdict), said)
    console.print(table)


def _worst(console: Any, made: Any) -> None:
    shown: set[str] = set()
    for entry in made.worst:
        if entry["limit"] in shown:
            continue
        shown.add(entry["limit"])
        line = f"worst for {entry['limit']}: {tables.number(entry['value'])}"
        moment = f" before {entry['first']:.0f} s" if "first" in entry else ""
        console.print(f"{line}{moment}; {entry['replay']}", highlight=False, markup=False, soft_wrap=True)


def _tolerances(console: Any, found: Any) -> None:
    if not found:
        return
    from rich import box
    from rich.table import Table

    if "reason" in found:
        console.print(f"tolerance: {found['reason']}", highlight=False, markup=False, soft_wrap=True)
        return
    title = (
        f"safe: fewer than {100.0 * found['level']:g} % of flights with an event ({100.0 * found['confidence']:g} %)"
    )
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
    for name in ("number", "nominal", "safe to", "factor", "not shown at", "flights", ""):
        table.add_column(name, justify="left" if name in ("number", "") else "right")
    for axis in found["axis"]:
        bad = tables.number(axis["not_shown"]) if "not_shown" in axis else ""
        table.add_row(
            axis["key"], tables.number(axis["nominal"]), tables.number(axis["safe"]), f"{axis['factor']:.3g}", bad,
            f"{axis['flights']:,}", axis.get("note", ""),
        )  # fmt: skip
    console.print(table)


def _map(console: Any, found: Any) -> None:
    """Upper bounds in percent of flights, first key downwards, second across."""
    if not found:
        return
    from rich import box
    from rich.table import Table

    (down, across), (rows, columns) = found["keys"], found["axes"]
    title = f"at most so many % of flights with an event; * safe, below {100.0 * found['level']:g} %"
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
    table.add_column(f"{down} / {across}", style="bold")
    for value in columns:
        table.add_column(f"{value:g}", justify="right")
    cells = iter(found["cell"])
    for value in rows:
        row = [next(cells) for _ in columns]
        told = [f"{100.0 * cell['high']:.3g}{'*' if cell['verdict'] == 'safe' else ''}" for cell in row]
        table.add_row(f"{value:g}", *told)
    console.print(table)
