"""Layer 1: aerodynamics as plain scalar text."""
