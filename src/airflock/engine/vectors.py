"""What lets LLVM use vectors on a CPU, as driver text: extremes, choices without a branch, the width of a vector.

`least` and `most` stand for min and max of two numbers: LLVM vectorises a reduction by its own
minimum instruction, but not one by the comparison that Numba makes of min (2.4 times on the
nearest-neighbour loop). `choose` is a conditional expression without a branch: of two branches on
one test LLVM makes two ways through a loop, and the extremes at their ends are then no reductions
any more (9 times on the same loop). `copy_block` copies a few neighbours in a row of one contiguous
table to another one, plus a shift, as one vector. `wide_vectors` asks for 512-bit vectors in the
function that calls it, on processors that keep their clock then (`support.machine.vector_bits`):
LLVM takes 256 bits by default. A driver asks for them on every processor, so that its text is the
same on all. `apart` promises that the arguments of the function that calls it lie apart in memory:
else LLVM compares the places of all rows before each loop, and gives up on a loop that writes many.
`alone` keeps the function that calls it out of those that call that one. `min` and `max` are
Numba's of two numbers, and `as_bits` and `as_number` its views of the bits of one, which Numba
compiles for each kind of number as functions that Python could call.
"""

EXTREME_TEXT = """
def _extreme(instruction, comparison):
    @intrinsic
    def extreme(typing_context, a, b):
        def emit(context, builder, signature, arguments):
            kind = arguments[0].type
            if isinstance(a, types.Float):
                shape = ir.FunctionType(kind, [kind, kind])
                return builder.call(builder.module.declare_intrinsic(instruction, [kind], shape), arguments)
            return builder.select(builder.icmp_signed(comparison, *arguments), *arguments)
        return a(a, a), emit
    return extreme

least = _extreme("llvm.minnum", "<")
most = _extreme("llvm.maxnum", ">")

def _first(comparison):
    @intrinsic
    def first(typing_context, a, b):
        kind = typing_context.unify_types(a, b)
        def emit(context, builder, signature, arguments):
            x, y = [context.cast(builder, x, was, kind) for x, was in zip(arguments, signature.args)]
            before = context.get_function(comparison, types.boolean(kind, kind))
            return builder.select(before(builder, (y, x)), y, x)
        return kind(a, b), emit
    return first

min = _first(operator.lt)
max = _first(operator.gt)

@intrinsic
def as_bits(typing_context, a):
    def emit(context, builder, signature, arguments):
        return builder.bitcast(arguments[0], context.get_value_type(signature.return_type))
    return (types.int32 if a.bitwidth == 32 else types.int64)(a), emit

@intrinsic
def as_number(typing_context, a):
    def emit(context, builder, signature, arguments):
        return builder.bitcast(arguments[0], context.get_value_type(signature.return_type))
    return (types.float32 if a.bitwidth == 32 else types.float64)(a), emit

@intrinsic
def choose(typing_context, test, a, b):
    def emit(context, builder, signature, arguments):
        return builder.select(*arguments)
    return a(types.boolean, a, a), emit

@intrinsic
def wide_vectors(typing_context):
    def emit(context, builder, signature, arguments):
        if WIDE:
            # llvmlite itself knows only names without values
            set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()
    return types.void(), emit

@intrinsic
def alone(typing_context):
    def emit(context, builder, signature, arguments):
        builder.function.attributes.add("noinline")
        return context.get_dummy_value()
    return types.void(), emit

@intrinsic
def apart(typing_context):
    def emit(context, builder, signature, arguments):
        for argument in builder.function.args[2:]:  # behind the two by which results and errors go back
            if isinstance(argument.type, ir.PointerType):
                argument.add_attribute("noalias")
        return context.get_dummy_value()
    return types.void(), emit
"""

# Only in drivers that sort agents into cells: a short loop that copies the few agents of a cell
# costs more than they.
BLOCK_TEXT = """
@intrinsic
def copy_block(typing_context, to, row, at, source, first, shift):
    def emit(context, builder, signature, arguments):
        kind = context.get_data_type(signature.args[0].dtype)
        block = ir.VectorType(kind, {block})

        def place(number, row, column):
            array = context.make_array(signature.args[number])(context, builder, arguments[number])
            width = builder.extract_value(array.shape, 1)
            begin = builder.gep(array.data, [builder.add(builder.mul(row, width), column)])
            return builder.bitcast(begin, block.as_pointer())

        number, none = ir.IntType(32), ir.Constant(block, ir.Undefined)
        one = builder.insert_element(none, arguments[5], number(0))
        more = builder.shuffle_vector(one, none, ir.Constant(ir.VectorType(number, {block}), [0] * {block}))
        align = signature.args[0].dtype.bitwidth // 8
        read = builder.load(place(3, arguments[1], arguments[4]), align=align)
        builder.store(builder.fadd(read, more), place(0, arguments[1], arguments[2]), align=align)
        return context.get_dummy_value()
    return types.void(to, types.int64, types.int64, source, types.int64, to.dtype), emit
"""
