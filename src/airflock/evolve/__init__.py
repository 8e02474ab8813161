"""Evolve a flock: search spaces, optimisers, a store of every flight, executors; and `airflock.evolve(...)` itself.

The package and its public function share the field's verb: the module can be called (`airflock.callable_module`).
"""

from airflock.callable_module import make_callable

make_callable(__name__, "airflock.evolve.run", "evolve")
