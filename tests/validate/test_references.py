"""The answers by themselves, against tables and against other ways to them."""

import math

import numpy as np
import pytest
from oracles.plate_strip_across import Strip, isotropic, orthotropic
from oracles.strip_elasticity import section_torsion
from scipy.optimize import brentq
from scipy.special import jv

from bilayer_core.verification.validate import closed_forms, strips
from bilayer_core.verification.validate.contacts import resting_gap


@pytest.mark.parametrize(
    ("m", "n", "expected"), [(1, 1, 1.5), (2, 1, 1.45455), (1, 2, 1.33333), (5, 0.5, 1.49584), (0.2, 3, 1.47541)]
)
def test_timoshenkos_curvature_is_that_of_two_bonded_beams_in_balance(m, n, expected):
    # forces ±P at the bond, moments E I κ: κ = η/(H (1/2 + 2 (ΣEI)(1/EA₁ + 1/EA₂)/H²)), Timoshenko 1925
    top = 1.0 / (1.0 + n)
    stiffness, area = (m * (n * top) ** 3 + top**3) / 12.0, 1.0 / (m * n * top) + 1.0 / top
    assert closed_forms.timoshenko(m, n) == pytest.approx(1.0 / (0.5 + 2.0 * stiffness * area), rel=1e-12)
    assert closed_forms.timoshenko(m, n) == pytest.approx(expected, rel=1e-5)
    assert closed_forms.timoshenko_as_printed(m, n) == closed_forms.timoshenko(n, m)


@pytest.mark.parametrize(
    ("torsion", "curvature", "twist", "radius", "pitch"),
    [
        ("layers", 40.0, 20.0, 40.9412, 506.054),
        ("layers", 100.0, 50.0, 16.9434, 204.392),
        ("layers", -80.0, 30.0, 29.5732, 287.481),
        ("layers", 15.0, 150.0, 0.493473, 84.1206),
        ("laminate", 40.0, 20.0, 155.410, 522.066),
        ("laminate", 100.0, 50.0, 62.1965, 208.108),
        ("laminate", -80.0, 30.0, 86.0590, 218.373),
        ("laminate", 15.0, 150.0, 5.17140, 309.351),
    ],
)
def test_helices_of_least_energy_are_those_found_with_other_minimisers(torsion, curvature, twist, radius, pitch):
    found = 1e3 * np.array(closed_forms.bonded_helix(curvature, twist, torsion))
    assert found == pytest.approx([radius, pitch], rel=1e-5)


def test_a_heavy_cantilever_that_hardly_bends_sinks_as_beam_theory_says():
    tip = closed_forms.heavy_cantilever(1e-3, 1.0, 1e6, 1.0)
    assert tip[1] == pytest.approx(-1e-3 / 8.0, rel=1e-4)


def test_the_tip_of_the_common_cantilever_is_known_to_many_digits():
    tip = closed_forms.heavy_cantilever(0.1962, 1e6 * 0.01 * 8e-9 / 12.0, 20.0, 0.1)
    assert tip == pytest.approx([0.0347151882735, -0.0871807525051], rel=1e-7)


def test_greenhills_number_is_from_the_zero_of_a_bessel_function():
    zero = brentq(lambda x: jv(-1.0 / 3.0, x), 1.5, 2.2)
    assert closed_forms.GREENHILL == pytest.approx(2.25 * zero**2, rel=1e-6)


def test_the_first_mode_is_the_root_of_its_equation():
    k = closed_forms.FIRST_MODE
    assert math.cos(k) * math.cosh(k) == pytest.approx(-1.0, abs=1e-5)


def test_the_bonded_stiffness_of_equal_layers_is_that_of_one_beam():
    one = 2e8 * 0.01 * 2e-3**3 / 12.0
    assert closed_forms.bonded_bending_stiffness((2e8, 2e8), (1e-3, 1e-3), 0.01) == pytest.approx(one)


def test_a_bonded_strip_is_four_times_as_stiff_in_torsion_as_its_thin_layers():
    stiffness = closed_forms.strip_torsion((1e6, 1e6), (1e-3, 1e-3), 1.0)
    assert stiffness["laminate"] / stiffness["layers"] == pytest.approx(4.0 * (1 - 0.00126) / (1 - 0.00063), rel=1e-5)


def test_torsion_of_a_strip_in_layers_lies_between_bounds_of_finite_elements():
    for moduli, thickness, width in (((1.0, 0.3), (0.7, 1.6), 10.0), ((1.0, 200.0), (2.0, 3.0), 1.0)):
        low, high = section_torsion(moduli, thickness, width, 20)
        assert low < closed_forms.strip_torsion(moduli, thickness, width)["laminate"] < high < 1.001 * low


def test_the_resting_gap_is_known():
    assert resting_gap() == pytest.approx(0.9974448e-3, rel=1e-7)


def test_sliding_along_an_axis_is_coulombs_friction():
    v = closed_forms.oblique_slide((1.5, 0.0), (0.1, 0.4), 9.81, 0.3)
    assert v == pytest.approx([0.3 * (1.5 - 0.1 * 9.81), 0.0], rel=1e-4, abs=1e-12)


@pytest.mark.parametrize(
    ("degrees", "stiffness", "ratio"),
    [
        pytest.param(30.0, 1.0, 10, marks=pytest.mark.verify),
        pytest.param(45.0, 1.0, 100, marks=pytest.mark.verify),
        (30.0, 8.0, 36),
    ],
)
def test_the_shapes_of_crossed_layers_are_those_of_a_plate_solved_across_its_width(degrees, stiffness, ratio):
    width, half, curvature = 1.0, 0.5e-3, ratio * 1e-3
    sheet, across = orthotropic(stiffness, 1.0, 0.3, 1.0 / 2.6), (0.0, curvature * 1e-3 / 1.5)
    angle, answer = math.radians(degrees), strips.RESTS[degrees, stiffness][ratio]
    found = Strip(width, [(half, sheet, across, angle - 0.5 * math.pi), (half, sheet, across, angle)])
    start = curvature * (np.array(answer) + [0.05, -0.05])
    assert found.rest(start) / curvature == pytest.approx(answer, abs=1e-5)


@pytest.mark.parametrize("ratio", [pytest.param(6, marks=pytest.mark.verify), 36])
def test_the_curvature_of_unlike_ratios_is_that_of_a_plate_solved_across_its_width(ratio):
    half, curvature = 0.5e-3, ratio * 1e-3
    sheets, swelling = [isotropic(1.0, nu) for nu in strips.UNLIKE.values()], curvature * 1e-3 / 1.5
    found = Strip(1.0, [(half, sheets[0], (swelling, swelling), 0.0), (half, sheets[1], (0.0, 0.0), 0.0)])
    assert found.rest([curvature, 0.0])[0] / curvature == pytest.approx(strips.UNLIKE_RESTS[ratio], abs=1e-5)
