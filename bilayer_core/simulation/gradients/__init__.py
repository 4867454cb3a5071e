"""Derivatives of equilibria and of runs, by stimuli and by numbers of the scene."""
