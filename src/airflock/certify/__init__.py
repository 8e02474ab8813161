"""Certify: what so many flights show about a limit, with which confidence; and `airflock.certify(...)` itself.

The package and its public function share a verb: the module can be called (`airflock.callable_module`).
"""

from airflock.callable_module import make_callable

make_callable(__name__, "airflock.certify.run", "certify")
