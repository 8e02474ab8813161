"""Verbs plot and video: pictures of a scenario or of a recording."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli import options, tables
from airflock.cli.progress import counted
from airflock.suffixes import PAGES, PICTURES, VIDEOS


class Kind(StrEnum):
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
    kind: Annotated[Kind, typer.Option(help="What to draw.")] = Kind.TRAJECTORIES,
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
    options.writable((out, PICTURES))
    from airflock.plots.picture import plot as picture
    from airflock.plots.save import save_figure
    from airflock.scenarios.files import load

    settings = options.settings(changes, agents, duration)
    window: dict[str, Any] = {"start": begin, "stop": end}
    if what.lower().endswith(".nc"):
        figure = picture(what, kind, settings=settings, law=law, trust=trust, **window)
    else:
        scenario = load(what, settings, law, trust=trust)
        tables.say_notes(scenario.notes)
        figure = picture(scenario, kind, seed=seed, **window)
    save_figure(figure, out)
    tables.say(f"saved {out}")


def video(
    what: Annotated[str, typer.Argument(metavar="PRESET|FILE", help="A preset, a scenario file or a recording (.nc).")],
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
    options.writable((out, VIDEOS))
    from airflock.plots.film_stage import check_chart
    from airflock.plots.picture import flight_of, named
    from airflock.plots.video import ffmpeg, frame_count
    from airflock.plots.video import video as make_video
    from airflock.recordings.scores import courses
    from airflock.scenarios.files import load

    settings = options.settings(changes, agents, duration)
    ffmpeg()  # before anything flies, as all that can be refused
    if what.lower().endswith(".nc"):
        recording = flight_of(what, seed, settings, law, trust=trust)
    else:
        scenario = load(what, settings, law, trust=trust)
        tables.say_notes(scenario.notes)
        check_chart(chart, courses(scenario) if chart else [], scenario.name)
        recording = flight_of(scenario, seed)
    choice: dict[str, Any] = {"fps": fps, "speed": speed, "start": begin, "stop": end}
    with named(what), counted("pictures", frame_count(recording, **choice)) as done:
        make_video(recording, out, done=done, space=space, chart=chart, **choice)
    tables.say(f"saved {out}")


def replay(
    what: Annotated[str, typer.Argument(metavar="PRESET|FILE", help="A preset, a scenario file or a recording (.nc).")],
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
    options.writable((page, PAGES))
    from airflock.plots.picture import flight_of, named
    from airflock.replays import check_colour
    from airflock.replays import replay as make_replay
    from airflock.scenarios.files import load

    settings = options.settings(changes, agents, duration)
    if what.lower().endswith(".nc"):
        recording = flight_of(what, seed, settings, law, trust=trust)
    else:
        scenario = load(what, settings, law, trust=trust)
        tables.say_notes(scenario.notes)
        check_colour(scenario, colour)
        recording = flight_of(scenario, seed)
    with named(what):
        replay_page = make_replay(recording, rate=rate, colour=colour)
    replay_page.save(page)
    tables.say(f"saved {page} ({len(replay_page.text) / 1e6:.1f} MB)")
