"""The boids of `gpu.py` written in JAX as its users would: cells by sorting, one expression per row of cells.

    python benchmarks/boids_jax.py [--agents 2000] [--steps 10]

flies the printed equations of Zapotecatl et al. 2016 (Eqs 2-12) in a periodic cube beside Airflock's CPU engine from
the same start and prints the largest difference. Needs JAX (`pip install jax`), which Airflock itself does not.
"""

import argparse
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from airflock.scenarios.scenario import Scenario

MARGIN = 1.3  # room for candidates beyond the longest run at the start; flights that outgrow it are flown anew


def missing() -> str | None:
    """Why there is no JAX here, as one line; None if there is."""
    try:
        import jax  # noqa: F401
    except ImportError as fault:
        return f"JAX cannot be imported ({fault}); pip install jax, with its CUDA plugin for a GPU"
    return None


def devices() -> list[str]:
    """Kinds of devices that JAX computes on."""
    import jax

    return [device.platform for device in jax.devices()]


class Boids:
    """One flock: positions x and velocities v (agent, 3) in m and m/s, and the number of each agent, in cell order."""

    def __init__(self, scenario: Scenario, x: Any, v: Any, bits: int = 32):
        import jax
        import jax.numpy as jnp

        if bits == 64:
            jax.config.update("jax_enable_x64", True)
        real = jnp.float32 if bits == 32 else jnp.float64
        p, world = scenario.parameters, scenario.world
        assert p.form == "printed" and world.edges == "periodic" and world.side == world.height
        self.p, self.b, self.box, self.dt = p, scenario.body.numbers, float(world.side), float(scenario.flight.dt)
        self.count = int(self.box / scenario.model.reach(p))
        assert self.count >= 3, "a cell must not be its own neighbour"
        self.x, self.v = jnp.asarray(x, real), jnp.asarray(v, real)
        self.number = jnp.arange(len(self.x))
        self.width = 0
        self._widen()

    def _widen(self) -> None:
        """Room for the candidates of one row of cells, and the program for it."""
        import jax

        longest = int(jax.jit(self._longest)(self.x))
        self.width = -(-int(MARGIN * longest) // 4) * 4
        self.program = jax.jit(self._fly, static_argnums=3)

    def _cells(self, x: Any) -> Any:
        import jax.numpy as jnp

        inside = (x + 0.5 * self.box) * (self.count / self.box)
        return jnp.clip(jnp.floor(inside).astype(jnp.int32), 0, self.count - 1)

    def _starts(self, key: Any) -> Any:
        """First agent of every cell."""
        import jax.numpy as jnp

        return jnp.searchsorted(key, jnp.arange(self.count**3 + 1, dtype=key.dtype)).astype(jnp.int32)

    def _key(self, cell: Any) -> Any:
        return (cell[:, 2] * self.count + cell[:, 1]) * self.count + cell[:, 0]

    def _runs(self, cell: Any, starts: Any, dy: int, dz: int) -> tuple[Any, Any, Any]:
        """Candidates in three cells along x: they lie side by side, or in two pieces across a face of the box."""
        import jax.numpy as jnp

        c = self.count
        line = (((cell[:, 2] + dz) % c) * c + (cell[:, 1] + dy) % c) * c
        low, high = jnp.maximum(cell[:, 0] - 1, 0), jnp.minimum(cell[:, 0] + 2, c)
        first, length = starts[line + low], starts[line + high] - starts[line + low]
        other = jnp.where(cell[:, 0] == 0, c - 1, 0)
        across = (cell[:, 0] == 0) | (cell[:, 0] == c - 1)
        more = jnp.where(across, starts[line + other + 1] - starts[line + other], 0)
        return first, length, (starts[line + other], more)

    def _longest(self, x: Any) -> Any:
        import jax.numpy as jnp

        cell = self._cells(x)
        starts = self._starts(jnp.sort(self._key(cell)))
        found = []
        for dz in (-1, 0, 1):
            for dy in (-1, 0, 1):
                _, length, (_, more) = self._runs(cell, starts, dy, dz)
                found.append((length + more).max())
        return jnp.stack(found).max()

    def _step(self, state: Any) -> Any:
        import jax.numpy as jnp

        p, b, dt = self.p, self.b, self.dt
        x, v, number, over = state
        key = self._key(self._cells(x))
        order = jnp.argsort(key)
        x, v, number, key = x[order], v[order], number[order], key[order]
        cell, starts = self._cells(x), self._starts(key)
        k = jnp.arange(self.width, dtype=jnp.int32)[None, :]
        own = jnp.arange(len(x), dtype=jnp.int32)[:, None]
        cohesion, separation, alignment = jnp.zeros_like(x), jnp.zeros_like(x), jnp.zeros_like(x)
        near_c, near_a = jnp.zeros_like(x[:, 0]), jnp.zeros_like(x[:, 0])
        for dz in (-1, 0, 1):
            for dy in (-1, 0, 1):
                first, length, (other, more) = self._runs(cell, starts, dy, dz)
                over = over | ((length + more).max() > self.width)
                j = jnp.where(k < length[:, None], first[:, None] + k, other[:, None] + k - length[:, None])
                there = (k < (length + more)[:, None]) & (j != own)
                j = jnp.clip(j, 0, len(x) - 1)
                d = x[j] - x[:, None, :]
                d = d - self.box * jnp.round(d / self.box)
                r2 = (d * d).sum(axis=2)
                c, s, a = (there & (r2 <= r * r) for r in (p.r_c, p.r_s, p.r_a))
                cohesion += jnp.where(c[..., None], d, 0.0).sum(axis=1)
                separation -= jnp.where(s[..., None], d, 0.0).sum(axis=1)
                alignment += jnp.where(a[..., None], v[j] - v[:, None, :], 0.0).sum(axis=1)
                near_c, near_a = near_c + c.sum(axis=1), near_a + a.sum(axis=1)
        force = p.w_s * separation
        force += (p.w_c / jnp.maximum(near_c, 1.0))[:, None] * cohesion
        force += (p.w_a / jnp.maximum(near_a, 1.0))[:, None] * alignment
        v = _shorten(v + _shorten(force, p.f_m) / p.m_b * dt, b.speed_max)
        x = x + v * dt
        return x - self.box * jnp.floor(x / self.box + 0.5), v, number, over

    def _fly(self, x: Any, v: Any, number: Any, steps: int) -> Any:
        import jax

        return jax.lax.fori_loop(0, steps, lambda _, state: self._step(state), (x, v, number, False))

    def advance(self, steps: int) -> None:
        """Fly this many steps, and wait until they are flown."""
        while True:
            x, v, number, over = self.program(self.x, self.v, self.number, steps)
            if not bool(over):  # waits
                self.x, self.v, self.number = x, v, number
                return
            self.width *= 2
            self._again()

    def _again(self) -> None:
        import jax

        self.program = jax.jit(self._fly, static_argnums=3)

    def state(self) -> np.ndarray[Any, Any]:
        """(component, agent) positions and velocities by the agents' numbers."""
        found = np.zeros((6, len(self.x)), np.asarray(self.x).dtype)
        number = np.asarray(self.number)
        found[:3, number], found[3:, number] = np.asarray(self.x).T, np.asarray(self.v).T
        return found


def _shorten(u: Any, longest: float) -> Any:
    """Vectors no longer than `longest`."""
    import jax.numpy as jnp

    length = jnp.sqrt((u * u).sum(axis=1, keepdims=True) + 1e-12)
    return u * jnp.minimum(1.0, longest / length)


def random_start(scenario: Scenario, seed: int) -> np.ndarray[Any, Any]:
    """(component, agent) random places in the cube, start speed in random directions."""
    draw = np.random.default_rng(seed)
    n, half = scenario.agents, 0.5 * scenario.world.side
    v = draw.normal(size=(3, n))
    return np.concatenate([draw.uniform(-half, half, (3, n)), scenario.start.speed * v / np.linalg.norm(v, axis=0)])


def difference(settings: Callable[[int], dict[str, Any]], agents: int, steps: int, seed: int = 1) -> float:
    """Largest difference (m, m/s) to Airflock's CPU engine after some steps from one start, in double precision."""
    from airflock.engine import fly_world
    from airflock.scenarios.files import load

    keys = settings(agents)
    found = load("zapotecatl_2016/literal", {**keys, "duration": steps * keys["dt"]})
    start = random_start(found, seed)
    boids = Boids(found, start[:3].T, start[3:].T, bits=64)
    boids.advance(steps)
    return float(np.abs(boids.state() - fly_world(found, 0, precision=64, start=start).state).max())


if __name__ == "__main__":
    from gpu import crowd_settings

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agents", type=int, default=2000)
    parser.add_argument("--steps", type=int, default=10)
    given = parser.parse_args()
    if missing():
        sys.exit(f"boids_jax: {missing()}")
    apart = difference(crowd_settings, given.agents, given.steps)
    print(f"{given.agents} boids, {given.steps} steps, float64: {apart:.2g} m apart at most on {', '.join(devices())}")
    sys.exit(0 if apart < 1e-9 else 1)
