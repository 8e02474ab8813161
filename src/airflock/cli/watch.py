"""Verb watch: a page in the browser that shows a flight and lets it be played, tuned and measured; or a fleet."""

from pathlib import Path
from typing import Annotated, Any

import typer

from airflock.cli import options, tables
from airflock.support import StudioError


def watch(
    scenario: Annotated[
        str,
        typer.Argument(
            metavar="PRESET|FILE",
            help="A preset, a scenario file, a recording (.nc) to fly again, or the flight card (.json) of a fleet.",
        ),
    ],
    changes: options.Set = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the flight.")] = 0,
    law: options.Law = None,
    trust: options.Trust = False,
    agents: options.Agents = None,
    against: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PRESET|FILE|KEY=VALUE",
            help="Fly this beside it, with the same seed and noise; repeatable for keys.",
        ),
    ] = None,
    host: Annotated[str, typer.Option(help="Address to listen at; 0.0.0.0 lets other machines in.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen at; 0 picks a free one.")] = 8080,
    radio: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PORT",
            help="For a fleet: where to receive its packets; repeatable.",
            show_default="udp:127.0.0.1:14600, as airflock fleet --card uses",
        ),
    ] = None,
    key: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="For a fleet: the mission's key.", show_default="beside the card, .key"),
    ] = None,
) -> None:
    """Open a page that flies a scenario live: play it, turn its sliders, select agents, save what you found.

    With --against, two laws or sets of parameters fly side by side. Given a flight card, the page shows its fleet, in
    software or in the air, from the packets that a radio receives; it sends nothing.

    Example: airflock watch vasarhelyi_2018/4ms --agents 50 --against radio.delay=3

    Example: airflock watch mission.json --radio udp:0.0.0.0:14600
    """
    from airflock.studio import watch as open_page

    open_page(
        scenario, options.parse_settings(changes, agents), seed, law=law, trust=trust, host=host, port=port,
        against=_comparison(against or []), radios=radio or [], key=key, say=tables.print_message,
    )  # fmt: skip


def _comparison(value: list[str]) -> str | dict[str, Any] | None:
    """What flies beside the scenario: a name, or keys with values."""
    if any("=" not in each for each in value) and len(value) > 1:
        raise StudioError(f"--against {' '.join(value)}: give one preset or file, or only KEY=VALUE")
    if value and "=" not in value[0]:
        return value[0]
    return options.parse_settings(value, option="--against") if value else None
