"""Gradients and Hessians of dimension 2 against differences, at random states of a plane."""

import numpy as np
import pytest
from planar_scenes import AHEAD, HUBS, everything_in_plane, touching_rods

from bilayer_core.integrate.integrators import INTEGRATORS
from bilayer_core.integrate.stages import predict, start_point
from bilayer_core.integrate.stepper import Stepper
from bilayer_core.model.build import build_model
from bilayer_core.model.plan import MODELS
from bilayer_core.model.state import initial_state
from bilayer_core.scene.loader import load_scene
from bilayer_core.solve.configuration import Configuration

GRADIENT_LIMIT = 1e-7  # of the largest entry
HESSIAN_LIMIT = 1e-6


class Problem:
    """A potential at a random state of a plane, as a function of the unknowns that are solved for."""

    def __init__(self, content, h, seed, noise=2e-4, model="two_rod"):
        rng = np.random.default_rng(seed)
        model = self.model = build_model(load_scene(content), model, 2)
        stepper = Stepper(model, INTEGRATORS["implicit_euler"], h, 1e-6, 50, 0)
        axes, normal, solved = model.plane.axes, model.plane.normal, model.solved_layout
        state = initial_state(model)
        free = np.setdiff1d(np.arange(model.node_count), model.attached_node)
        state.position[free] += noise * rng.standard_normal((len(free), 2)) @ axes
        rest = Configuration(model)
        rest.take_state(initial_state(model))
        bent = Configuration(model)
        bent.take_state(state)
        bent.carry_frames(rest, np.zeros(model.edge_count))
        state.director1[:] = bent.director1[: model.edge_count]
        state.velocity[free] = 0.05 * rng.standard_normal((len(free), 2)) @ axes
        for body in model.bodies.body_of_free:
            state.body_velocity[body] = 0.02 * rng.standard_normal(2) @ axes
            state.body_angular_velocity[body] = rng.standard_normal() * normal
        start = Configuration(model)
        start.take_state(state)
        drive = (
            stepper.surroundings.rest_strains_of(np.full(len(model.law_gain), 0.7)),
            stepper.surroundings.load_factor(0.03),
        )
        origin = start_point(model, state, start)
        origin.position[:] += 1e-5 * rng.standard_normal((model.node_count, 2)) @ axes
        context = predict(model, origin, start, np.zeros(model.edge_count), h, *drive, momentum_length=1.3 * h)
        self.potential = stepper.potential
        self.potential.start_step(context)
        size, bodies = model.layout.size, 6 * model.free_count
        self.basis = np.zeros((size + bodies, solved.size + model.bodies.freedom.shape[1]))
        for c in range(2):
            for d in range(3):
                self.basis[model.layout.node + d, solved.node + c] = axes[c, d]
        self.basis[size:, solved.size :] = model.bodies.freedom
        held = (solved.attached[:, None] + np.arange(2)).ravel()
        self.free = np.setdiff1d(np.arange(self.basis.shape[1]), held)
        turns = np.abs(self.basis.reshape(len(self.basis), -1)[size:].reshape(-1, 6, self.basis.shape[1])[:, 3:])
        self.scale = np.where(turns.sum(axis=(0, 1)) > 0.0, 50.0, 1.0)  # angles, of a body of 2 cm
        self.at, self.trial = Configuration(model), Configuration(model)
        step = np.zeros(self.basis.shape[1])
        step[self.free] = 3e-5 * rng.standard_normal(len(self.free))
        self._move(start, 0.5 * step, self.at)
        self.potential.follow(self.at)
        self._move(start, step, self.at)

    def _move(self, base, vector, out):
        step, size = self.basis @ (vector * self.scale), self.model.layout.size
        out.set_moved(base, step[:size], step[size:].reshape(-1, 6), 1.0)

    def _gradient(self):
        full = np.concatenate([self.potential.gradient, self.potential.body_gradient.ravel()])
        return self.scale * (full @ self.basis)

    def value(self, vector):
        self._move(self.at, vector, self.trial)
        energy = self.potential.evaluate(self.trial, False)
        return energy, self._gradient()

    def derivatives(self):
        potential, size, freedom = self.potential, self.model.solved_layout.size, self.model.bodies.freedom
        potential.evaluate(self.at, True)
        gradient = self._gradient()
        band, border, corner = potential.matrix.assemble(
            potential.diagonal_factor(), self.at, potential.edge_gradient, potential.attached_gradient
        )
        hessian = np.zeros((len(self.scale), len(self.scale)))
        for j in range(size):
            for r in range(min(band.shape[1] - 1, size - 1 - j) + 1):
                hessian[j + r, j] = hessian[j, j + r] = band[j, r]
        hessian[:size, size:] = border @ freedom
        hessian[size:, :size] = hessian[:size, size:].T
        hessian[size:, size:] = freedom.T @ corner @ freedom
        hessian *= np.outer(self.scale, self.scale)
        return gradient[self.free], hessian[np.ix_(self.free, self.free)]

    def differences(self, h):
        gradient, rows = [], []
        for i in self.free:
            unit = np.zeros(len(self.scale))
            unit[i] = h
            near, far = (
                [a - b for a, b in zip(self.value(k * unit), self.value(-k * unit), strict=True)] for k in (1, 2)
            )
            gradient.append((8 * near[0] - far[0]) / (12 * h))
            rows.append(((8 * near[1] - far[1]) / (12 * h))[self.free])
        return np.array(gradient), np.array(rows)


def check(problem):
    gradient, hessian = problem.derivatives()
    gradient_errors, hessian_errors = [], []
    for h in (3e-8, 1e-7, 3e-7, 1e-6):
        by_energy, by_gradient = problem.differences(h)
        gradient_errors.append(np.abs(gradient - by_energy).max() / np.abs(gradient).max())
        hessian_errors.append(np.abs(hessian - by_gradient).max() / np.abs(hessian).max())
    assert min(gradient_errors) < GRADIENT_LIMIT
    assert min(hessian_errors) < HESSIAN_LIMIT
    assert np.abs(hessian - hessian.T).max() < 1e-14 * np.abs(hessian).max()


def elasticity_alone(content):
    """The scene without what else acts, and without the ball."""
    bodies = [content["bodies"][0] | {"contact_points": []}]
    none = {"gravity": [0, 0, 0], "damping": {}, "fluid": None, "obstacles": [], "contact": None, "loads": []}
    return content | none | {"bodies": bodies}


@pytest.mark.parametrize("hub", HUBS)
@pytest.mark.parametrize("ahead", AHEAD)
@pytest.mark.parametrize("model", MODELS)
def test_derivatives_of_elasticity_agree_with_differences(model, ahead, hub):
    problem = Problem(elasticity_alone(everything_in_plane(AHEAD[ahead], hub)), 1e4, seed=1, model=model)
    check(problem)
    assert len(problem.model.coupled_joint) == (6 if model == "laminate" else 0)
    terms = ("stretching", "bending", "bond") if model == "two_rod" else ("stretching", "bending")
    assert problem.potential.terms.keys() >= set(terms)
    assert all(problem.potential.terms[term] > 0.0 for term in terms)


@pytest.mark.parametrize("hub", HUBS)
@pytest.mark.parametrize("ahead", AHEAD)
@pytest.mark.parametrize("model", MODELS)
def test_derivatives_of_all_forces_agree_with_differences(model, ahead, hub):
    problem = Problem(everything_in_plane(AHEAD[ahead], hub), 1e-3, seed=3, model=model)
    check(problem)
    assert all(problem.potential.terms[term] > 0.0 for term in ("barrier", "friction", "drag", "damping"))


@pytest.mark.parametrize("hub", HUBS)
@pytest.mark.parametrize("ahead", AHEAD)
def test_the_newton_matrix_of_rods_that_touch_is_the_derivative_of_the_gradient(ahead, hub):
    problem = Problem(touching_rods(AHEAD[ahead], hub), 1e-5, seed=4, noise=2e-5)
    potential, basis, free, rng = problem.potential, problem.basis, problem.free, np.random.default_rng(5)
    size = problem.model.layout.size
    potential.evaluate(problem.at, True)
    assert potential.factorise(problem.at)
    assert (potential.matrix.shift, potential.matrix.simplified) == (0.0, 0)
    assert all(potential.terms[term] > 0.0 for term in ("rod barrier", "rod friction"))
    touching = potential.matrix.rods.contacts.node[: potential.matrix.rods.contacts.count]
    assert np.isin(touching, problem.model.attached_node).any()
    for _ in range(3):
        load = np.zeros(len(problem.scale))
        load[free] = rng.standard_normal(len(free)) / problem.scale[free]
        full = basis @ load
        step = np.concatenate(
            [p.ravel() for p in potential.matrix.newton_step(full[:size], full[size:].reshape(-1, 6))]
        )
        step = basis.T @ step / problem.scale
        assert np.abs(np.delete(step, free)).max() == 0.0
        errors = []
        for h in (1e-8, 3e-8, 1e-7):
            unit = step * h / np.abs(step).max()
            near, far = (problem.value(k * unit)[1] - problem.value(-k * unit)[1] for k in (1, 2))
            change = (8 * near - far) / 12 * np.abs(step).max() / h
            wanted = -load * problem.scale
            errors.append(np.abs(change - wanted)[free].max() / np.abs(wanted).max())
        assert min(errors) < HESSIAN_LIMIT
