"""Hinges, pins, rails and junctions in motion; columns, periods and shapes at rest are cases of `bilayer validate`."""

import numpy as np
import pytest
from sample_scenes import fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SceneError
from bilayer_core.kinematics.rotation import rotation_matrix
from bilayer_core.validate.joints import layers_of, swinging

MODELS, GRAVITY = ["laminate", "two_rod"], [0, 0, -9.81]
STEPS = {"integrator": "sdirk2", "dt": 5e-4}


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("model", MODELS)
def test_a_hinge_bears_no_moment_about_its_axis_and_stays_where_it_is(model, dimension):
    simulator = swinging(model, dimension, **STEPS)
    for _ in range(40):
        simulator.step()
        hinge, clamp = simulator.bodies["pin"], simulator.clamps["arm.start"]
        assert hinge.position.tolist() == [0, 0, 0]
        # What turns the joint is the inertia of half an edge: a part in 1e5 of the strip's.
        weight = np.linalg.norm(clamp.wrench[:3])
        assert abs(hinge.clamp_wrench[4]) < 1e-5 * weight * 0.1
    assert np.linalg.norm(np.cross(simulator.positions[0], [0, 1, 0])) < 1e-3


@pytest.mark.parametrize("model", MODELS)
def test_a_pin_lets_a_strip_swing_in_any_plane_as_a_hinge_does_in_its_own(model):
    hinged, turn = swinging(model, 3, **STEPS), rotation_matrix(np.array([0, 0, 0.7]))
    content = hinged.scene.model_dump(mode="json", by_alias=True, exclude_none=True)
    (strip,), (pin,) = content["rods"], content["bodies"]
    strip["path"]["direction"] = (turn @ strip["path"]["direction"]).tolist()
    strip["normal"] = (turn @ strip["normal"]).tolist()
    pin["motion"] = {"type": "guided", "pinned": True}
    pinned = Simulator(load_scene(content), model=model, dimension=3, **STEPS)
    for simulator in (hinged, pinned):
        simulator.run(0.1)
    assert np.ptp(hinged.positions[-1]) > 0.05
    np.testing.assert_allclose(pinned.positions, hinged.positions @ turn.T, atol=1e-9)


@pytest.mark.parametrize("model", MODELS)
def test_a_hinge_slides_on_its_rail_and_turns_as_it_goes(model):
    simulator = swinging(model, 2, **STEPS)
    content = simulator.scene.model_dump(mode="json", by_alias=True, exclude_none=True)
    content["bodies"][0]["motion"] |= {"axis": [1, 0, 0]}
    simulator = Simulator(load_scene(content), model=model, dimension=2, **STEPS)
    start = simulator.com[0]
    simulator.run(0.1)
    assert abs(simulator.bodies["pin"].position[0]) > 1e-4
    assert simulator.bodies["pin"].position[[1, 2]].tolist() == [0, 0]
    assert simulator.com[0] == pytest.approx(start, abs=1e-12)  # nothing pushes along the rail
    assert simulator.bodies["pin"].clamp_wrench[0] == pytest.approx(0.0, abs=1e-8)


def star(model, **junction):
    """Three bilayer legs that meet in a junction, one of them stronger, in free flight."""
    legs = []
    for k, angle in enumerate((0.0, 2.0, 4.3)):
        active = layer("top", eigenstrain={"stimulus": "humidity", "gain": 0.02 * (1 + k)})
        leg = rod([layer("bottom"), active], 0.04, 11, name=f"leg_{k}", clamp_start="junction")
        leg["path"]["direction"] = [np.cos(angle), np.sin(angle), 0.3 * k]
        leg["path"]["start"] = [0.003 * np.cos(angle), 0.003 * np.sin(angle), 0.0]
        leg["normal"] = [-0.3 * k * np.cos(angle), -0.3 * k * np.sin(angle), 1.0]
        legs.append(leg)
    humidity = {"humidity": {"schedule": {"type": "ramp", "start": 0.0, "end": 0.01, "from": 0.0, "to": 1.0}}}
    hub = {"name": "junction", "position": [0, 0, 0], "motion": {"type": "free", **junction}}
    soft = {"gel": {"youngs_modulus": 1e6, "poisson_ratio": 0.5, "density": 1000.0}}
    content = scene(legs, bodies=[hub], stimuli=humidity, materials=soft)
    return Simulator(load_scene(content), model=model, dimension=3, integrator="sdirk2", dt=2.5e-4)


@pytest.mark.parametrize("model", MODELS)
def test_a_junction_has_no_mass_and_keeps_momentum_and_directions(model):
    simulator = star(model)
    start = simulator.com
    assert simulator.model.bodies.mass.tolist() == [0.0]
    simulator.run(0.03)
    assert np.ptp(simulator.curvatures) > 5.0  # the legs bend
    np.testing.assert_allclose(simulator.com, start, atol=1e-12)
    mass, model_ = simulator.model.node_mass, simulator.model
    momentum = mass @ simulator.velocities[: model_.node_count]
    assert np.abs(momentum).max() < 1e-10 * mass.sum()
    # The legs leave the junction at the angles at which they met: it is rigid.
    rotation = rotation_of(simulator, "junction")
    for strand in model_.strands:
        first = strand.first_node
        held = rotation @ model_.start_position[first]
        assert simulator.positions[first] == pytest.approx(simulator.bodies["junction"].position + held, abs=1e-12)


def rotation_of(simulator, name):
    """Rotation matrix of a body."""
    index = simulator.model.bodies.names.index(name)
    layout, flat, begin = simulator.description.state_layout, simulator.save_state(), 0
    for part, shape in layout:
        size = int(np.prod(shape))
        if part == "body_rotation":
            return flat[begin : begin + size].reshape(shape)[index]
        begin += size
    raise AssertionError


def test_a_junction_is_the_limit_of_light_bodies():
    def shape(**junction):
        simulator = star("laminate", **junction)
        simulator.run(0.02)
        return simulator.positions[: simulator.model.node_count]

    none = shape()
    far = [np.abs(shape(mass=m, inertia=[1e-6 * m] * 3) - none).max() for m in (1e-4, 1e-5, 1e-6)]
    assert far[0] > 5.0 * far[1] > 5.0 * far[2]
    assert far[2] < 1e-3 * 0.04  # what is left is the inertia of the half edges: of second order in their length


@pytest.mark.parametrize(
    ("motion", "fault"),
    [
        (
            {"type": "guided"},
            "bodies.joint.motion.axis: .*must be given, or `hinge`, or `pinned`: else it does not move",
        ),
        (
            {"type": "guided", "hinge": [0, 1, 0], "pinned": True},
            "motion.hinge: .*a pinned body turns in all directions",
        ),
        ({"type": "guided", "hinge": [0, 1, 0], "speed": 1.0}, "motion.speed: .*without an axis it does not slide"),
        ({"type": "guided", "axis": [1, 0, 0], "angular_speed": 1.0}, "motion.angular_speed: .*without a hinge"),
        ({"type": "guided", "axis": [1, 0, 0], "inertia": [1, 1, 1]}, "motion.inertia: .*it does not turn"),
        ({"type": "guided", "hinge": [0, 0, 0]}, "motion.hinge: .*"),
        ({"type": "guided", "hinge": [0, 1, 0], "mass": 1e-3}, "motion.inertia: .*with a mass but without a surface"),
    ],
)
def test_a_joint_that_cannot_be_is_refused(motion, fault):
    joint = {"name": "joint", "position": [0, 0, 0], "motion": motion}
    with pytest.raises(SceneError, match=fault):
        load_scene(scene([rod([layer()], clamp_start="joint")], bodies=[joint]))


@pytest.mark.parametrize("motion", [{"type": "free"}, {"type": "guided", "axis": [1, 0, 0]}])
def test_a_body_without_mass_must_hold_a_rod(motion):
    alone = {"name": "alone", "position": [0, 0, 1], "motion": motion}
    with pytest.raises(SceneError, match=r"bodies.alone.motion.mass: found 0.0; must be a mass \[kg\] above 0"):
        load_scene(scene([rod([layer()], clamp_start="wall")], bodies=[fixed(), alone]))


def test_a_hinge_that_leaves_the_plane_is_told():
    content = scene([rod(layers_of("laminate"), clamp_start="pin")], solver={"dimension": 2})
    content["bodies"] = [{"name": "pin", "position": [0, 0, 0], "motion": {"type": "guided", "hinge": [0, 0, 1]}}]
    with pytest.raises(SceneError, match="bodies.pin.motion.hinge"):
        Simulator(load_scene(content))
