"""Runs: many flights for one purpose in one folder: store, resume, executors."""
