"""Rods, bodies, clamps and joints by name, as they are at present."""
