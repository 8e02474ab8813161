"""Layer 2: order parameters and fitness, one notion per file."""
