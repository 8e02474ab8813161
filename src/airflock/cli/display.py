"""Verb display: a show of many drones, from shape to shape."""

from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli import options, tables
from airflock.support import PICTURES, RECORDINGS, collect_errors


def display(
    shapes: Annotated[
        list[str],
        typer.Argument(metavar="SHAPE...", help="Images, meshes (stl, obj, glb) or texts, shown one after another."),
    ],
    drones: Annotated[int, typer.Option(min=2, max=2000, help="Number of drones.")] = 200,
    failing: Annotated[float, typer.Option(help="Share of the drones that fail on the way, 0 to 0.9.")] = 0.0,
    failure: Annotated[
        str, typer.Option(help="What a failing drone does: fall, hover, or both (taking turns).")
    ] = "both",
    points: Annotated[int | None, typer.Option(min=2, help="Points per shape.", show_default="one per drone")] = None,
    spacing: Annotated[float, typer.Option(min=2.5, max=100.0, help="Smallest distance between two points, m.")] = 3.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of failures and noise.")] = 0,
    changes: options.Set = None,
    as_json: options.Json = False,
    save: options.SaveFile = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE.png", help="Draw every shape as it was formed.")] = None,
) -> None:
    """Fly a drone display: assign points to drones, again when some fail, and print how well each shape was formed.

    Example: airflock display AIR FLOCK heart.png --failing 0.1 --plot show.png
    """
    from airflock.displays import fly_show, plan_shapes

    faults: list[str] = []
    with collect_errors(faults):
        options.check_writable((save, RECORDINGS), (plot, PICTURES), reads=shapes)
    settings: dict[str, Any] = {}
    with collect_errors(faults):
        settings = options.parse_settings(changes)
    layouts = []
    with collect_errors(faults):
        layouts = plan_shapes(shapes, drones, failing, failure, points, spacing, settings, "--")
    options.raise_errors(faults)
    show = fly_show(layouts, drones, failing, failure, seed, settings)
    rows = [{"shape": shape, **vars(formed)} for shape, formed in zip(shapes, show.shape_reports, strict=True)]
    if save is not None:
        from airflock.displays import recording_of
        from airflock.recordings import save as save_recording

        tables.print_message(f"saved {save_recording(recording_of(show), save)}")
    if plot is not None:
        from airflock.view import save_figure, stood

        save_figure(stood(show, shapes), plot)
        tables.print_message(f"saved {plot}")
    if as_json:
        tables.print_json({"drones": drones, "failing": failing, "failure": failure, "seed": seed, "shapes": rows})
        return
    _print(rows)


def _print(rows: list[dict[str, Any]]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, collapse_padding=True)
    names = {
        "time": "formed\nafter (s)", "error": "error\n(m)", "worst": "worst\n(m)", "drones": "drones",
        "collisions": "hit\nflying", "hulls": "hit\nhovering", "struck": "hit by\nfalling",
        "reassigned": "points\nanew",
    }  # fmt: skip
    table.add_column("shape", overflow="fold")
    for title in names.values():
        table.add_column(title, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(row["shape"], *(tables.format_number(float(row[key])) for key in names))
    Console().print(table)
