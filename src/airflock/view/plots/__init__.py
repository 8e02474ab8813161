"""Plots as functions: each returns a figure, without pyplot, so that threads and notebooks may draw side by side."""

from airflock.view.order_parameter_plots import flocked, heatmap, rotations, series, transfer
from airflock.view.plot_by_kind import KINDS, plot
from airflock.view.result_plots import received, stood
from airflock.view.rules_plot import rules, wash
from airflock.view.search_plots import convergence, fitness_scatter, pareto, slices
from airflock.view.style import save_figure
from airflock.view.trajectory_plots import rays, through, trajectories

__all__ = [
    "KINDS", "convergence", "fitness_scatter", "flocked", "heatmap", "pareto", "plot", "rays", "received",
    "rotations", "rules", "save_figure", "series", "slices", "stood", "through", "trajectories", "transfer", "wash",
]  # fmt: skip
