"""
Colours by heading
==================

If all fly equally fast, as the particles of Vicsek et al. (1995) do, colours can show their headings. Two pictures
stand side by side in one figure: each takes the axes that it is drawn into.
"""

import matplotlib.pyplot as plt

import airflock

figure = plt.figure(figsize=(11, 4.6), layout="constrained")
for axes, preset in zip(figure.subplots(1, 2), ("vicsek_1995/ordered", "vicsek_1995/transition"), strict=True):
    airflock.plot(preset, seed=1, settings={"duration": 60.0}, ax=axes)
