"""Radio deaf: the agent no longer hears the others; they still hear it."""


def radio(reach):
    """Ranges outwards and inwards, m."""
    return reach, -1.0
