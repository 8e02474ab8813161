"""
Birds in each other's upwash
============================

Every bird feels its induced drag and slides down its slope (Dimock and Selig 2003). Each line is a wing seen from
above, flying to the right, at the beginning and at the end of the flight.
"""

from matplotlib.figure import Figure

import airflock

scenario = airflock.load("dimock_2003/physical", {"agents": 7, "duration": 30.0})
recording = airflock.simulate(scenario, seed=2)
half = 0.5 * scenario.wing.span

figure = Figure(figsize=(6, 5), layout="constrained")
for axes, instant in zip(figure.subplots(1, 2, sharex=True, sharey=True), (0, -1), strict=True):
    at = recording.isel(time=instant, keypoint=0)
    x, y = at.position.values[:2]
    axes.plot([x, x], [y - half, y + half], color="C0", lw=3)
    axes.set(title=f"{float(at.time):.0f} s", xlabel="m", ylabel="m", aspect="equal")
