"""Gradients and Hessians of dimension 2 against differences, at random states of a plane."""

import numpy as np
import pytest
from support.evaluations import HESSIAN_LIMIT, Problem, check
from support.planar_scenes import AHEAD, HUBS, everything_in_plane, touching_rods

from bilayer_core.model.force_list import FORCES
from bilayer_core.model.plan import MODELS

ELASTIC = ("stretching", "bending", "bond")
IDLE = ("rod barrier", "rod friction")  # nothing in this scene touches: see below
IN_SPACE = ("twisting", "turning drag", "gyroscopic", "flattening")
ALONE = [force.name for force in FORCES if force.kind is not None and force.name not in (*IN_SPACE, *IDLE)]


def of_everything(ahead, hub, seed, model):
    content = everything_in_plane(AHEAD[ahead], hub)
    return Problem(content, np.random.default_rng(seed), model, dimension=2)


@pytest.mark.parametrize("hub", HUBS)
@pytest.mark.parametrize("ahead", AHEAD)
@pytest.mark.parametrize("model", MODELS)
def test_derivatives_of_every_force_agree_with_differences(model, ahead, hub):
    problem = of_everything(ahead, hub, 1, model)
    assert len(problem.model.off_axis.joint) == (6 if model == "laminate" else 0)
    forces = [name for name in ALONE if name != "bond" or model == "two_rod"]
    assert set(forces) == set(problem.model.forces) - set(IDLE)
    for force in forces:
        check(problem, (force,))
        assert list(problem.terms) == [force]
        assert force not in ELASTIC or problem.terms[force] > 0.0


@pytest.mark.parametrize("hub", HUBS)
@pytest.mark.parametrize("ahead", AHEAD)
@pytest.mark.parametrize("model", MODELS)
def test_derivatives_of_forces_together_agree_with_differences(model, ahead, hub):
    problem = of_everything(ahead, hub, 3, model)
    check(problem, tuple(name for name in ELASTIC if name in problem.model.forces))
    check(problem)
    assert all(problem.terms[term] > 0.0 for term in ("barrier", "friction", "drag", "damping"))


@pytest.mark.parametrize("hub", HUBS)
@pytest.mark.parametrize("ahead", AHEAD)
def test_the_newton_matrix_of_rods_that_touch_is_the_derivative_of_the_gradient(ahead, hub):
    problem = Problem(touching_rods(AHEAD[ahead], hub), np.random.default_rng(4), dimension=2, h=1e-5, noise=2e-5)
    evaluator, basis, free, rng = problem.evaluator, problem.basis, problem.free, np.random.default_rng(5)
    size = problem.size
    terms = evaluator.evaluate(problem.at, second=True)
    assert evaluator.factorise(problem.at) == (0.0, 0)
    assert all(terms[term] > 0.0 for term in ("rod barrier", "rod friction"))
    contacts = evaluator.problem.rod_contact.contacts
    touching = contacts.node[: contacts.count[0]]
    assert np.isin(touching, problem.model.constrained.node).any()
    loads = []
    for _ in range(3):
        load = np.zeros(len(problem.scale))
        load[free] = rng.standard_normal(len(free)) / problem.scale[free]
        full = basis @ load
        step = np.concatenate([p.ravel() for p in evaluator.newton_step(full[:size], full[size:].reshape(-1, 6))])
        loads.append((load, basis.T @ step / problem.scale))
    for load, step in loads:
        assert np.abs(np.delete(step, free)).max() == 0.0
        errors = []
        for h in (1e-8, 3e-8, 1e-7):
            unit = step * h / np.abs(step).max()
            near, far = (problem.value(k * unit)[1] - problem.value(-k * unit)[1] for k in (1, 2))
            change = (8 * near - far) / 12 * np.abs(step).max() / h
            wanted = -load * problem.scale
            errors.append(np.abs(change - wanted)[free].max() / np.abs(wanted).max())
        assert min(errors) < HESSIAN_LIMIT
