"""Order of a flock: polarisation, milling, speed and shape. Our choice."""

METRICS = ["speed", "polarisation", "milling", "shape"]
