"""Which flocking law explains these tracks? Laws fitted by the likelihood of the next step, and compared.

The package and its public function share a verb: the module can be called (`airflock.callable_module`).
"""

from airflock.callable_module import make_callable

make_callable(__name__, "airflock.infer.run", "infer")
