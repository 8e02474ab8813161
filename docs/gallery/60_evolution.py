"""
A small evolution
=================

Two gains of a flock, searched by CMA-ES for a few generations: the fitness of each candidate.
"""

import tempfile

import pandas as pd

import airflock

scenario = airflock.load("vasarhelyi_2018/4ms", {"agents": 20, "duration": 60.0})
space = {"model": {"p_rep": {"low": 0.0, "high": 1.0}, "c_frict": {"low": 0.0, "high": 0.5}}}
few = {"population": 16, "generations": 8, "pool": 8, "top": 2, "final_seeds": 8}
with tempfile.TemporaryDirectory() as folder:
    result = airflock.evolve(scenario, f"{folder}/study", space=space, **few)
    table = pd.read_csv(f"{folder}/study/evaluations.csv")
print(f"fitness {result.fitness:.3f} with", {name: round(value, 3) for name, value in result.parameters.items()})

# %%
# Grey is the effect of luck alone: one candidate is flown once, and a flight's fitness has a spread.
search = table[table["stage"] == "search"]
figure = airflock.plots.convergence(search, "fitness", what="a small evolution")
figure
