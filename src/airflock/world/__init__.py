"""Layer 2: scalar geometry of arena and obstacles."""
