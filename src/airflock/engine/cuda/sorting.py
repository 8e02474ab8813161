"""Sorting: kernels that bring the agents of one big flock into the order of their cells: a counting sort."""

# Rows of near are two vectors of four. A compiler that knows nothing of their place loads number by number, seven times
# as often: one instruction of the GPU loads four. (Tables begin at multiples of 256 bytes.)
LOAD_FOURS_TEXT = """
from llvmlite import ir
from numba.cuda import types
from numba.cuda.extending import intrinsic


def four_at(offset):
    @intrinsic
    def four(typingctx, table, row):
        def codegen(context, builder, signature, arguments):
            array = context.make_array(signature.args[0])(context, builder, arguments[0])
            word, number = ir.IntType(64), ir.FloatType()
            place = builder.mul(builder.zext(arguments[1], word), word(32))
            address = builder.add(builder.add(builder.ptrtoint(array.data, word), place), word(offset))
            kind = ir.FunctionType(ir.LiteralStructType([number] * 4), [word])
            load = ir.InlineAsm(kind, "ld.global.nc.v4.f32 {$0, $1, $2, $3}, [$4];", "=f,=f,=f,=f,l")
            found = builder.call(load, [address])
            values = [builder.extract_value(found, c) for c in range(4)]
            return context.make_tuple(builder, signature.return_type, values)

        return types.UniTuple(types.float32, 4)(table, row), codegen

    return four


four_low = four_at(0)
four_high = four_at(16)
"""
SIMULATED_FOURS_TEXT = """
@njit()
def four_low(table, row):
    return table[row, 0], table[row, 1], table[row, 2], table[row, 3]


@njit()
def four_high(table, row):
    return table[row, 4], table[row, 5], table[row, 6], table[row, 7]
"""
SORT_TEXT = """
@njit()
def cell_along(x, low, size, count):
    return min(max(integer((x - low) / size), integer(0)), integer(count - 1))


@njit()
def cell_of(x, y, z, box, count):
    cx = cell_along(x, box[0], box[3], count[0])
    cy = cell_along(y, box[1], box[4], count[1])
    cz = cell_along(z, box[2], box[5], count[2])
    return integer((cz * count[1] + cy) * count[0] + cx)


@cuda.jit({options})
def count_agents(near, box, count, counts, cell, rank):
    a = cuda.grid(1)
    if a < near.shape[0]:
        c = cell_of(near[a, 0], near[a, 1], near[a, 2], box, count)
        cell[a] = c
        rank[a] = cuda.atomic.add(counts, c, 1)


@cuda.jit({options})
def sum_within(counts, starts, sums):
    part = cuda.shared.array({scan}, np.int32)
    t = cuda.threadIdx.x
    c = cuda.grid(1)
    own = counts[c] if c < counts.shape[0] else 0
    part[t] = own
    cuda.syncthreads()
    reach = 1
    while reach < {scan}:
        before = part[t - reach] if t >= reach else 0
        cuda.syncthreads()
        part[t] += before
        cuda.syncthreads()
        reach *= 2
    if c < counts.shape[0]:
        starts[c] = part[t] - own
    if t == {scan} - 1:
        sums[cuda.blockIdx.x] = part[t]


@cuda.jit({options})
def sum_before(counts, starts, sums):
    part = cuda.shared.array({scan}, np.int32)
    t = cuda.threadIdx.x
    c = cuda.grid(1)
    before = 0
    b = t
    while b < cuda.blockIdx.x:
        before += sums[b]
        b += {scan}
    part[t] = before
    cuda.syncthreads()
    half = {scan} // 2
    while half > 0:
        if t < half:
            part[t] += part[t + half]
        cuda.syncthreads()
        half //= 2
    if c < counts.shape[0]:
        starts[c] = starts[c] + part[0]
        if c == counts.shape[0] - 1:
            starts[c + 1] = starts[c] + counts[c]


@cuda.jit({options})
def list_agents(near, cell, rank, starts, counts, listed):
    a = cuda.grid(1)
    if a < near.shape[0]:
        listed[starts[cell[a]] + rank[a]] = integer(near[a, 3])
    if a < counts.shape[0]:
        counts[a] = 0


@cuda.jit({options})
def copy_agents(near, rest, cell, starts, listed, sorted_, rest_sorted):
    a = cuda.grid(1)
    if a < near.shape[0]:
        own = integer(near[a, 3])
        place = integer(starts[cell[a]])
        for s in range(integer(starts[cell[a]]), integer(starts[cell[a] + 1])):
            place += 1 if listed[s] < own else 0
        for c in range({near}):
            sorted_[place, c] = near[a, c]
        for c in range(rest.shape[1]):
            rest_sorted[place, c] = rest[a, c]
"""
