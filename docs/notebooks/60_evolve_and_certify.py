"""
Evolve, make safe, certify
==========================

An optimum is the best on average. Before it flies, ask how often it goes wrong, trade some of its fitness for
distance, and ask again.
"""

import tempfile
from pathlib import Path

import pandas as pd

import airflock

study = Path(tempfile.mkdtemp()) / "study"  # for real work choose a lasting folder: a study can be continued in it

# %%
# Evolve
# ------
# Twenty drones with half a second of delay. Four gains vary; the seeds of the search are its own.
scenario = airflock.load("vasarhelyi_2018/6ms", {"agents": 20, "duration": 120.0, "delay": "500 ms"})
space = {
    "model": {
        "r0_rep": {"low": 10.0, "high": 60.0},
        "p_rep": {"low": 0.0, "high": 0.5},
        "r0_frict": {"low": 0.0, "high": 150.0},
        "c_frict": {"low": 0.0, "high": 0.5},
    }
}
few = {"population": 24, "generations": 20, "pool": 24, "top": 4, "final_seeds": 30}
result = airflock.evolve(scenario, study, space=space, **few)
print(f"fitness {result.fitness:.3f} on fresh seeds")
pd.DataFrame({"optimum": result.parameters, "working range": result.ranges})

# %%
table = pd.read_csv(study / "evaluations.csv")
figure = airflock.plots.convergence(table[table["stage"] == "search"], "fitness", what="four gains, 20 drones")
figure

# %%
# How safe is it?
# ---------------
# Not "no collision in ten flights" but a statement with a confidence: two drones come closer than 5 m in fewer than 2 %
# of flights. The seeds follow from the scenario, so nobody can choose lucky ones, and every look is paid for.
limit = "r_min<5 at 2%"
print(*airflock.certify(study / "best.toml", limit, flights=400).statements, sep="\n")

# %%
# Trade fitness for distance
# --------------------------
# This is the authors' recipe from optimum to outdoor flights, step by step on the same seeds. A step stays if it gains
# distance, costs little fitness, and breaks nothing that held; the result is flown again on fresh seeds.
steps = airflock.harden(study / "best.toml", range(40))
pd.DataFrame([step.as_dict() for step in steps])[["name", "fitness", "r_min", "cost", "verdict"]].round(3)

# %%
# So ask the same question of the result. The certificate also says how far the delay may grow while the statement is
# still shown.
safer = airflock.load(study / "best.toml", dict(steps[-1].parameters))
certificate = airflock.certify(safer, limit, flights=400, tolerance=["radio.delay"])
certificate.save("certificate.toml")
print(*certificate.statements, sep="\n")
pd.DataFrame(certificate.tolerance["axis"])[["key", "unit", "nominal", "safe", "not_shown"]].round(2)

# %%
# What was shown, and what was not
# --------------------------------
# "Not shown" does not mean that the flock is worse than the limit: 400 flights may be too few. Even without a single
# event, they still allow one in 0.75 % of flights. And all this holds for the scenario as it is: no faults, no wind,
# no person at the transmitter.
#
# `airflock certify certificate.toml --check` flies a part of it again, on any machine, and computes all bounds anew.
