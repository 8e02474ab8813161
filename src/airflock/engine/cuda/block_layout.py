"""Shape: how one flock lies on the threads of a block. Everything here is fixed when a kernel is generated."""

from dataclasses import dataclass

WARP = 32
MOST_THREADS = 1024  # of one block, on every GPU so far
MOST_REGISTERED = 1024  # agents whose state stays in registers; more are kept in a table in the GPU's memory
REGISTERS = 65_536  # of a multiprocessor, on every GPU so far
# Measured on an H200: 128 registers spill nothing; 96 pay where a multiprocessor flies more than 16
# flocks.
ROOMY = 128  # of a thread where a multiprocessor has few flocks: nothing is spilled
SATURATED = 96  # of a thread where flocks fill a GPU: some are spilled, none in a pair loop (counted for sm_90)
MANY = 16  # blocks of 128 threads for a multiprocessor from which more warps are worth more than more registers
UNROLL = 2  # pairs per turn of a pair loop: 4 cost registers and were slower (trial, H200)


@dataclass(frozen=True)
class BlockLayout:
    """Layout of one flock.

    lanes     : agents that the shared tables hold, a multiple of 32
    per_agent : threads that share the pair loop of one agent, a power of two up to 32
    threads   : of the block
    registers : each thread keeps the state of its agent in registers, else all states lie in a
                table, and an agent has one thread, or the whole block: others would come to their
                sums in different turns, and wait for ever
    crowded   : flocks fill the GPU many times over
    simulated : text for Numba's CUDA simulator, which knows neither shuffles nor alignment
    """

    lanes: int
    per_agent: int
    threads: int
    registers: bool = True
    is_crowded: bool = True
    simulated: bool = False

    def __post_init__(self) -> None:
        assert self.registers or self.per_agent in (1, self.threads)

    @property
    def warps(self) -> int:
        """Groups of threads that reduce by shuffles; in the simulator every thread is its own."""
        return self.threads if self.simulated else self.threads // WARP

    @property
    def bounds(self) -> tuple[int, int]:
        """Threads of a block, and blocks that a multiprocessor shall hold at least: so many registers a thread gets.

        Warps that wait for each other's results hide it where flocks fill the GPU. Left alone a
        thread takes 159 registers; with 128 none is spilled. On an H200 a flock of 100 agents flies
        60 s in 5.4 ms with 128 registers and in 6.1 with 96; 1,000 flocks in 19.4 and 20.0, 5,000
        in 89.2 and 85.5. Fewer are slower.
        """
        registers = SATURATED if self.is_crowded else ROOMY
        alone = not self.registers or self.per_agent > 1  # a multiprocessor, and all the registers that it can use
        return self.threads, 1 if alone else max(1, REGISTERS // (registers * self.threads))

    @property
    def words(self) -> int:
        """Words of 32 bits in a mask of agents."""
        return self.lanes // WARP


def block_layout(
    agents: int, flocks: int, processors: int = 132, *, sequential: bool = False, whole_flock: bool = False,
    apart: bool = False,
) -> BlockLayout:  # fmt: skip
    """Layout for many flocks of this size on a GPU with this many multiprocessors.

    Few flocks leave most of a GPU idle. Where a flock is one warp, several threads then share the
    pairs of one agent; larger ones have warps enough to hide each other's waiting, and sums over
    threads cost more than they save (100 agents for 60 s, one flock on an H200: 5.4 ms with one
    thread per agent, 6.0 with two; 30 agents, a hundred flocks: 5.2 ms with one, 4.3 with two, 3.9
    with four; a thousand: 5.6, 8.6 and 11.8).

    sequential  : one agent after another
    whole_flock : some rule solves for the whole flock, which one thread does
    apart       : agents fly by several laws, where threads of one warp part, so that none hands
                  another a sum; or each ranks the agents that it hears, which one thread does
    """
    lanes = -(-agents // WARP) * WARP
    if sequential:  # one agent after another: a warp shares its pairs
        return BlockLayout(lanes, WARP, WARP, registers=False)
    if whole_flock:
        return BlockLayout(lanes, 1, WARP, registers=False)
    if agents > MOST_REGISTERED:
        return BlockLayout(lanes, 1, MOST_THREADS, registers=False)
    per_agent, busy = 1, flocks * lanes / (processors * 128.0)  # 1.0: a warp for each that can run at once
    # Only a flock of one warp shares its pairs among threads; the docstring has the times.
    while not apart and lanes == WARP and per_agent < 4 and busy * per_agent < 1.0:
        per_agent *= 2
    return BlockLayout(lanes, per_agent, lanes * per_agent, is_crowded=busy > MANY)
