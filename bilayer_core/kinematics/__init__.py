"""Geometry of edges and their material frames."""
