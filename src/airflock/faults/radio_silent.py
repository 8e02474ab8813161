"""Radio silent: nobody hears the agent any more; it hears the others."""


def radio(reach):
    """Ranges outwards and inwards, m."""
    return -1.0, reach
