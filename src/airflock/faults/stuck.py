"""Stuck: the autopilot goes on following the command of the moment at which it lost its computer."""


def overrule(at_cx, at_cy, at_cz):
    """The command as it was."""
    return at_cx, at_cy, at_cz
