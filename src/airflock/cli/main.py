"""The command `airflock`: its verbs, and one line for everything that goes wrong."""

import os
import signal
import sys
import threading
import traceback
import warnings
from typing import Any, NoReturn

import typer
from typer.core import TyperGroup

from airflock import __version__
from airflock.cli import (
    certify,
    display,
    evolve,
    fleet,
    fly,
    harden,
    identify,
    imports,
    inspect,
    keys,
    look,
    paper,
    run,
    sweep,
    tune,
    types,
    watch,
)
from airflock.errors import AirflockError, bounded, bounded_lines, printable

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
        except EOFError as fault:  # typer takes it for Ctrl-D
            raise AirflockError(f"unexpected end of a file: {fault}; AIRFLOCK_DEBUG=1 shows where") from fault


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
app.command("certify")(certify.certify)
app.command("tune")(tune.tune)
app.command("import")(imports.import_tracks)
app.command("export")(imports.export)
app.command("identify")(identify.identify)
app.command("plot")(look.plot)
app.command("video")(look.video)
app.command("replay")(look.replay)
app.command("display")(display.display)
app.command("fleet")(fleet.fleet)
app.add_typer(fly.app, name="fly")
app.command("paper")(paper.paper)
app.command("presets")(inspect.presets)
app.command("keys")(keys.keys)
app.command("validate")(inspect.validate)
app.command("types")(types.types)
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
    """Run the command; bad input ends with one line per fault and exit status 2, and so does SIGTERM."""
    if threading.current_thread() is threading.main_thread():  # only there are signals heard
        signal.signal(signal.SIGTERM, _stop)
    warnings.showwarning = _note
    try:
        try:
            app(standalone_mode=True)
        finally:
            sys.stdout.flush()  # a full disk behind stdout tells so here, and not after the last line of Python
    except AirflockError as fault:
        _end(str(fault), fault)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except KeyboardInterrupt as stop:  # while the verb was still being looked up, or after it
        _end("interrupted", stop)
    except OSError as fault:
        _end(f"{fault.filename or 'output'}: {fault.strerror or fault}", fault)
    except MemoryError as fault:
        _end(f"needs more memory than there is: {fault}; ask for fewer agents, flights or samples", fault)
    except Exception as fault:  # the border: whatever else goes wrong is one line, too
        _end(f"unexpected {type(fault).__name__}: {fault}; please report it; AIRFLOCK_DEBUG=1 shows where", fault)


def _note(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    """What Airflock warns of, as a line; what libraries say to programmers is not for who gives commands."""
    if category is UserWarning:
        sys.stderr.write(f"note: {bounded(printable(str(message)))}\n")


def _stop(number: int, _: Any) -> NoReturn:
    """SIGTERM, as batch systems send it, ends like Ctrl-C; a second one does not disturb what is being put away."""
    signal.signal(number, signal.SIG_IGN)
    raise KeyboardInterrupt


def _end(text: str, fault: BaseException) -> NoReturn:
    if os.environ.get("AIRFLOCK_DEBUG"):
        traceback.print_exception(fault)
    for line in bounded_lines(text.splitlines()):
        sys.stderr.write(f"airflock: {printable(line)}\n")
    if isinstance(fault, OSError):
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115  what could not be written must not be tried again at exit
    sys.exit(2)
