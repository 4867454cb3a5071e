"""What observers see of a step's forces, against formulas of whole arrays."""

import numpy as np
import pytest
from support.fluid_energy import energy_of_fluid
from support.sample_scenes import contact, everything, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.kinematics.rotation import quaternion_from_matrix
from bilayer_core.model.state import director_rates

SCENES = {
    "every force, two rods": (everything, "two_rod"),
    "every force, laminate": (everything, "laminate"),
    "closed": (lambda: "ring", "laminate"),
    "planar": (lambda: "crawling_inchworm", "laminate"),
    "rods that meet": (lambda: "knot", "laminate"),
}


@pytest.fixture(params=SCENES)
def simulator(request):
    content, model = SCENES[request.param]
    simulator = Simulator(load_scene(content()), model=model)
    simulator.run(0.01)
    return simulator


def strain_of(strand, edges):
    """Means of the strains of the edges before and after each node, where a strand has ends."""
    own = edges[strand.first_edge : strand.first_edge + strand.node_count - 1]
    return 0.5 * (np.concatenate([own[:1], own]) + np.concatenate([own, own[-1:]]))


def test_strains_of_nodes_are_those_of_their_edges(simulator):
    model, at, frame = simulator.model, simulator._stepper.engine.end, simulator.frame()
    edges = at.length[: model.rods.edge_count] / model.rods.rest_length - 1.0
    a, b = model.rods.joint_a, model.rods.joint_b
    cosine = np.sum(at.tangent[a] * at.tangent[b], axis=1)
    bend = np.sum(at.tangent[b] * at.director1[a], axis=1)
    bend -= np.sum(at.tangent[a] * at.director1[b], axis=1)
    bends = slice(model.rods.bend_count)
    expected = np.zeros(len(frame.curvature))
    expected[model.joint_node[bends]] = bend[bends] / (1.0 + cosine[bends]) / model.voronoi_length
    for strand in model.strands:
        nodes = np.arange(strand.first_node, strand.first_node + strand.node_count)
        strain = strain_of(strand, edges)
        if strand.closed:  # its first two nodes are its last
            strain[0], strain[-1] = strain[-2], strain[1]
            expected[nodes[[0, -1]]] = expected[nodes[[-2, 1]]]
        else:
            free = [end for end in (0, -1) if nodes[end] not in model.constrained.node]
            expected[nodes[free]] = [expected[nodes[1 if end == 0 else -2]] for end in free]
        np.testing.assert_allclose(frame.strain[nodes], strain, rtol=0, atol=1e-14)
        np.testing.assert_allclose(frame.curvature[nodes], expected[nodes], rtol=1e-12, atol=1e-12)
    assert np.abs(expected).max() > 1e-3
    assert not frame.strain[model.node_count :].any() and not frame.curvature[model.node_count :].any()


def test_wrenches_on_bodies_are_sums_over_what_touches_and_what_is_held(simulator):
    model, engine, frame = simulator.model, simulator._stepper.engine, simulator.frame()
    sums, at = engine.sums, engine.end
    contact = -sums.contact
    for own in (engine.joints, engine.mechanisms):
        np.add.at(contact, own.body, own.gradient.reshape(-1, 6))
    np.testing.assert_allclose(frame.contact_wrenches, contact[:-1], rtol=1e-12, atol=1e-18)
    points = model.node_count + model.point_count
    np.testing.assert_array_equal(frame.contact_forces, -sums.contact_point[:points])
    clamp_edges = slice(model.rods.edge_count, None)
    held, tangent, of_edge = -sums.attached, at.tangent[clamp_edges], -sums.edge[clamp_edges]
    moment = np.cross(at.arm, held) + np.cross(tangent, of_edge[:, :3]) + of_edge[:, 3:] * tangent
    clamps = np.zeros((len(model.bodies.names), 6))
    np.add.at(clamps, model.constrained.body, np.concatenate([held, moment], axis=1))
    np.testing.assert_allclose(frame.clamp_wrenches, clamps, rtol=1e-12, atol=1e-12 * np.abs(clamps).max(initial=1e-9))


def kinetic_energy(model, state):
    """Of nodes, of edges about their tangents, of masses off the curve, and of free bodies [J]."""
    kinetic = (
        0.5 * model.rods.node_mass @ np.square(state.velocity).sum(axis=1)
        + 0.5 * model.rods.spin_inertia @ state.spin**2
    )
    raised, rates = model.raised, director_rates(model, state)
    for half in range(raised.first_moment.shape[1]):
        velocity = state.velocity[model.rods.edge_node[raised.edge] + half]
        kinetic += raised.first_moment[:, half] @ (velocity * rates).sum(axis=1)
    kinetic += 0.5 * raised.second_moment @ np.square(rates).sum(axis=1)
    for slot, body in enumerate(model.free_bodies.body_of_free):
        velocity, spin, rotation = (
            of[body] for of in (state.body_velocity, state.body_angular_velocity, state.body_rotation)
        )
        second = model.free_bodies.second_moment[slot]
        inertia = rotation @ (np.trace(second) * np.eye(3) - second) @ rotation.T
        kinetic += 0.5 * (model.free_bodies.mass[slot] * velocity @ velocity + spin @ inertia @ spin)
    return kinetic


def test_energies_and_rotations_seen_are_those_of_the_state(simulator):
    model, state, frame = simulator.model, simulator._state, simulator.frame()
    assert frame.energy["kinetic"] == pytest.approx(kinetic_energy(model, state), rel=1e-12)
    if model.fluid.exists:
        moving = state.velocity, state.spin, director_rates(model, state)
        of_fluid = energy_of_fluid(model, simulator._stepper.engine.end, *moving)
        assert frame.energy["fluid"] == pytest.approx(of_fluid, rel=1e-12)
    assert ("fluid" in frame.energy) == model.fluid.exists
    expected = [quaternion_from_matrix(of) for of in state.body_rotation]
    np.testing.assert_allclose(frame.body_quaternions, np.reshape(expected, (-1, 4)), rtol=0, atol=1e-15)


def test_each_pair_that_touches_is_seen_once(simulator):
    surfaces, rods = simulator._stepper.engine.surfaces, simulator._stepper.engine.rod_contact
    owners, expected = simulator._stepper.contact_owners, set()
    if surfaces.exists:
        near = np.arange(surfaces.near_count[0])[surfaces.near_gap[: surfaces.near_count[0]] < surfaces.d_hat]
        points, own = owners.of_point[surfaces.near_contact_point[near]], owners.of_surface[surfaces.near_surface[near]]
        expected |= {tuple(sorted(pair)) for pair in zip(points.tolist(), own.tolist(), strict=True)}
    if rods.exists:
        nodes = owners.of_point[rods.contacts.node[: rods.contacts.count[0]]]
        expected |= {tuple(sorted(pair)) for pair in nodes.tolist()}
    for _ in range(2):
        _, seen = simulator._stepper.observe(simulator._state)
        assert sorted(divmod(number, owners.count) for number in seen.tolist()) == sorted(expected)
    assert len(simulator.frame().contacts) == len(expected)


def test_a_frame_keeps_what_was_seen_while_the_run_goes_on(simulator):
    frame, again = simulator.frame(), simulator.frame()
    names = ("strain", "clamp_wrenches", "contact_wrenches", "state")
    before = {name: np.array(getattr(again, name)) for name in names}
    simulator.run(0.002)
    simulator.frame()
    for name, values in before.items():
        np.testing.assert_array_equal(getattr(frame, name), values)


def test_pairs_press_with_the_weight_that_they_bear():
    """A box on a box, which bears it with its face or with its corners, and a strip across both their sides."""
    block = {"shape": "box", "size": [0.02, 0.02, 0.01]}
    free = {"type": "free", "mass": 0.003}
    bodies = [{"name": "top", "surface": block, "position": [0.003, 0, 0.01605], "motion": free}]
    table = {"name": "table", "type": "box", "size": [0.02, 0.02, 0.02], "position": [0, 0, 0]}
    strip = rod([layer()], 0.03, 11, start=(-0.015, 0, 0.0222), name="strip")
    content = scene([strip], bodies=bodies, obstacles=[table], gravity=[0, 0, -9.81], contact=contact())
    simulator = Simulator(load_scene(content | {"damping": {"mass": 50.0}}))
    simulator.run(1.0)
    of_strip = 9.81 * simulator.model.rods.node_mass.sum()
    assert simulator.pair_forces["top", "table"] == pytest.approx(9.81 * 0.003 + of_strip, rel=1e-6)
    assert simulator.pair_forces["strip", "top"] == pytest.approx(of_strip, rel=1e-5)
    assert simulator.pair_forces["strip", "table"] == 0.0
    assert simulator.summary()["pair_forces"].keys() == {"top on table", "strip on top"}
