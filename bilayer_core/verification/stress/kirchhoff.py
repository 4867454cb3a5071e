"""A cantilever of an inextensible Kirchhoff rod under a force at its tip, in space: a reference without the simulator.

    r′ = t,   R′ = R [ω]×,   ω = K⁻¹ Rᵀ ((r(L) − r) × F) + κ₀

with R = (t, m1, m2), m1 through the thickness and m2 = t × m1, K = (GJ, EI of m1, EI of m2) and κ₀ the curvature free
of stress, along t, m1 and m2. Curvature through the thickness, m1 · t′, is the component along m2.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

from bilayer_core.scene.config import SceneConfig
from bilayer_core.verification.validate.closed_forms import strip_torsion

Array = np.ndarray
LOAD_STEPS = 6
"""In which the force is brought on, so that the right one of several shapes is found."""


def stiffness(scene: SceneConfig) -> Array:
    """Return GJ, and EI about the normal and across it [N m²] of the first rod, of one layer, shape (3,)."""
    rod = scene.rods[0]
    layer, width = rod.layers[0], rod.width
    material = scene.materials[layer.material]
    shear = material.youngs_modulus / (2.0 * (1.0 + material.poisson_ratio))
    half = 0.5 * layer.thickness
    torsion = strip_torsion((shear, shear), (half, half), width)["laminate"]
    moduli = material.youngs_modulus * layer.thickness * width / 12.0
    return np.array([torsion, moduli * width**2, moduli * layer.thickness**2])


def loaded_tip(force: Array, k: Array, free: Array, length: float, start: Array, place: float) -> tuple[Array, Array]:
    """Return where the tip goes [m], shape (3,), and the frame (t, m1, m2) at a place along the rod, as columns.

    Parameters
    ----------
    force : Array
        F [N], shape (3,).
    k : Array
        GJ and the two EI [N m²], shape (3,).
    free : Array
        κ₀ [1/m], shape (3,).
    length : float
        [m]
    start : Array
        Frame of the clamped end, at the origin, shape (3, 3).
    place : float
        [m]

    Raises
    ------
    ArithmeticError
        If no equilibrium is found.
    """

    def swept(tip: Array, load: Array, until: float = length) -> Array:
        def rates(_: float, y: Array) -> Array:
            frame = y[3:].reshape(3, 3)
            a, b, c = frame.T @ np.cross(tip - y[:3], load) / k + free
            spin = np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]])
            return np.concatenate([frame[:, 0], (frame @ spin).ravel()])

        begin = np.concatenate([np.zeros(3), start.ravel()])
        return solve_ivp(rates, (0.0, until), begin, method="DOP853", rtol=1e-9, atol=1e-11 * length).y[:, -1]

    tip = swept(np.zeros(3), np.zeros(3))[:3]
    for part in np.linspace(0.0, 1.0, LOAD_STEPS + 1)[1:]:
        load = part * force
        found = root(lambda x, load=load: (swept(x, load)[:3] - x) / length, tip, tol=1e-9)
        if not found.success:
            raise ArithmeticError(f"no equilibrium at {part:.3g} of the force: {found.message}")
        tip = found.x
    return tip, swept(tip, force, place)[3:].reshape(3, 3)


def cantilever(scene: SceneConfig) -> tuple[Array, Array]:
    """Return where the tip of a scene goes that has one rod, straight or an arc, from the origin, and one load at its
    end [m]; and the frame in the middle of the last edge.
    """
    rod, load = scene.rods[0], scene.loads[0]
    path = rod.path
    along, normal = np.array(path.direction), np.array(rod.normal)
    curvature = 0.0
    if path.shape == "arc":
        curvature = (1.0 if path.toward == "normal" else -1.0) / path.radius
    start = np.stack([along, normal, np.cross(along, normal)], axis=1)
    free = np.array([0.0, 0.0, curvature])
    return loaded_tip(
        np.array(load.force), stiffness(scene), free, path.length, start, path.length - 0.5 * rod.edge_length
    )


def angle_between(first: Array, last: Array) -> float:
    """Return the angle between two unit vectors [rad]."""
    return 2.0 * math.asin(min(1.0, 0.5 * float(np.linalg.norm(first - last))))
