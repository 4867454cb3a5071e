"""Answers: closed forms, solutions of differential equations, least energies. Nothing here calls the simulator."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp
from scipy.optimize import brentq, minimize, minimize_scalar

EULER_FREE_END = math.pi**2 / 4.0
"""P L²/EI at which a column with one free end buckles."""
GREENHILL = 7.837347
"""q L³/EI at which a column buckles under its own weight q per length (Greenhill 1881): 9/4 j², J_{−1/3}(j) = 0."""
FIRST_MODE = 1.875104
"""k L of a cantilever's slowest vibration, ω = k² √(EI/ρA): the first root of cos x cosh x = −1."""


def timoshenko(m: float, n: float) -> float:
    """Return κH/η of a bilayer whose top layer grows, m = E₂/E₁, n = h₂/h₁ (bottom over top); Timoshenko 1925."""
    return 6 * (1 + n) ** 2 / (3 * (1 + n) ** 2 + (1 + m * n) * (n**2 + 1 / (m * n)))


def timoshenko_as_printed(m: float, n: float) -> float:
    """Return the curvature of the paper's equation 30, which swaps the two ratios."""
    return timoshenko(n, m)


def bending_of_layers(moduli: tuple[float, float], thickness: tuple[float, float], width: float) -> float:
    """Return Σ EA z² of two layers about their common neutral axis [N m²]; bottom, then top."""
    areas = [e * width * h for e, h in zip(moduli, thickness, strict=True)]
    return areas[0] * areas[1] / (areas[0] + areas[1]) * (0.5 * sum(thickness)) ** 2


def bonded_bending_stiffness(moduli: tuple[float, float], thickness: tuple[float, float], width: float) -> float:
    """Return EI of a bonded bilayer about its neutral axis [N m²]; bottom, then top."""
    own = sum(e * width * h**3 / 12.0 for e, h in zip(moduli, thickness, strict=True))
    return own + bending_of_layers(moduli, thickness, width)


def clamped_twist(torque: float, stiffness: float, warping: float, length: float) -> float:
    """Return the angle [rad] between the ends of a rod neither of which may warp: GJ τ − EC_w τ″ = T, τ = 0 there
    (Vlasov).
    """
    decay = math.sqrt(warping / stiffness)
    return torque / stiffness * (length - 2.0 * decay * math.tanh(0.5 * length / decay))


@cache
def strip_torsion(shear_moduli: tuple[float, float], thickness: tuple[float, float], width: float) -> dict[str, float]:
    """Return GJ [N m²] of two layers in a bonded strip: `layers`, the sum of their own, and `laminate`, of the
    section.
    """
    own = sum(_warped_section((g,), (h,), width) for g, h in zip(shear_moduli, thickness, strict=True))
    return {"layers": own, "laminate": _warped_section(shear_moduli, thickness, width)}


def _warped_section(shear_moduli: tuple[float, ...], thickness: tuple[float, ...], width: float) -> float:
    """Return GJ of layers bonded to each other [N m²], from St-Venant's warping ω = y z + Σ g_n(z) sin k_n y, k_n =
    (2n+1)π/w.

    g″ = k² g in each layer; G (g′ + b) with 2 y = Σ b_n sin k_n y is zero at the faces; it and g are continuous between
    layers: a linear system for each n with g = p e^{−k(z − z₀)} + q e^{−k(z₁ − z)} from z₀ to z₁. The sides are free by
    cos(k_n w/2) = 0, and GJ = ∫∫ G [y (2 y + ∂g/∂z) − z ∂g/∂y].
    """
    count, faces, n = len(thickness), np.concatenate([[0.0], np.cumsum(thickness)]), np.arange(8000)
    k, sign = (2 * n + 1) * math.pi / width, (-1.0) ** n
    far = np.exp(-np.multiply.outer(k, thickness))
    system, known = np.zeros((len(n), 2 * count, 2 * count)), np.zeros((len(n), 2 * count))
    for layer, g in enumerate(shear_moduli):
        p, q = 2 * layer, 2 * layer + 1
        low, high = p, q if layer == count - 1 else q + 1  # rows of the stress at its two faces
        for row, side, of_p, of_q in ((low, -1.0, 1.0, far[:, layer]), (high, 1.0, far[:, layer], 1.0)):
            system[:, row, p] -= side * g * k * of_p
            system[:, row, q] += side * g * k * of_q
            known[:, row] -= side * g * 8.0 * sign / (width * k**2)
        if layer > 0:
            system[:, low - 1, p], system[:, low - 1, q] = -1.0, -far[:, layer]
        if layer < count - 1:
            system[:, low + 1, p], system[:, low + 1, q] = far[:, layer], 1.0
    amplitudes = np.linalg.solve(system, known[..., None])[..., 0]
    total = 0.0
    for layer, (g, h, low, high) in enumerate(zip(shear_moduli, thickness, faces[:-1], faces[1:], strict=True)):
        p, q, f = amplitudes[:, 2 * layer], amplitudes[:, 2 * layer + 1], far[:, layer]
        rise = (q - p) * (1.0 - f)  # ∫ g′
        moment = (p * (low - high * f) + q * (high - low * f) - rise / k) / k  # ∫ z g
        # ∫ y sin ky = 2 (−1)ⁿ/k², ∫ k cos ky = 2 (−1)ⁿ
        total += g * (h * width**3 / 6.0 + np.sum(2.0 * sign * (rise / k**2 - moment)))
    return float(total)


def heavy_cantilever(weight: float, bending: float, axial: float, length: float) -> np.ndarray:
    """Return the tip (x, z) [m] of a horizontal extensible elastica, clamped at the origin, under its own weight.

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
def bonded_helix(
    curvature: float,
    twist: float,
    torsion: str,
    moduli: tuple[float, float] = (1e8, 1e8),
    thickness: tuple[float, float] = (1e-3, 1e-3),
) -> tuple[float, float]:
    """Return the radius and pitch [m] of a layer with natural curvature χ̄ and twist τ̄ [1/m] bonded on a straight one.

    Least energy per length over strain ε, curvature χ and twist τ of the layers' common neutral axis, over which their
    own centrelines stand at z: a = 1 + ε − z χ, b = z τ, ε_l = √(a² + b²) − 1, ψ = atan2(b, a),
    χ_l = χ cos ψ − τ sin ψ, τ_l = τ cos ψ + χ sin ψ,

        Σ ½ EA ε_l² + ½ EI (χ_l − χ̄_l)² + ½ GJ (τ_l − τ̄_l)²  +  ½ k_φ (ψ₁ − ψ₂)²

    k_φ = (GJ_lam − ΣGJ)/c² for the `torsion` of the section, c the distance of the centrelines; 0 for `layers`.

    Parameters
    ----------
    moduli, thickness : tuple of float
        E [Pa] and h [m], bottom, then top; ν = 0.5, 10 mm wide.
    """
    width, shears = 0.01, tuple(e / 3.0 for e in moduli)
    arm = 0.5 * sum(thickness)
    gj = [_warped_section((g,), (h,), width) for g, h in zip(shears, thickness, strict=True)]
    whole = strip_torsion(shears, thickness, width)
    tilt = (whole[torsion] - whole["layers"]) / arm**2
    axis = 0.5 * sum(e * h * y for e, h, y in zip(moduli, thickness, (-thickness[0], thickness[1]), strict=True))
    axis /= sum(e * h for e, h in zip(moduli, thickness, strict=True))
    layers = [  # z, EA, EI, GJ and natural shape
        (0.5 * h * sign - axis, e * width * h, e * width * h**3 / 12.0, torsional, *natural)
        for sign, e, h, torsional, natural in zip(
            (-1.0, 1.0), moduli, thickness, gj, ((0.0, 0.0), (curvature, twist)), strict=True
        )
    ]
    scale = gj[1] * twist**2

    def energy(unknowns):
        strain, chi, tau = unknowns[0] * 1e-3, unknowns[1] * abs(curvature), unknowns[2] * abs(twist)
        total, angles = 0.0, []
        for z, area, bending, torsional, own_curvature, own_twist in layers:
            a, b = 1.0 + strain - z * chi, z * tau
            angle = math.atan2(b, a)
            bent = chi * math.cos(angle) - tau * math.sin(angle) - own_curvature
            twisted = tau * math.cos(angle) + chi * math.sin(angle) - own_twist
            total += 0.5 * (area * (math.hypot(a, b) - 1.0) ** 2 + bending * bent**2 + torsional * twisted**2)
            angles.append(angle)
        total += 0.5 * tilt * (angles[0] - angles[1]) ** 2
        return total / scale

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
    """Return the velocity [m/s] after `time` [s] from rest of a block on a plane that a force per mass [m/s²] drives
    against friction whose coefficients differ along x and y: v̇_i = f_i − g μ_i² v_i/√(Σ μ² v²).
    """
    squares = np.square(coefficients)

    def acceleration(_, v):
        return np.array(force) - g * squares * v / math.sqrt(squares @ np.square(v))

    start = 1e-6 * np.array(force)
    return solve_ivp(acceleration, (1e-6, time), start, rtol=1e-9, atol=1e-12).y[:, -1]


def end_loaded_cantilever(load: float, follower: bool) -> np.ndarray:
    """Return the tip (x, z)/L of an inextensible cantilever along x under a force F L²/EI = `load` at its end: along z,
    or, as a `follower`, along its normal there.

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
    """Return the angle [rad] to which a rigid plate turns that is thrown aslant into a perfect fluid at rest (Lamb
    1932, ch. VI).

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
    """A mass on a belt that travels a given distance and stops (cubic smoothstep), held by a spring from rest on."""

    mass: float
    stiffness: float
    """`mass`, `stiffness`: [kg], [N/m]"""
    coefficient: float
    threshold: float
    """`coefficient`, `threshold`: μ and ε_v [m/s]."""
    normal_force: float
    amplitude: float
    period: float
    """`normal_force`, `amplitude`, `period`: N = normal_force + amplitude sin(2π t/period) [N], [s]."""
    travel: float
    duration: float
    """`travel`, `duration`: of the belt [m], [s]."""


def stick_slip(p: StickSlip, times: np.ndarray) -> np.ndarray:
    """Return the displacements of the mass [m] at some times [s]."""

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


def strip_towards_light(angle: float, curvature: float, length: float, strain: float) -> tuple[float, float]:
    """Return the tip of a strip clamped along x that bends away from light by κ₀ max(0, n·l) [m].

    With θ the angle of the tangent and light at `angle` α from the normal, ψ = θ + α has ψ′ = −κ₀ cos ψ, so sin ψ =
    tanh(artanh(sin α) − κ₀ s): it tends to −π/2 and never looks away from the light. Its middle grows by n·l times
    `strain`.
    """

    def direction(s: float, _: np.ndarray) -> np.ndarray:
        theta = math.asin(math.tanh(math.atanh(math.sin(angle)) - curvature * s)) - angle
        return (1.0 + strain * math.cos(theta + angle)) * np.array([math.cos(theta), math.sin(theta)])

    return tuple(solve_ivp(direction, (0.0, length), np.zeros(2), rtol=1e-11, atol=1e-14).y[:, -1])


def lag_behind(seen: Callable[[float], float], lag: float, time: float) -> float:
    """Return y at a time [s] where T y′ = u − y follows u, from where it has settled."""
    found = solve_ivp(lambda t, y: (seen(t) - y) / lag, (0.0, time), [seen(0.0)], rtol=1e-12, atol=1e-14, max_step=1e-3)
    return float(found.y[0, -1])


class PlateStrip:
    """A plate strip solved across its width, in units of E, H and w: curved by r along, it bends across to u(y), which
    stretches its fibres by r (u − mean).

    Attributes
    ----------
    poisson : float
    second, squares : ndarray
        ∫ of u″ of each shape, and ∫ of products of u″ and of u; shapes are even Legendre polynomials.
    """

    def __init__(self, poisson: float, shapes: int = 25):
        self.poisson, self.stiffness_of_plate = poisson, 1.0 / (12.0 * (1.0 - poisson**2))
        basis = [np.polynomial.Legendre.basis(2 * n + 2, domain=(-0.5, 0.5)) for n in range(shapes)]
        points, weights = np.polynomial.legendre.leggauss(2 * shapes + 4)
        values = np.array([[shape(0.5 * points), shape.deriv(2)(0.5 * points)] for shape in basis])
        self.second = values[:, 1] @ (0.5 * weights)
        self.squares = [np.einsum("im,jm,m->ij", own, own, 0.5 * weights) for own in (values[:, 1], values[:, 0])]

    def _moment(self, curvature: float, natural: float) -> tuple[float, float]:
        """Return the energy and the moment ∂U/∂r of a strip with the natural curvature `natural` in all directions."""
        d, change = self.stiffness_of_plate, curvature - natural
        matrix = d * self.squares[0] + curvature**2 * self.squares[1]
        force = d * (natural - self.poisson * change) * self.second
        u = np.linalg.solve(matrix, force)
        energy = 0.5 * d * (change**2 + natural**2 - 2.0 * self.poisson * change * natural) - 0.5 * force @ u
        bent = self.second @ u - natural
        return energy, d * (change + self.poisson * bent) + curvature * u @ self.squares[1] @ u

    def swollen_curvature(self, ratio: float) -> float:
        """Return κ/κ₀ at rest of a strip that swells alike in all directions, by its w²κ₀/H."""
        found = minimize_scalar(
            lambda k: self._moment(k * ratio, ratio)[0] / ratio**2, bounds=(0.6, 1.6), method="bounded"
        )
        return found.x

    def stiffness(self, ratio: float) -> float:
        """Return M/(EI κ) of a straight strip, by its w²κ/H."""
        return 12.0 * self._moment(ratio, 0.0)[1] / ratio
