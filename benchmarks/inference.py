"""Which law made the tracks? Recordings by plain NumPy that shares no text with the engine, judged in one table.

    python benchmarks/inference.py FOLDER [--set development|judging|walks] [--first 0] [--count 30]
        [--naming | --alone] [--topologies metric,nearest]

A seed draws everything: the law (Vicsek, Couzin, boids, Vásárhelyi with lag, alignment with the 7 nearest), its
numbers, individuals, frames, rate, size, tracking error, gaps and entries. Seeds of `judging` are never used to
develop; `walks` are individuals that go about by themselves, half of them in a dish that is known. One line of JSON
per recording in FOLDER; goes on where it stopped. `--naming` names the law and stops before the intervals;
`--alone` offers nothing but the law that made the tracks: its intervals alone.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
import xarray as xr

import airflock
from airflock.estimate.inference import law_inference

SETS = {"development": 0, "judging": 1000, "walks": 2000}
FAMILIES = ("vicsek", "couzin", "boids", "vasarhelyi", "nearest")
OFF, FINE = 1e-12, 5  # steps of the motion between decisions


def lengths(d):
    """Distances of offsets (individual, individual, axis), of oneself never zero."""
    return np.sqrt((d**2).sum(axis=2)) + OFF


def headings(angle):
    """Unit vectors (individual, axis)."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def turn_to(angle, wanted, most):
    """Turn by at most so much (rad) towards the wanted direction (individual, axis)."""
    off = (np.arctan2(wanted[:, 1], wanted[:, 0]) - angle + np.pi) % (2.0 * np.pi) - np.pi
    return angle + np.clip(off, -most, most)


def aligned(g, n, frames, period, size, nearest):
    """Vicsek et al. 1995 in a periodic square, by radius or with the k nearest; turns are not limited."""
    k, eta, speed = int(g.integers(5, 9)), g.uniform(0.3, 1.2), size * g.uniform(0.5, 1.5)
    radius = size * g.uniform(1.0, 2.5)
    side = radius * np.sqrt(n * np.pi / g.uniform(3.0, 6.0))
    x, angle = g.uniform(-0.5 * side, 0.5 * side, (n, 2)), g.uniform(-np.pi, np.pi, n)
    out = np.zeros((frames, n, 2))
    for frame in range(-50, frames):
        if frame >= 0:
            out[frame] = x
        d = x[None] - x[:, None]
        r = lengths(d - side * np.round(d / side))
        near = r <= np.sort(r, axis=1)[:, k, None] if nearest else r <= radius
        wanted = near @ headings(angle)
        angle = np.arctan2(wanted[:, 1], wanted[:, 0]) + eta * (g.random(n) - 0.5)
        x = x + speed * period * headings(angle)
        x -= side * np.floor(x / side + 0.5)
    truth = {"body.speed": speed, "model.eta": eta} | ({"topology.k": k} if nearest else {"model.r": radius})
    return out, truth, {"world.arena": "square", "world.side": float(side), "world.edges": "periodic"}


def couzin(g, n, frames, period, size):
    """Couzin et al. 2002 in the open."""
    r_r, dr_o, dr_a = size, size * g.uniform(0.5, 6.0), size * g.uniform(6.0, 12.0)
    fov, sigma, speed = g.uniform(220.0, 360.0), g.uniform(0.03, 0.15), size * g.uniform(1.0, 4.0)
    turn = g.uniform(0.7, 3.0)
    x, angle = size * g.normal(0.0, 0.6 * np.sqrt(n), (n, 2)), g.uniform(-np.pi, np.pi, n)
    out, others = np.zeros((frames, n, 2)), ~np.eye(n, dtype=bool)
    for frame in range(-50, frames):
        if frame >= 0:
            out[frame] = x
        d, h = x[None] - x[:, None], headings(angle)
        r = lengths(d)
        towards = d / r[:, :, None]
        seen = others & ((d * h[:, None]).sum(axis=2) >= np.cos(np.radians(0.5 * fov)) * r)
        close = others & (r < r_r)
        along, apart = seen & (r >= r_r) & (r < r_r + dr_o), seen & (r >= r_r + dr_o) & (r < r_r + dr_o + dr_a)
        wanted = along @ h + (apart[:, :, None] * towards).sum(axis=1)
        wanted = np.where(close.any(axis=1)[:, None], -(close[:, :, None] * towards).sum(axis=1), wanted)
        length = np.linalg.norm(wanted, axis=1, keepdims=True)
        wanted = np.where(length > 1e-9, wanted / np.maximum(length, 1e-9), h) + sigma * g.normal(size=(n, 2))
        for _ in range(FINE):
            angle = turn_to(angle, wanted, turn * period / FINE)
            x = x + speed * period / FINE * headings(angle)
    truth = {"model.r_r": r_r, "model.dr_o": dr_o, "model.dr_a": dr_a, "model.fov_deg": fov, "model.sigma": sigma}
    return out, truth | {"body.speed": speed, "body.turn": turn}, {}


def unit(v):
    """Unit vectors (individual, axis), zero where nothing is summed."""
    return v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), OFF)


def shorten(v, most):
    """Vectors (individual, axis) of at most this length."""
    return v * np.minimum(1.0, most / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), OFF))


def boids(g, n, frames, period, size):
    """Boids as the program of Zapotecatl et al. 2016 has them, in the open; gusts push each by itself."""
    r_s, r_a, r_c = size * g.uniform(1.0, 2.0), size * g.uniform(2.5, 5.0), size * g.uniform(8.0, 15.0)
    w_c, w_s, w_a = size * g.uniform(1.0, 3.0), size * g.uniform(3.0, 5.0), size * g.uniform(0.5, 2.0)
    most, fastest, push = size * g.uniform(3.0, 8.0), size * g.uniform(2.0, 4.0), size * g.uniform(0.02, 0.06)
    x = size * g.normal(0.0, 0.5 * np.sqrt(n), (n, 2))
    v, smooth = size * g.normal(size=(n, 2)), np.zeros((n, 2))
    k = min(max(9.0 * period, 0.15), 0.4)
    out, others = np.zeros((frames, n, 2)), ~np.eye(n, dtype=bool)
    for frame in range(-100, frames):
        if frame >= 0:
            out[frame] = x
        d = x[None] - x[:, None]
        r = lengths(d)
        pull = ((others & (r <= r_c))[:, :, None] * d).sum(axis=1)
        away = -((others & (r <= r_s)) / r**2)[:, :, None] * d
        match = ((others & (r <= r_a))[:, :, None] * (v[None] - v[:, None])).sum(axis=1)
        force = shorten(w_c * unit(pull) + w_s * unit(away.sum(axis=1)) + w_a * unit(match), most)
        smooth = smooth + k * (force - smooth)
        for _ in range(FINE):
            v = shorten(v + period / FINE * smooth + push / np.sqrt(FINE) * g.normal(size=(n, 2)), fastest)
            x = x + period / FINE * v
    truth = {"model.r_s": r_s, "model.r_a": r_a, "model.r_c": r_c, "model.w_c": 100.0 * w_c, "model.w_s": 100.0 * w_s}
    return out, truth | {"model.w_a": 100.0 * w_a, "model.f_m": most, "body.speed_max": fastest}, {}


def brake(room, a, p):
    """Speed (m/s) at which one may still stop, `room` (m) before the place: linear near it, then a root."""
    room = np.maximum(room, 0.0)
    return np.where(p * room < a / p, p * room, np.sqrt(np.maximum(2.0 * a * room - (a / p) ** 2, 0.0)))


def vasarhelyi(g, n, frames, period, size):
    """Vásárhelyi et al. 2018 within walls; multirotors with a lag, a limit and noise."""
    flock, r0_rep, p_rep = g.uniform(2.0, 4.0), g.uniform(5.0, 10.0), g.uniform(0.15, 0.5)
    r0_frict, c_frict, v_frict = g.uniform(5.0, 15.0), g.uniform(0.05, 0.2), g.uniform(0.2, 0.6)
    p_frict, a_frict, tau, a_max, noise = g.uniform(1.0, 3.0), g.uniform(1.0, 4.0), g.uniform(0.4, 0.9), 5.0, 0.1
    half, wall, v_wall, p_wall, a_wall = 30.0, 1.0, 8.0, 2.0, 3.0
    x, v = g.uniform(-20.0, 20.0, (n, 2)), g.normal(0.0, 1.0, (n, 2))
    out, fine = np.zeros((frames, n, 2)), period / FINE
    for frame in range(-100, frames):
        if frame >= 0:
            out[frame] = x
        d, dv = x[None] - x[:, None], v[None] - v[:, None]
        r, faster = lengths(d), lengths(dv)
        away = -p_rep * np.maximum(r0_rep - r, 0.0) / r
        allowed = np.maximum(v_frict, brake(r - r0_frict, a_frict, p_frict))
        pull = c_frict * np.maximum(faster - allowed, 0.0) / faster
        np.fill_diagonal(away, 0.0)
        wanted = flock * unit(v) + (away[:, :, None] * d + pull[:, :, None] * dv).sum(axis=1)
        for axis in range(2):
            side = np.sign(x[:, axis])
            inward = np.zeros((n, 2))
            inward[:, axis] = -side
            gap = half - np.abs(x[:, axis])
            shill = v_wall * inward - v
            size_ = np.linalg.norm(shill, axis=1)
            k = np.maximum(size_ - brake(gap - wall, a_wall, p_wall), 0.0) / size_
            wanted = wanted + k[:, None] * shill
        wanted = flock * unit(wanted)
        for _ in range(FINE):
            v = v + fine * shorten((wanted - v) / tau, a_max) + np.sqrt(2.0 * noise * fine) * g.normal(size=(n, 2))
            x = x + fine * v
    truth = {"model.v_flock": flock, "model.r0_rep": r0_rep, "model.p_rep": p_rep, "model.r0_frict": r0_frict}
    truth |= {"model.c_frict": c_frict, "model.v_frict": v_frict, "body.tau": tau, "body.noise": noise}
    return out, truth, {"world.arena": "square", "world.side": 2.0 * half}


def walk(g, n, frames, period, size):
    """Individuals that turn and change their speed at random; half of the recordings in a dish that is known."""
    turn, change, speed = g.uniform(0.5, 3.0), g.uniform(0.0, 0.1), size * g.uniform(0.5, 3.0)
    dish = size * g.uniform(2.0, 5.0) * np.sqrt(n) if g.random() < 0.5 else np.inf
    radius = min(dish, 3.0 * size * np.sqrt(n))
    angle, x = g.uniform(-np.pi, np.pi, n), headings(g.uniform(-np.pi, np.pi, n)) * radius * np.sqrt(g.random((n, 1)))
    out = np.zeros((frames, n, 2))
    for frame in range(frames):
        out[frame] = x
        angle = angle + turn * np.sqrt(period) * g.normal(size=n)
        step = speed * period * (1.0 + change * g.normal(size=(n, 1))) * headings(angle)
        outside = np.linalg.norm(x + step, axis=1) > dish
        angle = np.where(outside, np.arctan2(-x[:, 1], -x[:, 0]), angle)
        x = x + np.where(outside[:, None], 0.0, step)
    known = {} if np.isinf(dish) else {"world.arena": "circle", "world.radius": float(dish)}
    return out, {}, known


LAWS_OF = {"vicsek": "vicsek_1995", "couzin": "couzin_2002", "boids": "reynolds_1987", "vasarhelyi": "vasarhelyi_2018"}
LAWS_OF["nearest"] = "vicsek_1995, nearest"


def draw(which, number):
    """Return the recording, the law's name (None for walks), its numbers and what is known of the place."""
    g = np.random.default_rng([20_000, SETS[which] + number])
    family = "walk" if which == "walks" else FAMILIES[number % len(FAMILIES)]
    n, frames, rate = int(g.integers(8, 25)), int(g.integers(300, 801)), g.uniform(5.0, 15.0)
    size = 1.0 if family == "vasarhelyi" else 10.0 ** g.uniform(-1.5, 0.5)
    arguments = (g, n, frames, 1.0 / rate, size)
    if family in ("vicsek", "nearest"):
        place, truth, known = aligned(*arguments, family == "nearest")
    else:
        place, truth, known = {"couzin": couzin, "boids": boids, "vasarhelyi": vasarhelyi, "walk": walk}[family](
            *arguments
        )
    place = place + size * g.uniform(0.003, 0.03) * g.normal(size=place.shape)
    place[g.random(place.shape[:2]) < g.uniform(0.0, 0.03)] = np.nan
    if g.random() < 0.3:  # some enter late, some leave early
        for i in g.choice(n, n // 4, replace=False):
            place[(slice(0, frames // 3) if g.random() < 0.5 else slice(-frames // 3, None)), i] = np.nan
    names = {"space": ["x", "y"], "keypoint": ["centroid"], "individual": [f"i{k}" for k in range(n)]}
    coordinates = {"time": np.arange(frames) / rate, **names}
    tracks = xr.Dataset({"position": (tuple(coordinates), place.transpose(0, 2, 1)[:, :, None])}, coordinates)
    return tracks, family, truth, known


def holds(value, low, high):
    """True inside an interval; an end without a limit is open."""
    return (low is None or low <= value) and (high is None or value <= high)


def run(which, number, naming, alone, topologies):
    """One recording as a row."""
    tracks, family, truth, known = draw(which, number)
    began = time.process_time()
    if alone:
        own, *kind = LAWS_OF[family].split(", ")
        result = airflock.infer(tracks, [own], settings=known, topologies=kind or ["metric"], check=0)
    elif naming:
        result = law_inference.name_law(tracks, law_inference.LAWS, known, topologies)[0]
    else:
        result = airflock.infer(tracks, settings=known, topologies=topologies, check=20)
    best = result.best
    row = {"number": number, "family": family, "best": best and best.name, "verdict": result.verdict}
    row["right"] = row["best"] == LAWS_OF.get(family)
    row["laws"] = {
        law.name: [round(law.gain, 1), round(law.error, 1), round(law.ahead, 2), law.by_chance] for law in result.laws
    }
    if best is not None and not naming:
        told = {k: n for k, n in best.numbers.items() if k in truth and not (n.low is None and n.high is None)}
        row["told"] = len(told)
        row["alone"] = sum(holds(truth[k], n.low, n.high) for k, n in told.items())
        row["together"] = all(holds(truth[k], n.least, n.most) for k, n in told.items())
        row["own"] = all(holds(n.value, n.low, n.high) for n in best.numbers.values())
        row["widths"] = [
            float(np.log(n.high / n.low)) for n in told.values() if None not in (n.low, n.high) and n.low > 0.0
        ]
        row["missed"] = [f"{k} = {truth[k]:.4g}: {n.low} to {n.high}" for k, n in told.items()
                         if not holds(truth[k], n.low, n.high)]  # fmt: skip
        row["outside"] = result.check.outside() if result.check else []
    row["seconds"] = round(time.process_time() - began, 1)
    return row


def main():
    """Run what has not been run, then print the table."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("folder", type=Path)
    ask.add_argument("--set", dest="which", choices=SETS, default="development")
    ask.add_argument("--first", type=int, default=0)
    ask.add_argument("--count", type=int, default=30)
    ask.add_argument("--naming", action="store_true")
    ask.add_argument("--alone", action="store_true")
    ask.add_argument("--topologies", default="metric,nearest")
    given = ask.parse_args()
    if given.alone and (given.naming or given.which == "walks"):
        ask.error("--alone is for the intervals of a law: neither with --naming nor for walks")
    given.folder.mkdir(parents=True, exist_ok=True)
    file = given.folder / f"{given.which}{'_naming' * given.naming}{'_alone' * given.alone}.jsonl"
    rows = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    for number in range(given.first, given.first + given.count):
        if all(row["number"] != number for row in rows):
            rows.append(run(given.which, number, given.naming, given.alone, given.topologies.split(",")))
            with file.open("a") as out:
                out.write(json.dumps(rows[-1]) + "\n")
            print(json.dumps(rows[-1]), flush=True)
    print("| law | recordings | named rightly | numbers in intervals | all together | median width | s each |")
    print("|---|---|---|---|---|---|---|")
    for family in dict.fromkeys(row["family"] for row in rows):
        own = [row for row in rows if row["family"] == family]
        full = [row for row in own if row["right"] and "told" in row]
        widths = [w for row in full for w in row["widths"]]
        print(
            f"| {family} | {len(own)} | {sum(row['right'] for row in own)} | {sum(row['alone'] for row in full)} of "
            f"{sum(row['told'] for row in full)} | {sum(row['together'] for row in full)} of {len(full)} | "
            f"{np.median(widths) if widths else np.nan:.2g} | {np.mean([row['seconds'] for row in own]):.0f} |"
        )


if __name__ == "__main__":
    main()
