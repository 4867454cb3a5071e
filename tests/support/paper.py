"""The paper's method and step, for bundled scenes whose own is the default."""

from bilayer_core.verification.validate.parts import PAPER

TWO_RODS = "solver.model=two_rod"
PAPERS = tuple(f"solver.{key}={value}" for key, value in PAPER.items())
"""Changes to a scene."""
