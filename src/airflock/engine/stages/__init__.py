"""The stages of a step as plain Python: loops and memory, never an equation."""
