"""One driver compiled and kept by a process of its own; `engine.store` starts it. No module imports it.

The request comes by standard input: the text of a driver, which holds every rule, so that no file
of anybody's is run. The input stays open; its end means that the process that sent the request has
gone.
"""

import json
import os
import pickle
import sys
from threading import Thread


def main() -> None:
    """Compile the driver of a request."""
    request = json.loads(sys.stdin.readline())
    Thread(target=_end_with_the_input, daemon=True).start()
    sys.path[:] = request["paths"]
    from airflock.engine.store import load_driver

    driver = load_driver(request["text"], request["label"], by_process=False)
    driver.advance.compile(pickle.loads(bytes.fromhex(request["types"])))


def _end_with_the_input() -> None:
    """Wait for the end of the input, and end this process at once."""
    while os.read(sys.stdin.fileno(), 1):
        continue
    os._exit(1)


if __name__ == "__main__":
    main()
