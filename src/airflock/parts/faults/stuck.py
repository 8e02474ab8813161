"""Stuck: the autopilot keeps following the last command from before it lost its computer."""


def overrule(at_cx, at_cy, at_cz):
    """The command as it was."""
    return at_cx, at_cy, at_cz
