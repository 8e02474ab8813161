"""Clusters on a GPU: all agents of a block check at once if they are linked to the growing cluster.

A cluster grows from its first agent, one hop per round, until a round adds none. Where states lie in registers each
thread keeps the links of its agent as bits, so that a round reads a few words; else a round looks at all pairs.
"""

from typing import Any

from airflock.core import Metric
from airflock.engine.passes.build import Builder, branch_lines, loop_lines
from airflock.engine.plan import Plan
from airflock.engine.specialise.known_values import LocalVector, driver_argument
from airflock.engine.specialise.specialiser import specialise
from airflock.engine.stages.clusters import call_member, mean_from_sums
from airflock.engine.stages.measure import add_terms, clear_totals, record_of_totals, reductions
from airflock.engine.stages.state import FlockRows
from airflock.engine.stages.words import (
    HALF,
    REDUCTION_START,
    ZERO,
    X,
    Y,
    Z,
    call_rule,
    real,
    reduce_term,
    totals,
    vector,
)
from airflock.world import nearest_image

VALID = "np.uint32(FULL) if n >= 32 * part + 32 else (np.uint32((1 << max(n - 32 * part, 0)) - 1))"


def cluster_lines(build: Builder, metric: Metric) -> list[str]:
    """Lines that sum the cluster rule of one metric over all clusters."""
    registers = build.shape.registers  # type: ignore[attr-defined]
    build.bind_rows(["mine", "earlier", "joins"])
    totals_of = {"total": LocalVector("u", "totals"), "record": metric.Cluster}
    lines = specialise(build, clear_totals, metric=metric, **totals_of).lines
    lines += loop_lines("i in range(n)", ["mine[i] = ZERO; earlier[i] = ZERO; joins[i] = ZERO"])
    lines += _links(build, metric) if registers else []
    grow = _grow_by_masks() if registers else _grow_by_pairs(build, metric)
    made = specialise(
        build,
        grown,
        mine=driver_argument("mine"),
        size=driver_argument("size"),
        mean=driver_argument("mean"),
        metric=metric,
    )
    body = [*grow, *made.lines, f"t = {made.answer}"]
    body += specialise(build, add_terms, t=driver_argument("t"), metric=metric, **totals_of).lines
    body += loop_lines("i in range(n)", ["earlier[i] = most(earlier[i], mine[i])"])
    body += ["done += size", "cuda.syncthreads()"]
    lines += ["done = integer(0)", "while done < n:", *[f"    {line}" for line in body]]
    return [*lines, f"clusters = {specialise(build, record_of_totals, **totals_of).answer}", "return clusters"]


def _offset(build: Builder, other: str) -> list[str]:
    """Squared distance of agent i to another, by its text."""
    axes, nearest = build.plan.axes, build.source.name(nearest_image) if build.plan.periodic else ""
    lines = [f"d_{a} = {other.format(a=a, c=c)} - own_{a}" for c, a in enumerate(axes)]
    lines += [f"d_{a} = {nearest}(d_{a}, w.half_{a})" for a in axes if nearest]
    return [*lines, f"r2 = {' + '.join(f'd_{a} * d_{a}' for a in axes)} + TINY"]


def _linked(build: Builder, metric: Metric) -> tuple[list[str], str]:
    root = ["r = math.sqrt(r2)"] if build.rule_asks(metric.linked, "linked", "r") else []
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
    word += loop_lines(
        "e in range(4)", ["eight = np.uint32(0)", *eight, "bits = np.uint32(bits | (eight << np.uint32(8 * e)))"]
    )
    word += [f"links_[part] = np.uint32(bits & ({VALID}))"]
    lines = [f"own_{a} = {a}_i" for a in build.plan.axes] + loop_lines("part in range(sub, WORDS, PER_AGENT)", word)
    return [
        *lines,
        *loop_lines("part in range(tid, WORDS, THREADS)", ["seen[part] = np.uint32(0)"]),
        "cuda.syncthreads()",
    ]


def _grow_by_masks() -> list[str]:
    """One cluster, from the first agent that no earlier one holds."""
    # A round is a bitwise and of the own links with the members found so far: 32 agents in one
    # instruction.
    find = [f"left = np.uint32(~seen[part] & ({VALID}))"]
    find += branch_lines("(first < 0) and (left != np.uint32(0))", ["first = integer(32 * part + cuda.ffs(left) - 1)"])
    put = ["grown[part] = np.uint32(1) << np.uint32(first & 31) if part == (first >> 5) else np.uint32(0)"]
    touch = ["touched = np.uint32(0)"]
    touch += loop_lines(
        "part in range(sub, WORDS, PER_AGENT)", ["touched = np.uint32(touched | (links_[part] & grown[part]))"]
    )
    touch += ["hit = integer(1) if touched != np.uint32(0) else integer(0)"]
    growth = ["hit = integer(0)", *branch_lines("(i < n) and (mine_i + earlier_i < HALF)", touch)]
    growth += ["hit = integer(group_max(hit, tid))"]
    growth += ["fresh = integer(cuda.syncthreads_count(hit if sub == 0 else integer(0)))"]
    join = [
        "mine_i = ONE",
        *branch_lines("sub == 0", ["cuda.atomic.or_(grown, i >> 5, np.uint32(1) << np.uint32(i & 31))"]),
    ]
    growth += [*branch_lines("hit != 0", join), "size = integer(size + fresh)", "cuda.syncthreads()"]
    growth += ["growing = (fresh > 0) and (done + size < n)"]
    return [
        "first = integer(-1)", *loop_lines("part in range(WORDS)", find), "mine_i = ONE if i == first else ZERO",
        *loop_lines("part in range(tid, WORDS, THREADS)", put), "size = integer(1); growing = done + size < n",
        "cuda.syncthreads()", *["while growing:", *[f"    {line}" for line in growth]],
        *loop_lines("part in range(tid, WORDS, THREADS)", ["seen[part] = np.uint32(seen[part] | grown[part])"]),
    ]  # fmt: skip


def _grow_by_pairs(build: Builder, metric: Metric) -> list[str]:
    """Lines that grow one cluster by all pairs of rows of the table."""
    axes = build.plan.axes
    root, link = _linked(build, metric)
    pair = [*_offset(build, "{a}[j]"), *root, f"hit = most(hit, (ONE if {link} & (mine[j] > HALF) else ZERO))"]
    meet = [f"own_{a} = {a}[i]" for a in axes] + ["hit = ZERO", *loop_lines("j in range(m)", pair)]
    meet += ["joins[i] = hit if mine[i] + earlier[i] < HALF else ZERO", "fresh += joins[i]"]
    growth = ["fresh = ZERO", *loop_lines("i in range(n)", meet), "size = integer(size + integer(fresh))"]
    growth += loop_lines("i in range(n)", ["mine[i] = most(mine[i], joins[i])"])
    growth += ["cuda.syncthreads()", "growing = (fresh > HALF) and (done + size < n)"]
    return [
        "first = FAR",
        *loop_lines("i in range(n)", ["first = least(first, (real(i) if earlier[i] < HALF else FAR))"]),
        "size = integer(1); growing = done + size < n and first < FAR",
        *loop_lines("i in range(n)", ["mine[i] = ONE if real(i) == first else ZERO"]),
        "cuda.syncthreads()",
        *["while growing:", *[f"    {line}" for line in growth]],
    ]


def grown(
    mine: Any, size: Any, mean: Any, flock: FlockRows, numbers: Any, n: int, *, plan: Plan, metric: Metric
) -> Any:  # fmt: skip
    """Call the cluster rule for the agents that `mine` marks with 1; mean : over the flock."""
    axes, h = range(plan.dimensions), flock.heading
    s, cx, cv, ch = vector(), vector(), vector(), vector()
    for a in axes:
        s[a] = ZERO
    hh = ZERO
    # Each thread adds its own agent, times one or zero; the lowering reduces the sums over the
    # block.
    for i in range(n):
        for a in axes:
            s[a] = s[a] + mine[i] * h[a][i]
        hh += mine[i] * sum(h[a][i] * h[a][i] for a in axes)
    if metric.member is not None:
        for total in (cx, cv, ch):
            for a in axes:
                total[a] = ZERO
        for i in range(n):
            for total, row in ((cx, flock.position), (cv, flock.velocity), (ch, h)):
                for a in axes:
                    total[a] = total[a] + mine[i] * row[a][i]
    own_mean = mean_from_sums(size, cx, cv, ch, mean, plan=plan, metric=metric)
    k = totals()
    if metric.member is not None:
        clear_totals(k, metric.Member, metric)
        for i in range(n):
            t = call_member(i, own_mean, flock, numbers, metric=metric)
            for c, way in enumerate(reductions(metric.Member, metric)):
                k[c] = reduce_term(way, k[c], t[c] if mine[i] > HALF else REDUCTION_START[way])
    members = record_of_totals(metric.Member, k) if metric.member is not None else None
    return call_rule(
        metric.cluster, n=real(size), hx=s[X], hy=s[Y], hz=s[Z], hh=hh, members=members, mean=own_mean,
        q=numbers.q,
    )  # fmt: skip
