"""Numba's CUDA simulator, quick and safe: the threads of a block are threads of Python, which a manager asks in a loop.

Without `quick` the manager holds Python's lock for 5 ms at a time, and a test takes three times as long. Threads that
change places oftener meet a gap in the simulator: two of them that come to the same `cuda.shared.array` at once may get
an array each, and what one writes the other never sees.
"""

import sys
import threading

SWITCH = 1e-5  # s
LITTER = 9  # any number that a mark, a count or a distance could be


class Allocations(dict):
    """Shared arrays of a block by where they are asked for; who asks for one that is being made waits for it."""

    def __init__(self):
        super().__init__()
        self.making = threading.Lock()

    def get(self, place):
        found = super().get(place)
        if found is None:
            self.making.acquire()  # until it is put in
            found = super().get(place)
            if found is not None:
                self.making.release()
        return found

    def __setitem__(self, place, array):
        super().__setitem__(place, array)
        self.making.release()


def littered():
    """Let memory that a launch asks for hold numbers, so that whoever reads what nobody has written is found out."""
    from airflock.gpu import runtime

    cuda = runtime()
    made = cuda.device_array

    def full(*given, **named):
        array = made(*given, **named)
        array[:] = LITTER
        return array

    cuda.device_array = full


def quick():
    """Let the simulator's threads change places often, and close the gap."""
    from numba.cuda.simulator.kernelapi import FakeCUDAShared  # by the name that kernels know it by

    sys.setswitchinterval(SWITCH)
    begin = FakeCUDAShared.__init__

    def closed(self, *given):
        begin(self, *given)
        self._allocations = Allocations()

    FakeCUDAShared.__init__ = closed
