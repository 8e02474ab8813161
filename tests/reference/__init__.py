"""A second flight, for the tests to trust: N pilots, each the `core.pilot.Pilot` that flies on board, and around them a
world, bodies and an ether of its own.

It asks the same rules as a driver and draws the same random numbers, and shares no line of the passes that write one.
"""
