"""Figures and video, without pyplot, so that threads and notebooks may draw side by side."""

from airflock.plots.convergence import convergence
from airflock.plots.display import stood
from airflock.plots.fitness_scatter import fitness_scatter
from airflock.plots.flocked import flocked
from airflock.plots.heatmap import heatmap
from airflock.plots.pareto import pareto
from airflock.plots.picture import KINDS, plot
from airflock.plots.rays import rays
from airflock.plots.reception import received
from airflock.plots.rules import rules
from airflock.plots.save import save_figure
from airflock.plots.scene_paths import through
from airflock.plots.series import rotations, series
from airflock.plots.slices import slices
from airflock.plots.trajectories import trajectories
from airflock.plots.transfer import transfer
from airflock.plots.wash import wash

__all__ = [
    "KINDS", "convergence", "fitness_scatter", "flocked", "heatmap", "pareto", "plot", "rays", "received",
    "rotations", "rules", "save_figure", "series", "slices", "stood", "through", "trajectories", "transfer", "wash",
]  # fmt: skip
