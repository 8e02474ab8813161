"""Certificates: what flights show of a limit, and checks of what was shown."""
