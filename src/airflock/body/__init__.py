"""Layer 2: what lies between a wish and a motion: body and wind.

The package can be called: `airflock.body(globals())` gathers a body of your own (`core.contract.body`).
"""

from airflock.callable_module import make_callable

make_callable(__name__, "airflock.core.contract", "body")
