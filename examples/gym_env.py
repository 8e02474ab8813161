"""A Gymnasium environment: a policy flies one drone of a flock, the others fly their law. `pip install gymnasium`.

Observation: own velocity, then offset and velocity of the nearest five whom it hears (m, m/s; else zeros). Action: the
velocity that it wants, in parts of FASTEST. Reward: -1 to 1 for flying as the flock does, -10 nearer than `r_coll`.
"""

import gymnasium
import numpy as np

import airflock

NEAREST, FASTEST = 5, 8.0  # drones; m/s


class FlockMember(gymnasium.Env):
    """Drone 0 of a scenario in a plane whose law commands a velocity."""

    def __init__(self, scenario="vasarhelyi_2018/4ms", settings=None):
        self.scenario = airflock.load(scenario, settings)
        self.period = self.scenario.sensors.period  # s between two decisions
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (2 + 4 * NEAREST,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)

    def reset(self, *, seed=None, options=None):
        """Begin a flight anew; the same seed is the same flight to the bit."""
        super().reset(seed=seed)
        self.flight = airflock.open(self.scenario, seed=int(self.np_random.integers(2**32)))
        return self._perceived(), {}

    def step(self, action):
        """Overrule the drone's own law until its next decision."""
        self.flight.sense().command(0, FASTEST * np.asarray(action, float)).advance(self.period)
        x, v = np.split(self.flight.state.astype(float), 2)
        apart = np.linalg.norm(x[:, 1:] - x[:, :1], axis=0).min()
        hit = bool(apart < self.scenario.metrics.r_coll)
        mean = v[:, 1:].mean(axis=1)
        along = float(v[:, 0] @ mean / max(np.linalg.norm(v[:, 0]) * np.linalg.norm(mean), 1e-9))
        return self._perceived(), -10.0 if hit else along, hit, self.flight.over, {"apart": apart}

    def _perceived(self):
        view = self.flight.look(0)
        own, others = view.own, [heard.state for heard in view.heard]
        rows = [[s.x - own.x, s.y - own.y, s.vx - own.vx, s.vy - own.vy] for s in others]
        near = sorted(rows, key=lambda row: np.hypot(row[0], row[1]))[:NEAREST]
        seen = np.zeros(2 + 4 * NEAREST, np.float32)
        seen[:2], seen[2 : 2 + 4 * len(near)] = (own.vx, own.vy), np.ravel(near)
        return seen


if __name__ == "__main__":
    env = FlockMember(settings={"agents": 20, "duration": 20.0, "world.side": 120.0})
    env.reset(seed=1)
    env.action_space.seed(1)
    rewards, hit, over = [], False, False
    while not hit and not over:
        _, reward, hit, over, _ = env.step(env.action_space.sample())
        rewards.append(reward)
    print(
        f"random actions: mean reward {np.mean(rewards):.3f}; the flock: phi_vel {env.flight.scores()['phi_vel']:.3f}"
    )
