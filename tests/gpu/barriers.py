"""Threads of the CUDA simulator at barriers, with some that end early and one that fails; prints what came of it.

Run in a process of its own, with NUMBA_ENABLE_CUDASIM=1: python barriers.py
"""

import json
import sys

import numpy as np
import simulator
from numba import cuda

THREADS, TURNS, FAILING = 7, 20, 3


@cuda.jit
def turns(seen, ends):
    count = cuda.shared.array(1, np.int64)
    i = cuda.threadIdx.x
    if i == 0:
        count[0] = 0
    for turn in range(ends[i]):
        cuda.syncthreads()
        if i == turn % THREADS:
            count[0] += 1
        cuda.syncthreads()
        seen[turn, i] = count[0]


@cuda.jit
def fails(reached):
    i = cuda.threadIdx.x
    cuda.syncthreads()
    if i == FAILING:
        raise ValueError("as asked")
    cuda.syncthreads()
    reached[i] = 1.0


def told():
    """What a launch of which one thread fails ends with, and how many got past the barrier behind."""
    reached = np.zeros(THREADS)
    try:
        fails[1, THREADS](reached)
    except ValueError as fault:
        return str(fault), int(reached.sum())
    return "", int(reached.sum())


if __name__ == "__main__":
    simulator.quick()
    whole, early = np.zeros((TURNS, THREADS), np.int64), np.zeros((TURNS, THREADS), np.int64)
    turns[1, THREADS](whole, np.full(THREADS, TURNS))
    turns[1, THREADS](early, np.arange(THREADS) + 1)  # thread i takes its own turn and ends
    said, past = told()
    json.dump({"whole": whole.tolist(), "early": early.tolist(), "said": said, "past": past}, sys.stdout)
