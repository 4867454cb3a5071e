"""The contact of rods by itself: derivatives, sums of forces, the Newton matrix."""

from dataclasses import replace

import numpy as np
import pytest
from support.evaluations import Problem
from support.meeting_rods import CASES, D_HAT, WIDTH, Rods, model_of, parallel_rods
from support.records_by_hand import changed
from support.sample_scenes import contact, layer, rod, scene
from support.slips import dissipation

from bilayer_core.kinematics.rotation import rotation_matrix


def dense(contacts, nodes):
    """Second derivatives of all contacts, from what the kernels leave for the matrix."""
    hessian = np.zeros((nodes, 3, nodes, 3))
    for c in range(contacts.count[0]):
        i, j = contacts.node[c]
        places = [i, i + 1, j, j + 1]
        w, m, a = contacts.weight[c], contacts.matrix[c], contacts.foot_gradient[c]
        side = contacts.tangential_stiffness[c] if contacts.inner[c] else 0.0
        turn = contacts.turn[c, :, :3].reshape(2, 3, 3)  # of friction
        rate = [w[k] * np.eye(3) + (-1.0, 1.0)[k % 2] * turn[k // 2] for k in range(4)]
        for k, row in enumerate(places):
            for n, column in enumerate(places):
                hessian[row, :, column, :] += rate[k].T @ m @ rate[n] - side * np.outer(a[k], a[n])
    return hessian.reshape(3 * nodes, 3 * nodes)


def differences(function, position, h):
    """Fourth-order central differences of a function of node positions, by each of their components."""
    rows = []
    for index in range(position.size):
        values = []
        for step in (h, -h, 2 * h, -2 * h):
            moved = position.copy()
            moved.ravel()[index] += step
            values.append(function(moved))
        rows.append((8 * (values[0] - values[1]) - (values[2] - values[3])) / (12 * h))
    return np.array(rows)


@pytest.mark.parametrize("term", ["barrier", "friction"])
@pytest.mark.parametrize("case", CASES)
def test_derivatives_of_rod_contact_agree_with_differences(case, term):
    model, position = CASES[case](np.random.default_rng(3))
    rods, force = Rods(model), f"rod {term}"
    rods.start(position, position + 2e-6 * np.random.default_rng(4).standard_normal(position.shape))
    energy, gradient = rods.evaluate(position, force)
    found = rods.contacts if term == "barrier" else rods.lagged
    hessian = dense(found, model.node_count)
    assert energy > 0.0 and found.count[0] >= 4
    if term == "barrier":
        multiplicity, inner = found.multiplicity[: found.count[0]], found.inner[: found.count[0]]
        assert inner.any()
        assert case != "folded" or multiplicity.min() < 0  # a corner seen from inside
        assert case != "parallel" or not inner.all()
    errors = []
    for h in (1e-9, 3e-9, 1e-8, 3e-8):
        by_energy = differences(lambda at: rods.evaluate(at, force)[0], position, h)
        by_gradient = differences(lambda at: rods.evaluate(at, force)[1].ravel(), position, h)
        errors.append(
            (
                np.abs(by_energy - gradient.ravel()).max() / np.abs(gradient).max(),
                np.abs(by_gradient - hessian).max() / np.abs(hessian).max(),
            )
        )
    best = np.min(errors, axis=0)
    assert best[0] < 1e-7 and best[1] < 1e-6


@pytest.mark.parametrize("case", CASES)
def test_friction_between_rods_along_a_step_is_that_of_the_ways_of_contacts(case):
    model, position = CASES[case](np.random.default_rng(3))
    rods, rng = Rods(model), np.random.default_rng(4)
    origin = position + 2e-6 * rng.standard_normal(position.shape)
    step = 1e-5 * rng.standard_normal(position.shape)
    rods.start(position, origin)
    way, threshold = rods.bound(position, step).slip, model.scene.contact.friction.speed_threshold
    assert len(way) >= 4
    for fraction in (0.0, 0.3, 1.0):
        energy, _ = rods.evaluate(position + fraction * step, "rod friction")
        assert energy == pytest.approx(dissipation(way, fraction, threshold), rel=1e-9)


def moved_rigidly(position):
    turn = rotation_matrix(np.array([0.7, -0.4, 1.9]))
    return position @ turn.T + np.array([0.1, -2.0, 0.3])


@pytest.mark.parametrize("case", CASES)
def test_the_barrier_between_rods_feels_no_rigid_motion_and_exerts_no_net_force(case):
    model, position = CASES[case](np.random.default_rng(5))
    rods = Rods(model)
    energy, gradient = rods.evaluate(position)
    assert rods.evaluate(moved_rigidly(position))[0] == pytest.approx(energy, rel=1e-9)
    assert energy > 0.0
    scale = np.abs(gradient).sum()
    center = position.mean(axis=0)
    assert np.abs(gradient.sum(axis=0)).max() < 1e-13 * scale
    assert np.abs(np.cross(position - center, gradient).sum(axis=0)).max() < 1e-13 * scale * np.ptp(position)


def test_friction_between_rods_is_opposite_on_the_two_and_a_part_of_what_presses_them():
    model, position = parallel_rods(np.random.default_rng(5))
    rods = Rods(model)
    rods.start(position, position)
    load = np.linalg.norm(rods.evaluate(position)[1][6:].sum(axis=0))  # with which the barrier presses
    slipped = position.copy()
    slipped[:6, 0] += 1e-4  # far above the threshold in 10 ms
    _, gradient = rods.evaluate(slipped, "rod friction")
    first, second = -gradient[:6].sum(axis=0), -gradient[6:].sum(axis=0)
    assert first == pytest.approx(-second, abs=1e-12 * load)
    assert first[0] == pytest.approx(-0.4 * load, rel=0.05)  # normals lean by the noise of the shape


def test_friction_between_round_rods_exerts_no_net_force_and_no_moment():
    problem = Problem(closer(pressed(None)), np.random.default_rng(2), h=1e-5, noise=5e-5, origin_noise=1e-6, turns=0.1)
    evaluator, layout, rods = problem.evaluator, problem.model.layout, problem.model.rods
    assert not problem.model.rails.exists
    evaluator.start_stage(problem.at)  # friction is frozen there
    assert evaluator.evaluate(problem.at, ("rod friction",))["rod friction"] > 0.0
    gradient = evaluator.sums.gradient
    of_nodes = gradient[layout.node[:, None] + np.arange(3)]
    scale = np.abs(of_nodes).sum()
    moment = np.cross(problem.at.position, of_nodes).sum(axis=0)
    moment += gradient[layout.edge] @ problem.at.tangent[: rods.edge_count]
    assert np.abs(of_nodes.sum(axis=0)).max() < 1e-13 * scale
    assert np.abs(moment).max() < 1e-13 * scale * 0.02


MESHES = [(3, 3), (11, 12), (21, 38), (81, 55)]


@pytest.mark.parametrize("stations", MESHES)
def test_parallel_ribbons_press_on_each_other_with_the_same_force_on_any_meshes(stations):
    lower, upper = (rod([layer()], stations=n, name=name) for n, name in zip(stations, "ab", strict=True))
    model = model_of([lower, {**upper, "path": {**upper["path"], "start": [0, 0, 1.8e-3]}}])
    _, gradient = Rods(model).evaluate(model.start_position)
    gap = 0.8e-3
    s = gap - D_HAT
    force = 1e7 * (2.0 * s * np.log(gap / D_HAT) + s * s / gap) * 0.1
    assert -gradient[stations[0] :].sum(axis=0) == pytest.approx([0, 0, force], rel=1e-12, abs=1e-9 * force)


def pressed(hub):
    """Two bilayer arms of a hub, bent onto each other, and a third rod across them; held nodes take part in contact.

    Without a hub nothing holds them.
    """
    arms = rod(
        [layer("bottom"), layer("top")], length=0.02, stations=7, start=(0, 0, 0.5e-3), name="arm", clamp_start="hub"
    )
    under = {**rod([layer()], length=0.02, stations=8, start=(-0.004, 1e-4, -2.6e-3), name="under")}
    held = {**rod([layer()], length=0.015, stations=5, start=(0, 0, -5.2e-3), name="held"), "clamp_start": "hub"}
    motion = {"type": "prescribed"} if hub == "prescribed" else {"type": "free", "mass": 1e-3, "inertia": [2e-8] * 3}
    bodies = [{"name": "hub", "position": [0, 0, 0], "motion": motion}] if hub else []
    law = {**contact(coefficient=0.4, speed_threshold=0.1), "rods": True}
    rods = [{**each, "width": WIDTH} for each in (arms, under, held)]
    if not hub:
        rods = [{key: value for key, value in each.items() if key != "clamp_start"} for each in rods]
    return scene(rods, bodies=bodies, contact=law)


def without_elasticity(model):
    """Its gradient has symmetric differences only up to the holonomy of frames."""
    stiff = {name: 0.0 * getattr(model.rods, name) for name in ("axial_stiffness", "joint_stiffness")}
    bonds = changed(model.bonds, stiffness=0.0 * model.bonds.stiffness)
    return replace(model, rods=changed(model.rods, **stiff), bonds=bonds)


def closer(content):
    """The scene with the rod in the middle nearer to the one above it than the barrier distance."""
    content["rods"][1]["path"]["start"][2] += 0.6e-3
    return content


@pytest.mark.parametrize("hub", ["prescribed", "free"])
def test_the_newton_matrix_with_rod_contact_is_the_derivative_of_the_gradient(hub):
    rng = np.random.default_rng(2)
    problem = Problem(
        closer(pressed(hub)), rng, h=1e-5, noise=5e-5, origin_noise=1e-6, turns=0.0, change=without_elasticity
    )
    evaluator, model, size = problem.evaluator, problem.model, problem.size
    scale, held = problem.scale, np.setdiff1d(np.arange(len(problem.scale)), problem.free)

    def gradient(vector):
        problem.value(vector / scale)
        body = evaluator.sums.body.copy()  # in the chart of rotations at the moved place; wanted is that at `at`
        body[:, 3:] -= 0.5 * np.cross(vector[size:].reshape(-1, 6)[:, 3:], body[:, 3:])
        return np.concatenate([evaluator.sums.gradient, body.ravel()])

    terms = evaluator.evaluate(problem.at, second=True)
    assert evaluator.factorise(problem.at) == (0.0, 0)
    assert terms["rod barrier"] > 0.0 and terms["rod friction"] > 0.0
    contacts = evaluator.problem.rod_contact.contacts
    touching = contacts.node[: contacts.count[0]]
    assert np.isin(touching, model.constrained.node).any()
    loads = []
    for _ in range(3):
        load = rng.standard_normal(len(scale)) / scale
        load[held] = 0.0
        step = np.concatenate([p.ravel() for p in evaluator.newton_step(load[:size], load[size:].reshape(-1, 6))])
        step[held] = 0.0
        loads.append((load, step))
    for load, step in loads:
        errors = []
        for h in (1e-8, 3e-8, 1e-7):
            unit = step * h / np.abs(step / scale).max()
            change = (8 * (gradient(unit) - gradient(-unit)) - (gradient(2 * unit) - gradient(-2 * unit))) / 12
            change *= np.abs(step / scale).max() / h
            errors.append(np.abs((change + load) * scale).max() / np.abs(load * scale).max())
        assert min(errors) < 1e-6
