"""Searches for the pattern with which a robot takes wanted shapes.

A wanted shape is a curve (`target_curve`), what may vary are numbers of the scene and profiles along a rod (`varied`).
`shape_search` goes from equilibrium to equilibrium by the Gauss–Newton method, and `design_files` writes what it found.
"""
