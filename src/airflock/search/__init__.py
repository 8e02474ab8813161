"""Search: evolve, harden and tune the numbers of a flock."""
