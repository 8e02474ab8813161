"""Bodies and wind: what lies between a command and a motion."""
