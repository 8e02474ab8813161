"""Tune: from a scenario of one's own to a set that is evolved, hardened and certified; and `airflock.tune(...)`.

The package and its public function share a verb: the module can be called (`airflock.callable_module`).
"""

from airflock.callable_module import make_callable

make_callable(__name__, "airflock.tune.run", "tune")
