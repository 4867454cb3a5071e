"""Springs, damping, friction and limits of the turn of a body against another about an axis, or of its way along one.

Of the bodies A and B, or of the world as A, A has the axis a, and either has a direction across it, p_A and p_B, which
were one at the start. With b = a × p_A and the points X + ρ of both that were one,

    turn  q = atan2(p_B·b, p_B·p_A)        way  q = a·(X_B + ρ_B − X_A − ρ_A)

Whole turns are those nearest to q at the end of the last step, which is kept in `Problem.memory`. The potential of q is

    ½ k (q − q̄)²                                       spring
    K x³/(6 w) to x = w, then K (x²/2 − w x/2 + w²/6)   limits, at x > 0 beyond one: twice continuously differentiable
    ½ c h v²,  M h f₀(|v|)                              damping and friction, v = (q − q°)/h, see `contact.friction_law`

so a moment M at a limit turns it beyond by M/K + w/2, w a thousandth of the range. The largest x at the end of a step
is kept, and told. The friction does not depend on what the joint bears. Over a stage q advances as positions do, from
an origin of its own, like strains of viscosity (`forces.viscosity`): so integrators keep their order.

Derivatives. With W′ and W″ of all these, the gradient is W′ ∇q and the Hessian W″ ∇q ∇qᵀ + W′ ∇²q. Vectors u of A and v
of B turn by u → u + φ×u + ½ φ×(φ×u), see `forces.joints`, so that the product c = u·v has

    ∂c/∂φ_A = u×v,  ∂c/∂φ_B = v×u,  ∂²c: T(u, v) for (φ_A, φ_A) and (φ_B, φ_B),  (u·v) 1 − v uᵀ for (φ_A, φ_B)

and of the turn, with x = p_B·p_A, y = p_B·b and r² = x² + y²

    ∇q = (x ∇y − y ∇x)/r²,   ∇²q = (x ∇²y − y ∇²x)/r² + [2xy (∇x∇xᵀ − ∇y∇yᵀ) + (y² − x²)(∇x∇yᵀ + ∇y∇xᵀ)]/r⁴.

a·ρ_A is a constant. So of the way, with n = X_B + ρ_B − X_A,

    ∂q/∂(X_A, φ_A, X_B, φ_B) = (−a, a×n, a, ρ_B×a)
    ∂²q: (φ_A, φ_A) T(a, n),  (φ_B, φ_B) T(ρ_B, a),  (φ_A, X_A) −[a]×,  (φ_A, X_B) [a]×,  (φ_A, φ_B) (a·ρ_B) 1 − ρ_B aᵀ.
"""

from __future__ import annotations

import math

import numpy as np

from bilayer_core.contact.friction_law import friction_over_speed, friction_potential, friction_slope
from bilayer_core.forces.joint_stiffness import across, scatter_pair, stiffness_of_joints
from bilayer_core.jit import kernel, piece
from bilayer_core.jit.called import stack_matrix, stack_vector
from bilayer_core.kinematics.vector import cross, dot
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.free_motions import WORLD
from bilayer_core.model.model import Model
from bilayer_core.model.records.parts import Mechanisms
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Stage

JOINTS, FRICTION = map(slot_of, ("joints", "joint friction"))
TWO_PI = 2.0 * math.pi
REMEMBERED = 2
"""Values of each in memory: q, and the largest distance beyond a limit."""
MARGIN = 1e-3
"""Of the range between limits, over which a limit comes in: w."""
BOUNDLESS = 1e300
"""Where a limit is that is not there."""


@kernel
def turned(rotation, b, local, k):
    """Return R r of a body, as a tuple."""
    x, y, z = local[k, 0], local[k, 1], local[k, 2]
    return (
        rotation[b, 0, 0] * x + rotation[b, 0, 1] * y + rotation[b, 0, 2] * z,
        rotation[b, 1, 0] * x + rotation[b, 1, 1] * y + rotation[b, 1, 2] * z,
        rotation[b, 2, 0] * x + rotation[b, 2, 1] * y + rotation[b, 2, 2] * z,
    )


@kernel
def _value(mechanisms, at, k, before):
    """Return q, with the whole turns nearest to a value before."""
    a, b = mechanisms.body[2 * k], mechanisms.body[2 * k + 1]
    axis = turned(at.rotation, a, mechanisms.axis, k)
    if mechanisms.slides[k]:
        first, second = turned(at.rotation, a, mechanisms.arm, 2 * k), turned(at.rotation, b, mechanisms.arm, 2 * k + 1)
        way = 0.0
        for c in range(3):
            apart = (at.pose_position[b, c] - at.pose_position[a, c]) + (second[c] - first[c])
            way += axis[c] * apart
        return way
    mark, other = turned(at.rotation, a, mechanisms.mark, 2 * k), turned(at.rotation, b, mechanisms.mark, 2 * k + 1)
    angle = math.atan2(dot(other, cross(axis, mark)), dot(other, mark))
    return angle + TWO_PI * math.floor((before - angle) / TWO_PI + 0.5)


@kernel
def measure_mechanisms(p, at, strain_out):
    """Write q of all, after strains and gaps (`viscosity.measure_strains`, `restitution.measure_gaps`)."""
    mechanisms = p.mechanisms
    for k in range(mechanisms.slides.shape[0]):
        before = p.memory[mechanisms.memory[0] + REMEMBERED * k]
        strain_out[mechanisms.first + k] = _value(mechanisms, at, k, before)


@kernel
def remember_mechanisms(p, at, memory):
    """Write q of all, and how far they have been beyond a limit, into the memory of forces."""
    mechanisms = p.mechanisms
    for k in range(mechanisms.slides.shape[0]):
        slot = mechanisms.memory[0] + REMEMBERED * k
        q = _value(mechanisms, at, k, memory[slot])
        beyond = max(mechanisms.lower[k] - q, q - mechanisms.upper[k])
        memory[slot], memory[slot + 1] = q, max(memory[slot + 1], beyond)


@kernel
def add_product(u, v, factor, hessian):
    """Add a multiple of the second derivatives of u·v by (φ_A, φ_B), rows and columns 3 and 9 on, shape (12, 12)."""
    product = dot(u, v)
    for i in range(3):
        for j in range(3):
            both = 0.5 * factor * (u[i] * v[j] + v[i] * u[j])
            hessian[3 + i, 3 + j] += both
            hessian[9 + i, 9 + j] += both
            hessian[3 + i, 9 + j] -= factor * v[i] * u[j]
            hessian[9 + j, 3 + i] -= factor * v[i] * u[j]
        hessian[3 + i, 3 + i] -= factor * product
        hessian[9 + i, 9 + i] -= factor * product
        hessian[3 + i, 9 + i] += factor * product
        hessian[9 + i, 3 + i] += factor * product


@kernel
def _add_turn(mechanisms, at, k, slope, slope_of_slope, with_hessian, gradient, hessian):
    """Write ∇q of a turn, shape (12,), and if asked for add W″ ∇q ∇qᵀ + W′ ∇²q, shape (12, 12)."""
    a, b = mechanisms.body[2 * k], mechanisms.body[2 * k + 1]
    axis, p = turned(at.rotation, a, mechanisms.axis, k), turned(at.rotation, a, mechanisms.mark, 2 * k)
    v = turned(at.rotation, b, mechanisms.mark, 2 * k + 1)
    side = cross(axis, p)
    x, y = dot(v, p), dot(v, side)
    square = x * x + y * y
    of_x, of_y = cross(p, v), cross(side, v)
    for c in range(3):
        gradient[c] = gradient[6 + c] = 0.0
        gradient[3 + c] = (x * of_y[c] - y * of_x[c]) / square
        gradient[9 + c] = -gradient[3 + c]
    if not with_hessian:
        return
    for i in range(3):
        for j in range(3):
            bend = 2.0 * x * y * (of_x[i] * of_x[j] - of_y[i] * of_y[j])
            bend += (y * y - x * x) * (of_x[i] * of_y[j] + of_y[i] * of_x[j])
            value = slope_of_slope * gradient[3 + i] * gradient[3 + j] + slope * bend / (square * square)
            hessian[3 + i, 3 + j] += value
            hessian[9 + i, 9 + j] += value
            hessian[3 + i, 9 + j] -= value
            hessian[9 + i, 3 + j] -= value
    add_product(side, v, slope * x / square, hessian)
    add_product(p, v, -slope * y / square, hessian)


@kernel
def add_way(at, a, b, axis, arm, slope, slope_of_slope, with_hessian, gradient, hessian):
    """Write ∇q of a way, shape (12,), and if asked for add W″ ∇q ∇qᵀ + W′ ∇²q, shape (12, 12).

    Parameters
    ----------
    at : Configuration
    a, b : int
        The bodies.
    axis, arm : Array or tuple
        a, and ρ_B [m], shape (3,).
    slope, slope_of_slope : float
        W′ [N] and W″ [N/m].
    """
    x, y = at.pose_position[a], at.pose_position[b]
    n = (y[0] - x[0] + arm[0], y[1] - x[1] + arm[1], y[2] - x[2] + arm[2])
    of_a, of_b = cross(axis, n), cross(arm, axis)
    for c in range(3):
        gradient[c], gradient[3 + c] = -axis[c], of_a[c]
        gradient[6 + c], gradient[9 + c] = axis[c], of_b[c]
    if not with_hessian:
        return
    for i in range(12):
        for j in range(12):
            hessian[i, j] += slope_of_slope * gradient[i] * gradient[j]
    along, by_arm = dot(axis, n), dot(axis, arm)
    for i in range(3):
        for j in range(3):
            hessian[3 + i, 3 + j] += 0.5 * slope * (axis[i] * n[j] + n[i] * axis[j])
            hessian[9 + i, 9 + j] += 0.5 * slope * (axis[i] * arm[j] + arm[i] * axis[j])
            hessian[3 + i, 9 + j] -= slope * arm[i] * axis[j]
            hessian[9 + j, 3 + i] -= slope * arm[i] * axis[j]
        hessian[3 + i, 3 + i] -= slope * along
        hessian[9 + i, 9 + i] -= slope * by_arm
        hessian[3 + i, 9 + i] += slope * by_arm
        hessian[9 + i, 3 + i] += slope * by_arm
        j, m = (i + 1) % 3, (i + 2) % 3  # [a]× has −a_m at (i, j) and a_j at (i, m)
        for column, sign in ((0, -slope), (6, slope)):
            hessian[3 + i, column + j] -= sign * axis[m]
            hessian[column + j, 3 + i] -= sign * axis[m]
            hessian[3 + i, column + m] += sign * axis[j]
            hessian[column + m, 3 + i] += sign * axis[j]


@kernel
def limit_energy(beyond, stiffness, margin):
    """Return W(x), W′ and W″ of a limit."""
    if beyond <= 0.0:
        return 0.0, 0.0, 0.0
    if beyond < margin:
        slope = stiffness * beyond / margin
        return slope * beyond * beyond / 6.0, 0.5 * slope * beyond, slope
    energy = stiffness * (0.5 * beyond * (beyond - margin) + margin * margin / 6.0)
    return energy, stiffness * (beyond - 0.5 * margin), stiffness


@piece(float, Mechanisms, Problem, Configuration, Stage, bool)
def add_mechanisms(mechanisms, p, at, stage, with_hessian):
    """Add the energy and derivatives of springs, limits, damping and friction."""
    sums, h, own = p.sums, stage.length, mechanisms.gradient
    own[:] = 0.0
    mechanisms.in_limits[0], mechanisms.limit_slope[:] = 0.0, 0.0
    conserved, resists = sums.selected[JOINTS], sums.selected[FRICTION]
    if not (conserved or resists):
        return math.inf
    gradient, hessian = stack_vector(12), stack_matrix(12, 12)
    energy = dissipated = lost = 0.0
    for k in range(mechanisms.slides.shape[0]):
        q = _value(mechanisms, at, k, p.memory[mechanisms.memory[0] + REMEMBERED * k])
        mechanisms.value[k] = q
        a, b = mechanisms.body[2 * k], mechanisms.body[2 * k + 1]
        slope = slope_of_slope = 0.0
        if conserved:
            stretch = q - mechanisms.rest[k]
            energy += 0.5 * mechanisms.spring[k] * stretch * stretch
            slope, slope_of_slope = mechanisms.spring[k] * stretch, mechanisms.spring[k]
            above = limit_energy(q - mechanisms.upper[k], mechanisms.limit_stiffness[k], mechanisms.margin[k])
            below = limit_energy(mechanisms.lower[k] - q, mechanisms.limit_stiffness[k], mechanisms.margin[k])
            energy += above[0] + below[0]
            mechanisms.in_limits[0] += above[0] + below[0]
            mechanisms.limit_slope[k] = above[1] - below[1]
            slope += mechanisms.limit_slope[k]
            slope_of_slope += above[2] + below[2]
        if resists:
            rate = (q - stage.origin_strain[mechanisms.first + k]) / h
            speed, friction, threshold = abs(rate), mechanisms.friction[k], mechanisms.threshold[k]
            dissipated += h * 0.5 * mechanisms.damping[k] * rate * rate
            dissipated += h * friction * friction_potential(speed, threshold)
            resistance = mechanisms.damping[k] + friction * friction_over_speed(speed, threshold)
            lost += resistance * rate * rate
            slope += resistance * rate
            slope_of_slope += (mechanisms.damping[k] + friction * friction_slope(speed, threshold)) / h
        if with_hessian:
            hessian[:] = 0.0
        if mechanisms.slides[k]:
            axis, arm = turned(at.rotation, a, mechanisms.axis, k), turned(at.rotation, b, mechanisms.arm, 2 * k + 1)
            add_way(at, a, b, axis, arm, slope, slope_of_slope, with_hessian, gradient, hessian)
        else:
            _add_turn(mechanisms, at, k, slope, slope_of_slope, with_hessian, gradient, hessian)
        for c in range(6):
            own[2 * k, c], own[2 * k + 1, c] = slope * gradient[c], slope * gradient[6 + c]
            sums.contact[a, c] += own[2 * k, c]
            sums.contact[b, c] += own[2 * k + 1, c]
        if with_hessian:
            scatter_pair(mechanisms.free[2 * k], mechanisms.free[2 * k + 1], hessian, sums.body_hessian)
    sums.energy[JOINTS] += energy
    sums.energy[FRICTION], sums.lost[FRICTION] = dissipated, lost
    return math.inf


@piece(int, Mechanisms, Problem, Configuration, Stage)
def end_mechanisms(mechanisms, p, at, stage):
    """Remember the end of a step."""
    remember_mechanisms(p, at, p.memory)
    return READY


def memory_at(mechanisms: Mechanisms, first: int) -> Mechanisms:
    """Return the record with its memory beginning at slot `first` of `Problem.memory`."""
    if mechanisms.exists:
        mechanisms.memory[:] = first
    return mechanisms


def mechanisms_record(model: Model) -> Mechanisms:
    """Return the record of a model; absent if nothing is resisted."""
    found, bodies = model.mechanisms, model.bodies
    if not found:
        return Mechanisms.absent()
    places = {WORLD: len(bodies.names)} | {name: index for index, name in enumerate(bodies.names)}
    body = np.array([[places[m.first], places[m.second]] for m in found])
    position = np.vstack([bodies.start_position, np.zeros(3)])[body]  # (n, 2, 3)
    rotation = np.concatenate([bodies.start_rotation, np.eye(3)[None]])[body]  # (n, 2, 3, 3)
    axis = np.array([m.axis for m in found])
    marks = np.array([across(m.axis) for m in found])
    edge, bend = stiffness_of_joints(model)
    laws = [m.law for m in found]
    limits = np.array([law.limits or (-BOUNDLESS, BOUNDLESS) for law in laws])
    usual = [edge if m.slides else bend for m in found]

    def of(name: str) -> np.ndarray:
        return np.array([getattr(law, name) for law in laws], dtype=float)

    return Mechanisms(
        first=model.strain_count + len(model.impact_pairs),
        memory=np.zeros(1, dtype=np.int64),
        slides=np.array([m.slides for m in found]),
        body=body.reshape(-1),
        free=model.free_bodies.free_index[body].reshape(-1),
        arm=np.einsum("ksij,ksi->ksj", rotation, np.array([m.point for m in found])[:, None] - position).reshape(-1, 3),
        axis=np.einsum("kij,ki->kj", rotation[:, 0], axis),
        mark=np.einsum("ksij,ki->ksj", rotation, marks).reshape(-1, 3),
        spring=of("spring"),
        rest=of("rest"),
        damping=of("damping"),
        friction=of("friction"),
        threshold=of("friction_speed"),
        lower=limits[:, 0].copy(),
        upper=limits[:, 1].copy(),
        limit_stiffness=np.array([law.limit_stiffness or least for law, least in zip(laws, usual, strict=True)]),
        margin=MARGIN * (limits[:, 1] - limits[:, 0]),
        value=np.zeros(len(found)),
        limit_slope=np.zeros(len(found)),
        in_limits=np.zeros(1),
        gradient=np.zeros((2 * len(found), 6)),
    )
