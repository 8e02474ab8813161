"""Cell grid: neighbours by cells no smaller than the reach, sorted by counting; for many agents that see a short way.

Agents of one cell share their candidates: those of the cells around it are copied side by side once, so that
the loop over them runs in whole vectors. Candidates come in the order of cells and within a
cell by index, whatever the number of threads. Only for perception without noise, delay and loss; there it equals
all pairs but for the order of sums.
"""

from airflock.engine.passes.build import Builder, loop

CELLS = 4  # at most so many cells per agent: a flock that has dispersed widely does not fill the memory


def neighbours(build: Builder, lines: list[str], before: list[str], inner: list[str], after: list[str]) -> None:
    """Function `neighbours` over a grid: `before`, `inner` for each candidate j, then `after`, for each agent."""
    axes = build.plan.axes
    build.function("cells_of(n, near, row, work)", build.records("w"), _box(build), "return low, size, count")
    lines = [*lines, *_sorted(build)]
    fill = [f"box[{c}, found] = packed[{c}, s]" for c in range(2 * len(axes))] + ["who[found] = ident[s]", "found += 1"]
    copy = loop("s in range(starts[cell], starts[cell + 1])", fill)
    around = ["cell = (cz * count[1] + cy) * count[0] + cx", *copy]
    for name, c in zip("xyz", range(3), strict=True):
        inside = around
        first, last = f"low_{name}", f"high_{name}"
        around = loop(f"q{name} in range({first}, {last})", [f"c{name} = q{name} % count[{c}]", *inside])
    edges = []
    for c, a in enumerate("xyz"):
        if build.plan.periodic:
            edges += [f"low_{a} = o{a} - 1 if count[{c}] > 2 else 0", f"high_{a} = low_{a} + min(3, count[{c}])"]
            edges += [f"low_{a} += count[{c}]; high_{a} += count[{c}]"]
        else:
            edges += [f"low_{a} = max(o{a} - 1, 0)", f"high_{a} = min(o{a} + 2, count[{c}])"]
    names = [*(f"h{a}" for a in axes), *(f"hv{a}" for a in axes)]
    pad = loop("s in range(found, padded)", [f"box[{c}, s] = AWAY" for c in range(len(axes))] + [
        f"box[{c + len(axes)}, s] = ZERO" for c in range(len(axes))
    ] + ["who[s] = integer(-1)"])  # fmt: skip
    meet = ["i = ident[e]", *before, *loop("j in range(padded)", inner), *after]
    cell = [
        "here = (oz * count[1] + oy) * count[0] + ox",
        "if starts[here] == starts[here + 1]:",
        "    continue",
        *edges,
        "found = 0",
        *around,
        "padded = found + (-found) % 16",
        *pad,
        *loop("e in range(starts[here], starts[here + 1])", meet),
    ]
    line = [
        "oy = line % count[1]; oz = line // count[1]",
        f"box = np.empty(({2 * len(axes)}, room), work.dtype); who = np.empty(room, np.int{build.plan.bits})",
        *[f"{name} = box[{c}]" for c, name in enumerate(names)],
        *loop("ox in range(count[0])", cell),
    ]
    head = "neighbours(k_, n, m, time, late, row, whole, work, store)"
    build.function(head, lines, loop("line in prange(count[1] * count[2])", line), "return 0", parallel=True)


def _box(build: Builder) -> list[str]:
    """Lower corner, cell size (m) and number of cells per axis: of the periodic box, or around the flock."""
    axes = build.plan.axes
    lines = ["low = np.zeros(3, work.dtype); size = np.ones(3, work.dtype); count = np.ones(3, np.int64)"]
    lines += ["width = np.ones(3, work.dtype); volume = ONE"]
    for c, a in enumerate(axes):
        lines += build.bind([a])
        if build.plan.periodic:
            lines += [f"low[{c}] = -w.half_{a}; width[{c}] = w.half_{a} + w.half_{a}"]
        else:
            lines += ["least_ = FAR; most_ = -FAR"]
            lines += loop("i in range(n)", [f"least_ = least(least_, {a}[i]); most_ = most(most_, {a}[i])"])
            lines += [f"low[{c}] = least_; width[{c}] = most(most_ - least_, near)"]
        lines += [f"volume *= most(width[{c}] / near, ONE)"]
    coarse = f"(volume / real({CELLS} * n)) ** real({1.0 / len(axes)})"
    lines += [f"side = near * most(ONE, {coarse})"]
    for c in range(len(axes)):
        lines += [f"count[{c}] = max(1, int(width[{c}] / side))", f"size[{c}] = width[{c}] / real(count[{c}])"]
    return lines


def _sorted(build: Builder) -> list[str]:
    """Agents sorted by cell: starts (first agent of each cell), ident (who it is), packed (position and velocity)."""
    axes = build.plan.axes
    lines = ["low, size, count = cells_of(n, near, row, work)", "cell_of = np.empty(n, np.int64)"]
    lines += ["starts = np.zeros(count[0] * count[1] * count[2] + 1, np.int64)"]
    place = ["c = 0"]
    for c, a in reversed(list(enumerate(axes))):
        lines += build.bind([a])
        place += [f"c = c * count[{c}] + min(max(int(({a}[i] - low[{c}]) / size[{c}]), 0), count[{c}] - 1)"]
    lines += loop("i in range(n)", [*place, "cell_of[i] = c; starts[c + 1] += 1"])
    lines += ["most_in = 0"]
    count = ["most_in = max(most_in, starts[c + 1])", "starts[c + 1] += starts[c]"]
    lines += loop("c in range(len(starts) - 1)", count)
    lines += [f"room = min(n, most_in * {3 ** len(axes)}) + 16"]
    lines += ["fill = starts.copy()", f"ident = np.empty(n, np.int{build.plan.bits})"]
    lines += [f"packed = np.empty(({2 * len(axes)}, n), work.dtype)"]
    names = [*axes, *(f"v{a}" for a in axes)]
    lines += build.bind([f"v{a}" for a in axes])
    put = ["d = fill[cell_of[i]]; fill[cell_of[i]] = d + 1; ident[d] = i"]
    return lines + loop("i in range(n)", put + [f"packed[{c}, d] = {name}[i]" for c, name in enumerate(names)])
