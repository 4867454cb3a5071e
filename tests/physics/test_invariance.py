"""What no force may do: feel a rigid motion, create momentum; and what twist must cost."""

import numpy as np
import pytest
from support.evaluations import at_rest
from support.sample_scenes import ball, contact, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.kinematics.rotation import rotation_matrix
from bilayer_core.model.build_model import build_model
from bilayer_core.model.section import bond, rectangle

ELASTIC = ("stretching", "bending", "twisting", "bond")
LONG = 1e3  # in which inertia does not count [s]


def bilayer(stations=9, torsion="laminate", length=0.02):
    layers = [layer("passive"), layer("active", thickness=1.5e-3)]
    return scene([rod(layers, length=length, stations=stations, torsion=torsion)])


def model_of(content):
    return build_model(load_scene(content))


def deformed(evaluator, start, seed=0, amplitude=2e-4):
    model, rng = evaluator.model, np.random.default_rng(seed)
    shape = evaluator.new()
    step = np.zeros(model.layout.size)
    step[model.layout.node[:, None] + np.arange(3)] = amplitude * rng.standard_normal((model.node_count, 3))
    step[model.layout.edge] = 0.2 * rng.standard_normal(model.rods.edge_count)
    evaluator.move(start, step, np.zeros((0, 6)), shape)
    return shape


def elastic_energy(evaluator, shape):
    return sum(evaluator.evaluate(shape, ELASTIC).values())


def test_rigid_motion_leaves_the_elastic_energy_unchanged():
    evaluator, start = at_rest(model_of(bilayer()), LONG)
    shape = deformed(evaluator, start)
    before = elastic_energy(evaluator, shape)
    turn, shift = rotation_matrix(np.array([0.4, -1.1, 2.0])), np.array([0.3, -0.2, 0.7])
    moved = evaluator.new()
    moved.position[:] = shape.position @ turn.T + shift
    for name in ("tangent", "director1", "director2"):
        getattr(moved, name)[:] = getattr(shape, name) @ turn.T
    moved.length[:] = shape.length
    assert before > 1.0
    assert elastic_energy(evaluator, moved) == pytest.approx(before, rel=1e-10)


def test_frames_carried_along_a_rigid_turn_turn_with_the_body():
    evaluator, start = at_rest(model_of(bilayer()), LONG)
    shape = deformed(evaluator, start)
    before = elastic_energy(evaluator, shape)
    axis, steps = np.array([0.3, 0.5, -0.8]), 400
    turn = rotation_matrix(axis / steps)
    now, following = shape, evaluator.new()
    for _ in range(steps):
        following.position[:] = now.position @ turn.T
        # a rigid turn spins each edge about its tangent by the turn's component along it
        tangents = now.tangent[: evaluator.model.rods.edge_count]
        evaluator.transport_frames(now, tangents @ (axis / steps), following)
        now, following = following, evaluator.new()
    assert elastic_energy(evaluator, now) == pytest.approx(before, rel=1e-6)


@pytest.mark.parametrize("forces", ["all", *ELASTIC])
@pytest.mark.parametrize("torsion", ["laminate", "layers"])
def test_elastic_forces_and_moments_sum_to_zero(torsion, forces):
    evaluator, start = at_rest(model_of(bilayer(torsion=torsion)), LONG)
    shape, model = deformed(evaluator, start), evaluator.model
    evaluator.evaluate(shape, None if forces == "all" else (forces,))
    gradient = evaluator.sums.gradient
    forces = gradient[model.layout.node[:, None] + np.arange(3)]
    about_tangent = gradient[model.layout.edge]
    moment = np.cross(shape.position, forces).sum(axis=0) + about_tangent @ shape.tangent[: model.rods.edge_count]
    scale = np.abs(forces).sum()
    assert np.abs(forces.sum(axis=0)).max() < 1e-12 * scale
    assert np.abs(moment).max() < 1e-12 * scale * 0.02


@pytest.mark.parametrize("stations", [21, 41, 81])
@pytest.mark.parametrize("torsion", ["laminate", "layers"])
def test_twist_of_a_bonded_strip_costs_its_torsional_stiffness_at_every_mesh(torsion, stations):
    rate, length = 0.5, 0.1  # [rad/m], [m]: so small that the stretch of the outer fibres does not count
    evaluator, start = at_rest(model_of(bilayer(stations, torsion, length)), LONG)
    model, shape = evaluator.model, evaluator.new()
    x = start.position[:, 0]
    angle = rate * x
    shape.position[:] = np.stack(
        [x, -start.position[:, 2] * np.sin(angle), start.position[:, 2] * np.cos(angle)], axis=1
    )
    middle = 0.5 * (angle[model.rods.edge_node] + angle[model.rods.edge_node + 1])
    evaluator.transport_frames(start, middle, shape)
    sections = [rectangle(model.scene.materials["gel"], *np.array([[0.01], [t], [1.0]])) for t in (1e-3, 1.5e-3)]
    tilt = bond(*sections, model.scene.coupling, torsion).tilt[0]
    stiffness = sum(s.twisting_stiffness[0] for s in sections) + tilt * (0.5 * 2.5e-3) ** 2
    assert elastic_energy(evaluator, shape) == pytest.approx(0.5 * rate**2 * stiffness * length, rel=2e-3)


def test_friction_and_barrier_between_ball_and_strip_keep_their_total_momentum():
    strip = rod([layer()], length=0.04, stations=21, start=(-0.02, 0, 0.0213))
    sphere = ball((0, 0, 0), velocity=[0.05, 0.1, 0.2], angular_velocity=[3, 0, 5])
    simulator = Simulator(
        load_scene(scene([strip], bodies=[sphere], contact=contact(coefficient=0.5, speed_threshold=1e-3)))
    )

    def momentum():
        frame = simulator.frame()
        return simulator.model.rods.node_mass @ simulator.velocities + 2.7e-3 * frame.body_velocities[0]

    before = momentum()
    simulator.run(0.05)
    assert simulator.statistics.bodies["ball"].most_nodes > 0
    assert simulator.frame().body_angular_velocities[0] != pytest.approx([3, 0, 5], abs=1e-3)
    assert np.abs(momentum() - before).max() < 1e-9 * np.linalg.norm(before)
