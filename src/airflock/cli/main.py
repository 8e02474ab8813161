"""The command `airflock`: its verbs, and one line for every error."""

import _thread
import atexit
import gc
import os
import pkgutil
import signal
import sys
import threading
import traceback
import warnings
from bdb import BdbQuit
from collections.abc import Sequence
from importlib import import_module
from typing import Annotated, Any, Literal, NoReturn

import typer
from typer.completion import completion_init, get_completion_script  # type: ignore[attr-defined]

from airflock import __version__, scenarios
from airflock.cli.command import GroupOfVerbs, expand_home, usage_error
from airflock.cli.drone_verbs import fly_app
from airflock.support import AirflockError, os_error_message, printable, shortened, shortened_lines

for _module in pkgutil.iter_modules(sys.modules[__name__.rpartition(".")[0]].__path__):  # each registers its verbs
    import_module(f"airflock.cli.{_module.name}")

PROGRAM_HELP = """Decentralised flocks of drones and birds: simulate, score, evolve, plot.

Try [bold]airflock run vasarhelyi_2018/4ms[/bold]. Every verb has --help with an example.
"""


INTERRUPT_DELAY = 0.05  # s
COMPLETION_VARIABLE = "_AIRFLOCK_COMPLETE"  # of the environment, in which a shell asks what may follow


class VerbGroup(GroupOfVerbs):
    """Group of the verbs; a wrong command line and Ctrl-C end like any other error, with one line and status 2."""

    def main(self, args: Sequence[str] | None = None, *, standalone_mode: bool = True, **how: Any) -> Any:  # type: ignore[override]
        """Run a command line; raise an AirflockError where it is wrong."""
        completion_init()  # typer's own classes for shells, which its scripts expect
        words = [expand_home(word) for word in (sys.argv[1:] if args is None else args)]
        try:
            result = super().main(words, standalone_mode=False, **how | {"complete_var": COMPLETION_VARIABLE})
        except typer.Abort as stop:
            raise AirflockError("interrupted") from stop
        except Exception as error:
            if not hasattr(error, "format_message"):
                raise
            if type(error).__name__ == "NoArgsIsHelpError":
                error.show()  # type: ignore[attr-defined]
                sys.exit(2)
            raise AirflockError(usage_error(error, words)) from error
        return sys.exit(result if isinstance(result, int) else 0) if standalone_mode else result

    def invoke(self, ctx: Any) -> Any:
        """Run a verb."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as stop:
            raise AirflockError("interrupted; files that were not announced as saved were not written") from stop
        except EOFError as error:  # typer takes it for Ctrl-D
            raise AirflockError(f"unexpected end of a file: {error}; AIRFLOCK_DEBUG=1 shows where") from error


app = typer.Typer(
    cls=VerbGroup,
    help=PROGRAM_HELP,
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    add_completion=False,
)
app.add_typer(fly_app, name="fly", rich_help_panel="Towards real drones")


def _version(is_requested: bool) -> None:
    if is_requested:
        typer.echo(f"airflock {__version__}")
        raise typer.Exit


def _show_completion(shell: str | None) -> None:
    if shell is not None:
        typer.echo(get_completion_script(prog_name="airflock", complete_var=COMPLETION_VARIABLE, shell=shell))
        raise typer.Exit


@app.callback()
def _root_callback(
    show_completion: Annotated[
        Literal["bash", "zsh", "fish"] | None,
        typer.Option(
            callback=_show_completion,
            is_eager=True,
            show_default=False,
            help="Print what lets a shell complete commands, options, presets, keys and choices.",
        ),
    ] = None,
    version: bool = typer.Option(
        False, "--version", callback=_version, is_eager=True, help="Show the version and stop."
    ),
) -> None:
    pass


def main() -> None:
    """Run the command; bad input ends with one line per error and exit status 2, and so does SIGTERM."""
    if threading.current_thread() is threading.main_thread():  # only there are signals heard
        signal.signal(signal.SIGTERM, _on_sigterm)
        sys.unraisablehook = _repeat_interrupt
    atexit.register(gc.freeze)  # a last look for garbage among what a compiler leaves takes 0.6 s
    warnings.showwarning = _show_warning
    warnings.simplefilter("once", UserWarning, append=True)  # of many files or flights
    try:
        try:
            app(standalone_mode=True)
        finally:
            sys.stdout.flush()  # a full disk behind stdout is an error here, not after the last line of Python
    except AirflockError as error:
        _end(str(error), error)
    except BrokenPipeError:
        # The reader of a pipe has gone (head, less): Python would complain once more when it
        # flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except (KeyboardInterrupt, BdbQuit) as stop:  # while the verb is looked up, or after it; a debugger that is left
        _end("interrupted", stop)
    except OSError as error:
        _end(f"{error.filename or 'output'}: {os_error_message(error)}", error)
    except MemoryError as error:
        _end(f"needs more memory than there is: {error}; ask for fewer agents, flights or samples", error)
    except Exception as error:  # the border: whatever else goes wrong is one line, too
        if message := scenarios.user_error_line(error):  # on the device python: compiled, a rule raises nothing
            _end(message, error)
        _end(f"unexpected {type(error).__name__}: {error}; please report it; AIRFLOCK_DEBUG=1 shows where", error)


def _show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    """Print warnings of Airflock as a line; drop those that libraries address to programmers."""
    if category is UserWarning:
        sys.stderr.write(f"note: {shortened(printable(str(message)))}\n")


def _on_sigterm(number: int, _: Any) -> NoReturn:
    """End like Ctrl-C on SIGTERM, which batch systems send; a second one does not disturb the cleaning up."""
    signal.signal(number, signal.SIG_IGN)
    raise KeyboardInterrupt


def _repeat_interrupt(lost: Any) -> None:
    """Repeat an interruption that fell into a finaliser, where Python can only print it, a moment later.

    Numba's compiler drops objects with finalisers at every turn: Ctrl-C and SIGTERM were lost in one of 200 tries.
    """
    if not (lost.exc_type and issubclass(lost.exc_type, KeyboardInterrupt)):
        sys.__unraisablehook__(lost)
    elif threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _on_sigterm)
        later = threading.Timer(
            INTERRUPT_DELAY, _thread.interrupt_main, (signal.SIGTERM,)
        )  # by then this function has ended
        later.daemon = True
        later.start()


def _end(text: str, error: BaseException) -> NoReturn:
    if os.environ.get("AIRFLOCK_DEBUG"):
        traceback.print_exception(error)
    for line in shortened_lines(text.splitlines()):
        sys.stderr.write(f"airflock: {printable(line)}\n")
    if isinstance(error, OSError):
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115  what could not be written must not be tried again at exit
    sys.exit(2)
