"""The command `airflock`: its verbs, and one line for everything that goes wrong."""

import errno
import os
import sys
from typing import Any

import typer
from typer.core import TyperGroup

from airflock import __version__
from airflock.cli import display, evolve, harden, inspect, look, paper, run, sweep, watch
from airflock.errors import AirflockError

HELP = """Decentralised flocks of drones and birds: simulate, score, evolve, plot.

Try [bold]airflock run vasarhelyi_2018/4ms[/bold]. Every verb has --help with an example.
"""


class Verbs(TyperGroup):
    """The verbs; Ctrl-C ends one of them like any other fault, with one line and status 2."""

    def invoke(self, ctx: Any) -> Any:
        """Run a verb."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as stop:
            raise AirflockError("interrupted; files that were not announced as saved were not written") from stop


app = typer.Typer(
    cls=Verbs,
    help=HELP,
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    add_completion=False,
)
app.command("run")(run.run)
app.command("score")(run.score)
app.command("watch")(watch.watch)
app.command("sweep")(sweep.sweep)
app.command("evolve")(evolve.evolve)
app.command("harden")(harden.harden)
app.command("plot")(look.plot)
app.command("video")(look.video)
app.command("replay")(look.replay)
app.command("display")(display.display)
app.command("paper")(paper.paper)
app.command("presets")(inspect.presets)
app.command("validate")(inspect.validate)
app.command("doctor")(inspect.doctor)


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"airflock {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: bool = typer.Option(
        False, "--version", callback=_version, is_eager=True, help="Show the version and stop."
    ),
) -> None:
    pass


def main() -> None:
    """Run the command; bad input ends with one line per fault and exit status 2."""
    try:
        app(standalone_mode=True)
    except AirflockError as fault:
        _end(str(fault))
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except OSError as fault:
        if fault.errno not in (errno.ENOSPC, errno.EACCES, errno.EROFS, errno.EDQUOT, errno.ENOENT, errno.ENOTDIR):
            raise
        _end(f"{fault.filename or 'output'}: {fault.strerror}")


def _end(text: str) -> None:
    for line in text.splitlines():
        sys.stderr.write(f"airflock: {line}\n")
    sys.exit(2)
