"""Joints, guides and reactions of clamps in markers and descriptions of logs."""

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore
from support.sample_scenes import fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.kinematics.rotation import matrix_from_quaternion
from bilayer_core.log.messages.description_text import from_text, to_text
from bilayer_core.log.messages.encoders import FrameEncoder
from bilayer_core.log.messages.markers import (
    ARROW_DECADE,
    ARROW_FORCE,
    ARROW_MOMENT,
    CUBE,
    CYLINDER,
    LINE_LIST,
    SPHERE,
    force_arrows,
)
from bilayer_core.log.messages.topics import output_topics


def block(name, position, **motion):
    """A rigid box."""
    free = {"type": "free", "mass": 1e-3, "inertia": [1e-7] * 3}
    return {"name": name, "position": list(position), "rotation": [0.3, 0.1, -0.2], "motion": motion or free}


@pytest.fixture(scope="module")
def simulator():
    guided = {"type": "guided", "mass": 1e-3, "inertia": [1e-7] * 3, "hinge": [0, 1, 0], "axis": [1, 0, 0]}
    guided["sliding"] = {"limits": [-0.01, 0.03]}
    bodies = [fixed(), block("a", (0, 0, 0.05)), block("b", (0.05, 0, 0.1)), block("cart", (0, 0.1, 0), **guided)]
    joints = [
        {"name": "ball", "type": "pin", "bodies": ["wall", "a"], "point": [0, 0, 0.02]},
        {"name": "knee", "type": "hinge", "bodies": ["a", "b"], "point": [0, 0, 0.1], "axis": [0, 1, 0]},
        {"name": "glue", "type": "weld", "bodies": ["b", "cart"], "point": [0.05, 0.1, 0.1]},
    ]
    strip = rod([layer()], 0.1, 11, clamp_start="wall")
    content = scene([strip], bodies=bodies, joints=joints, gravity=[0, 0, -9.81])
    simulator = Simulator(load_scene(content), integrator="tr_bdf2", dt=1e-3)
    simulator.run(0.05)
    return simulator


@pytest.fixture(scope="module")
def markers(simulator):
    topics = {spec.name: spec for spec in output_topics(simulator.description)}
    data = FrameEncoder(simulator.description).encode("markers", simulator.frame())
    found = get_typestore(Stores.ROS2_KILTED).deserialize_cdr(data, topics["markers"].type).markers
    return {marker.ns: marker for marker in found}


def test_every_joint_and_guide_has_a_marker_of_its_kind(markers):
    kinds = {
        name: marker.type for name, marker in markers.items() if name.split("/")[0] in ("joints", "guides", "rails")
    }
    assert kinds == {
        "joints/ball": SPHERE,
        "joints/knee": CYLINDER,
        "joints/glue": CUBE,
        "rails/cart": CYLINDER,
        "guides/cart": CYLINDER,
    }


def vector(point):
    """As an array."""
    return np.array([getattr(point, key) for key in ("x", "y", "z", "w") if hasattr(point, key)])


def test_a_joint_is_drawn_where_it_is_along_its_axis(simulator, markers):
    pose, frame = markers["joints/knee"].pose, simulator.frame()
    model = simulator.model
    a = model.bodies.names.index("a")
    turned = matrix_from_quaternion(frame.body_quaternions[a]) @ model.bodies.start_rotation[a].T
    place = frame.body_positions[a] + turned @ (np.array([0, 0, 0.1]) - model.bodies.start_position[a])
    np.testing.assert_allclose(vector(pose.position), place, atol=1e-12)
    axis = matrix_from_quaternion(vector(pose.orientation))[:, 2]
    np.testing.assert_allclose(axis, turned @ [0, 1, 0], atol=1e-12)
    assert np.linalg.norm(place - [0, 0, 0.1]) > 1e-3  # it has moved


def test_a_rail_stays_in_the_world_between_its_limits(markers):
    rail = markers["rails/cart"]
    np.testing.assert_allclose(vector(rail.pose.position), [0.01, 0.1, 0.0], atol=1e-12)
    assert rail.scale.z == pytest.approx(0.04)


def test_arrows_show_what_clamps_bear(simulator, markers):
    frame = simulator.frame()
    wall = simulator.model.bodies.names.index("wall")
    for name, part, unit in (("clamp_forces", slice(0, 3), ARROW_FORCE), ("clamp_moments", slice(3, 6), ARROW_MOMENT)):
        marker, wrench = markers[name], frame.clamp_wrenches[wall, part]
        assert (marker.type, len(marker.points)) == (LINE_LIST, 6)  # of the wall alone: nothing else holds a rod
        shaft = vector(marker.points[1]) - vector(marker.points[0])
        size = np.linalg.norm(wrench)
        assert size > 0.0
        np.testing.assert_allclose(shaft, ARROW_DECADE * np.log10(1 + size / unit) * wrench / size, atol=1e-15)


def test_a_zero_force_has_an_arrow_of_no_length():
    origin = np.array([[1.0, 2.0, 3.0]])
    np.testing.assert_array_equal(force_arrows(origin, np.zeros((1, 3))), np.repeat(origin, 6, axis=0))


def test_a_log_keeps_the_shapes_of_joints_and_older_logs_have_none(simulator):
    description = simulator.description
    text = to_text(description)
    assert from_text(text, description.scene_text).joints == description.joints
    del text["joints"]
    assert from_text(text, description.scene_text).joints == ()


def test_scenes_without_joints_and_clamps_have_no_markers_of_them():
    loose = Simulator(load_scene(scene([rod([layer()])])), dt=1e-3)
    data = FrameEncoder(loose.description).encode("markers", loose.frame())
    topics = {spec.name: spec for spec in output_topics(loose.description)}
    found = get_typestore(Stores.ROS2_KILTED).deserialize_cdr(data, topics["markers"].type).markers
    assert [marker.ns.split("/")[0] for marker in found] == ["strands", "contact_forces"]
