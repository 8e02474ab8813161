"""Verbs plot and video: pictures of a scenario or of a recording."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli import options, tables
from airflock.cli.progress import counting_parts
from airflock.support import PAGES, PICTURES, VIDEOS


class PictureKind(StrEnum):
    """What to draw."""

    TRAJECTORIES = "trajectories"
    SERIES = "series"
    RULES = "rules"
    TRANSFER = "transfer"
    SCENE = "scene"
    SPACE = "space"
    RAYS = "rays"
    FLOCKED = "flocked"
    WASH = "wash"
    RECEPTION = "reception"


Out = Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="File to write; its ending sets the format.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of the flight, if a scenario is flown.")]
Begin = Annotated[float | None, typer.Option(help="First instant shown, s.", show_default="see the picture's title")]
End = Annotated[float | None, typer.Option(help="Last instant shown, s.", show_default="the end")]


def plot(
    what: Annotated[str, typer.Argument(metavar="PRESET|FILE", help="A preset, a scenario file or a recording (.nc).")],
    kind: Annotated[PictureKind, typer.Option(help="What to draw.")] = PictureKind.TRAJECTORIES,
    out: Out = Path("flight.png"),
    seed: Seed = 0,
    begin: Begin = None,
    end: End = None,
    changes: options.Set = None,
    law: options.Law = None,
    trust: options.Trust = False,
    agents: options.Agents = None,
    duration: options.Duration = None,
) -> None:
    """Draw trajectories coloured by speed, order parameters over time, or a model's rules.

    In a city, forest or mesh: paths through the scene from above or in space, one agent's rays, share flocked. Also
    the time since the last packet by distance: --kind reception.

    Example: airflock plot vasarhelyi_2018/real_8ms --kind series --out course.png
    """
    options.check_writable((out, PICTURES))
    from airflock.scenarios import load
    from airflock.view import plot as picture, save_figure

    settings = options.parse_settings(changes, agents, duration)
    window: dict[str, Any] = {"start": begin, "stop": end}
    if what.lower().endswith(".nc"):
        figure = picture(what, kind, settings=settings, law=law, trust=trust, **window)
    else:
        scenario = load(what, settings, law, trust=trust)
        tables.print_notes(scenario.notes)
        figure = picture(scenario, kind, seed=seed, **window)
    save_figure(figure, out)
    tables.print_message(f"saved {out}")


def video(
    source: Annotated[
        str, typer.Argument(metavar="PRESET|FILE", help="A preset, a scenario file or a recording (.nc).")
    ],
    out: Out = Path("flight.mp4"),
    seed: Seed = 0,
    begin: Begin = None,
    end: End = None,
    space: Annotated[
        bool | None,
        typer.Option("--space/--above", help="View at an angle, or from above.", show_default="as flown"),
    ] = None,
    chart: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="Show this order parameter over time beside the picture.", show_default=False
        ),
    ] = "",
    fps: Annotated[int, typer.Option(min=1, max=120, help="Frames per second.")] = 25,
    speed: Annotated[float, typer.Option(min=0.01, max=1000.0, help="Speed relative to real time.")] = 10.0,
    changes: options.Set = None,
    law: options.Law = None,
    trust: options.Trust = False,
    agents: options.Agents = None,
    duration: options.Duration = None,
) -> None:
    r"""Make an MP4 or GIF of a flight. Needs pip install 'airflock\[video]'.

    Example: airflock video kidger/city --duration 60 --speed 2 --space --chart flocked --out flight.mp4
    """
    options.check_writable((out, VIDEOS))
    from airflock.recordings import time_series_names
    from airflock.scenarios import load
    from airflock.view import (
        check_chart,
        frame_count,
        import_ffmpeg,
        naming_file,
        recording_or_flight,
        video as make_video,
    )

    settings = options.parse_settings(changes, agents, duration)
    import_ffmpeg()  # before anything flies, as all that can be refused
    if source.lower().endswith(".nc"):
        recording = recording_or_flight(source, seed, settings, law, trust=trust)
    else:
        scenario = load(source, settings, law, trust=trust)
        tables.print_notes(scenario.notes)
        check_chart(chart, time_series_names(scenario) if chart else [], scenario.name)
        recording = recording_or_flight(scenario, seed)
    choice: dict[str, Any] = {"fps": fps, "speed": speed, "start": begin, "stop": end}
    with naming_file(source), counting_parts("pictures", frame_count(recording, **choice)) as done:
        make_video(recording, out, done=done, space=space, chart=chart, **choice)
    tables.print_message(f"saved {out}")


def replay(
    source: Annotated[
        str, typer.Argument(metavar="PRESET|FILE", help="A preset, a scenario file or a recording (.nc).")
    ],
    page: Annotated[Path, typer.Option("--html", "--out", "-o", metavar="FILE.html", help="File to write.")] = Path(
        "flight.html"
    ),
    seed: Seed = 0,
    rate: Annotated[float, typer.Option(min=0.1, max=100.0, help="Most frames kept per second.")] = 10.0,
    colour: Annotated[
        str, typer.Option(metavar="NAME", help="Colour by speed, heading, agent, cluster, group, fault or a variable.")
    ] = "speed",
    changes: options.Set = None,
    law: options.Law = None,
    trust: options.Trust = False,
    agents: options.Agents = None,
    duration: options.Duration = None,
) -> None:
    """Write a flight as one HTML file that plays in any browser, from disk and without a network.

    Example: airflock replay flight.nc --html show.html --colour cluster
    """
    options.check_writable((page, PAGES))
    from airflock.scenarios import load
    from airflock.view import check_colour, naming_file, recording_or_flight, replay as make_replay

    settings = options.parse_settings(changes, agents, duration)
    if source.lower().endswith(".nc"):
        recording = recording_or_flight(source, seed, settings, law, trust=trust)
    else:
        scenario = load(source, settings, law, trust=trust)
        tables.print_notes(scenario.notes)
        check_colour(scenario, colour)
        recording = recording_or_flight(scenario, seed)
    with naming_file(source):
        replay_page = make_replay(recording, rate=rate, colour=colour)
    replay_page.save(page)
    tables.print_message(f"saved {page} ({len(replay_page.text) / 1e6:.1f} MB)")
