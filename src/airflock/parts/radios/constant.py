"""Constant: every packet in range arrives after the delay; some are lost, more of them over a distance, if loss > 0.

A packet counts at the decision that it comes at, and is held as it came. The numbers are those of
`links`, so that a scenario changes from one to the other by its kind alone.
"""

from airflock.core import Radio
from airflock.parts.radios.links import Parameters

CONSTANT = Radio("constant", Parameters)
