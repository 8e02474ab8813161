"""Shape: how one flock lies on the threads of a block. Everything here is fixed when a kernel is generated."""

from dataclasses import dataclass

WARP = 32
MOST_THREADS = 1024  # of one block, on every GPU so far
MOST_REGISTERED = 1024  # agents whose state stays in registers; more are kept in a table in the GPU's memory
REGISTERS = 65_536  # of a multiprocessor, on every GPU so far
SATURATED = 96  # of a thread where flocks fill a GPU: 52 bytes are spilled, none in a pair loop (counted for sm_90)
UNROLL = 2  # pairs per turn of a pair loop: 4 cost registers and were slower (trial, H200)


@dataclass(frozen=True)
class Shape:
    """Layout of one flock.

    lanes     : agents that the shared tables hold, a multiple of 32
    per_agent : threads that share the pair loop of one agent, a power of two up to 32
    threads   : of the block
    registers : each thread keeps the state of its agent in registers, else all states lie in a table, and an agent has
                one thread, or the whole block: others would come to their sums in different turns, and wait for ever
    simulated : text for Numba's CUDA simulator, which knows neither shuffles nor alignment
    """

    lanes: int
    per_agent: int
    threads: int
    registers: bool = True
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

        Where one thread serves an agent flocks fill the GPU, and warps that wait for each other's results hide it: left
        alone a thread takes 159 registers, and 12 warps fit where 20 do with 96. Otherwise each flock has a
        multiprocessor to itself, and all the registers it can use.
        """
        crowded = self.registers and self.per_agent == 1
        return self.threads, max(1, REGISTERS // (SATURATED * self.threads)) if crowded else 1

    @property
    def words(self) -> int:
        """Words of 32 bits in a mask of agents."""
        return self.lanes // WARP


def shape_of(
    agents: int, flocks: int, processors: int = 132, *, sequential: bool = False, whole: bool = False,
    apart: bool = False,
) -> Shape:  # fmt: skip
    """Layout for many flocks of this size on a GPU with this many multiprocessors.

    Few flocks leave most of a GPU idle. Where a flock is one warp, several threads then share the pairs of one agent;
    larger ones have warps enough to hide each other's waiting, and sums over threads cost more than they save (100
    agents, one flock on an H200: 5.9 ms with one thread per agent, 6.5 with two, 7.3 with four).

    sequential : one agent after another
    whole      : some rule solves for the whole flock, which one thread does
    apart      : agents fly by several laws, where threads of one warp part, so that none hands another a sum; or each
                 ranks those whom it hears, which one thread does
    """
    lanes = -(-agents // WARP) * WARP
    if sequential:  # one agent after another: a warp shares its pairs
        return Shape(lanes, WARP, WARP, registers=False)
    if whole:
        return Shape(lanes, 1, WARP, registers=False)
    if agents > MOST_REGISTERED:
        return Shape(lanes, 1, MOST_THREADS, registers=False)
    per_agent = 1
    busy = flocks * lanes / (processors * 3.0 * 128.0)  # 1.0: as full as pays
    while not apart and lanes == WARP and per_agent < 4 and busy * per_agent < 1.0:
        per_agent *= 2
    return Shape(lanes, per_agent, lanes * per_agent)
