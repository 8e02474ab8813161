"""Verb watch: a page in the browser that shows a flight and lets it be played, tuned and measured."""

from typing import Annotated

import typer

from airflock.cli import options, tables


def watch(
    scenario: Annotated[
        str, typer.Argument(metavar="PRESET|FILE", help="A preset, a scenario file or a recording (.nc), flown again.")
    ],
    changes: options.Set = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the flight.")] = 0,
    law: options.Law = None,
    trust: options.Trust = False,
    agents: options.Agents = None,
    host: Annotated[str, typer.Option(help="Address to listen at; 0.0.0.0 lets other machines in.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen at; 0 takes any free one.")] = 8080,
) -> None:
    """Open a page that flies a scenario live: play it, turn its sliders, select agents, save what was found.

    Example: airflock watch vasarhelyi_2018/4ms --agents 50
    """
    from airflock.studio.watch import watch as open_page

    open_page(
        scenario, options.settings(changes, agents), seed, law=law, trust=trust, host=host, port=port, say=tables.say
    )
