"""Fails: the agent drops out at once and for good: it has come down, landed or been switched off."""


def leaves():
    """At once."""
    return 0.0
