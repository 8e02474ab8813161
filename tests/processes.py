"""Processes that tests start and end."""

import signal


def hear_interrupts():
    """Before a child starts: Ctrl-C reaches it, also where the tests themselves run in a shell's background."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
