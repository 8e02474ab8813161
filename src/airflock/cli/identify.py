"""Verb identify: flight logs to the numbers of a scenario."""

from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli import imports, options, tables
from airflock.cli.progress import counting_parts
from airflock.support import PICTURES, SCENARIOS, AirflockError, collect_errors


def identify(
    files: imports.Files,
    like: Annotated[str, typer.Option(metavar="PRESET|FILE", help="Scenario whose law the logs flew.")],
    heard: Annotated[
        Path | None,
        typer.Option(metavar="FILE.csv", help="Packets: receiver, sender, t, stamp (s), distance (m), got (0 or 1)."),
    ] = None,
    standing: Annotated[
        str,
        typer.Option(
            metavar="BEGIN:END", help="Time on the ground, s after each log begins.", show_default="as logged"
        ),
    ] = "",
    out: Annotated[Path | None, typer.Option("--out", "-o", metavar="FILE.toml", help="Scenario to write.")] = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE.png", help="Draw what was found, in six panels.")] = None,
    conservative: Annotated[
        float | None, typer.Option(help="Write the pessimistic end of each interval of this level, such as 0.95.")
    ] = None,
    uncertain: Annotated[bool, typer.Option("--uncertain", help="Also write the intervals into the scenario.")] = False,
    plan: Annotated[
        bool, typer.Option("--plan", help="Print the test flights that make every number identifiable.")
    ] = False,
    flights: Annotated[int, typer.Option("--check", min=0, help="Flights to compare with the log; 0: none.")] = 100,
    changes: options.Set = None,
    map: imports.Map = None,
    unit: imports.Unit = "",
    time_unit: imports.TimeUnit = "",
    axes: imports.Axes = "",
    begin: imports.Begin = None,
    end: imports.End = None,
    same_clock: imports.SameClock = False,
    accept: imports.Accept = None,
    decimal: imports.Decimal = ".",
    delimiter: imports.Delimiter = "",
    as_json: options.Json = False,
) -> None:
    """Find the lag, limits, noise, sensor error and radio of a fleet in its own logs, with 95 % intervals.

    What the logs cannot show is listed with the reason, and stays as in --like. Logs need commands and raw velocities.

    Example: airflock identify logs/*.ulg --heard heard.csv --like vasarhelyi_2018/real_6ms --out mine.toml
    """
    from airflock.estimate import identify as find, read_heard
    from airflock.recordings import ImportOptions
    from airflock.scenarios import load

    faults: list[str] = []
    with collect_errors(faults):
        options.check_writable((out, SCENARIOS), (plot, PICTURES), reads=[like, heard, *files])
    with collect_errors(faults):
        scenario = load(like, options.parse_settings(changes))
    with collect_errors(faults):
        how = imports.parse_mapping(map)
    with collect_errors(faults):
        ground = _span(standing)
    with collect_errors(faults):
        packets = None if heard is None else read_heard(heard)
    if conservative is not None and not 0.0 < conservative < 1.0:
        faults.append(f"--conservative {conservative:g} lies outside (0, 1); 0.95 is usual")
    options.raise_errors(faults)
    with imports.reading_progress(len(files), as_json) as done:
        reading = ImportOptions(
            map=how, unit=unit, time_unit=time_unit, axes=axes, decimal=decimal, delimiter=delimiter, done=done
        )
        result = find(
            files, scenario, heard=packets, standing=ground, same_clock=same_clock, options=reading,
            accept=accept or (), begin=begin, end=end,
        )  # fmt: skip
    if out is not None and not result.settings():
        raise AirflockError(
            "\n".join([f"{out}: not written: no number can be identified from these logs", *_reasons(result)])
        )
    check = _checked(result, flights, as_json)
    if out is not None:
        from airflock.runs import write_toml_file

        write_toml_file(out, result.document(conservative, uncertain=uncertain))
        tables.print_message(f"saved {out}")
    if plot is not None:
        from airflock.view import plot_identified, save_figure

        save_figure(plot_identified(result, check), plot)
        tables.print_message(f"saved {plot}")
    if as_json:
        tables.print_json(_json_values(result, check))
        return
    for note in result.notes:
        tables.print_message(f"note: {note}")
    _table(result)
    if check is not None:
        _verdicts(check, result, flights)
    if plan:
        _card(result)


def _span(text: str) -> tuple[float, float] | None:
    if not text:
        return None
    begin, colon, end = text.partition(":")
    try:
        span = float(begin or 0.0), float(end)
    except ValueError as fault:
        raise AirflockError(f"--standing {text}: write BEGIN:END in s, such as 0:60") from fault
    if not colon or not 0.0 <= span[0] < span[1]:
        raise AirflockError(f"--standing {text}: write BEGIN:END in s, such as 0:60")
    return span


def _checked(result: Any, flights: int, quiet: bool) -> Any:
    """Posterior check, if there is something to check."""
    from airflock.estimate import check_against_logs

    if not flights or not result.settings():
        return None
    with counting_parts("check: flights", flights, quiet=quiet) as done:
        return check_against_logs(result.scenario(), result.logs, flights, done, comparable=result.has_one_clock)


def _table(result: Any) -> None:
    from rich.console import Console

    from airflock.estimate import UNIDENTIFIABLE

    console = Console()
    if result.settings():
        console.print(_numbers_table(result))
        console.print("not identified, kept from --like:")
    else:
        console.print(
            f"{result.logs.drones} drones: no number can be identified from these logs; all are kept from --like:"
        )
    for line in _reasons(result):
        console.print(f"  {line}", highlight=False, markup=False, soft_wrap=True)
    for key, reason in UNIDENTIFIABLE.items():
        console.print(f"  {key}: {reason}", highlight=False, markup=False, soft_wrap=True)


def _reasons(result: Any) -> list[str]:
    """Why numbers are not told, a line each reason."""
    keys: dict[str, list[str]] = {}
    for key, number in result.numbers.items():
        if not number.told:
            keys.setdefault(number.reason, []).append(key)
    return [f"{', '.join(own)}: {reason}" for reason, own in keys.items()]


def _numbers_table(result: Any) -> Any:
    """Numbers that the logs tell, as a table."""
    from rich import box
    from rich.table import Table

    from airflock.estimate import KEY_UNITS

    table = Table(
        title=f"{result.logs.drones} drones, like {result.like.name}", box=box.SIMPLE_HEAD, title_justify="left"
    )
    columns = (("number", "left"), ("value", "right"), ("95 %", "right"), ("unit", "left"), ("like", "right"))
    for name, justify in columns:
        table.add_column(name, justify=justify, no_wrap=True)  # type: ignore[arg-type]
    table.add_column("from")
    for key, number in result.numbers.items():
        if number.told:
            like = "" if number.like is None else tables.format_number(number.like)
            span = f"{number.low:.3g} to {number.high:.3g}"
            unit = KEY_UNITS[key] if KEY_UNITS[key] != "1" else ""
            table.add_row(key, tables.format_number(number.value), span, unit, like, number.origin)
    return table


def _verdicts(check: Any, result: Any, flights: int) -> None:
    from rich.console import Console

    console = Console()
    console.print(f"check: {flights} flights of the identified scenario against the log")
    for name, (own, low, high) in check.found.items():
        verdict = "ok" if low <= own <= high else "OUTSIDE: not explained"
        line = f"  {name} {tables.format_number(own)} in [{low:.4g}, {high:.4g}] {verdict}"
        console.print(line, highlight=False, markup=False)
    if not result.has_one_clock:
        console.print("  distances are left out: it is not known whether the clocks agree (--same-clock)")


def _card(result: Any) -> None:
    from rich.console import Console

    from airflock.estimate import flight_card

    console = Console()
    card = flight_card(result.like)
    console.print(f"test flights, {sum(part.seconds for part in card) / 60.0:.0f} min:")
    for number, part in enumerate(card, 1):
        lacking = [key for key in part.keys if key not in result.numbers or not result.numbers[key].told]
        need = f"for {', '.join(lacking)}" if lacking else "all told already"
        console.print(f"{number}. {part.title}, {part.seconds:.0f} s ({need})", highlight=False, markup=False)
        console.print(f"   {part.instructions}", highlight=False, markup=False)


def _json_values(result: Any, check: Any) -> dict[str, Any]:
    from airflock.estimate import flight_card

    numbers = {
        key: {"like": n.like, "from": n.origin, "reason": n.reason}
        | {name: getattr(n, name) if n.told else None for name in ("value", "low", "high")}
        for key, n in result.numbers.items()
    }  # fmt: skip
    checks = {} if check is None else {k: {"log": o, "low": lo, "high": hi} for k, (o, lo, hi) in check.found.items()}
    card = [part._asdict() for part in flight_card(result.like)]
    return {"like": result.like.name, "numbers": numbers, "check": checks, "plan": card, "notes": result.notes}
