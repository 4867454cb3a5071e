"""Runs as quantities over time: recorded, read, compared, exported."""
