"""
Extension and polarization of boids
===================================

The boids of Reynolds (1987) in the pond of Zapotecatl et al. (2016): how the flock draws together and aligns.
"""

import matplotlib.pyplot as plt

import airflock

recording = airflock.simulate("zapotecatl_2016/best", seed=1)
course = airflock.over_time(recording)

figure = plt.figure(figsize=(7, 4), layout="constrained")
top, below = figure.subplots(2, sharex=True)
top.plot(course.index, 100.0 * course["extension"])
top.set_ylabel("extension, cm")
below.plot(course.index, course["polarization"] * 57.29577951)
below.set(xlabel="time, s", ylabel="polarization, deg")
