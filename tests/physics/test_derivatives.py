"""Gradients and Hessians of every force against differences, at random physical states.

Differences are those of the engine's own energy and gradient, for each force alone and all together.
"""

from dataclasses import replace

import numpy as np
import pytest
from support.evaluations import Problem, check
from support.records_by_hand import changed
from support.sample_scenes import GROUND, ball, contact, everything, layer, rod, scene
from support.slips import dissipation

from bilayer_core.forces.surface_friction import PARTS
from bilayer_core.model.force_list import FORCES
from bilayer_core.verification.validate.friction import two_boxes

ELASTIC = ("stretching", "bending", "twisting", "bond")
ROD_CONTACT = ("rod barrier", "rod friction", "flattening")  # see `test_rod_contact.py`, `test_flattening.py`
ALONE = [force.name for force in FORCES if force.kind is not None and force.name not in ROD_CONTACT]
OTHERS = tuple(name for name in ALONE if name not in ELASTIC)
TOGETHER = {"all but elasticity": OTHERS, "everything": None}

HUBS = {
    "prescribed hub": {"type": "prescribed"},
    "free hub": {"type": "free", "mass": 1e-3, "inertia": [2e-8, 3e-8, 4e-8]},
}


def without_rotation(model):
    """The model whose bond does not resist that its layers turn against each other."""
    stiffness = model.rods.joint_stiffness.copy()
    stiffness[model.rods.bend_count :] = 0.0
    return replace(model, rods=changed(model.rods, joint_stiffness=stiffness))


def without_translation(model):
    """The model whose bond resists turns alone, about both axes across the strip."""
    stiffness = model.rods.joint_stiffness.copy()
    stiffness[model.rods.bend_count :, 1] = stiffness[model.rods.bend_count :, 0]
    rods = changed(model.rods, joint_stiffness=stiffness)
    return replace(model, rods=rods, bonds=changed(model.bonds, stiffness=0.0 * model.bonds.stiffness))


BONDS = {"translation": without_rotation, "rotation": without_translation}


def of_everything(hub, seed, model="two_rod", change=lambda m: m):
    """The scene that has every force."""
    content = everything()
    content["bodies"][0]["motion"] = HUBS[hub]
    return Problem(content, np.random.default_rng(seed), model, change=change)


@pytest.fixture(scope="module", params=[0, 1], ids=["seed 0", "seed 1"])
def seed(request):
    return request.param


@pytest.fixture(scope="module", params=HUBS)
def problem(request, seed):
    return of_everything(request.param, seed)


@pytest.mark.parametrize("force", ALONE)
def test_gradient_and_hessian_of_every_force_agree_with_differences(problem, force):
    check(problem, (force,))
    assert list(problem.terms) == [force]


@pytest.mark.parametrize("forces", TOGETHER)
def test_gradient_and_hessian_of_forces_together_agree_with_differences(problem, forces):
    check(problem, TOGETHER[forces])
    assert all(problem.terms[term] > 0.0 for term in ("barrier", "friction", "drag", "damping"))
    assert problem.terms["added mass"] != 0.0
    assert {"loads", "followers", "moments"} <= problem.terms.keys()
    assert problem.coupling > 0.0


def test_energies_of_forces_alone_add_up_to_that_of_all_and_so_do_gradients(problem):
    whole = problem.value(0.0 * problem.scale)
    terms, every = dict(problem.terms), problem.model.forces
    alone = [problem.value(0.0 * problem.scale, (force,)) for force in every]
    assert whole[0] == pytest.approx(sum(energy for energy, _ in alone), rel=1e-12)
    summed = sum(gradient for _, gradient in alone)
    assert np.abs(whole[1] - summed).max() < 1e-12 * max(np.abs(gradient).max() for _, gradient in alone)
    assert [terms[force] for force in every] == pytest.approx([energy for energy, _ in alone], rel=1e-12)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("hub", HUBS)
@pytest.mark.parametrize("part", BONDS)
def test_gradient_and_hessian_of_either_part_of_the_bond_agree_with_differences(part, hub, seed):
    check(of_everything(hub, seed, change=BONDS[part]), ("bond",))


@pytest.mark.parametrize("hub", HUBS)
def test_derivatives_of_a_laminate_off_its_neutral_axis_agree_with_differences(hub):
    problem = of_everything(hub, 0, "laminate")
    slopes = problem.model.strain_coupling  # arms begin and end with one layer
    assert len(slopes) == 6 and np.abs(slopes).max() > 0.5
    for forces in (*((name,) for name in ALONE if name != "bond"), None):
        check(problem, forces)


@pytest.mark.parametrize("hub", HUBS)
def test_friction_along_a_step_is_that_of_the_ways_of_contacts(hub):
    problem = of_everything(hub, 0)
    model = problem.model
    vector = np.zeros(len(problem.scale))
    vector[problem.free] = 5e-6 * np.random.default_rng(5).standard_normal(len(problem.free))
    problem.value(0.0 * vector)
    way, threshold = (
        problem.evaluator.bound(problem.trial, *problem.split(vector)).slip,
        model.scene.contact.friction.speed_threshold,
    )
    assert len(way) >= 3
    found, expected = [], []
    for fraction in (0.0, 0.5, 1.0):
        problem.value(fraction * vector, ("friction",))
        found.append(problem.terms["friction"])
        expected.append(dissipation(way, fraction, threshold))
    assert found[0] == pytest.approx(expected[0], rel=1e-12)
    assert np.diff(found) == pytest.approx(np.diff(expected), rel=1e-2)
    assert abs(found[2] - found[0]) > 1e-3 * found[0]


@pytest.mark.parametrize("below", [(GROUND,), two_boxes(0.0137)], ids=["ground", "two boxes"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_friction_where_slip_turns_round_within_edges_agrees_with_differences(dimension, below):
    law = contact(coefficient=0.4)
    law["friction"] |= {"forward": 0.3, "backward": 0.5}
    strip = rod([layer()], length=0.03, stations=7, start=(0, 0, 9e-4))
    content = scene([strip], contact=law, obstacles=list(below))
    problem = Problem(content, np.random.default_rng(3), "laminate", dimension, noise=5e-5)
    assert problem.evaluator.problem.sliding.count[0] >= 7 + 2 * PARTS
    check(problem, ("friction",))
    assert problem.terms["friction"] > 0.0


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
    problem = Problem(around_a_shape(shape, feature, owner), np.random.default_rng(3), noise=5e-5)
    without_elasticity = tuple(name for name in problem.model.forces if name not in ELASTIC)
    for forces in (("barrier",), ("friction",), without_elasticity):
        check(problem, forces)
    assert all(problem.terms[term] > 0.0 for term in ("barrier", "friction"))
    near = problem.evaluator.problem.surfaces
    count = near.near_count[0]
    touching = near.near_gap[:count] < 1e-3
    nodes = near.near_contact_point[:count] < problem.model.node_count
    assert touching[nodes].any() and np.count_nonzero(touching[~nodes]) >= 2  # strip, ball and box
    assert (problem.coupling > 0.0) == (owner == "free")
