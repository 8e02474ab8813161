"""Trajectories as labelled datasets, simulated or flown, and their scores."""
