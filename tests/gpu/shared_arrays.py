"""Threads that ask the CUDA simulator for a shared array at the same moment: prints how many blocks got more than one.

Run in a process of its own, with NUMBA_ENABLE_CUDASIM=1: python shared_arrays.py
"""

import sys
import time

import numpy as np
import simulator
from numba import cuda

THREADS = 8


@cuda.jit
def told(found):
    cuda.syncthreads()
    array = cuda.shared.array(1, np.float64)
    if cuda.threadIdx.x == 0:
        array[0] = 7.0
    cuda.syncthreads()
    found[cuda.threadIdx.x] = array[0]


if __name__ == "__main__":
    simulator.quick()
    made = np.empty

    def slowly(*given):
        time.sleep(0.01)  # s: long enough for all others to ask meanwhile
        return made(*given)

    apart = 0
    for _ in range(5):
        found = np.zeros(THREADS)
        np.empty = slowly
        told[1, THREADS](found)
        np.empty = made
        apart += bool((found != 7.0).any())
    sys.stdout.write(f"{apart}\n")
