"""Layer 2: scenarios and presets: everything about a flight but the seed."""
