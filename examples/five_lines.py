"""Fly, score and look at a published flock in five lines."""

import airflock

scenario = airflock.load("vasarhelyi_2018/4ms", {"duration": 60.0})
table = airflock.score(scenario, seeds=4)
recording = airflock.simulate(scenario, seed=0)
print(table[["phi_vel", "phi_corr", "r_min_mean", "fitness"]].describe().loc[["mean", "std"]].round(3))
print(recording.position.sizes)
