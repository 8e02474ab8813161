"""A certificate on the terminal: verdicts, worst flights, tolerances, maps."""

from typing import Any

from airflock.cli import tables


def print_certificate(certificate: Any) -> None:
    """Print all that it says, and what it does not say."""
    from rich.console import Console

    console = Console()

    def line(text: str, **how: Any) -> None:
        console.print(text, highlight=False, markup=False, soft_wrap=True, **how)

    _verdicts(console, certificate)
    for text in certificate.statements:
        line(text)
    for i, hazard in certificate.hazards.items():
        if hazard.events:
            early = f"{hazard.early} of {hazard.events} first events in the first half of flights"
            even = f"{100.0 * hazard.expected:.0f} % if even: {hazard.verdict}"
            line(f"{certificate.campaign.limits[i].event}: {early}, {even}")
    _worst(console, certificate)
    _tolerances(console, certificate.tolerance)
    _map(console, certificate.over)
    for text in certificate.splitting.get("statements", ()):
        line(text)
    line(f"Not said: {'; '.join(certificate.disclaimers)}.", style="dim")


def _verdicts(console: Any, certificate: Any) -> None:
    """One row a limit."""
    from rich import box
    from rich.table import Table

    from airflock.certificates import upper_bound_in_unit

    campaign = certificate.campaign
    sure = f"{100.0 * campaign.confidence:g} %"
    title = f"{campaign.scenario.name}: {len(certificate.rows):,} flights of {campaign.scenario.flight.duration:g} s"
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
    for name in ("limit", "events", "flights", f"at most ({sure})", "verdict"):
        table.add_column(name, justify="right" if name in ("events", "flights") else "left")
    for verdict in certificate.verdicts:
        said = "shown" if verdict.shown else "refuted" if verdict.is_refuted else "not shown"
        table.add_row(
            verdict.limit.text,
            f"{verdict.events:,}",
            f"{verdict.flights:,}",
            upper_bound_in_unit(campaign, verdict),
            said,
        )
    console.print(table)


def _worst(console: Any, certificate: Any) -> None:
    shown: set[str] = set()
    for entry in certificate.worst:
        if entry["limit"] in shown:
            continue
        shown.add(entry["limit"])
        line = f"worst for {entry['limit']}: {tables.format_number(entry['value'])}"
        moment = f" before {entry['first']:.0f} s" if "first" in entry else ""
        console.print(f"{line}{moment}; {entry['replay']}", highlight=False, markup=False, soft_wrap=True)


def _tolerances(console: Any, tolerance: Any) -> None:
    if not tolerance:
        return
    from rich import box
    from rich.table import Table

    if "reason" in tolerance:
        console.print(f"tolerance: {tolerance['reason']}", highlight=False, markup=False, soft_wrap=True)
        return
    level, confidence = (100.0 * tolerance[name] for name in ("level", "confidence"))
    title = f"safe: fewer than {level:g} % of flights with an event ({confidence:g} %)"
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
    for name in ("number", "nominal", "safe to", "factor", "not shown at", "flights", ""):
        table.add_column(
            name, justify="left" if name in ("number", "") else "right", no_wrap=name == "number", overflow="fold"
        )
    for axis in tolerance["axis"]:
        bad = tables.format_number(axis["not_shown"]) if "not_shown" in axis else ""
        factor = f"{axis['factor']:.3g}" if "factor" in axis else ""
        table.add_row(
            axis["key"], tables.format_number(axis["nominal"]), tables.format_number(axis["safe"]), factor, bad,
            f"{axis['flights']:,}", axis.get("note", ""),
        )  # fmt: skip
    console.print(table)


def _map(console: Any, bounds: Any) -> None:
    """Upper bounds in percent of flights, first key downwards, second across."""
    if not bounds:
        return
    from rich import box
    from rich.table import Table

    (down, across), (rows, columns) = bounds["keys"], bounds["axes"]
    title = f"at most so many % of flights with an event; * safe, below {100.0 * bounds['level']:g} %"
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
    table.add_column(f"{down} / {across}", style="bold")
    for value in columns:
        table.add_column(f"{value:g}", justify="right")
    cells = iter(bounds["cell"])
    for value in rows:
        row = [next(cells) for _ in columns]
        texts = [f"{100.0 * cell['high']:.3g}{'*' if cell['verdict'] == 'safe' else ''}" for cell in row]
        table.add_row(f"{value:g}", *texts)
    console.print(table)
