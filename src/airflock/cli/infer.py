"""Verb infer: which flocking law explains these tracks?"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli import options, tables
from airflock.cli.progress import progress_line
from airflock.support import PICTURES, SCENARIOS, AirflockError, collect_errors

DEFAULT_LAWS = "couzin_2002,reynolds_1987,vicsek_1995,vasarhelyi_2018"
Tracks = Annotated[
    list[Path],
    typer.Argument(
        metavar="TRACKS...", show_default=False,
        help="Recordings (.nc, as airflock import saves them), or files that import reads without options.",
    ),
]  # fmt: skip


def infer(
    tracks: Tracks,
    models: Annotated[
        str,
        typer.Option(
            "--models",
            metavar="LAW,FILE,...",
            help="Laws by name, presets, scenario files, or files with laws of your own.",
        ),
    ] = DEFAULT_LAWS,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE.toml", help="Scenario to write, with the law found.")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw force maps of the tracks and of each law.")
    ] = None,
    changes: options.Set = None,
    flights: Annotated[int, typer.Option("--check", min=0, help="Flights to compare with the tracks; 0: none.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search for the best fit.")] = 0,
    trust: options.Trust = False,
    as_json: options.Json = False,
) -> None:
    """Find which flocking law explains tracks best, with which numbers, and what it leaves unexplained.

    Each law is fitted by the likelihood of the next frame and judged on data that it has not seen: neighbouring spans
    of one recording, or whole recordings where there are several. --set gives what is known of the place, for all laws.

    Example: airflock infer fish.nc --models couzin_2002,reynolds_1987,vicsek_1995 --out best.toml --plot forces.png
    """
    from airflock.estimate import infer as find

    faults: list[str] = []
    with collect_errors(faults):
        options.check_writable((out, SCENARIOS), (plot, PICTURES), reads=[*models.split(","), *tracks])
    settings: dict[str, Any] = {}
    with collect_errors(faults):
        settings = options.parse_settings(changes)
    laws = [name.strip() for name in models.split(",") if name.strip()]
    if not laws:
        faults.append("--models names no law; write for instance --models couzin_2002,vicsek_1995")
    faults += [f"{path}: no such file" for path in tracks if not path.exists()]
    options.raise_errors(faults)
    with _fit_progress(as_json) as done:
        result = find(tracks, laws, settings=settings, check=flights, seed=seed, trust=trust, done=done)
    if plot is not None:
        from airflock.view import plot_inferred, save_figure

        save_figure(plot_inferred(result), plot)
        tables.print_message(f"saved {plot}")
    if out is not None and result.best is not None:
        from airflock.runs import write_toml_file

        write_toml_file(out, result.document())
        tables.print_message(f"saved {out}")
    if as_json:
        tables.print_json(_json_values(result))
        return
    _table(result)
    if result.best is not None:
        _numbers(result)
        _check(result)
    if out is not None and result.best is None:
        raise AirflockError(f"{out}: not written: {result.verdict}")


@contextmanager
def _fit_progress(quiet: bool) -> Iterator[Callable[[str], None]]:
    """Progress: which law is fitted, and how many steps that took so far."""
    with progress_line(quiet) as told:
        told.update("reading")
        steps: dict[str, int] = {}

        def show_step(name: str) -> None:
            steps[name] = steps.get(name, 0) + 1
            told.update(f"{name}, step {steps[name]}")

        yield show_step


def _table(result: Any) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    fitted, every = result.fitted
    title = f"{result.individual_count} individuals, {result.steps} steps; fitted on {fitted} of {every} frames"
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left")
    for name in ("law", "gain", "ahead", "AIC", "in 95 %", "left over", "numbers"):
        table.add_column(name, justify="left" if name == "law" else "right", no_wrap=True)
    for law in result.laws:
        table.add_row(
            law.name, f"{law.gain:.0f} ± {law.error:.0f}", f"{law.ahead:.0%}", f"{law.criterion:.0f}",
            f"{law.inside:.1%}", f"{law.missed:.1%}", str(len(law.numbers)),
        )  # fmt: skip
    console = Console()
    console.print(table)
    console.print(
        "compared with going straight on: gain in log-likelihood of held-out steps; AIC of the fit, negative is better",
        highlight=False,
    )
    console.print(result.verdict, style="bold", highlight=False, markup=False)


def _numbers(result: Any) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from airflock.estimate import ends_text

    table = Table(title=f"numbers of {result.best.name}", box=box.SIMPLE_HEAD, title_justify="left")
    for name in ("number", "value", "unit", "95 % for it alone", "95 % for all together"):
        table.add_column(name, justify="right" if name == "value" else "left", no_wrap=True)
    for key, number in result.best.numbers.items():
        table.add_row(
            key, f"{number.value:.4g}", "" if number.unit == "1" else number.unit, ends_text(number.low, number.high),
            ends_text(number.least, number.most),
        )  # fmt: skip
    console = Console()
    console.print(table)
    console.print(f"noise of the tracks {result.noise.seen:.3g} m", highlight=False)


def _check(result: Any) -> None:
    from rich.console import Console

    if result.check is None:
        return
    console = Console()
    console.print("check: flocks of this law, flown freely from the first frame, against the tracks")
    for name, (own, low, high) in result.check.found.items():
        verdict = "ok" if low <= own <= high else "OUTSIDE: not explained"
        console.print(f"  {name} {own:.4g} in [{low:.4g}, {high:.4g}] {verdict}", highlight=False, markup=False)


def _json_values(result: Any) -> dict[str, Any]:
    """What was found as plain values."""
    laws = [
        {name: getattr(law, name) for name in ("name", "gain", "error", "ahead", "criterion", "inside", "missed")}
        | {"numbers": {key: number.value for key, number in law.numbers.items()}}
        for law in result.laws
    ]
    best = None
    if result.best is not None:
        numbers = {
            key: {name: getattr(number, name) for name in ("value", "low", "high", "least", "most", "unit")}
            for key, number in result.best.numbers.items()
        }
        best = {"name": result.best.name, "numbers": numbers, "noise_of_tracks": result.noise.seen}
    check = {} if result.check is None else {
        name: {"tracks": own, "low": low, "high": high} for name, (own, low, high) in result.check.found.items()
    }  # fmt: skip
    frames = {"fitted": result.fitted[0], "all": result.fitted[1]}
    return {
        "verdict": result.verdict,
        "best": best,
        "laws": laws,
        "check": check,
        "frames": frames,
        "steps": result.steps,
    }
