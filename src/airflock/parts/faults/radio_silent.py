"""Radio silent: the others no longer hear the agent; it still hears them."""


def radio(reach):
    """Ranges outwards and inwards, m."""
    return -1.0, reach
