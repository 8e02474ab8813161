"""Our readers."""
