"""A rule compiled as it is in a driver: copied by the generator, with literals in the driver's precision."""

from functools import cache

from airflock.engine.text.generate import DriverSource
from inside import HEAD, JIT, load_driver, primitives


@cache
def compiled(rule, bits=64, loop=""):
    """Compiled twin of a rule; `loop` is driver text that calls RULE, and defines `run`, which is returned instead."""
    source = DriverSource(JIT, {})
    name = source.name(rule)
    head = HEAD.format(label=rule.__name__, bits=bits, primitives=primitives(bits))
    called = f"run = njit(**JIT | CALLED)({name}.py_func)"  # of a driver Python calls the last one only
    text = "\n\n".join([head, *source.blocks, loop.replace("RULE", name) or called]) + "\n"
    return load_driver(text, "rule").run
