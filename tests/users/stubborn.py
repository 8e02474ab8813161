"""A controller that repeats the command of the beginning."""


def overrule(at_cx, at_cy, at_cz):
    """The command that reaches the body."""
    return at_cx, at_cy, at_cz
