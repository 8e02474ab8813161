"""Replay: a recording as one HTML file that plays in any browser, from disk and in notebooks."""
