"""Perceive: own state as measured, neighbours' states as heard; the ring of past states behind the delay."""

from airflock.body import radio, sensors
from airflock.core import random
from airflock.engine.passes.build import Builder, loop


def snapshot(build: Builder) -> None:
    """Put the true state into the slot from which decision number `slot` will hear it."""
    axes = build.plan.axes
    names = [*axes, *(f"v{a}" for a in axes)]
    body = loop("i in range(m)", [f"ring[slot, {c}, i] = {name}[i]" for c, name in enumerate(names)])
    build.function("snapshot(slot, m, work, ring)", build.bind(names), body)


def perceive(build: Builder) -> None:
    """Advance both error processes, then measure and hear."""
    plan, axes = build.plan, build.plan.axes
    lines = [*build.records("s c")] + build.whole("world", "seed_low", "seed_high")
    if plan.noisy:
        step = build.source.name(sensors.langevin)
        for draw, kinds in enumerate(
            (("own_x", "own_y", "sent_x", "sent_y"), ("own_z", "sent_z"))[: plan.dimensions - 1]
        ):
            lines += normals(build, "k", random.SENSOR + 256 * draw, "e")
            for g, kind in enumerate(kinds):
                who, a = kind.split("_")
                q, u = f"{who}_q{a}", f"{who}_u{a}"
                lines += build.bind([q, u])
                lines += loop("i in range(m)", [f"{q}[i], {u}[i] = {step}({q}[i], {u}[i], e{g}[i], c.period, s)"])
        for a in axes:
            lines += build.bind([a, f"v{a}", f"m{a}", f"mv{a}"])
            lines += loop("i in range(m)", [f"m{a}[i] = {a}[i] + own_q{a}[i]", f"mv{a}[i] = v{a}[i] + own_u{a}[i]"])
    if plan.noisy or plan.delayed:
        for c, a in enumerate(axes):
            error_q = f" + sent_q{a}[i]" if plan.noisy else ""
            error_u = f" + sent_u{a}[i]" if plan.noisy else ""
            lines += build.bind([f"h{a}", f"hv{a}"])
            lines += loop(
                "i in range(m)",
                [
                    f"h{a}[i] = ring[slot, {c}, i]{error_q}",
                    f"hv{a}[i] = ring[slot, {c + len(axes)}, i]{error_u}",
                ],
            )
    build.function("perceive(k, slot, m, row, whole, work, ring, words)", lines, "return 0")


def normals(build: Builder, step: str, stream: int, row: str = "g") -> list[str]:
    """Four normal numbers per agent, in rows of their own: those of the outer noise (g0..g3) serve two steps."""
    philox, pair = build.source.name(random.philox), build.source.name(random.normal_pair)
    return [
        *build.bind([f"{row}{c}" for c in range(4)]),
        *build.order(),
        "u0 = words[0]; u1 = words[1]; u2 = words[2]; u3 = words[3]",
        *loop(
            "i in range(m)",
            [f"u0[i], u1[i], u2[i], u3[i] = {philox}({build.who}, {step}, {stream}, world, seed_low, seed_high)"],
        ),
        *loop("i in range(m)", [f"{row}0[i], {row}1[i] = {pair}(u0[i], u1[i])"]),
        *loop("i in range(m)", [f"{row}2[i], {row}3[i] = {pair}(u2[i], u3[i])"]),
    ]


def receive(build: Builder) -> None:
    """Per agent i: which neighbours it hears now, and on two lossy links the newest packet of each, extrapolated.

    `store` keeps per pair the last packet: position, velocity, time stamp. Fills rows heard, age and, on links, e*.
    """
    plan, axes = build.plan, build.plan.axes
    if not (plan.lossy or plan.links):
        return
    philox, uniform = build.source.name(random.draw), build.source.name(random.uniform)
    lines = build.records("k c w" if plan.periodic else "k c") + build.whole("world", "seed_low", "seed_high")
    lines += build.bind([*axes, "heard", "age"])
    offsets = {a: f"o{a}" if plan.periodic else f"({a}[j] - {a}[i])" for a in axes}  # neighbours are met at their image
    inner = [f"o{a} = {a}[j] - {a}[i]" for a in axes] + build.image(axes, "o{}") if plan.periodic else []
    inner += ["d = math.sqrt(" + " + ".join(f"{offset} * {offset}" for offset in offsets.values()) + " + TINY)"]
    draw = f"w0, w1, w2, w3 = {philox}(i * n + j, k_, {{}}, world, seed_low, seed_high)"
    if plan.lossy:
        inner += [
            draw.format(random.LOSS),
            f"arrives = {uniform}(w0) >= {build.source.name(radio.lost)}(d, k)",
        ]
    else:
        inner += ["arrives = True"]
    if plan.links:
        states = [*(f"h{a}" for a in axes), *(f"hv{a}" for a in axes)]
        lines += build.bind([*states, *(f"e{s}" for s in states)])
        received, packets = build.source.name(radio.received), build.source.name(radio.packets)
        lines += [
            f"fast = real({packets}(real(k_), k.fast_rate, c.period))",
            f"slow = real({packets}(real(k_), k.slow_rate, c.period))",
        ]
        lines += ["farthest = math.sqrt(k.range * k.range + TINY)"] if plan.bits == 64 else []  # as d carries its guard
        within = "farthest" if plan.bits == 64 else "k.range"
        stamp = 2 * len(axes)
        inner += [
            draw.format(random.LINK),
            f"miss_fast = (ONE - {received}(d, ZERO, k)) ** fast",
            f"miss_slow = (ONE - {received}(d, ONE, k)) ** slow",
            f"got = arrives & (d <= {within}) & ({uniform}(w0) >= miss_fast * miss_slow)",
            "if got:",
            *[f"    store[i, {c}, j] = {s}[j]" for c, s in enumerate(states)],
            f"    store[i, {stamp}, j] = time - late",
            f"age[j] = time - store[i, {stamp}, j]",
            f"heard[j] = ONE if store[i, {stamp}, j] > real(-1e8) else ZERO",
            *[f"eh{a}[j] = store[i, {c}, j] + store[i, {c + len(axes)}, j] * age[j]" for c, a in enumerate(axes)],
            *[f"ehv{a}[j] = store[i, {c + len(axes)}, j]" for c, a in enumerate(axes)],
        ]
    else:
        inner += ["heard[j] = ONE if arrives else ZERO", "age[j] = late"]
    build.function(
        "receive(i, k_, n, time, late, row, whole, work, store)", lines, loop("j in range(n)", inner), "return 0"
    )
