"""Layer 3: trajectories as labelled datasets, simulated or flown, and their scores."""
