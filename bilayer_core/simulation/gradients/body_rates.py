"""Derivatives of what free bodies, and the nodes that they hold, do in a stage.

A body has six unknowns, its motion X and its turn φ, and in place of velocities v and the angular momentum L. With
R̄, L̄ of the origin, h the length of the stage, E = exp(h ω̃), J its left Jacobian there, and I the inertia at R̃ = E R̄,

    I ω̃ = L̄:   (I + h N J) dω̃ = dL̄ − N E dφ̄,   N = I [ω̃]× − [L̄]×,   dφ̃ = E dφ̄ + h J dω̃

and what is held at the arm a = R̃ r has the origin X̄ + (1 − h [ω̃]×) a. Inertia has the moment −ax(A)/(h h′), with
A = R̃ J Rᵀ, and L = L̄ − ax(A)/h at the end (`forces.inertia`, `engine.step_ends`). Origins of later stages follow by
rotation vectors, θ of earlier ones from their origins, as in `engine.stages`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bilayer_core.forces.body_drag import BodyFlow
from bilayer_core.model.records.step import Configuration, Method
from bilayer_core.model.state import State
from bilayer_core.simulation.gradients.entries import Entries
from bilayer_core.simulation.gradients.step_again import (
    StepAgain,
    cross_matrices,
    cross_matrix,
    left_jacobian,
    rotation_of,
)

Array = np.ndarray


def _axial(a: Array) -> Array:
    return np.array([a[2, 1] - a[1, 2], a[0, 2] - a[2, 0], a[1, 0] - a[0, 1]])


class BodyRates:
    """Maps of free bodies in a stage.

    Parameters
    ----------
    again : StepAgain
        At the end of the stage, `at`.
    at : Configuration
    couplings : sequence of float
        Of earlier stages.
    turned : sequence of ndarray
        Rotation vectors from their origins, shapes (n_free, 3).

    Attributes
    ----------
    slides : ndarray or None
        ∂g by turns of R̃ and by ω̃, of friction and of moments on bodies, shape (n_free, 6, size).
    """

    def __init__(self, again: StepAgain, at: Configuration, couplings: Sequence[float], turned: Sequence[Array]):
        problem, stage, point = again.problem, again.stage, again.point
        self.slides: Array | None = None
        self._bodies = again.problem.bodies.body_of_free
        self.unknown, self.length, self.momentum_length = again.of_bodies, stage.length, stage.momentum_length
        constrained, h = problem.constrained, stage.length
        held = np.flatnonzero(constrained.free >= 0)
        self.rows, self.free = again.of_nodes[constrained.node[held]], constrained.free[held]
        self.arm = at.arm[held].copy()
        freed = np.ones(again.size)
        freed[(constrained.unknown[:, None] + np.arange(3)).ravel()] = 0.0
        self.freed = freed[:, None]
        bodies, count = problem.bodies, len(self.unknown)
        blocks = {
            name: np.zeros((count, 3, 3)) for name in ("p_turn", "p_spin", "w_turn", "w_spin", "k_before", "k_end")
        }
        spins = stage.body_spin
        for f in range(count):
            spin, before, end = spins[f], stage.predicted_body_rotation[f], at.body_rotation[f]
            moment = bodies.second_moment[f]
            second = before @ moment @ before.T
            inertia = np.trace(second) * np.eye(3) - second
            turn, jacobian = rotation_of(h * spin), left_jacobian(h * spin)
            n = inertia @ cross_matrix(spin) - cross_matrix(point.angular_momentum[f])
            if moment.any():
                inverse = np.linalg.inv(inertia + h * n @ jacobian)
                blocks["w_turn"][f], blocks["w_spin"][f] = -inverse @ n @ turn, inverse
            blocks["p_turn"][f] = turn + h * jacobian @ blocks["w_turn"][f]
            blocks["p_spin"][f] = h * jacobian @ blocks["w_spin"][f]
            a = before @ moment @ end.T
            for c in range(3):
                unit = cross_matrix(np.eye(3)[c])
                blocks["k_before"][f][:, c], blocks["k_end"][f][:, c] = _axial(unit @ a), _axial(-a @ unit)
        self._of = blocks
        self._ahead = -cross_matrices(stage.attached_arm[held])
        spinning = cross_matrices(spins[self.free])
        self._by_turn, self._by_spin = self._ahead - h * spinning @ self._ahead, -h * self._ahead
        self.first = np.stack([np.eye(3)] * count) if count else np.zeros((0, 3, 3))
        self.chain: list[tuple[Array, Array]] = []  # of each earlier stage: what its gain does, and its turn
        for weight, vectors in zip(couplings, turned, strict=False):
            turn = np.array([rotation_of(weight * v) for v in vectors])
            own = [weight * left_jacobian(weight * v) @ np.linalg.inv(left_jacobian(v)) for v in vectors]
            self.first = turn @ self.first
            self.chain = [(turn @ gain, of) for gain, of in self.chain]
            self.chain.append((np.array(own), np.array([rotation_of(v) for v in vectors])))

    def _turns(self, of: Array) -> Array:
        return of[self.unknown[:, 3:]]

    # places of what bodies hold

    def spread(self, moved: Array) -> Array:
        """Return motions of all nodes from those of unknowns."""
        found = self.freed * moved
        motion = moved[self.unknown[self.free]]
        found[self.rows] = motion[:, :3] + np.cross(motion[:, 3:], self.arm[:, :, None], axis=1)
        return found

    def gather(self, forces: Array) -> Array:
        """Return the transpose: forces on unknowns from those on nodes."""
        found, on = self.freed * forces, forces[self.rows]
        np.add.at(found, self.unknown[self.free, :3], on)
        np.add.at(found, self.unknown[self.free, 3:], np.cross(self.arm[:, :, None], on, axis=1))
        return found

    def keep(self, state: State, moments: Array, method: Method, n: int, length: float) -> None:
        """Take by what a history turns the origin of stage n: it depends on turns at the start of the step, on L and on
        its derivative M there; `moments` are those of inertia.

        It turns by x = c h ω + d h² ω̇, with I ω = L and I ω̇ = M − ω × L.
        """
        c, d = method.along[n] * length, method.bend * length**2
        self.history, self._beyond = np.zeros((len(self.unknown), 3, 9)), np.zeros((len(self.unknown), 3, 3))
        for f, own in enumerate(moments):
            b = self._bodies[f]
            rotation, spin = state.body_rotation[b], state.body_angular_velocity[b]
            second = rotation @ own @ rotation.T
            inertia = np.trace(second) * np.eye(3) - second
            momentum, moment = inertia @ spin, state.body_moment[f] - np.cross(spin, inertia @ spin)
            inverse = np.linalg.inv(inertia)
            rate = inverse @ moment
            by_turn, by_momentum, by_moment = (np.eye(3, 9, 3 * k) for k in range(3))
            of_spin = inverse @ (by_momentum + cross_matrix(momentum) @ by_turn) - cross_matrix(spin) @ by_turn
            of_moment = by_moment + cross_matrix(momentum) @ of_spin - cross_matrix(spin) @ by_momentum
            of_rate = inverse @ (of_moment + cross_matrix(moment) @ by_turn) - cross_matrix(rate) @ by_turn
            x = c * spin + d * rate
            self.history[f], self._beyond[f] = left_jacobian(x) @ (c * of_spin + d * of_rate), rotation_of(x)

    # forward

    def turn_by_history(self, first: Array, speed: Array, push: Array, origin: Array) -> None:
        """Turn the origin on by what a history keeps."""
        kept = [self._turns(of) for of in (first, speed, push)]
        origin[self.unknown[:, 3:]] = self._beyond @ self._turns(origin) + self.history @ np.concatenate(kept, axis=1)

    def turn_origin(self, first: Array, origin: Array, gained: Sequence[tuple[Array, Array]]) -> None:
        """Write turns of the origin, from those at the start of the step and at ends and origins of earlier stages."""
        found = self.first @ self._turns(first)
        for (gain, turn), (end, before) in zip(self.chain, gained, strict=True):
            found += gain @ (self._turns(end) - turn @ self._turns(before))
        origin[self.unknown[:, 3:]] = found

    def predict(self, origin: Array, speed: Array) -> Array:
        """Write the origin of what is held; return turns to where inertia takes bodies, and changes of ω̃, shape
        (n_free, 6, n).
        """
        of, turn, spin = self._of, self._turns(origin), self._turns(speed)
        ahead = of["p_turn"] @ turn + of["p_spin"] @ spin
        rate = of["w_turn"] @ turn + of["w_spin"] @ spin
        moved = origin[self.unknown[self.free, :3]]
        origin[self.rows] = moved + self._by_turn @ ahead[self.free] + self._by_spin @ rate[self.free]
        return np.concatenate([ahead, rate], axis=1)

    def guess(self, origin: Array, speed: Array, ahead: Array, guess: Array) -> None:
        """Write where the first guess of what is held goes."""
        x = self.unknown[self.free, :3]
        guess[self.rows] = origin[x] + self.length * speed[x] + self._ahead @ ahead[self.free, :3]

    def push(self, ahead: Array, right: Array) -> None:
        """Add what turns to where inertia takes bodies, and ω̃, make of moments of inertia, of friction and of loads."""
        right[self.unknown[:, 3:]] -= self._of["k_before"] @ ahead[:, :3] / (self.length * self.momentum_length)

    def end(self, end: Array, origin_speed: Array, ahead: Array, end_speed: Array) -> None:
        """Write angular momenta at the end."""
        change = self._of["k_before"] @ ahead[:, :3] + self._of["k_end"] @ self._turns(end)
        end_speed[self.unknown[:, 3:]] = self._turns(origin_speed) - change / self.length

    # backward

    def end_back(self, end: Array, origin_speed: Array, end_speed: Array) -> Array:
        """Take derivatives by angular momenta at the end; return those by turns to where inertia takes bodies."""
        turns = self.unknown[:, 3:]
        by = end_speed[turns]
        end_speed[turns] = 0.0
        origin_speed[turns] += by
        end[turns] -= self._of["k_end"].swapaxes(1, 2) @ by / self.length
        return self._by_ahead(by / self.length)

    def _by_ahead(self, moments: Array) -> Array:
        """Return derivatives by what `predict` returns, from those by moments of inertia, shape (n_free, 3, n)."""
        found = -self._of["k_before"].swapaxes(1, 2) @ moments
        return np.concatenate([found, np.zeros_like(found)], axis=1)

    def push_back(self, right: Array) -> Array:
        """Return derivatives by turns to where inertia takes bodies, and by ω̃."""
        return self._by_ahead(self._turns(right) / (self.length * self.momentum_length))

    def guess_back(self, guess: Array, origin: Array, speed: Array, ahead: Array) -> None:
        """Take derivatives by the first guess of what is held."""
        by, x = guess[self.rows], self.unknown[self.free, :3]
        np.add.at(origin, x, by)
        np.add.at(speed, x, self.length * by)
        np.add.at(ahead[:, :3], self.free, self._ahead.swapaxes(1, 2) @ by)

    def predict_back(self, origin: Array, speed: Array, ahead: Array) -> None:
        """Take derivatives by the origin of what is held, and by turns to where inertia takes bodies."""
        of, turns, by = self._of, self.unknown[:, 3:], origin[self.rows]
        origin[self.rows] = 0.0
        np.add.at(origin, self.unknown[self.free, :3], by)
        ahead, rate = ahead[:, :3], ahead[:, 3:]
        np.add.at(ahead, self.free, self._by_turn.swapaxes(1, 2) @ by)
        np.add.at(rate, self.free, self._by_spin.swapaxes(1, 2) @ by)
        origin[turns] += of["p_turn"].swapaxes(1, 2) @ ahead + of["w_turn"].swapaxes(1, 2) @ rate
        speed[turns] += of["p_spin"].swapaxes(1, 2) @ ahead + of["w_spin"].swapaxes(1, 2) @ rate

    def turn_by_history_back(self, first: Array, speed: Array, push: Array, origin: Array) -> None:
        """Take derivatives by what a history keeps, and leave those by turns of the origin without it."""
        turns = self.unknown[:, 3:]
        pulled = self.history.swapaxes(1, 2) @ origin[turns]
        origin[turns] = self._beyond.swapaxes(1, 2) @ origin[turns]
        for k, of in enumerate((first, speed, push)):
            of[turns] += pulled[:, 3 * k : 3 * k + 3]

    def turn_origin_back(self, first: Array, origin: Array, ends: Sequence[Array], origins: Sequence[Array]) -> None:
        """Take derivatives by turns of the origin."""
        turns = self.unknown[:, 3:]
        by = origin[turns]
        origin[turns] = 0.0
        first[turns] += self.first.swapaxes(1, 2) @ by
        for (gain, turn), end, before in zip(self.chain, ends, origins, strict=False):
            pulled = gain.swapaxes(1, 2) @ by
            end[turns] += pulled
            before[turns] -= turn.swapaxes(1, 2) @ pulled
