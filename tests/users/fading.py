"""A radio whose ranges shrink."""


def radio(since):
    """How far it is heard and hears, m."""
    return 40.0 - 15.0 * since, 30.0
