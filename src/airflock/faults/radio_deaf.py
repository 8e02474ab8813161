"""Radio deaf: the agent hears nobody any more; the others hear it."""


def radio(reach):
    """Ranges outwards and inwards, m."""
    return reach, -1.0
