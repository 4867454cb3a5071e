"""Torsion of layered sections, against bounds by finite elements, tables and limits."""

import numpy as np
import pytest
from oracles.strip_elasticity import section_torsion
from support.sample_scenes import fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.model.torsion_section import bond_torsion, rectangle_torsion

SECTIONS = {  # shear moduli, thicknesses (bottom, then top), width
    "equal layers": ((1, 1), (1, 1), 10),
    "stiff thin layer": ((1, 0.3), (0.7, 1.6), 10),
    "stiff thick layer": ((0.3, 1), (0.7, 1.6), 10),
    "a thousand times stiffer": ((1, 1000), (1, 1), 10),
    "a thousandth": ((1, 0.001), (0.3, 2), 5),
    "higher than wide": ((1, 2), (2, 3), 1),
    "much higher than wide": ((1, 4), (0.2, 0.6), 0.1),
    "square": ((3, 1), (0.4, 0.6), 1),
    "a film on a strip": ((1, 5), (0.05, 1), 3),
    "wide": ((1, 1.7), (1, 0.1), 100),
}
UNLIKE = {
    "a T": ((1, 1), (1, 1), (10, 4)),
    "a T upside down, of a soft foot": ((1, 0.2), (1, 1), (4, 10)),
    "of a soft flange": ((0.2, 1), (1, 1), (10, 4)),
    "nearly alike": ((1, 0.5), (1, 1), (20, 18)),
    "thick": ((1, 2), (1, 3), (4, 3)),
}


def layered(moduli, thickness, width):
    """GJ of each layer, and what the bond adds."""
    moduli, thickness = np.array(moduli, float), np.array(thickness, float)
    width = np.broadcast_to(np.array(width, float), 2)
    bond = bond_torsion(moduli[:, None], width[:, None], thickness[:, None])
    return rectangle_torsion(moduli, width, thickness), bond[0]


@pytest.mark.parametrize("name", SECTIONS)
def test_torsion_of_a_layered_section_lies_between_bounds_that_close_in_on_it(name):
    section = SECTIONS[name]
    own, bond = layered(*section)
    gaps = []
    for count in (10, 20):
        low, high = section_torsion(*section, count)
        assert low <= own.sum() + bond <= high
        gaps.append(high / low - 1)
    assert gaps[1] < 0.3 * gaps[0] and gaps[1] < 1e-3


@pytest.mark.parametrize("name", UNLIKE)
def test_torsion_of_layers_of_unlike_width_is_that_by_finite_elements(name):
    own, bond = layered(*UNLIKE[name])
    low, high = section_torsion(*UNLIKE[name], 20)
    assert 0.9995 * low <= own.sum() + bond <= high


def test_layers_of_nearly_one_width_have_nearly_the_torsion_of_one():
    like, nearly = layered((1, 3), (1, 0.5), 4.0)[1], layered((1, 3), (1, 0.5), (4.0, 4.0 * (1 - 1e-7)))[1]
    assert nearly == pytest.approx(like, rel=1e-3)


def test_rectangles_have_the_torsion_that_tables_give():
    # J/(a b³), Timoshenko and Goodier, Theory of Elasticity, section 109
    for ratio, expected in ((1, 0.1406), (1.5, 0.196), (2, 0.229), (3, 0.263), (5, 0.291), (10, 0.312)):
        assert rectangle_torsion(1.0, ratio, 1.0) / ratio == pytest.approx(expected, abs=6e-4)
        assert rectangle_torsion(1.0, 1.0, ratio) == rectangle_torsion(1.0, ratio, 1.0)


@pytest.mark.parametrize("width", [0.1, 1.0, 10.0, 1000.0])
@pytest.mark.parametrize("upper", [0.02, 0.3, 0.5])
def test_two_bonded_layers_of_one_material_are_one_layer(width, upper):
    own, bond = layered((7, 7), (1 - upper, upper), width)
    assert own.sum() + bond == pytest.approx(float(rectangle_torsion(7.0, width, 1.0)), rel=1e-7)


def test_a_wide_strip_tends_to_the_thin_formula():
    (_, bond), width = layered((2, 3), (1, 0.5), 1e5), 1e5
    assert bond == pytest.approx(4 * width * (2 * 1.5 / 3.5) * 0.75**2, rel=1e-4)


def test_sections_that_vary_along_a_rod_are_those_of_each_place():
    moduli, width = np.array([[1, 1, 2, 1], [3, 3, 3, 3.0]]), np.array([[5, 5, 5, 9.0], [5, 5, 5, 7.0]])
    thickness = np.ones((2, 4))
    together = bond_torsion(moduli, width, thickness)
    for place in range(4):
        one = slice(place, place + 1)
        assert bond_torsion(moduli[:, one], width[:, one], thickness[:, one])[0] == pytest.approx(
            together[place], rel=1e-14
        )


@pytest.mark.parametrize("model", ["two_rod", "laminate"])
def test_a_plane_does_not_feel_torsion(model):
    swelling = layer("top", eigenstrain={"stimulus": "heat", "gain": 0.02})
    positions = []
    for torsion in ("layers", "laminate"):
        content = scene(
            [rod([layer("bottom"), swelling], torsion=torsion, clamp_start="wall")],
            bodies=[fixed()],
            stimuli={"heat": {"schedule": {"type": "hold", "value": 1}}},
        )
        simulator = Simulator(load_scene(content), model=model, dimension=2)
        simulator.solve_static()
        positions.append(simulator.positions)
    assert np.array_equal(*positions)
