"""Measure: order parameters of one instant, and how instants add up. The same text scores flights and recordings."""

from airflock.core.contract import Metric
from airflock.core.maths import norm
from airflock.core.vocabulary import Mean, asks
from airflock.engine.passes import flock
from airflock.engine.passes.build import Builder, branch, columns, loop
from airflock.engine.passes.decide import START, combine
from airflock.engine.passes.members import members
from airflock.engine.passes.move import excursion
from airflock.engine.specialise.stage import specialise
from airflock.engine.stages import scene

CLOCKS = ("sample", "collision")


def arguments(build: Builder) -> str:
    """What a measure function is called with."""
    rest = ", scratch" if flock.surveys(build.plan) else ""
    return f"time, n, m, row, whole, work, edges, spans, scene, memory, labels, values{rest}"


def measure(build: Builder, clock: str) -> None:
    """Function measure_<clock>: writes every Sample field into `values`.

    That of the collision clock returns the least distance of a pair, m.
    """
    metrics = [metric for metric in build.plan.metrics if metric.clock == clock]
    surveyed = any(metric.survey is not None for metric in metrics)
    lines = (
        build.records("w q c wing" if surveyed else "w q c")
        + build.whole("corners", "obstacles")
        + ["least2 = FAR", "nn = integer(n)"]
    )
    lines += _headings(build)
    lines += _pairs(build, metrics, clock == "collision")
    lines += _excursions(build, metrics)
    if any(build.wants(metric.agent, "agent", "touches") for metric in metrics):
        lines += specialise(build, scene.contacts).lines
    if any(build.wants(metric.agent, "agent", "rays") for metric in metrics):
        lines += build.bind(["rays_"])
    for metric in metrics:
        lines += flock.survey(build, metric)
    for metric in metrics:
        lines += _agents(build, metric)
        lines += build.clusters(metric) if build.clusters else _clusters(build, metric)
        lines += _sample(build, metric)
    head = f"measure_{clock}({arguments(build)})"
    build.function(head, lines, "return math.sqrt(least2)")


def _headings(build: Builder) -> list[str]:
    axes = build.plan.axes
    lines = build.bind([*axes, *(f"v{a}" for a in axes), "speed", *(f"head_{a}" for a in axes)])
    z = build.z("vz[i]")
    body = [f"speed[i] = {build.source.name(norm)}(vx[i], vy[i], {z})", "f = ONE / speed[i]"]
    lines += loop("i in range(n)", body + [f"head_{a}[i] = f * v{a}[i]" for a in axes])
    names = [*axes, *(f"v{a}" for a in axes), *(f"head_{a}" for a in axes)]
    lines += [f"s_{name} = ZERO" for name in names]
    lines += loop("i in range(n)", [f"s_{name} += {name}[i]" for name in names])
    means = [f"s_{kind}{a} / real(n)" if a in axes else "ZERO" for kind in ("", "v", "head_") for a in "xyz"]
    return [*lines, f"mean = {build.source.name(Mean)}({', '.join(means)}, real(n))"]


def _pairs(build: Builder, metrics: list[Metric], least: bool) -> list[str]:
    """One loop over all pairs for the pair rules of all metrics of this clock; `least`: note the least distance too.

    Only where it is asked for: two minima of the same squares in one loop are not vectorised (7 times slower).
    """
    axes = build.plan.axes
    paired = [metric for metric in metrics if metric.pair is not None]
    if not paired:
        return []
    lines, before, inner, after = [], [], [], []
    for metric in paired:
        fields = metric.Pair._fields  # type: ignore[union-attr]
        used = metric.name
        call = build.call(metric.pair, "pair", {"lower": "(ONE if integer(j) < ii else ZERO)"}, metric.name)  # type: ignore[arg-type]
        inner += [f"t = {call}"]
        for c, name in enumerate(fields):
            how = metric.reduce.get(name, "sum")
            lines += build.bind([f"{used}_{name}"])
            before += [f"p_{used}_{c} = {START[how]}"]
            inner += [combine(how, f"p_{used}_{c}", f"choose(ok, t[{c}], {START[how]})")]
            after += [f"{used}_{name}[i] = p_{used}_{c}"]
    root = ["r = math.sqrt(r2)"] if any(build.wants(metric.pair, "pair", "r") for metric in paired) else []
    offsets = (
        [f"d{a} = {a}[j] - {a}i" for a in axes]
        + build.image(axes)
        + ([] if build.plan.dimensions == 3 else ["dz = ZERO"])
    )
    square = " + ".join(f"d{a} * d{a}" for a in axes)
    outer = ["ii = integer(i)", *[f"{a}i = {a}[i]" for a in axes], *before]
    outer += ["near2 = FAR"] if least else []
    body = [*offsets, f"r2 = {square} + TINY", *root, "ok = (integer(j) != ii) & (integer(j) < nn)"]
    body += [*inner, *(["near2 = least(near2, choose(ok, r2, FAR))"] if least else [])]
    outer += loop("j in range(m)", body) + after + (["least2 = least(least2, near2)"] if least else [])
    return lines + loop("i in range(n)", outer)


def _excursions(build: Builder, metrics: list[Metric]) -> list[str]:
    if not any(build.wants(metric.agent, "agent", "excursion") for metric in metrics):
        return []
    excursion(build)
    call = f"excursion(x[i], y[i], {build.z('z[i]')}, w, edges, spans, corners, obstacles, scene)"
    return [*build.bind(["excursion_"]), *loop("i in range(n)", [f"excursion_[i] = {call}"])]


def _agents(build: Builder, metric: Metric) -> list[str]:
    """Sum the agent rule of one metric over all agents."""
    if metric.agent is None:
        return []
    axes, used = build.plan.axes, asks(metric.agent, "agent", metric.name)
    fields = metric.Agent._fields  # type: ignore[union-attr]
    lines, body = [f"a{c} = {START[metric.reduce.get(name, 'sum')]}" for c, name in enumerate(fields)], []
    given = {"speed": "speed[i]", "excursion": "excursion_[i]", "touches": "touches_[i]", "rays": "rays_[i]"}
    for a in "xyz":
        given |= (
            {a: f"{a}[i]", f"v{a}": f"v{a}[i]", f"h{a}": f"head_{a}[i]"}
            if a in axes
            else dict.fromkeys((a, f"v{a}", f"h{a}"), "ZERO")
        )
    if "pair" in used:
        lines += build.bind([f"{metric.name}_{name}" for name in metric.Pair._fields])  # type: ignore[union-attr]
        values = ", ".join(f"{metric.name}_{name}[i]" for name in metric.Pair._fields)  # type: ignore[union-attr]
        body += [f"pair = {build.source.name(metric.Pair)}({values})"]
    if "shared" in used:
        body += flock.shared(build, metric.Shared, metric.name)
    memory = getattr(metric.Memory, "_fields", ()) if "memory" in used else ()
    first = memory_offset(build, metric)
    if memory:
        values = ", ".join(f"memory[{first + c}, i]" for c in range(len(memory)))
        body += [f"memory_ = {build.source.name(metric.Memory)}({values})"]
        given["memory"] = "memory_"
    call = build.call(metric.agent, "agent", given, metric.name)
    body += [f"t, kept = {call}" if memory else f"t = {call}"]
    body += [f"memory[{first + c}, i] = kept[{c}]" for c in range(len(memory))]
    body += [combine(metric.reduce.get(name, "sum"), f"a{c}", f"t[{c}]") for c, name in enumerate(fields)]
    values = ", ".join(f"a{c}" for c in range(len(fields)))
    return lines + loop("i in range(n)", body) + [f"agents = {build.source.name(metric.Agent)}({values})"]


def memory_offset(build: Builder, metric: Metric) -> int:
    """First row of a metric in the table of metric memories."""
    first = 0
    for other in build.plan.metrics:
        if other is metric:
            return first
        first += len(getattr(other.Memory, "_fields", ()))
    raise KeyError(metric.name)


def _clusters(build: Builder, metric: Metric) -> list[str]:
    """Label connected agents (expand one after another until all are reached) and sum the cluster rule over clusters.

    labels[0]: 0 unseen, 1 in the cluster that grows, 2 in an earlier one; labels[1]: 1 once expanded.
    """
    if metric.cluster is None:
        return []
    axes = build.plan.axes
    fields = metric.Cluster._fields  # type: ignore[union-attr]
    lines = ["state = labels[0]; expanded = labels[1]"]
    lines += [f"u{c} = {START[metric.reduce.get(name, 'sum')]}" for c, name in enumerate(fields)]
    lines += loop("i in range(m)", ["state[i] = 0; expanded[i] = 0"])
    offsets = [f"d{a} = {a}[j] - {a}i" for a in axes] + build.image(axes)
    square = " + ".join(f"d{a} * d{a}" for a in axes)
    link = build.call(metric.linked, "linked", {}, metric.name)  # type: ignore[arg-type]
    grow = [
        *[f"{a}i = {a}[e]" for a in axes],
        "expanded[e] = 1; fresh = integer(0)",
        *loop(
            "j in range(n)",
            [
                *offsets,
                f"r2 = {square} + TINY",
                *(["r = math.sqrt(r2)"] if build.wants(metric.linked, "linked", "r") else []),
                f"joins = integer({link} & (state[j] == 0))",
                "state[j] |= joins",
                "fresh += joins",
            ],
        ),
        "size += fresh",
        "if done + size == n:",
        "    break",
        "e = -1",
        *loop("j in range(n)", branch("(state[j] == 1) and (expanded[j] == 0)", ["e = j", "break"])),
    ]
    members, mean = _members(build, metric)
    heads = " + ".join(f"head_{a}[j] * head_{a}[j]" for a in axes)
    gather = ["inside = ONE if state[j] == 1 else ZERO"]
    gather += [f"s{a} += inside * head_{a}[j]" for a in axes]
    gather += [f"hh += inside * ({heads})"]
    gather += [] if members else ["state[j] = integer(2) if state[j] != 0 else integer(0)"]
    given = {"n": "real(size)", "hx": "sx", "hy": "sy", "hz": "sz", "mean": mean}
    body = [
        *["while state[first] != 0:", "    first += 1"],
        "state[first] = 1; size = 1; e = first",
        *["while e >= 0:", *[f"    {line}" for line in grow]],
        "sx = ZERO; sy = ZERO; sz = ZERO; hh = ZERO",
        *loop("j in range(n)", gather),
        *members,
        "done += size",
        f"t = {build.call(metric.cluster, 'cluster', given, metric.name)}",
        *[combine(metric.reduce.get(name, "sum"), f"u{c}", f"t[{c}]") for c, name in enumerate(fields)],
    ]
    lines += ["done = 0; first = 0", "while done < n:", *[f"    {line}" for line in body]]
    values = ", ".join(f"u{c}" for c in range(len(fields)))
    return [*lines, f"clusters = {build.source.name(metric.Cluster)}({values})"]


def _members(build: Builder, metric: Metric) -> tuple[list[str], str]:
    """Lines that sum the member rule over the cluster at hand, after its own mean; and the name of that mean."""
    if metric.member is None:
        return [], "mean"
    text = members(build, metric, "j")
    lines = [*text.zeros, *loop("j in range(n)", branch("state[j] == 1", [f"c_{x} += {x}[j]" for x in text.rows]))]
    body = [*text.body, *(combine(how, f"m{c}", f"t[{c}]") for c, how in enumerate(text.how))]
    lines += [*text.mean, *loop("j in range(n)", branch("state[j] == 1", body))]
    lines += loop("j in range(n)", ["state[j] = integer(2) if state[j] != 0 else integer(0)"])
    return [*lines, text.record], "own_mean"


def _sample(build: Builder, metric: Metric) -> list[str]:
    names = [name for name, _, _ in columns(build.plan.metrics)]
    call = build.call(
        metric.sample, "sample", {"n": "real(n)", "dimensions": f"real({build.plan.dimensions})"}, metric.name
    )
    fields = metric.Sample._fields  # type: ignore[attr-defined]
    return [f"t = {call}", *[f"values[{names.index(name)}] = t[{c}]" for c, name in enumerate(fields)]]


def accumulate(build: Builder, clock: str) -> list[str]:
    """Lines that add the values of one instant to the sums over time."""
    lines = []
    for c, (_, how, when) in enumerate(columns(build.plan.metrics)):
        if when == clock:
            if how in ("mean", "sum"):
                lines += [f"sums[{c}] += values[{c}]"]
            else:
                lines += [f"sums[{c}] = {how}(sums[{c}], values[{c}])"]
    count = len(columns(build.plan.metrics)) + CLOCKS.index(clock)
    return [*lines, f"sums[{count}] += 1.0"]
