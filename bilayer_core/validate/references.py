"""Answers: closed forms, solutions of differential equations, least energies. Nothing here calls the simulator."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp
from scipy.optimize import brentq, minimize

EULER_FREE_END = math.pi**2 / 4.0
"""P L²/EI at which a column with one free end buckles."""
GREENHILL = 7.837347
"""q L³/EI at which a column buckles under its own weight q per length (Greenhill 1881): 9/4 j², J_{−1/3}(j) = 0."""
FIRST_MODE = 1.875104
"""k L of a cantilever's slowest vibration, ω = k² √(EI/ρA): the first root of cos x cosh x = −1."""


def timoshenko(m: float, n: float) -> float:
    """κH/η of a bilayer whose top layer grows, m = E₂/E₁, n = h₂/h₁ (bottom over top); Timoshenko 1925."""
    return 6 * (1 + n) ** 2 / (3 * (1 + n) ** 2 + (1 + m * n) * (n**2 + 1 / (m * n)))


def timoshenko_as_printed(m: float, n: float) -> float:
    """The paper's equation 30, in which the two ratios have changed places."""
    return timoshenko(n, m)


def bonded_bending_stiffness(moduli: tuple[float, float], thickness: tuple[float, float], width: float) -> float:
    """EI of a bonded bilayer about its neutral axis [N m²]; bottom, then top."""
    areas = [e * width * h for e, h in zip(moduli, thickness, strict=True)]
    own = sum(e * width * h**3 / 12.0 for e, h in zip(moduli, thickness, strict=True))
    arm = 0.5 * sum(thickness)
    return own + areas[0] * areas[1] / (areas[0] + areas[1]) * arm**2


def strip_torsion(shear_moduli: tuple[float, float], thickness: tuple[float, float], width: float) -> dict[str, float]:
    """GJ [N m²] of two layers in a bonded strip: `layers`, the sum of their own (Roark's rectangle, h ≤ w), and
    `laminate`, with Bredt's circulation through the bond.
    """
    own = sum(g * width * h**3 / 3.0 * (1.0 - 0.63 * h / width) for g, h in zip(shear_moduli, thickness, strict=True))
    shears = [g * h for g, h in zip(shear_moduli, thickness, strict=True)]
    arm = 0.5 * sum(thickness)
    bond = 4.0 * width * shears[0] * shears[1] / sum(shears) * arm**2
    return {"layers": own, "laminate": own + bond}


def heavy_cantilever(weight: float, bending: float, axial: float, length: float) -> np.ndarray:
    """Tip (x, z) [m] of a horizontal extensible elastica, clamped at the origin, under its own weight.

    With s the rest length, θ the slope, ε the strain:  EA ε = −q (L − s) sin θ,
    EI θ'' = q (1 + ε) (L − s) cos θ,  θ(0) = 0,  θ'(L) = 0;  solved by collocation.

    Parameters
    ----------
    weight, bending, axial, length : float
        q [N/m], EI [N m²], EA [N], L [m].
    """

    def strain(s, theta):
        return -weight * (length - s) * np.sin(theta) / axial

    def slope(s, y):
        theta, curvature = y[0], y[1]
        stretch = 1.0 + strain(s, theta)
        turning = weight * (length - s) * np.cos(theta) * stretch / bending
        return np.array([curvature, turning, stretch * np.cos(theta), stretch * np.sin(theta)])

    def ends(start, end):
        return np.array([start[0], end[1], start[2], start[3]])

    s = np.linspace(0.0, length, 201)
    guess = np.zeros((4, 201))
    guess[0], guess[2] = -1.2 * s / length, s
    solution = solve_bvp(slope, ends, s, guess, tol=1e-10, max_nodes=100000)
    return solution.y[2:, -1]


@cache
def bonded_helix(curvature: float, twist: float, tilt: float) -> tuple[float, float]:
    """Radius and pitch [m] of a layer with natural curvature χ̄ and twist τ̄ [1/m] bonded on a straight one.

    Least energy per length over strain ε, curvature χ and twist τ of the curve midway between the layers, whose own
    centrelines stand z = ±c/2 over it: a = 1 + ε − z χ, b = z τ, ε_l = √(a² + b²) − 1, ψ = atan2(b, a),
    χ_l = χ cos ψ − τ sin ψ, τ_l = τ cos ψ + χ sin ψ,

        Σ ½ EA ε_l² + ½ EI (χ_l − χ̄_l)² + ½ GJ (τ_l − τ̄_l)²  +  ½ k_φ (ψ₁ − ψ₂)²

    Two layers of 10 mm × 1 mm, E 100 MPa, ν 0.5; `tilt` is k_φ [N].
    """
    e, g, w, h = 1e8, 1e8 / 3.0, 0.01, 1e-3
    area, bending = e * w * h, e * w * h**3 / 12.0
    torsion = g * w * h**3 / 3.0 * (1.0 - 0.63 * h / w)

    def energy(unknowns):
        strain, chi, tau = unknowns[0] * 1e-3, unknowns[1] * abs(curvature), unknowns[2] * abs(twist)
        total, angles = 0.0, []
        for z, own_curvature, own_twist in ((0.5 * h, curvature, twist), (-0.5 * h, 0.0, 0.0)):
            a, b = 1.0 + strain - z * chi, z * tau
            angle = math.atan2(b, a)
            bent = chi * math.cos(angle) - tau * math.sin(angle) - own_curvature
            twisted = tau * math.cos(angle) + chi * math.sin(angle) - own_twist
            total += 0.5 * (area * (math.hypot(a, b) - 1.0) ** 2 + bending * bent**2 + torsion * twisted**2)
            angles.append(angle)
        total += 0.5 * tilt * (angles[0] - angles[1]) ** 2
        return total / (torsion * twist**2)

    best = minimize(
        energy,
        [0.0, 0.2, 0.3],
        method="Nelder-Mead",
        options={"xatol": 1e-10, "fatol": 1e-16, "maxiter": 20000, "maxfev": 20000},
    )
    stretch, chi, tau = 1.0 + best.x[0] * 1e-3, best.x[1] * abs(curvature), best.x[2] * abs(twist)
    rate2 = chi**2 + tau**2
    return stretch * abs(chi) / rate2, 2.0 * math.pi * stretch * abs(tau) / rate2


def oblique_slide(force: tuple[float, float], coefficients: tuple[float, float], g: float, time: float) -> np.ndarray:
    """Velocity [m/s] after `time` [s] from rest of a block on a plane that a force per mass [m/s²] drives against
    friction whose coefficients differ along x and y: v̇_i = f_i − g μ_i² v_i/√(Σ μ² v²).
    """
    squares = np.square(coefficients)

    def acceleration(_, v):
        return np.array(force) - g * squares * v / math.sqrt(squares @ np.square(v))

    start = 1e-6 * np.array(force)
    return solve_ivp(acceleration, (1e-6, time), start, rtol=1e-9, atol=1e-12).y[:, -1]


def end_loaded_cantilever(load: float, follower: bool) -> np.ndarray:
    """Tip (x, z)/L of an inextensible cantilever along x under a force F L²/EI = `load` at its end: along z, or, as a
    `follower`, along its normal there.

    Seen from the tip, θ'' = −F cos(θ − θ_F) with θ' = 0 there, and θ = 0 at the wall.
    """

    def from_tip(angle: float, of_force: float) -> np.ndarray:
        def change(_, y):
            return [y[1], -load * np.cos(y[0] - of_force), np.cos(y[0]), np.sin(y[0])]

        return solve_ivp(change, (0.0, 1.0), [angle, 0.0, 0.0, 0.0], rtol=1e-10, atol=1e-12).y[:, -1]

    if follower:  # turned as a whole: the angle at the tip is minus that found at the wall
        angle = -from_tip(0.0, 0.0)[0]
        return from_tip(angle, angle)[2:]
    angle = brentq(lambda tip: from_tip(tip, 0.0)[0], 0.0, 1.5)
    return from_tip(angle, 0.0)[2:]


def kirchhoff_plate(velocity: tuple[float, float], own: float, whole: float, moment: float, time: float) -> float:
    """Angle [rad] to which a rigid plate turns that is thrown aslant into a perfect fluid at rest (Lamb 1932, ch. VI).

    In its plane of motion, with u along the plate, v across it, m its own mass and n that with the fluid it takes
    along:  m u̇ = n ω v,  n v̇ = −m ω u,  I ω̇ = −(n − m) u v,  θ̇ = ω.

    Parameters
    ----------
    velocity : tuple of float
        u and v at the start [m/s].
    own, whole, moment : float
        m [kg], n [kg], I with the fluid [kg m²].
    time : float
        [s]
    """

    def rate(_, y):
        u, v, omega, _ = y
        return [whole * omega * v / own, -own * omega * u / whole, -(whole - own) * u * v / moment, omega]

    return float(solve_ivp(rate, (0.0, time), [*velocity, 0.0, 0.0], rtol=1e-10, atol=1e-12).y[3, -1])


@dataclass(frozen=True)
class StickSlip:
    """A mass on a belt that travels a given distance and stops (cubic smoothstep), held by a spring from rest on.

    Attributes
    ----------
    mass, stiffness : float
        [kg], [N/m]
    coefficient, threshold : float
        μ and ε_v [m/s].
    normal_force, amplitude, period : float
        N = normal_force + amplitude sin(2π t/period) [N], [s].
    travel, duration : float
        Of the belt [m], [s].
    """

    mass: float
    stiffness: float
    coefficient: float
    threshold: float
    normal_force: float
    amplitude: float
    period: float
    travel: float
    duration: float


def stick_slip(p: StickSlip, times: np.ndarray) -> np.ndarray:
    """Displacements of the mass [m] at some times [s]."""

    def rate(t: float, y: np.ndarray) -> list[float]:
        part = t / p.duration
        slip = 6.0 * p.travel * part * (1.0 - part) / p.duration - y[1]
        w = min(abs(slip) / p.threshold, 1.0)
        force = p.normal_force + p.amplitude * math.sin(2.0 * math.pi * t / p.period)
        friction = p.coefficient * force * math.copysign(w * (2.0 - w), slip)
        return [y[1], (friction - p.stiffness * y[0]) / p.mass]

    solved = solve_ivp(
        rate, (0.0, p.duration), [0.0, 0.0], "Radau", t_eval=times, rtol=1e-10, atol=1e-13, max_step=1e-3 * p.duration
    )
    return solved.y[0]
