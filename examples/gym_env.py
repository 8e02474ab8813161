"""Learn to flock: a small network, the same for all drones, trained by CMA-ES. `pip install 'airflock[learn]'`.

Each candidate flies two flights of one vector environment, all candidates at once. What an agent observes becomes ten
numbers in axes along and to the left of its velocity; the network answers with the velocity that it wants.
"""

import sys

import cma
import numpy as np

import airflock.learn

SCENARIO = {"agents": 10, "duration": 60.0, "world.side": 120.0}
SPEED, FASTEST, LENGTH = 4.0, 6.0, 40.0  # m/s; m/s; m
HIDDEN, INPUTS = 8, 10
SIZE = HIDDEN * INPUTS + 2 * (HIDDEN + 1)
AHEAD = np.eye(SIZE)[-2]  # the search begins here: all fly on at SPEED
EAST_NORTH = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])  # of every second ray of eight


def inputs(parts):
    """Inputs of each agent, and the rotation into its axes; parts: `Percepts`, (flight, agent, ...).

    Its speed; means of offsets and of relative velocities, a push from the near, one from near walls; and 1.
    """
    speed = np.linalg.norm(parts.velocity, axis=-1, keepdims=True)
    along = np.where(speed > 1e-3, parts.velocity / np.maximum(speed, 1e-3), EAST_NORTH[0])
    turn = np.stack([along, along[..., ::-1] * [-1.0, 1.0]], axis=-2)  # rows: along, to the left
    square = (parts.offset**2).sum(axis=-1)
    near = (parts.heard * (square <= LENGTH**2))[..., None]
    count = np.maximum(near.sum(axis=-2), 1.0)
    vectors = [
        (near * parts.offset).sum(axis=-2) / count / LENGTH,
        -LENGTH * (near * parts.offset / np.maximum(square, 1e-6)[..., None]).sum(axis=-2),
        (near * parts.closing).sum(axis=-2) / count / SPEED,
        -np.maximum(1.0 - parts.free[..., ::2] / LENGTH, 0.0) @ EAST_NORTH,
    ]
    own = [np.einsum("...ij,...j->...i", turn, vector) for vector in vectors]
    return np.concatenate([speed / SPEED, *own, np.ones_like(speed)], axis=-1), turn


def layers(weights):
    """The two layers of each network, (flight, input, output); the last input of each is 1."""
    first = weights[:, : HIDDEN * INPUTS].reshape(-1, INPUTS, HIDDEN)
    return first, weights[:, HIDDEN * INPUTS :].reshape(-1, HIDDEN + 1, 2)


def as_law(weights):
    """The same network as numbers of the law `network`, whose inputs ours are; a flat one sees and wants nothing up."""
    first, last = (layer[0] for layer in layers(weights[None]))
    hidden, wanted = np.zeros((HIDDEN, 18)), np.zeros((3, HIDDEN))
    hidden[:, [2, 3, 4, 6, 7, 9, 10, 12, 13]], wanted[:2] = first[:-1].T, last[:-1].T
    return airflock.network_weights([(hidden, first[-1]), (wanted, [*last[-1], 0.0])])


def act(weights, parts):
    """Commands of all agents, (flight, agent, axis), by the weights of each flight, (flight, SIZE)."""
    seen, turn = inputs(parts)
    first, last = layers(weights)
    wanted = SPEED * (np.tanh(seen @ first) @ last[:, :-1] + last[:, None, -1])
    wanted *= np.minimum(1.0, FASTEST / np.maximum(np.linalg.norm(wanted, axis=-1, keepdims=True), 1e-6))
    return np.einsum("...ij,...i->...j", turn, wanted)  # back to east and north


def fly(envs, weights, seed):
    """Fitness of one episode of each flight."""
    _, info = envs.reset(seed=seed)
    over = np.zeros(1, bool)
    while not over.all():
        actions = act(weights, envs.episodes.flights.percepts)
        _, _, ended, cut, info = envs.step(actions.astype(np.float32))
        over = ended | cut
    return info["fitness"]


def train(seed=1, generations=30, candidates=16, flights=2):
    """Return the weights that CMA-ES ends with."""
    envs = airflock.learn.make_vec("vasarhelyi_2018/4ms", candidates * flights, settings=SCENARIO)
    search = cma.CMAEvolutionStrategy(AHEAD, 0.5, {"popsize": candidates, "seed": seed, "verbose": -9})
    for generation in range(generations):
        found = np.array(search.ask())
        fitness = fly(envs, np.repeat(found, flights, axis=0), 1000 * generation).reshape(-1, flights).mean(axis=1)
        search.tell(found, -fitness)
        if generation % 10 == 9:
            print(f"generation {generation + 1}: mean fitness {fitness.mean():.3f}, best {fitness.max():.3f}")
    return search.result.xfavorite


if __name__ == "__main__":
    best = train(generations=int(sys.argv[1]) if len(sys.argv) > 1 else 30)
    tests = airflock.learn.make_vec("vasarhelyi_2018/4ms", 10, settings=SCENARIO)
    draws = np.random.default_rng(1).normal(AHEAD, 0.5, (10, SIZE))
    for name, weights in {"random": draws, "trained": np.tile(best, (10, 1))}.items():
        print(f"{name}: fitness of ten new flights {np.round(fly(tests, weights, 10**6), 3)}")
    scenario = airflock.load("vasarhelyi_2018/4ms", {**SCENARIO, "model.weights": as_law(best)}, law="network")
    scores = airflock.score(scenario, seeds=range(10**6, 10**6 + 10))
    print(f"as the law `network`: fitness {scores['fitness'].mean():.3f}, phi_vel {scores['phi_vel'].mean():.2f} m/s")
