"""Faults of bodies and of what can be touched are refused with their key path and what is allowed."""

import pytest
from support.faulty_scenes import changed, faults_of
from support.sample_scenes import ball, everything, fixed, layer, rod, scene

from bilayer_core import load_scene
from bilayer_core.errors import PenetrationError
from bilayer_core.model.build_model import build_model

BOX = {"shape": "box", "size": [0.01, 0.02, 0.03]}


def test_a_body_without_mass_distribution_is_refused():
    body = ball((0, 0, 0.0209), inertia=[1e-7, 1e-7, 3e-7])
    assert "none exceeds the sum of the other two" in faults_of({**everything(), "bodies": [fixed("hub"), body]})[0]


def test_a_body_without_inertia_about_an_axis_is_refused():
    body = ball((0, 0, 0.0209), inertia=[1e-7, 1e-7, 0.9e-17])
    assert "at least 1e-10 of the largest" in faults_of({**everything(), "bodies": [fixed("hub"), body]})[0]


@pytest.mark.parametrize("part", ["obstacle", "ball", "contact point"])
def test_whatever_can_touch_needs_contact_settings(part):
    content = scene([rod([layer()])])
    point = {"position": [0, 0, 0], "length": 0.01, "offset": 0}
    if part == "obstacle":
        content["obstacles"] = everything()["obstacles"]
    else:
        content["bodies"] = [ball((0, 0, 1)) if part == "ball" else fixed(contact_points=[point])]
    assert "contact: found null" in faults_of(content)[0]


@pytest.mark.parametrize(
    ("surface", "fault"),
    [
        ({"shape": "boks", "size": [1, 1, 1]}, "`shape` must be one of 'plane', 'sphere', 'box', 'cylinder'"),
        ({**BOX, "size": [0.01, -0.02, 0.03]}, ".size[1]: found -0.02; must be a length [m] above 0"),
        ({**BOX, "rounding": 0.006}, ".rounding: found 0.006; must be at most half the shortest edge (0.005 m)"),
        ({**BOX, "radius": 0.01}, ".radius: unknown key"),
        ({"shape": "cylinder", "radius": 0.01}, ".length: is missing; must be a length [m] above 0"),
        (
            {"shape": "cylinder", "radius": 0.01, "length": 0.01, "rounding": 0.01},
            ".rounding: found 0.01; must be at most",
        ),
        (
            {"shape": "cylinder", "radius": 0.01, "length": 0.01, "rim_points": 2},
            "must be a whole number of at least 3",
        ),
        ({"shape": "plane", "normal": [0, 0, 1]}, '.shape: found "plane"; must be `sphere`, `box` or `cylinder`'),
    ],
)
def test_a_shape_that_cannot_be_is_refused(surface, fault):
    content = everything()
    content["bodies"][1]["surface"] = surface
    content["bodies"][1]["motion"]["shell"] = False
    lines = faults_of(content)
    assert any(line.startswith("scene: bodies.ball.surface") and fault in line for line in lines), lines


def test_only_balls_are_hollow_and_rotations_are_as_many_as_times():
    content = everything()
    content["bodies"][1]["surface"] = BOX
    assert "bodies.ball.motion.shell: found true; is for spheres" in faults_of(content)[0]
    turned = {"type": "prescribed", "times": [0, 1], "rotations": [[0, 0, 0]]}
    assert (
        'rotations: found "1 entries"; must be as many as `times`, 2'
        in faults_of(changed("bodies.hub.motion", turned))[0]
    )


def test_a_box_that_starts_in_a_cylinder_is_refused_by_name():
    content = everything()
    content["obstacles"].append(
        {"name": "post", "type": "cylinder", "position": [0.1, 0, 0.05], "radius": 0.02, "length": 0.02}
    )
    motion = {"type": "free", "mass": 0.1}
    content["bodies"].append({"name": "crate", "position": [0.1, 0, 0.07], "motion": motion, "surface": BOX})
    with pytest.raises(PenetrationError, match=r"\(crate\) .* behind the surface of post"):
        build_model(load_scene(content))
