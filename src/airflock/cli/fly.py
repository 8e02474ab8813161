"""Verb fly: prepare a mission on the ground, run a node, give orders, fly a log again."""

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from airflock.cli import fly_order, fly_prepare, options, tables
from airflock.cli.verb import VerbCommand
from airflock.support import ScenarioError, is_file


class FlyGroup(TyperGroup):
    """Subcommands; anything else is a flight card, which is flown."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """A subcommand by its name; `run_node` for the name of a file."""
        if args and args[0] not in self.commands and (Path(args[0]).suffix or is_file(args[0])):
            args = ["card", *args]
        return super().resolve_command(ctx, args)


app = typer.Typer(
    cls=FlyGroup, no_args_is_help=True, rich_markup_mode="rich",
    help="""Fly the same law on real drones: one card for all, a node beside each autopilot, orders from one operator.

    Example: airflock fly prepare vasarhelyi_2018/real_4ms --site 47.50,19.04,120 --members 1-10,
    then on each drone airflock fly mission.json --member 3 --autopilot udp:127.0.0.1:14540 --radio ...
    """,
)  # fmt: skip


@app.command(
    "card", context_settings={"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []}
)
def run_node(ctx: typer.Context) -> None:
    """Run a node, as python -m airflock.drones.onboard CARD ... does; `airflock fly card --help` lists its options."""
    from airflock.drones import main

    raise typer.Exit(main(ctx.args))


app.command("prepare", cls=VerbCommand)(fly_prepare.prepare)
app.command("order", cls=VerbCommand)(fly_order.order)


@app.command("replay", cls=VerbCommand)
def replay(
    card_file: Annotated[Path, typer.Argument(metavar="CARD", help="The flight card.", show_default=False)],
    log: Annotated[Path, typer.Argument(metavar="LOG", help="Log of a node.", show_default=False)],
    as_json: options.Json = False,
) -> None:
    """Fly the log of a node again: the same inputs must give the same outputs, to the bit.

    Example: airflock fly replay mission.json mission-3-20270115T101500Z.log
    """
    from airflock.drones import read_card, read_key, replay_log_file

    card, key = read_card(card_file), read_key(card_file.with_suffix(".key"))
    ticks, different, notes = 0, [], []
    for tick in replay_log_file(log, card, key):
        ticks += 1
        notes += [(tick.time, note) for note in tick.out.notes]
        if not tick.same:
            different.append(tick.time)
    if as_json:
        tables.print_json({"ticks": ticks, "different": different, "notes": notes})
    else:
        for at, note in notes:
            tables.print_message(f"{at:10.2f} s  {note}")
        tables.print_message(f"{ticks} ticks, {len(different)} with another output than was logged")
    if different:
        raise ScenarioError(
            [f"{log}: {len(different)} of {ticks} ticks differ when flown again, first at {different[0]:g} s"]
        )
