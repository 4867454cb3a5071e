"""Searches for the pattern with which a robot takes wanted shapes.

A wanted shape is a curve (`target_curve`), what may vary are numbers of the scene and profiles along a rod (`varied`).
A `shaped_rod` is in equilibrium with some values. `shape_search` goes from equilibrium to equilibrium by the
Gauss–Newton method, `shape_report` tells what came of it, and `design_files` writes that.
"""
