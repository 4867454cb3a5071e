"""Rods, bodies, clamps and joints by name."""

import numpy as np
import pytest
from support.sample_scenes import everything

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError, UnknownName

MODELS = ("laminate", "two_rod")


@pytest.fixture(scope="module", params=MODELS)
def gripper(request):
    simulator = Simulator(load_scene("gripping"), model=request.param)
    simulator.run(stop=lambda: simulator.contact_forces[: simulator.model.node_count].any())
    return simulator


def test_views_of_rods_show_all_nodes_of_the_simulator_once(gripper):
    nodes = np.concatenate([rod.nodes for rod in gripper.rods.values()])
    edges = np.concatenate([rod.edges for rod in gripper.rods.values()])
    assert nodes.tolist() == list(range(gripper.model.node_count))
    assert edges.tolist() == list(range(gripper.model.rods.edge_count))
    frame = gripper.frame()
    for of_rods, of_frame in (
        ("positions", frame.positions),
        ("velocities", frame.velocities),
        ("strain", frame.strain),
        ("curvature", frame.curvature),
        ("contact_forces", frame.contact_forces),
    ):
        shown = np.concatenate([getattr(rod, of_rods) for rod in gripper.rods.values()])
        np.testing.assert_array_equal(shown, of_frame[: len(nodes)], err_msg=of_rods)
    shown = np.concatenate([rod.directors for rod in gripper.rods.values()])
    np.testing.assert_array_equal(shown, frame.directors)
    assert np.abs(frame.contact_forces).max() > 0.0 and np.abs(frame.velocities).max() > 0.0


def test_arc_length_ends_with_the_length_of_the_path(gripper):
    arms = gripper.scene.rods[0]
    for name, rod in gripper.rods.items():
        assert rod.arc_length[0] == 0.0 and (np.diff(rod.arc_length) != 0.0).all(), name
        assert rod.arc_length.max() == pytest.approx(arms.path.length, rel=1e-2)


def test_strains_of_layers_do_not_depend_on_the_model():
    found = {}
    for model in MODELS:
        simulator = Simulator(load_scene("bending"), model=model)
        simulator.solve_static()
        rod = next(iter(simulator.rods.values()))
        found[model] = {name: (layer.strain.mean(), layer.thickness[0]) for name, layer in rod.layers.items()}
    one, other = found.values()
    assert one.keys() == other.keys() and len(one) == 2
    for name, (strain, thickness) in one.items():
        assert strain == pytest.approx(other[name][0], rel=0.01), name
        assert thickness == other[name][1]


def test_velocities_of_bodies_are_the_slopes_of_their_motion():
    falling = everything()
    simulator = Simulator(load_scene(falling))
    simulator.run(0.02)
    ball = simulator.bodies["ball"]
    position, velocity = ball.position, ball.velocity
    step = simulator.step()
    assert np.linalg.norm(velocity) > 0.0
    np.testing.assert_allclose((ball.position - position) / step.length, 0.5 * (velocity + ball.velocity), atol=1e-3)
    assert ball.angular_velocity.shape == (3,)


def test_a_wrong_name_is_told_with_the_nearest_and_is_a_key_error(gripper):
    with pytest.raises(UnknownName, match=r"rods\['arm0'\]: there is none of this name; did you mean arm_0"):
        gripper.rods["arm0"]
    with pytest.raises(KeyError, match="there are: hub, ball"):
        gripper.bodies["xyz"]
    assert gripper.bodies.get("xyz") is None and "xyz" not in gripper.bodies
    assert isinstance(pytest.raises(InputError, lambda: gripper.joints["x"]).value, KeyError)


def arrays_of(thing, depth=0):
    """Every array that a public attribute of an object holds, with how one comes to it."""
    for name in dir(thing):
        if name.startswith("_") or name in {"T", "base", "model", "steps", "statistics", "plane_watch"}:
            continue
        value = getattr(thing, name)
        if isinstance(value, np.ndarray):
            yield name, value
        elif isinstance(value, dict):
            yield from ((f"{name}.{key}", part) for key, part in value.items() if isinstance(part, np.ndarray))


def test_writing_into_any_array_that_was_handed_out_changes_nothing(gripper):
    views = [*gripper.rods.values(), *gripper.bodies.values(), *gripper.clamps.values(), gripper]
    layers = [layer for rod in gripper.rods.values() for layer in rod.layers.values()]
    description, found = gripper.description, 0
    before, state = gripper.frame(), gripper.save_state()
    for thing in [*views, *layers, gripper.frame(), description, *description.strands, *description.layers]:
        for _, array in arrays_of(thing):
            found += 1
            if array.flags.writeable:
                array[...] = 7
            else:
                with pytest.raises(ValueError, match="read-only"):
                    array[...] = 7
    assert found > 100
    np.testing.assert_array_equal(gripper.save_state(), state)
    after = gripper.frame()
    for name, array in arrays_of(before):
        np.testing.assert_array_equal(getattr(after, name), array, err_msg=name)
    for strand, fresh in zip(description.strands, gripper.description.strands, strict=True):
        np.testing.assert_array_equal(strand.thickness, fresh.thickness)


def test_whatever_is_public_is_shown_within_a_screen(gripper):
    rod = next(iter(gripper.rods.values()))
    shown = [gripper, gripper.rods, rod, rod.layers, gripper.bodies, gripper.clamps, gripper.joints, gripper.scene]
    shown += [gripper.frame(), gripper.description, *gripper.description.strands, gripper.scene.rods[0]]
    shown += [*gripper.bodies.values(), *gripper.clamps.values(), *rod.layers.values(), gripper.run(0.0)]
    shown += [gripper.scene.bodies[1], gripper.plan, gripper.model, gripper.model.strands[0], gripper.model.layout]
    shown += [gripper.model.bodies, gripper.model.surfaces, gripper.statistics]
    for thing in shown:
        assert 0 < len(repr(thing)) <= 2000, type(thing)
        assert "object at 0x" not in repr(thing) and "array(" not in repr(thing), type(thing)
    assert "arm_0, arm_1, arm_2, arm_3" in repr(gripper.rods)
