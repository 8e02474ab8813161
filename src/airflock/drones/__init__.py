"""Drones: what runs on board, and the bytes that it exchanges with autopilots."""
