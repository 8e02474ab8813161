"""From flight logs to the numbers of a scenario, with intervals and with reasons where there are none.

The package and its public function share a verb: the module can be called (`airflock.callable_module`).
"""

from airflock.callable_module import make_callable

make_callable(__name__, "airflock.identify.run", "identify")
