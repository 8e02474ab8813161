"""Figures and video, without pyplot, so that threads and notebooks may draw side by side."""

from airflock.view.plots.convergence import convergence
from airflock.view.plots.display import stood
from airflock.view.plots.fitness_scatter import fitness_scatter
from airflock.view.plots.flocked import flocked
from airflock.view.plots.heatmap import heatmap
from airflock.view.plots.pareto import pareto
from airflock.view.plots.picture import KINDS, plot
from airflock.view.plots.rays import rays
from airflock.view.plots.reception import received
from airflock.view.plots.rules import rules
from airflock.view.plots.save import save_figure
from airflock.view.plots.scene_paths import through
from airflock.view.plots.series import rotations, series
from airflock.view.plots.slices import slices
from airflock.view.plots.trajectories import trajectories
from airflock.view.plots.transfer import transfer
from airflock.view.plots.wash import wash

__all__ = [
    "KINDS", "convergence", "fitness_scatter", "flocked", "heatmap", "pareto", "plot", "rays", "received",
    "rotations", "rules", "save_figure", "series", "slices", "stood", "through", "trajectories", "transfer", "wash",
]  # fmt: skip
