"""Processes that tests start and end, and the command without one."""

import io
import signal
import subprocess
import sys
import warnings
from contextlib import redirect_stderr, redirect_stdout


def hear_interrupts():
    """Before a child starts: Ctrl-C reaches it, also where the tests themselves run in a shell's background."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def called(*arguments):
    """Status and texts of the command `airflock`, called in this process: most tests need none of its own."""
    from airflock.cli import main

    command, (out, err) = ["airflock", *map(str, arguments)], (io.TextIOWrapper(io.BytesIO(), "utf-8") for _ in "12")
    argv, heard, told, status = sys.argv, signal.getsignal(signal.SIGTERM), sys.unraisablehook, 0
    with warnings.catch_warnings(), redirect_stdout(out), redirect_stderr(err):
        warnings.simplefilter("default")
        sys.argv = command
        try:
            main()
        except SystemExit as end:
            status = end.code or 0
        finally:
            sys.argv = argv
            signal.signal(signal.SIGTERM, heard)
            sys.unraisablehook = told
    texts = []
    for stream in (out, err):
        stream.flush()
        texts.append(stream.buffer.getvalue().decode())
    return subprocess.CompletedProcess(command, status, *texts)
