"""Numba's CUDA simulator, quick and safe: the threads of a block are threads of Python, which meet at barriers.

Numba's manager asks all of them in a loop where they are, in half of the time that a test takes. Here who comes last to
a barrier lets the others go. And each call of a device function looks for the module `cuda` among the globals of the
kernel, where the kernel has exchanged it already: not here. Threads change places often, so that none is ahead of the
others between two barriers. They meet a gap in the simulator then: two that come to the same `cuda.shared.array` at
once may get an array each, and what one writes the other never sees.
"""

import sys
import threading

import numpy as np

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


class Block:
    """The threads of a block, in the place of Numba's manager: who comes last to a barrier, or ends, lets all go on."""

    def __init__(self, function, grid, block, debug):
        self._block_dim = block  # by these names a thread of Numba's asks for them
        self.block_state = np.zeros(block, bool)
        self.function, self.debug = function, debug
        self.meeting = threading.Lock()
        self.flying, self.waiting, self.failed = 0, [], None

    def run(self, place, *arguments):
        """Fly all threads of one block to their ends, and raise what the first one raised."""
        from numba.cuda.simulator.kernel import BlockThread

        def target():
            try:
                self.function(*arguments)
            except Exception:
                self.abort(threading.current_thread())
                raise
            finally:
                self.ended()

        threads = [BlockThread(target, self, place, at, self.debug) for at in np.ndindex(*self._block_dim)]
        self.flying = len(threads)
        for thread in threads:
            thread.gate = threading.Lock()
            thread.gate.acquire()
            thread.start()
        for thread in threads:
            thread.join()
        if self.failed:
            raise self.failed.exception[0].with_traceback(self.failed.exception[1])

    def meet(self, thread):
        """Wait at a barrier for all others that still fly."""
        with self.meeting:
            self.waiting.append(thread)
            self._go_on()
        thread.gate.acquire()
        if self.failed:
            raise RuntimeError("another thread of the block has failed")

    def ended(self):
        """One thread less to wait for."""
        with self.meeting:
            self.flying -= 1
            self._go_on()

    def abort(self, thread):
        """Nobody flies on."""
        with self.meeting:
            self.failed = self.failed or thread

    def _go_on(self):
        if len(self.waiting) == self.flying:
            waiting, self.waiting = self.waiting, []
            for thread in waiting:
                thread.gate.release()


def littered():
    """Let memory that a launch asks for hold numbers, so that whoever reads what nobody has written is found out."""
    from airflock.support.gpu import cuda_runtime

    cuda = cuda_runtime()
    made = cuda.device_array

    def full(*given, **named):
        array = made(*given, **named)
        array[:] = LITTER
        return array

    cuda.device_array = full


def quick():
    """Let the simulator's threads meet by themselves and change places often, and close the gap."""
    from numba.cuda.simulator import kernel
    from numba.cuda.simulator.kernelapi import FakeCUDAShared  # by the name that kernels know it by

    sys.setswitchinterval(SWITCH)
    begin, launch = FakeCUDAShared.__init__, kernel.FakeCUDAKernel.__call__

    def closed(self, *given):
        begin(self, *given)
        self._allocations = Allocations()

    def called(self, *given):
        inside = self._device or kernel._kernel_context
        return self.fn(*given) if inside else launch(self, *given)

    FakeCUDAShared.__init__ = closed
    kernel.FakeCUDAKernel.__call__ = called
    kernel.BlockManager = Block
    kernel.BlockThread.syncthreads = lambda thread: thread._manager.meet(thread)
