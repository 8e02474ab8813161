"""Verbs plot and video: pictures of a scenario or of a recording."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli import options, tables
from airflock.endings import PAGES, PICTURES, VIDEOS
from airflock.errors import AirflockError


class Kind(StrEnum):
    """What to draw."""

    TRAJECTORIES = "trajectories"
    EXPOSURE = "exposure"
    SERIES = "series"
    RULES = "rules"
    TRANSFER = "transfer"
    SCENE = "scene"
    SPACE = "space"
    RAYS = "rays"
    FLOCKED = "flocked"


Out = Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="File to write; its ending decides the format.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of the flight, where a scenario is flown.")]
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
    agents: options.Agents = None,
    duration: options.Duration = None,
) -> None:
    """Draw trajectories coloured by speed, a long-exposure picture, order parameters over time, or a model's rules.

    In a city, forest or mesh: paths through the scene from above or in space, rays of one agent, share flocked.

    Example: airflock plot vasarhelyi_2018/real_8ms --kind series --out course.png
    """
    options.writable((out, PICTURES))
    from airflock.plots.save import save_figure

    save_figure(_figure(what, kind, seed, begin, end, options.settings(changes, agents, duration)), out)
    tables.say(f"saved {out}")


def _figure(what: str, kind: Kind, seed: int, begin: float | None, end: float | None, changed: dict[str, Any]) -> Any:
    if kind is Kind.TRANSFER:
        from airflock.plots.transfer import transfer

        return transfer(_scenario(what, changed))
    if kind is Kind.RULES:
        from airflock.plots.rules import rules

        return rules(_scenario(what, changed))
    recording = _recording(what, seed, changed)
    if kind in (Kind.SCENE, Kind.SPACE):
        from airflock.plots.through import through

        return through(recording, start=begin, stop=end, space=kind is Kind.SPACE)
    if kind is Kind.RAYS:
        from airflock.plots.rays import rays

        return rays(recording, start=begin)
    if kind is Kind.FLOCKED:
        from airflock.plots.flocked import flocked

        return flocked(recording, start=begin, stop=end)
    if kind is Kind.SERIES:
        from airflock.plots.series import series

        return series(recording, start=begin, stop=end)
    if kind is Kind.EXPOSURE:
        from airflock.plots.exposure import exposure

        return exposure(recording, start=begin, stop=end)
    from airflock.plots.trajectories import trajectories

    return trajectories(recording, start=begin, stop=end)


def _scenario(what: str, changed: dict[str, Any]) -> Any:
    if what.lower().endswith(".nc"):
        from airflock.recordings.files import load_recording
        from airflock.recordings.scores import scenario_of

        return scenario_of(load_recording(what), changed)
    from airflock.scenarios.files import load

    return load(what, changed)


def _recording(what: str, seed: int, changed: dict[str, Any]) -> Any:
    if what.lower().endswith(".nc"):
        if changed:
            raise AirflockError(f"{what}: is a recording; --set, --agents and --duration need a scenario to fly")
        from airflock.recordings.files import load_recording

        return load_recording(what)
    from airflock.recordings.flights import simulate

    return simulate(_scenario(what, changed), seed)


def video(
    what: Annotated[str, typer.Argument(metavar="PRESET|FILE", help="A preset, a scenario file or a recording (.nc).")],
    out: Out = Path("flight.mp4"),
    seed: Seed = 0,
    begin: Begin = None,
    end: End = None,
    fps: Annotated[int, typer.Option(min=1, max=120, help="Pictures per second.")] = 25,
    speed: Annotated[float, typer.Option(min=0.01, max=1000.0, help="Times real time.")] = 10.0,
    changes: options.Set = None,
    agents: options.Agents = None,
    duration: options.Duration = None,
) -> None:
    """Make an MP4 or GIF of a flight.

    Example: airflock video vasarhelyi_2018/obstacles --duration 120 --out flight.mp4
    """
    options.writable((out, VIDEOS))
    from airflock.plots.video import frame_count
    from airflock.plots.video import video as make_video

    recording = _recording(what, seed, options.settings(changes, agents, duration))
    choice: dict[str, Any] = {"fps": fps, "speed": speed, "start": begin, "stop": end}
    with options.progress("pictures", frame_count(recording, **choice)) as done:
        make_video(recording, out, done=done, **choice)
    tables.say(f"saved {out}")


def replay(
    what: Annotated[str, typer.Argument(metavar="PRESET|FILE", help="A preset, a scenario file or a recording (.nc).")],
    page: Annotated[Path, typer.Option("--html", "--out", "-o", metavar="FILE.html", help="File to write.")] = Path(
        "flight.html"
    ),
    seed: Seed = 0,
    rate: Annotated[float, typer.Option(min=0.1, max=100.0, help="Frames per second that are kept at most.")] = 10.0,
    changes: options.Set = None,
    agents: options.Agents = None,
    duration: options.Duration = None,
) -> None:
    """Write a flight as one HTML file that plays in any browser, from disk and without network.

    Example: airflock replay flight.nc --html show.html
    """
    options.writable((page, PAGES))
    from airflock.replays import replay as make_replay

    made = make_replay(_recording(what, seed, options.settings(changes, agents, duration)), rate=rate)
    made.save(page)
    tables.say(f"saved {page} ({len(made.text) / 1e6:.1f} MB)")
