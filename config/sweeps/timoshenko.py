"""Bilayer strips of other moduli and thicknesses, and how far they curl up."""

THICKNESS = 2e-3
"""Of both layers together [m]."""


def change(content, parameters):
    """Set E₂ = m E₁ and h₂ = n h₁ of the lower layer (2) and the upper one (1), which grows.

    Thickness h₁ + h₂ and modulus E₁ stay the same.
    """
    lower, upper = content["rods"][0]["layers"]
    materials = content["materials"]
    upper["thickness"] = THICKNESS / (1.0 + parameters["n"])
    lower["thickness"] = THICKNESS - upper["thickness"]
    materials["passive"]["youngs_modulus"] = parameters["m"] * materials["active"]["youngs_modulus"]
    return content


def curvature(run):
    """Return κ (h₁ + h₂)/η in the middle of the strip at rest, where η is the growth of the upper layer."""
    run.simulator.solve_static()  # what still swings a little comes to rest
    strip, layer = run.simulator.rods["strip"], run.simulator.scene.rods[0].layers[1]
    return -float(strip.curvature[len(strip.curvature) // 2]) * THICKNESS / layer.eigenstrain[0].gain


def timoshenko(run):
    """Return the same curvature by the formula (Timoshenko 1925)."""
    m, n = run.parameters["m"], run.parameters["n"]
    return 6.0 * (1.0 + n) ** 2 / (3.0 * (1.0 + n) ** 2 + (1.0 + m * n) * (n**2 + 1.0 / (m * n)))


def error(run):
    """Return the relative difference of the two curvatures."""
    return curvature(run) / timoshenko(run) - 1.0
