"""Scene: what stands in a world, in a driver: shapes gathered for casts, contacts, excursions, goals on their way.

`scene` is one tuple of arrays: shapes, nodes and links (`world.bvh`); near, numbers of gathered shapes; counts (rays
cast at this decision, whether positions before are known); goals, aim (where the goal is, its number) and reached
(time of each, s; -1 before); later (bounds, time and number of each shape that is yet to appear; time -1 once it has).
A shape that is not there yet has its bounds far away, so that nothing meets it.
"""

from airflock.engine.passes.build import Builder, branch, loop
from airflock.engine.stages.state import SCENE
from airflock.world import bvh, goals


def parts(*names: str) -> list[str]:
    """Lines that take arrays out of the tuple."""
    return [f"{name} = scene[{SCENE.index(name)}]" for name in names]


def contacts(build: Builder) -> list[str]:
    """Lines that find which agents have touched the scene since the positions were last looked at."""
    axes = build.plan.axes
    if not build.plan.scene:
        return [*build.bind(["touches_"]), *loop("i in range(n)", ["touches_[i] = ZERO"])]
    before = [f"before_{a}" for a in axes]
    lines = [*parts("shapes", "nodes", "links", "counts"), *build.bind(["touches_", *before])]
    lines += branch("counts[1] == 0", loop("i in range(n)", [f"before_{a}[i] = {a}[i]" for a in axes]))
    start, end = (
        ", ".join(build.z(f"{word}{a}[i]") if a == "z" else f"{word}{a}[i]" for a in "xyz") for word in ("before_", "")
    )
    rule = build.source.name(bvh.touches)
    body = [f"touches_[i] = {rule}({start}, {end}, q.r_body, shapes, nodes, links)"]
    body += [f"before_{a}[i] = {a}[i]" for a in axes]
    return [*lines, "counts[1] = 1", *loop("i in range(n)", body)]


def aim(build: Builder) -> None:
    """Function aim(time, elapsed, n, work, row, scene): the goal goes on its way, for the flock's centre as it is."""
    plan = build.plan
    lines = [*build.records("w"), *parts("goals", "aim", "reached"), *build.bind(plan.axes), "number = int(aim[3])"]
    lines += branch("number >= len(goals)", ["return 0"])
    lines += [f"s{a} = ZERO" for a in "xyz"] + loop("i in range(n)", [f"s{a} += {a}[i]" for a in plan.axes])
    centre = ", ".join(f"s{a} / real(n)" for a in "xyz")
    travel = "(w.goal_speed * elapsed if w.goal_speed > ZERO else FAR)"
    target = ", ".join(f"goals[number, {c}]" for c in range(3))
    place = f"aim[0], aim[1], aim[2], {target}, {centre}"
    if plan.herd:
        lines += ["cx, cy, cz = " + centre, "stray = -ONE; fx = cx; fy = cy; fz = cz"]
        gap = " + ".join(f"({a}[i] - c{a}) * ({a}[i] - c{a})" for a in plan.axes)
        away = [f"stray = {gap}", *[f"f{a} = {a}[i]" for a in plan.axes]]
        lines += loop("i in range(n)", branch(f"{gap} > stray", away))
        given = f"{place}, fx, fy, fz, w.goal_spread, w.goal_behind, w.goal_radius, {travel}"
        lines += [f"g = {build.source.name(goals.herd)}({given})"]
    else:
        lines += [f"g = {build.source.name(goals.pursue)}({place}, w.goal_radius, {travel})"]
    lines += [f"aim[{c}] = g[{c}]" for c in range(3)]
    lines += branch("g.reached > HALF", ["reached[number] = time", "aim[3] += ONE"])
    build.function("aim_(time, elapsed, n, work, row, scene)", lines, "return 0")


def appear(build: Builder) -> None:
    """Function appear_(time, n, work, row, scene): what is due stands from now on, as soon as nobody is in its place.

    A shape waits until every agent is at start.clearance from its bounds, as nobody builds onto a drone in flight.
    """
    axes = build.plan.axes
    lines = [*build.records("w"), *parts("shapes", "later"), *build.bind(axes)]
    position = f"x[i], y[i], {build.z('z[i]')}"
    beside = build.source.name(bvh.beside)
    wait = branch(f"{beside}({position}, later, r) <= w.clearance * w.clearance", ["free = False"])
    put = ["shape = int(later[r, 7]); later[r, 6] = -ONE", *loop("c in range(6)", ["shapes[shape, c] = later[r, c]"])]
    due = ["free = True", *loop("i in range(n)", wait), *branch("free", put)]
    lines += loop("r in range(len(later))", branch("(later[r, 6] >= ZERO) and (later[r, 6] <= time)", due))
    build.function("appear_(time, n, work, row, scene)", lines, "return 0")


def glide(build: Builder) -> None:
    """Function glide_(time, n, work, row, scene): each agent's own goal on its way from where the agent started.

    aim[3] keeps how long all are under way, s: the longest way at goals.speed, which a smooth course exceeds by half.
    """
    axes = build.plan.axes
    lines = [*build.records("w"), *parts("goals", "aim"), *build.bind(axes), *build.order()]
    lines += build.bind([f"{word}_{a}" for word in ("goal", "from") for a in axes])
    square = " + ".join(
        f"(goals[{build.who}, {c}] - {a}[i]) * (goals[{build.who}, {c}] - {a}[i])" for c, a in enumerate(axes)
    )
    begin = [
        "far = ZERO",
        *loop("i in range(n)", [*[f"from_{a}[i] = {a}[i]" for a in axes], f"far = most(far, {square})"]),
    ]
    begin += ["aim[3] = real(1.5) * math.sqrt(far) / w.goal_speed if w.goal_speed > ZERO else ZERO"]
    rule = build.source.name(goals.glide)
    way = [f"goal_{a}[i] = {rule}(from_{a}[i], goals[{build.who}, {c}], time, aim[3])" for c, a in enumerate(axes)]
    lines += [*branch("time <= ZERO", begin), *loop("i in range(n)", way)]
    build.function("glide_(time, n, work, row, scene)", lines, "return 0")
