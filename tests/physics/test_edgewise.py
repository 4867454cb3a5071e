"""Natural curvature across the width: strips that are cut straight and want to be curved in their plane, and back."""

import numpy as np
import pytest
from support.sample_scenes import GEL, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SceneError

CURVATURE, LENGTH, STATIONS = 8.0, 0.1, 41
MATERIALS = {"gel": GEL, "stiff": {**GEL, "youngs_modulus": 3.0 * GEL["youngs_modulus"]}}


def strip(layers, **more):
    return rod(layers, length=LENGTH, stations=STATIONS, clamp_start="wall") | more


def at_rest(rods, model="laminate"):
    content = scene(rods, bodies=[fixed()], materials=MATERIALS)
    content["solver"] = {"model": model, "newton_tolerance": 1e-10}
    simulator = Simulator(load_scene(content))
    simulator.solve_static()
    return simulator


def circle(curvature):
    """Middles of stations of a strip along x that bends towards path × normal, here −y; shape (n, 3)."""
    angle = curvature * np.linspace(0.0, LENGTH, STATIONS)
    return np.stack([np.sin(angle), np.cos(angle) - 1.0, 0.0 * angle], axis=1) / curvature


def middles(simulator):
    """Means of the layers' curves, shape (n, 3)."""
    return simulator.positions.reshape(-1, STATIONS, 3).mean(axis=0)


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
@pytest.mark.parametrize("stiff", [False, True])
def test_a_straight_strip_bends_in_its_plane_by_the_mean_of_its_layers(model, stiff):
    top = layer("top", material="stiff") if stiff else layer("top", natural_curvature_across=CURVATURE)
    simulator = at_rest([strip([layer("bottom", natural_curvature_across=CURVATURE), top])], model)
    bent = circle(CURVATURE / 4.0 if stiff else CURVATURE)
    found = middles(simulator)
    assert np.abs((found - found[0]) - bent).max() < 2e-4 * LENGTH


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_a_strip_cut_along_a_circle_straightens_where_its_layers_are_straight(model):
    points = (circle(CURVATURE) + [0, 0, 0.01]).tolist()
    bent = strip([layer("a", natural_curvature_across=0.0), layer("b", natural_curvature_across=0.0)])
    bent["path"] = {"shape": "spline", "points": points}
    found = middles(at_rest([bent], model))
    along = found[-1] - found[0]
    assert np.linalg.norm(along) == pytest.approx(LENGTH, rel=1e-4)
    assert along[0] == pytest.approx(LENGTH, rel=1e-3)
    kept = strip([layer("a"), layer("b")], path=bent["path"])
    assert np.abs(middles(at_rest([kept], model)) - points).max() < 1e-6


def test_a_mirror_image_bends_to_the_other_side():
    curled = [layer("a", natural_curvature_across={"at": [0.0, LENGTH], "value": [2.0, 12.0]}), layer("b")]
    image = {"type": "mirror", "axis": [0, 1, 0], "center": [0, 0.05, 0]}
    positions = at_rest([strip(curled, pattern=image)]).positions - [0, 0.05, 0]
    first, second = positions.reshape(2, STATIONS, 3)
    assert np.ptp(first[:, 1]) > 0.013
    assert np.abs(first * [1, -1, 1] - second).max() < 1e-9


def test_such_a_strip_leaves_a_plane_and_has_a_border_of_some_length():
    content = scene([strip([layer(natural_curvature_across=CURVATURE)])], bodies=[fixed()])
    assert Simulator(load_scene(content)).plan.dimension == 3
    content["rods"][0]["layers"][0]["natural_curvature_across"] = 300.0
    with pytest.raises(SceneError, match=r"natural_curvature_across: found 300.*below 200 1/m"):
        load_scene(content)
