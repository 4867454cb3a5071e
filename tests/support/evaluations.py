"""Forces at states of a test's own, through the functions that steps use: derivatives and differences."""

import numpy as np

from bilayer_core.engine.evaluator import Evaluator
from bilayer_core.forces.force_register import memory_size
from bilayer_core.kinematics.rotation import rotation_matrix
from bilayer_core.model.build_model import build_model
from bilayer_core.model.state import initial_state
from bilayer_core.model.stimulated_strains import RestStrains
from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.surroundings import Surroundings

GRADIENT_LIMIT = 1e-7  # of the largest entry
HESSIAN_LIMIT = 1e-6
SIZE = 1e-2  # of the robots of tests [m]
HALF_WIDTH, RADIUS = 5e-3, 2e-2  # what turns of edges and of bodies are multiplied with [m]
STEPS = (3e-8, 1e-7, 3e-7, 1e-6)  # of differences, of which the best counts [m]


def undriven(model):
    """Strains without stress and factors of loads where no stimulus acts and loads are whole."""
    rest = RestStrains(model.drives.rest_strain, model.drives.joint_rest, np.zeros(len(model.drives.law_gain)))
    return rest, np.ones(len(model.scene.loads))


def at_rest(model, length):
    """An evaluator with a stage of a length [s] that begins at the scene's start at rest, and that configuration."""
    evaluator, state, (rest, load_factor) = Evaluator(model), initial_state(model), undriven(model)
    start = evaluator.new()
    evaluator.take_state(state, start)
    evaluator.stand_still(state, start, length, rest.edge, rest.joint, load_factor)
    evaluator.start_stage(start)
    return evaluator, start


def dense(band, size):
    """The symmetric matrix whose lower band, by columns, is the argument."""
    matrix = np.zeros((size, size))
    for j in range(size):
        for r in range(min(band.shape[1] - 1, size - 1 - j) + 1):
            matrix[j + r, j] = matrix[j, j + r] = band[j, r]
    return matrix


class Problem:
    """Forces at a random state, as functions of one vector: the unknowns that are solved for, then those of bodies.

    Unknowns that are angles are multiplied with a length, so that all entries are of one kind.

    Parameters
    ----------
    content : dict
        A scene.
    rng : numpy.random.Generator
    model : str
    dimension : int
    h : float
        Length of the stage [s].
    noise, origin_noise, turns : float
        Of positions [m], of the origin and of the step [m], and of turns of edges at the start [rad].
    change : callable
        From the scene's model to that to be tested.
    """

    def __init__(
        self,
        content,
        rng,
        model="two_rod",
        dimension=3,
        h=1e-3,
        noise=2e-4,
        origin_noise=1e-5,
        turns=0.1,
        change=lambda m: m,
    ):
        model = self.model = change(build_model(load_scene(content), model, dimension))
        evaluator = self.evaluator = Evaluator(model)
        in_space, axes = not model.plane.exists, model.rods.axes
        free = np.setdiff1d(np.arange(model.node_count), model.constrained.node)

        def draw(count):
            return rng.standard_normal((count, len(axes))) @ axes

        state = self.state = initial_state(model, memory=memory_size(model))
        state.memory[:] = 0.05  # speeds of approach
        rest, bent = evaluator.new(), evaluator.new()
        evaluator.take_state(state, rest)
        evaluator.take_state(state, bent)
        bent.position[free] += noise * draw(len(free))
        still = np.zeros(model.rods.edge_count)
        evaluator.transport_frames(
            rest, turns * rng.standard_normal(model.rods.edge_count) if in_space else still, bent
        )
        state.position[:] = bent.position
        state.director1[:] = bent.director1[: model.rods.edge_count]
        state.velocity[free] = 0.05 * draw(len(free))
        state.spin[:] = rng.standard_normal(model.rods.edge_count) if in_space else still
        for body in model.free_bodies.body_of_free:
            state.body_velocity[body] = 0.02 * draw(1)[0]
            spin = rng.standard_normal(3) if in_space else rng.standard_normal() * model.plane.normal
            state.body_angular_velocity[body] = spin
        start = self.start = evaluator.new()
        evaluator.take_state(state, start)
        origin = evaluator.start_point(state, start)  # of a later stage: not where that is solved from
        origin.displacement[:] += origin_noise * draw(model.node_count)
        strains = model.strain_count
        origin.strain[:strains] += 1e-3 * np.random.default_rng(7).standard_normal(strains)
        origin.strain[strains:] += origin_noise * np.random.default_rng(8).standard_normal(len(origin.strain) - strains)
        turned = 0.0
        if in_space:
            origin.body_displacement[:] += origin_noise * draw(len(origin.body_displacement))
            for b in range(len(origin.rotation)):
                origin.rotation[b] = rotation_matrix(1e3 * origin_noise * rng.standard_normal(3)) @ origin.rotation[b]
            turned = 1e3 * origin_noise * rng.standard_normal(model.rods.edge_count)
        strains = evaluator.rest_strains_of(np.full(len(model.drives.mode_rising), 0.7))
        then = state.copy()
        then.time[0] = 0.03
        load_factor = Surroundings(model).load_factor(then)
        evaluator.predict(start, (h, 1.3 * h), strains.edge, strains.joint, load_factor, turned)
        evaluator.start_stage(start)
        self._number()
        self.at, self.trial = evaluator.new(), evaluator.new()
        step = np.zeros(len(self.scale))
        step[self.free] = 3 * origin_noise * rng.standard_normal(len(self.free))
        self.move(start, 0.5 * step, self.at)
        evaluator.update_lagged(self.at)
        self.move(start, step, self.at)

    def _number(self):
        """`basis`: unknowns of the model in space, and of bodies, by those of the vector; `free`: those not held."""
        model = self.model
        size, solved, freedom = model.layout.size, model.solved_layout, model.free_bodies.freedom
        self.size = size
        self.basis = np.zeros((size + 6 * model.free_count, solved.size + freedom.shape[1]))
        self.scale = np.ones(self.basis.shape[1])
        for c, axis in enumerate(model.rods.axes):
            for d in range(3):
                self.basis[model.layout.node + d, solved.node + c] = axis[d]
        if not model.plane.exists:
            self.basis[model.layout.edge, solved.edge] = 1.0
            self.scale[solved.edge] = 1.0 / HALF_WIDTH
        self.basis[size:, solved.size :] = freedom
        turns = np.abs(freedom.reshape(model.free_count, 6, freedom.shape[1])[:, 3:]).sum(axis=(0, 1)) > 0.0
        self.scale[solved.size :][turns] = 1.0 / RADIUS
        held = (solved.attached[:, None] + np.arange(solved.dimension)).ravel()
        self.free = np.setdiff1d(np.arange(len(self.scale)), held)

    def split(self, vector):
        """A vector as steps of the unknowns, shape (size,), and of free bodies, shape (n_free, 6), in space."""
        step = self.basis @ (vector * self.scale)
        return step[: self.size], step[self.size :].reshape(-1, 6)

    def move(self, base, vector, out):
        """Make `out` the configuration `base` moved by a vector."""
        self.evaluator.move(base, *self.split(vector), out)

    def gradient(self):
        """That of the last evaluation, by the vector."""
        first = self.evaluator.sums
        return self.scale * (np.concatenate([first.gradient, first.body.ravel()]) @ self.basis)

    def value(self, vector, forces=None):
        """Energy of some forces, or all, at a vector from `at`, and its gradient."""
        self.move(self.at, vector, self.trial)
        self.terms = self.evaluator.evaluate(self.trial, forces)
        return self.evaluator.total, self.gradient()

    def derivatives(self, forces=None):
        """Gradient and Hessian of the free unknowns at `at`, as steps take them."""
        evaluator, size, freedom = self.evaluator, self.model.solved_layout.size, self.model.free_bodies.freedom
        self.terms = evaluator.evaluate(self.at, forces, second=True)
        gradient = self.gradient()
        band, border, corner = evaluator.assemble(self.at)
        self.coupling = np.abs(border).max(initial=0.0)
        hessian = np.zeros((len(self.scale), len(self.scale)))
        hessian[:size, :size] = dense(band, size)
        hessian[:size, size:] = border @ freedom
        hessian[size:, :size] = hessian[:size, size:].T
        hessian[size:, size:] = freedom.T @ corner @ freedom
        hessian *= np.outer(self.scale, self.scale)
        return gradient[self.free], hessian[np.ix_(self.free, self.free)]

    def differences(self, h, forces=None):
        """The same by central differences of fourth order with step `h` [m]: of energies, and of gradients."""
        gradient, rows = [], []
        for i in self.free:
            unit = np.zeros(len(self.scale))
            unit[i] = h
            near, far = (
                [a - b for a, b in zip(self.value(k * unit, forces), self.value(-k * unit, forces), strict=True)]
                for k in (1, 2)
            )
            gradient.append((8 * near[0] - far[0]) / (12 * h))
            rows.append(((8 * near[1] - far[1]) / (12 * h))[self.free])
        return np.array(gradient), np.array(rows)


def check(problem, forces=None):
    """Compare both derivatives of some forces, or all, with differences."""
    gradient, hessian = problem.derivatives(forces)
    largest = np.abs(gradient).max()
    assert largest > 0.0
    stiffest = max(np.abs(hessian).max(), 1e-3 * largest / SIZE)  # a force that is constant has none
    gradient_errors, hessian_errors = [], []
    for h in STEPS:
        by_energy, by_gradient = problem.differences(h, forces)
        if not problem.model.plane.exists:
            # frames are transported: differences of the gradient are symmetric only up to holonomy
            by_gradient = 0.5 * (by_gradient + by_gradient.T)
        gradient_errors.append(np.abs(gradient - by_energy).max() / largest)
        hessian_errors.append(np.abs(hessian - by_gradient).max() / stiffest)
    assert min(gradient_errors) < GRADIENT_LIMIT
    assert min(hessian_errors) < HESSIAN_LIMIT
    # parts of one force may cancel, as those of friction across a plane do: rounding is that of the whole matrix
    _, whole = problem.derivatives()
    assert np.abs(hessian - hessian.T).max() <= 1e-14 * np.abs(whole).max()
    problem.derivatives(forces)


def end_of_step(simulator, before):
    """The last step of a run with implicit Euler, from the state `before` it, as a stage of an evaluator of its own.

    Returns
    -------
    evaluator : Evaluator
        What follows the configuration is that of the end.
    start, end : Configuration
    """
    model, state, h = simulator.model, simulator._state, simulator.dt
    evaluator = Evaluator(model)
    start, end = evaluator.new(), evaluator.new()
    evaluator.take_state(before, start)
    evaluator.start_point(before, start)
    strains, load_factor = evaluator.rest_strains_of(state.transduction), Surroundings(model).load_factor(state, h)
    evaluator.predict(start, (h, h), strains.edge, strains.joint, load_factor)
    evaluator.start_stage(start)
    evaluator.take_state(state, end)
    end.total_angle[:] = h * state.spin
    evaluator.update_lagged(end)
    return evaluator, start, end


def left_of_step(evaluator, end):
    """What Newton's method would still change at the end of a step: of unknowns and of free bodies."""
    evaluator.evaluate(end, second=True)
    evaluator.factorise(end)
    first = evaluator.sums
    return evaluator.newton_step(first.gradient.copy(), first.body.copy())
