"""Hinges, pins, rails and junctions in motion; columns, periods and shapes at rest are cases of `bilayer validate`."""

import re

import numpy as np
import pytest
import yaml
from support.sample_scenes import fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.cli import main
from bilayer_core.errors import SceneError
from bilayer_core.kinematics.rotation import rotation_matrix
from bilayer_core.verification.validate.joints import layers_of, swinging

MODELS, GRAVITY = ["laminate", "two_rod"], [0, 0, -9.81]
STEPS = {"integrator": "sdirk2", "dt": 5e-4}
AXES = {
    "pin": {},
    "hinge": {"axis": [0, 1, 0]},
    "universal": {"axis": [0, 1, 0], "second_axis": [0, 0, 1]},
    "slide": {"axis": [1, 0, 0]},
    "cylinder": {"axis": [0, 1, 0]},
    "weld": {},
}


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
    assert simulator.model.free_bodies.mass.tolist() == [0.0]
    simulator.run(0.03)
    assert np.ptp(simulator.curvatures) > 5.0  # the legs bend
    np.testing.assert_allclose(simulator.com, start, atol=1e-12)
    mass, model_ = simulator.model.rods.node_mass, simulator.model
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


def two_links(kind, model="laminate", **keys):
    """Two soft strips, the first held by a wall, the second by a joint."""
    half, soft = 0.05, {"gel": {"youngs_modulus": 1e7, "poisson_ratio": 0.5, "density": 1000.0}}
    strips = [
        rod(layers_of(model), half, 11, name="first", clamp_start="wall", clamp_end="inner"),
        rod(layers_of(model), half, 11, start=(half, 0, 0), name="second", clamp_start="outer"),
    ]
    light = [{"name": name, "position": [half, 0, 0], "motion": {"type": "free"}} for name in ("inner", "outer")]
    joint = {"name": "knee", "type": kind, "bodies": ["inner", "outer"], "point": [half, 0, 0], **keys}
    return scene(strips, bodies=[fixed(), *light], joints=[joint], gravity=GRAVITY, materials=soft)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("model", MODELS)
def test_a_hinge_between_rods_bears_what_hangs_on_it_and_says_how_far_it_gives_way(model, dimension):
    content = two_links("hinge", model, axis=[0, 1, 0])
    simulator = Simulator(load_scene(content), model=model, dimension=dimension)
    simulator.solve_static()
    weight = 0.05 * 0.01 * 1e-3 * 1000.0 * 9.81
    knee, outer = simulator.joints["knee"], simulator.bodies["outer"]
    assert knee.bodies == ("inner", "outer")
    assert knee.wrench[:3] == pytest.approx([0, 0, -weight], abs=1e-7 * weight)
    assert knee.wrench[3:] == pytest.approx([0, 0, 0], abs=1e-9 * weight)
    assert outer.clamp_wrench[:3] == pytest.approx([0, 0, -weight], abs=1e-7 * weight)
    assert simulator.clamps["second.start"].wrench[4] == pytest.approx(0.0, abs=1e-8 * weight)
    apart = np.linalg.norm(simulator.bodies["inner"].position - outer.position)
    assert knee.distance == pytest.approx(apart, rel=1e-6, abs=1e-16) and 0.0 < apart < 1e-8
    assert simulator.summary()["joints"]["knee"] == {"distance": knee.distance, "angle": knee.angle}
    below = simulator.positions[simulator.model.node_count - 1] - outer.position
    assert below == pytest.approx([0, 0, -0.05], abs=2e-3)  # it hangs straight down


def test_a_stiffer_joint_gives_way_less_and_changes_nothing_else():
    def solved(**keys):
        simulator = Simulator(load_scene(two_links("weld", **keys)), model="laminate")
        simulator.solve_static()
        return simulator.joints["knee"].distance, simulator.positions

    usual, stiff = solved(), solved(stiffness=1e9)
    assert stiff[0] < 0.2 * usual[0]
    np.testing.assert_allclose(stiff[1], usual[1], atol=1e-7)


@pytest.mark.parametrize("kind", AXES)
def test_joints_keep_momentum_and_the_energy_budget(kind):
    content = two_links(kind, **AXES[kind])
    content |= {"gravity": [0, 0, 0]}
    content["rods"][0].pop("clamp_start")
    content["bodies"] = content["bodies"][1:]
    content["loads"] = [
        {"name": "kick", "rod": "first", "position": 0.01, "force": [0, 0, 0.02]},
        {"name": "back", "rod": "second", "position": 0.03, "force": [0, 0, -0.02]},
    ]
    simulator = Simulator(load_scene(content), model="laminate", integrator="sdirk2", tolerance=1e-5, budget=True)
    simulator.run(0.05)
    momentum = simulator.model.rods.node_mass @ simulator.velocities[: simulator.model.node_count]
    assert np.abs(momentum).max() < 1e-10
    assert np.ptp(simulator.positions[:, 2]) > 0.01
    assert abs(simulator.budget()["relative_residual"]) < 1e-3
    assert simulator.joints["knee"].distance < 1e-6
    assert not simulator.summary()["warnings"]


@pytest.mark.parametrize(
    ("keys", "fault"),
    [
        ({"bodies": ["inner", "inner"]}, "joints.knee.bodies: .*must be two different bodies"),
        ({"bodies": ["inner", "nobody"]}, r"joints.knee.bodies\[1\]: found .nobody.; must be one of the bodies"),
        ({"type": "hinge", "axis": None}, "joints.knee.axis: .*must be given for a hinge"),
        ({"axis": [0, 1, 0]}, "joints.knee.axis: .*must be left out: a pin has none"),
        ({"torsional_stiffness": 1.0}, "joints.knee.torsional_stiffness: .*a pin turns freely"),
        ({"stiffness": 0}, "joints.knee.stiffness: found 0; must be a stiffness"),
        ({"type": "slider"}, "joints.knee.type: .*pin"),
        ({"type": "slide"}, "joints.knee.axis: .*must be given for a slide"),
        ({"type": "universal", "axis": [0, 1, 0]}, "joints.knee.second_axis: .*must be given for a universal joint"),
        (
            {"type": "universal", "axis": [0, 1, 0], "second_axis": [0, 1, 1]},
            "joints.knee.second_axis: .*must be perpendicular to `axis`",
        ),
        ({"second_axis": [0, 1, 0]}, "joints.knee.second_axis: .*must be left out: a pin has none"),
        ({"turning": {"spring": 1.0}}, "joints.knee.turning: .*must be left out: a pin has no axis about which alone"),
        ({"type": "hinge", "axis": [0, 1, 0], "sliding": {}}, "joints.knee.sliding: .*a hinge does not slide"),
        (
            {"type": "hinge", "axis": [0, 1, 0], "turning": {"limits": [0.1, 1.0]}},
            r"joints.knee.turning.limits: .*must be \[least, greatest\] with the start, 0, between them",
        ),
        (
            {"type": "hinge", "axis": [0, 1, 0], "turning": {"rest_angle": 1.0}},
            "joints.knee.turning.rest_angle: .*there is no `spring`",
        ),
        (
            {"type": "hinge", "axis": [0, 1, 0], "turning": {"limit_stiffness": 1.0}},
            "joints.knee.turning.limit_stiffness: .*there are no `limits`",
        ),
        (
            {"type": "hinge", "axis": [0, 1, 0], "turning": {"friction": "1 N"}},
            r"joints.knee.turning.friction: .*a moment \[N\*m\]",
        ),
    ],
)
def test_a_joint_between_bodies_that_cannot_be_is_refused(keys, fault):
    content = two_links("pin")
    content["joints"][0] |= keys
    with pytest.raises(SceneError, match=fault):
        load_scene(content)


def test_two_bodies_on_prescribed_paths_are_not_joined():
    content = two_links("pin")
    content["bodies"][1]["motion"] = content["bodies"][2]["motion"] = {"type": "prescribed"}
    with pytest.raises(SceneError, match="joints.knee.bodies: .*one must not be prescribed"):
        load_scene(content)


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


def test_check_says_what_turns_and_what_is_joined(tmp_path, capsys):
    content = two_links("hinge", axis=[0, 1, 0], turning={"spring": 1e-4, "friction": 1e-6, "limits": [-1, 1]})
    content["bodies"] += [{"name": "pin", "position": [0, 0, 0.1], "motion": {"type": "guided", "pinned": True}}]
    content["rods"] += [rod([layer()], 0.02, 5, start=(0, 0, 0.1), name="third", clamp_start="pin")]
    content["bodies"][0]["motion"] = {"type": "guided", "axis": [1, 0, 0], "hinge": [0, 1, 0]}
    content["bodies"][0]["motion"]["sliding"] = {"damping": 1.0}
    path = tmp_path / "linkage.yaml"
    path.write_text(yaml.safe_dump(content))
    assert main(["check", str(path)]) == 0
    found = capsys.readouterr().out
    for line in (
        r"wall +guided body, on a rail with damping and on a hinge",
        r"inner +junction without mass",
        r"pin +guided body, on a pin",
        r"joint knee +hinge of inner and outer with a spring, friction and limits",
    ):
        assert re.search(line, found), found
