"""Layers of unlike width: stiffness, mass and shape of a T, what is drawn of it, and what is refused."""

import numpy as np
import pytest
from oracles.strip_elasticity import section_torsion
from support.sample_scenes import GEL, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SceneError
from bilayer_core.model.edge_figures import edge_figures

FLANGE, WEB = (8e-3, 1e-3), (3e-3, 1.5e-3)
"""Width and thickness of the lower and the upper layer."""
LENGTH, MODULUS, DENSITY = 0.1, GEL["youngs_modulus"], GEL["density"]
AREAS = np.array([width * thickness for width, thickness in (FLANGE, WEB)])
HEIGHTS = np.array([-0.5 * FLANGE[1], 0.5 * WEB[1]])
AXIS = float(AREAS @ HEIGHTS / AREAS.sum())
BENDING = MODULUS * float(sum(w * h**3 / 12.0 for w, h in (FLANGE, WEB)) + AREAS @ (HEIGHTS - AXIS) ** 2)


def tee(gain=0.0, **more):
    """A rod with the section of a T."""
    law = {"stimulus": "heat", "gain": gain}
    layers = [layer("flange", FLANGE[1], width=FLANGE[0], eigenstrain=law), layer("web", WEB[1])]
    return rod(layers, length=LENGTH, width=WEB[0]) | more


def simulator(model, dimension=3, gain=0.0, **more):
    """The rod in a scene."""
    clamp = {"clamp_start": "wall"} if "bodies" in more else {}
    heat = {"heat": {"schedule": {"type": "hold", "value": 1}}}
    return Simulator(load_scene(scene([tee(gain, **clamp)], stimuli=heat, **more)), model=model, dimension=dimension)


def turn_of_end(model, moment):
    """The rotation vector [rad] of the end of the rod under a moment there; the turn about itself from the middle half,
    since two rods hold back a part of their warping at clamps.
    """
    motion = {"type": "free", "mass": 1e-3, "inertia": [1e-7, 1e-7, 1e-7]}
    crank = {"name": "crank", "position": [LENGTH, 0, 0], "motion": motion}
    content = scene([tee(clamp_start="wall", clamp_end="crank")], bodies=[fixed(), crank])
    content |= {
        "stimuli": {"heat": {"schedule": {"type": "hold", "value": 0}}},
        "loads": [{"name": "moment", "body": "crank", "moment": list(moment)}],
    }
    turned = Simulator(load_scene(content), model=model, dimension=3)
    turned.solve_static()
    frame = turned.frame()
    quaternion, directors = frame.body_quaternions[1], frame.directors[[5, 15]]
    angle = np.arctan2(-directors[:, 1], directors[:, 2])
    return np.array([2.0 * (angle[1] - angle[0]), *(2.0 * quaternion[1:3] / quaternion[3])])


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_bending_and_torsional_stiffness_of_a_tee_are_those_of_its_section(model):
    across = MODULUS * sum(h * w**3 / 12.0 for w, h in (FLANGE, WEB))
    shear = MODULUS / (2.0 * (1.0 + GEL["poisson_ratio"]))
    torsion, _ = section_torsion((shear, shear), (FLANGE[1], WEB[1]), (FLANGE[0], WEB[0]), 20)
    for axis, stiffness, error in ((1, BENDING, 2e-3), (2, across, 2e-3), (0, torsion, 5e-3)):
        moment = 0.01 * stiffness / LENGTH * np.eye(3)[axis]
        assert turn_of_end(model, moment) == pytest.approx(0.01 * np.eye(3)[axis], abs=0.01 * error)


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_swelling_flange_bends_a_tee_as_its_section_says(model, dimension):
    bent = simulator(model, dimension, gain=0.01, bodies=[fixed()])
    bent.solve_static()
    curvature = MODULUS * AREAS[0] * (AXIS - HEIGHTS[0]) * 0.01 / BENDING
    inner = bent.curvatures.reshape(-1, 21)[:, 2:-2]
    assert np.abs(inner).mean() == pytest.approx(curvature, rel=2e-3)


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_mass_and_inertia_of_a_tee_are_those_of_its_section(model):
    rods = simulator(model).model.rods
    mass = DENSITY * LENGTH * AREAS
    assert rods.node_mass.sum() == pytest.approx(mass.sum(), rel=1e-12)
    own = sum(m * (w**2 + h**2) / 12.0 for m, (w, h) in zip(mass, (FLANGE, WEB), strict=True))
    centre = float(mass @ HEIGHTS / mass.sum())
    apart = 0.0 if model == "two_rod" else float(mass @ (HEIGHTS - centre) ** 2)
    assert rods.spin_inertia.sum() == pytest.approx(own + apart, rel=1e-12)


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_layers_of_a_tee_are_drawn_as_wide_as_they_are(model):
    tapered = {"at": [0.0, LENGTH], "value": [8e-3, 4e-3]}
    content = scene([tee() | {"layers": [layer("flange", width=tapered), layer("web")]}])
    strands = Simulator(load_scene(content), model=model).model.strands
    drawn = strands[0].layers or strands
    assert drawn[0].width == pytest.approx(np.linspace(8e-3, 4e-3, 21))
    assert drawn[1].width == pytest.approx(np.full(21, WEB[0]))
    assert strands[0].width == pytest.approx(drawn[0].width)


def test_two_layers_with_the_width_of_the_rod_are_the_rod_to_the_last_digit():
    like = rod([layer("a"), layer("b")], width=5e-3)
    own = {key: value for key, value in like.items() if key != "width"}
    own["layers"] = [{**part, "width": 5e-3} for part in like["layers"]]
    rods = [Simulator(load_scene(scene([each])), model="laminate").model.rods for each in (like, own)]
    for name in ("axial_stiffness", "joint_stiffness", "node_mass", "spin_inertia", "half_width"):
        assert np.array_equal(*(getattr(each, name) for each in rods)), name


def test_figures_of_a_tee_say_how_far_its_layers_would_bend_it():
    config = load_scene(scene([tee(0.01)], stimuli={"heat": {"schedule": {"type": "hold", "value": 1}}}))
    curvature = MODULUS * AREAS[0] * (AXIS - HEIGHTS[0]) * 0.01 / BENDING
    assert edge_figures(config, config.rods[0]).free_curvature() == pytest.approx(np.full(20, curvature), rel=1e-12)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"layers": [layer("a", width=1e-3), layer("b", width=2e-3)]}, "rods.rod.width: found 0.003; must be left out"),
        ({"width": None}, "rods.rod.width: found null; must be given"),
        ({"layers": [layer("a", width=-1e-3), layer("b")]}, "rods.rod.layers.a.width"),
        ({"section": "strip"}, "needs layers of one `width`, since a plate has one thickness"),
        (
            {"width": None, "radius": 1e-3, "layers": [{"name": "a", "material": "gel", "width": 2e-3}]},
            "layers.a.width",
        ),
    ],
)
def test_widths_that_no_rod_can_have_are_refused(change, told):
    content = scene([tee() | change], stimuli={"heat": {"schedule": {"type": "hold", "value": 0}}})
    with pytest.raises(SceneError, match=told.replace(".", r"\.").replace("(", r"\(")):
        Simulator(load_scene(content), model="laminate")
