"""Layer 2: what lies between a wish and a motion: body, sensors, radio, wind."""
