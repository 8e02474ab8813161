"""Fleets in software: vehicles that speak MAVLink, the ether between them, and a clock for all.

The package can be called: `airflock.fleet("vasarhelyi_2018/real_4ms")`.
"""

from airflock.callable_module import make_callable

make_callable(__name__, "airflock.fleet.flying", "fleet")
