"""Clusters on a GPU: all agents of a block look at once who is linked to the cluster that grows.

A cluster grows from its first agent, one hop per round, until a round brings nobody. Where states lie in registers each
thread keeps the links of its agent as bits, so that a round reads a few words; else a round looks at all pairs.
"""

from airflock.core.contract import Metric
from airflock.engine.passes.build import Builder, branch, loop
from airflock.engine.passes.decide import START, combine
from airflock.engine.passes.members import members

VALID = "np.uint32(FULL) if n >= 32 * part + 32 else (np.uint32((1 << max(n - 32 * part, 0)) - 1))"


def clusters(build: Builder, metric: Metric) -> list[str]:
    """Lines that sum the cluster rule of one metric over all clusters."""
    if metric.cluster is None:
        return []
    registers = build.shape.registers  # type: ignore[attr-defined]
    fields = metric.Cluster._fields  # type: ignore[union-attr]
    build.bind(["mine", "earlier", "joins"])
    lines = [f"u{c} = {START[metric.reduce.get(name, 'sum')]}" for c, name in enumerate(fields)]
    lines += loop("i in range(n)", ["mine[i] = ZERO; earlier[i] = ZERO; joins[i] = ZERO"])
    lines += _links(build, metric) if registers else []
    grow = _grow_by_masks() if registers else _grow_by_pairs(build, metric)
    names = [f"head_{a}" for a in build.plan.axes]
    heads = " + ".join(f"{name}[i] * {name}[i]" for name in names)
    sums = [f"s{a} += mine[i] * head_{a}[i]" for a in build.plan.axes] + [f"hh += mine[i] * ({heads})"]
    members, mean = _members(build, metric)
    given = {"n": "real(size)", "hx": "sx", "hy": "sy", "hz": "sz", "mean": mean}
    body = [*grow, "sx = ZERO; sy = ZERO; sz = ZERO; hh = ZERO", *loop("i in range(n)", sums), *members]
    body += [f"t = {build.call(metric.cluster, 'cluster', given, metric.name)}"]
    body += [combine(metric.reduce.get(name, "sum"), f"u{c}", f"t[{c}]") for c, name in enumerate(fields)]
    body += loop("i in range(n)", ["earlier[i] = most(earlier[i], mine[i])"])
    body += ["done += size", "cuda.syncthreads()"]
    lines += ["done = integer(0)", "while done < n:", *[f"    {line}" for line in body]]
    values = ", ".join(f"u{c}" for c in range(len(fields)))
    return [*lines, f"clusters = {build.source.name(metric.Cluster)}({values})"]


def _offset(build: Builder, other: str) -> list[str]:
    """Squared distance of agent i to another, by its text."""
    axes = build.plan.axes
    square = " + ".join(f"d{a} * d{a}" for a in axes)
    return [*(f"d{a} = {other.format(a=a, c=c)} - {a}i" for c, a in enumerate(axes)), *build.image(axes),
            f"r2 = {square} + TINY"]  # fmt: skip


def _linked(build: Builder, metric: Metric) -> tuple[list[str], str]:
    root = ["r = math.sqrt(r2)"] if build.wants(metric.linked, "linked", "r") else []
    return root, build.call(metric.linked, "linked", {}, metric.name)  # type: ignore[arg-type]


def _links(build: Builder, metric: Metric) -> list[str]:
    """Links of the own agent as bits, word by word; the threads of an agent share the words."""
    root, link = _linked(build, metric)
    eight = []
    for bit in range(8):
        eight += [*_offset(build, "truth[other, {c}]"), *root]
        eight += [f"eight = np.uint32(eight | (np.uint32({1 << bit}) if {link} else np.uint32(0)))"]
        eight += ["other = np.uint32(other + np.uint32(1))"]
    word = ["bits = np.uint32(0); other = np.uint32(32 * part)"]
    word += loop(
        "e in range(4)", ["eight = np.uint32(0)", *eight, "bits = np.uint32(bits | (eight << np.uint32(8 * e)))"]
    )
    word += [f"links_[part] = np.uint32(bits & ({VALID}))"]
    lines = [f"{a}i = {a}_i" for a in build.plan.axes] + loop("part in range(sub, WORDS, PER_AGENT)", word)
    return [*lines, *loop("part in range(tid, WORDS, THREADS)", ["seen[part] = np.uint32(0)"]), "cuda.syncthreads()"]


def _grow_by_masks() -> list[str]:
    """One cluster, from the first agent that no earlier one holds."""
    find = [f"left = np.uint32(~seen[part] & ({VALID}))"]
    find += branch("(first < 0) and (left != np.uint32(0))", ["first = integer(32 * part + cuda.ffs(left) - 1)"])
    put = ["grown[part] = np.uint32(1) << np.uint32(first & 31) if part == (first >> 5) else np.uint32(0)"]
    touch = ["touched = np.uint32(0)"]
    touch += loop(
        "part in range(sub, WORDS, PER_AGENT)", ["touched = np.uint32(touched | (links_[part] & grown[part]))"]
    )
    touch += ["hit = integer(1) if touched != np.uint32(0) else integer(0)"]
    growth = ["hit = integer(0)", *branch("(i < n) and (mine_i + earlier_i < HALF)", touch)]
    growth += ["hit = integer(group_max(hit, tid))"]
    growth += ["fresh = integer(cuda.syncthreads_count(hit if sub == 0 else integer(0)))"]
    join = ["mine_i = ONE", *branch("sub == 0", ["cuda.atomic.or_(grown, i >> 5, np.uint32(1) << np.uint32(i & 31))"])]
    growth += [*branch("hit != 0", join), "size = integer(size + fresh)", "cuda.syncthreads()"]
    growth += ["growing = (fresh > 0) and (done + size < n)"]
    return [
        "first = integer(-1)", *loop("part in range(WORDS)", find), "mine_i = ONE if i == first else ZERO",
        *loop("part in range(tid, WORDS, THREADS)", put), "size = integer(1); growing = done + size < n",
        "cuda.syncthreads()", *["while growing:", *[f"    {line}" for line in growth]],
        *loop("part in range(tid, WORDS, THREADS)", ["seen[part] = np.uint32(seen[part] | grown[part])"]),
    ]  # fmt: skip


def _grow_by_pairs(build: Builder, metric: Metric) -> list[str]:
    """The same from the rows of the table."""
    axes = build.plan.axes
    root, link = _linked(build, metric)
    pair = [*_offset(build, "{a}[j]"), *root, f"hit = most(hit, (ONE if {link} & (mine[j] > HALF) else ZERO))"]
    meet = [f"{a}i = {a}[i]" for a in axes] + ["hit = ZERO", *loop("j in range(m)", pair)]
    meet += ["joins[i] = hit if mine[i] + earlier[i] < HALF else ZERO", "fresh += joins[i]"]
    growth = ["fresh = ZERO", *loop("i in range(n)", meet), "size = integer(size + integer(fresh))"]
    growth += loop("i in range(n)", ["mine[i] = most(mine[i], joins[i])"])
    growth += ["cuda.syncthreads()", "growing = (fresh > HALF) and (done + size < n)"]
    return [
        "first = FAR",
        *loop("i in range(n)", ["first = least(first, (real(i) if earlier[i] < HALF else FAR))"]),
        "size = integer(1); growing = done + size < n and first < FAR",
        *loop("i in range(n)", ["mine[i] = ONE if real(i) == first else ZERO"]),
        "cuda.syncthreads()",
        *["while growing:", *[f"    {line}" for line in growth]],
    ]


def _members(build: Builder, metric: Metric) -> tuple[list[str], str]:
    """Lines that sum the member rule over the cluster at hand, after its own mean; and the name of that mean."""
    if metric.member is None:
        return [], "mean"
    text = members(build, metric, "i")
    lines = [*text.zeros, *loop("i in range(n)", [f"c_{x} += mine[i] * {x}[i]" for x in text.rows])]
    terms = [f"(t[{c}] if mine[i] > HALF else {START[how]})" for c, how in enumerate(text.how)]
    body = [*text.body, *(combine(text.how[c], f"m{c}", term) for c, term in enumerate(terms))]
    return [*lines, *text.mean, *loop("i in range(n)", body), text.record], "own_mean"
