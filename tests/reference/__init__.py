"""A second flight, for the tests to trust: `core.agent` in a loop over agents, with a radio and sums of its own.

It asks the same rules as a driver and draws the same random numbers, and shares no line of the passes that write one.
"""
