"""Layer 2: one publication per file."""
