"""Gradients and Hessians of every force against differences, at random physical states."""

from dataclasses import replace

import numpy as np
import pytest
from sample_scenes import ball, contact, everything, layer, rod, scene
from slips import dissipation

from bilayer_core.integrate.integrators import INTEGRATORS
from bilayer_core.integrate.stages import predict, start_point
from bilayer_core.integrate.stepper import Stepper
from bilayer_core.kinematics.rotation import rotation_matrix
from bilayer_core.model.build import build_model
from bilayer_core.model.state import initial_state
from bilayer_core.scene.loader import load_scene
from bilayer_core.solve.configuration import Configuration

GRADIENT_LIMIT = 1e-7  # of the largest entry
HESSIAN_LIMIT = 1e-6
STEP = 1e-3  # [s]
LONG_STEP = 1e4  # in which inertia does not count [s]

STIFFNESS = ("axial_stiffness", "joint_stiffness", "pair_stiffness")


def only(model, **kept):
    """The model without elasticity except for what `kept` names."""
    arrays = {name: getattr(model, name) * 0.0 for name in STIFFNESS}
    arrays.update(kept)
    return replace(model, **arrays)


def bends(model, column):
    stiffness = model.joint_stiffness.copy()
    stiffness[model.bend_count :] = 0.0
    stiffness[:, [c for c in range(3) if c not in column]] = 0.0
    return only(model, joint_stiffness=stiffness)


def bonds(model):
    stiffness = model.joint_stiffness.copy()
    stiffness[: model.bend_count] = 0.0
    stiffness[model.bend_count :, 1] = stiffness[model.bend_count :, 0]
    return only(model, joint_stiffness=stiffness)


OTHERS = "inertia gravity damping drag added mass contact friction"
FORCES = {
    "stretching": lambda m: only(m, axial_stiffness=m.axial_stiffness),
    "bending": lambda m: bends(m, (0, 1)),
    "twisting": lambda m: bends(m, (2,)),
    "bond translation": lambda m: only(m, pair_stiffness=m.pair_stiffness),
    "bond rotation": bonds,
    "loads": only,
    OTHERS: only,
    "everything": lambda m: m,
}

HUBS = {
    "prescribed hub": {"type": "prescribed"},
    "free hub": {"type": "free", "mass": 1e-3, "inertia": [2e-8, 3e-8, 4e-8]},
}


class Problem:
    """A potential at a random state, as functions of one vector (rods' unknowns, then six for each free body).

    Unknowns that are angles are multiplied with a length, so that all entries are of one kind.
    """

    def __init__(self, scene, force, h, rng, noise=2e-4, model="two_rod"):
        model = FORCES[force](build_model(load_scene(scene), model))
        stepper = Stepper(model, INTEGRATORS["implicit_euler"], h, 1e-6, 50, 0)
        state = initial_state(model)
        rest = Configuration(model)
        rest.take_state(state)
        bent = Configuration(model)
        bent.take_state(state)
        free = np.setdiff1d(np.arange(model.node_count), model.attached_node)
        bent.position[free] += noise * rng.standard_normal((len(free), 3))
        bent.carry_frames(rest, 0.1 * rng.standard_normal(model.edge_count))
        state.position[:] = bent.position
        state.director1[:] = bent.director1[: model.edge_count]
        state.velocity[free] = 0.05 * rng.standard_normal((len(free), 3))
        state.spin[:] = rng.standard_normal(model.edge_count)
        for body in model.bodies.body_of_free:
            state.body_velocity[body] = 0.02 * rng.standard_normal(3)
            state.body_angular_velocity[body] = rng.standard_normal(3)
        start = Configuration(model)
        start.take_state(state)
        drive = (
            stepper.surroundings.rest_strains_of(np.full(len(model.law_gain), 0.7)),
            stepper.surroundings.load_factor(0.03),
        )
        origin = start_point(model, state, start)  # of a later stage: not where that is solved from
        origin.position[:] += 1e-5 * rng.standard_normal(origin.position.shape)
        origin.body_position[:] += 1e-5 * rng.standard_normal(origin.body_position.shape)
        for b in range(len(origin.rotation)):
            origin.rotation[b] = rotation_matrix(1e-2 * rng.standard_normal(3)) @ origin.rotation[b]
        turned = 1e-2 * rng.standard_normal(model.edge_count)
        context = predict(model, origin, start, turned, h, *drive, momentum_length=1.3 * h)
        self.potential = stepper.potential
        self.potential.start_step(context)
        size = model.layout.size
        held = (model.layout.node[model.attached_node][:, None] + np.arange(3)).ravel()
        total = size + 6 * model.free_count
        self.free = np.setdiff1d(np.arange(total), held)
        self.scale = np.ones(total)
        self.scale[model.layout.edge] = 1.0 / 5e-3  # half width
        self.scale[size:].reshape(-1, 6)[:, 3:] = 1.0 / 2e-2  # radius
        self.size, self.model = size, model
        self.at, self.trial = Configuration(model), Configuration(model)
        step = np.zeros(total)
        step[self.free] = 3e-5 * rng.standard_normal(len(self.free))
        self._move(start, 0.5 * step, self.at)
        self.potential.follow(self.at)
        self._move(start, step, self.at)

    def _move(self, base, vector, out):
        step = vector * self.scale
        out.set_moved(base, step[: self.size], step[self.size :].reshape(-1, 6), 1.0)

    def value(self, vector):
        self._move(self.at, vector, self.trial)
        energy = self.potential.evaluate(self.trial, False)
        return energy, np.concatenate([self.potential.gradient, self.potential.body_gradient.ravel()]) * self.scale

    def derivatives(self):
        """Gradient and Hessian of the free unknowns as the package computes them."""
        potential, size, b = self.potential, self.size, self.model.layout.half_bandwidth
        potential.evaluate(self.at, True)
        gradient = np.concatenate([potential.gradient, potential.body_gradient.ravel()]) * self.scale
        band, border, corner = potential.matrix.assemble(
            potential.diagonal_factor(), self.at, potential.edge_gradient, potential.attached_gradient
        )
        self.coupling = np.abs(border).max(initial=0.0)
        hessian = np.zeros((len(self.scale), len(self.scale)))
        for j in range(size):
            for r in range(min(b, size - 1 - j) + 1):
                hessian[j + r, j] = hessian[j, j + r] = band[j, r]
        hessian[:size, size:] = border
        hessian[size:, :size] = border.T
        hessian[size:, size:] = corner
        hessian *= np.outer(self.scale, self.scale)
        return gradient[self.free], hessian[np.ix_(self.free, self.free)]

    def differences(self, h):
        """The same by central differences of fourth order with step `h` [m]."""
        gradient, rows = [], []
        for i in self.free:
            unit = np.zeros(len(self.scale))
            unit[i] = h
            plus, minus = self.value(unit), self.value(-unit)
            plus2, minus2 = self.value(2 * unit), self.value(-2 * unit)
            first, second = ((a[0] - b[0]) for a, b in ((plus, minus), (plus2, minus2)))
            gradient.append((8 * first - second) / (12 * h))
            first, second = ((a[1] - b[1]) for a, b in ((plus, minus), (plus2, minus2)))
            rows.append(((8 * first - second) / (12 * h))[self.free])
        return np.array(gradient), np.array(rows)


def of_everything(force, hub, seed, model="two_rod"):
    """One force, or all, of the scene that has every one."""
    scene = everything()
    scene["bodies"][0]["motion"] = HUBS[hub]
    h = STEP
    if force not in (OTHERS, "everything"):  # elasticity, or loads, by themselves
        h = LONG_STEP
        scene |= {"gravity": [0, 0, 0], "damping": {}, "fluid": None, "obstacles": [], "contact": None}
        if force == "loads":
            scene["bodies"][0]["contact_points"] = []
            del scene["bodies"][1]["surface"]
            scene["bodies"][1]["motion"] = {**HUBS["free hub"]}
        else:
            scene["bodies"] = [{**scene["bodies"][0], "contact_points": []}]
            scene["loads"] = []
    return Problem(scene, force, h, np.random.default_rng(seed), model=model)


def check(problem):
    """Compare both derivatives with differences."""
    gradient, hessian = problem.derivatives()
    gradient_errors, hessian_errors = [], []
    for h in (3e-8, 1e-7, 3e-7, 1e-6):
        by_energy, by_gradient = problem.differences(h)
        # frames are transported: differences of the gradient are symmetric only up to holonomy
        symmetric = 0.5 * (by_gradient + by_gradient.T)
        gradient_errors.append(np.abs(gradient - by_energy).max() / np.abs(gradient).max())
        hessian_errors.append(np.abs(hessian - symmetric).max() / np.abs(hessian).max())
    assert min(gradient_errors) < GRADIENT_LIMIT
    assert min(hessian_errors) < HESSIAN_LIMIT
    assert np.abs(hessian - hessian.T).max() < 1e-14 * np.abs(hessian).max()


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("hub", HUBS)
@pytest.mark.parametrize("force", FORCES)
def test_gradient_and_hessian_agree_with_differences(force, hub, seed):
    problem = of_everything(force, hub, seed)
    check(problem)
    if force in (OTHERS, "everything"):
        assert all(problem.potential.terms[term] > 0.0 for term in ("barrier", "friction", "drag", "damping"))
        assert problem.potential.terms["added mass"] != 0.0
        assert problem.coupling > 0.0
    if force == "loads":
        assert {"loads", "followers", "moments"} <= problem.potential.terms.keys()


@pytest.mark.parametrize("hub", HUBS)
@pytest.mark.parametrize("force", ["stretching", "bending", "twisting", "everything"])
def test_derivatives_of_a_laminate_off_its_neutral_axis_agree_with_differences(force, hub):
    problem = of_everything(force, hub, 0, "laminate")
    slopes = problem.model.strain_coupling  # arms begin and end with one layer
    assert len(slopes) == 6 and np.abs(slopes).max() > 0.5
    check(problem)


@pytest.mark.parametrize("hub", HUBS)
def test_friction_along_a_step_is_that_of_the_ways_of_contacts(hub):
    problem = of_everything(OTHERS, hub, 0)
    model, potential = problem.model, problem.potential
    vector = np.zeros(len(problem.scale))
    vector[problem.free] = 5e-6 * np.random.default_rng(5).standard_normal(len(problem.free))
    step = vector * problem.scale
    motion = np.zeros((len(model.bodies.names) + 1, 6))
    motion[model.bodies.body_of_free] = step[problem.size :].reshape(-1, 6)
    problem.value(0.0 * vector)
    node_step, held = step[model.layout.node[:, None] + np.arange(3)], motion[model.attached_body]
    node_step[model.attached_node] = held[:, :3] + np.cross(held[:, 3:], problem.trial.arm)
    ways = [term.slip_along(problem.trial, node_step, motion) for term in potential._of_carriers]
    way, threshold = np.concatenate(ways), model.scene.contact.friction.speed_threshold
    assert len(way) >= 3
    found, expected = [], []
    for fraction in (0.0, 0.5, 1.0):
        problem.value(fraction * vector)
        found.append(potential.terms["friction"])
        expected.append(dissipation(way, fraction, threshold))
    assert found[0] == pytest.approx(expected[0], rel=1e-12)
    assert np.diff(found) == pytest.approx(np.diff(expected), rel=1e-2)
    assert abs(found[2] - found[0]) > 1e-3 * found[0]


SHAPES = {
    "sphere": {"radius": 0.01},
    "box": {"size": [0.02, 0.016, 0.012]},
    "rounded box": {"size": [0.02, 0.016, 0.012], "rounding": 2e-3},
    "cylinder": {"radius": 0.01, "length": 0.014, "rim_points": 12},
    "capsule": {"radius": 0.006, "length": 0.014, "rounding": 0.006},
}
FEATURES = {  # a point of the surface and the way out of it
    "sphere": {"pole": ([0.006, 0.0, 0.008], [0.6, 0, 0.8])},
    "box": {"face": ([0.01, 0.001, 0.0005], [1, 0, 0]), "edge": ([0.01, 0.008, 0.001], [1, 1, 0])},
    "cylinder": {"side": ([0.006, 0.008, 0.001], [0.6, 0.8, 0]), "rim": ([0.01, 0, 0.007], [1, 0, 1])},
}
FEATURES["box"]["corner"] = ([0.01, 0.008, 0.006], [1, 1, 1])
FEATURES["rounded box"] = {"corner": ([0.01 - 0.85e-3, 0.008 - 0.85e-3, 0.006 - 0.85e-3], [1, 1, 1])}
FEATURES["capsule"] = {"end": ([0.0036, 0, 0.0058], [0.6, 0, 0.8])}


def around_a_shape(shape, feature, owner):
    """A short strip at a feature of a shape, a ball at the opposite one, and a tilted box over its upper face."""
    kind = {"rounded box": "box", "capsule": "cylinder"}.get(shape, shape)
    point, normal = (np.array(value, dtype=float) for value in FEATURES[shape][feature])
    normal /= np.linalg.norm(normal)
    along = np.cross(normal, [0.3, -0.5, 0.8])
    along /= np.linalg.norm(along)
    strip = rod([layer()], length=2e-3, stations=5, width=2e-3)
    strip["path"] |= {"start": list(point + 1.2e-3 * normal - 1e-3 * along), "direction": list(along)}
    strip["normal"] = list(normal)
    free = {"type": "free", "mass": 1e-3}
    top = {"sphere": 0.01, "box": 0.006, "cylinder": 0.007}[kind]
    corner = np.sqrt(3) * 3e-3  # one corner of the small box points straight down
    tilt = np.arccos(-1 / np.sqrt(3)) * np.array([1, -1, 0]) / np.sqrt(2)
    bodies = [
        {**ball(list(-point - 5.6e-3 * normal), radius=5e-3), "name": "ball"},
        {
            "name": "small",
            "position": [1e-3, 0.5e-3, top + corner + 0.5e-3],
            "rotation": list(tilt),
            "motion": free,
            "surface": {"shape": "box", "size": [6e-3, 6e-3, 6e-3]},
        },
    ]
    obstacles = []
    if owner == "obstacle":
        obstacles = [{"name": "shape", "type": kind, "position": [0, 0, 0], **SHAPES[shape]}]
    else:
        motion = {"type": "prescribed"} if owner == "prescribed" else {"type": "free", "mass": 2e-3}
        surface = {"shape": kind, **SHAPES[shape]}
        bodies.append({"name": "shape", "position": [0, 0, 0], "motion": motion, "surface": surface})
    law = contact(coefficient=0.5, speed_threshold=1e-2)
    return scene([strip], bodies=bodies, obstacles=obstacles, contact=law, gravity=[0.1, 0, -9.81])


@pytest.mark.parametrize("owner", ["obstacle", "prescribed", "free"])
@pytest.mark.parametrize(("shape", "feature"), [(shape, f) for shape, found in FEATURES.items() for f in found])
def test_derivatives_of_contact_agree_with_differences_at_every_feature_of_a_shape(shape, feature, owner):
    rng = np.random.default_rng(3)
    problem = Problem(around_a_shape(shape, feature, owner), OTHERS, STEP, rng, noise=5e-5)
    check(problem)
    assert all(problem.potential.terms[term] > 0.0 for term in ("barrier", "friction"))
    near = problem.potential.near
    touching = near.gap[: near.count] < 1e-3
    nodes = near.carrier[: near.count] < problem.model.node_count
    assert touching[nodes].any() and np.count_nonzero(touching[~nodes]) >= 2  # strip, ball and box
    assert (problem.coupling > 0.0) == (owner == "free")
