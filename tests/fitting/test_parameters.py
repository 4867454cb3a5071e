"""Parameters of fits: bounds with units, starts, scales, and what is refused."""

import pytest

from bilayer_core import load_scene
from bilayer_core.errors import InputError, SceneError
from bilayer_core.studies.fitting.parameters import read_parameters

MODULUS = "materials.gel.youngs_modulus"


@pytest.fixture(scope="module")
def scene():
    return load_scene("cantilever")


def test_bounds_and_start_have_units_and_are_shown_in_them(scene):
    (found,) = read_parameters(scene, [f"{MODULUS}=500kPa:2000kPa:0.9MPa"])
    assert (found.low, found.high, found.start) == (5e5, 2e6, 9e5)
    assert found.shown(1.2345e6) == "1234.5 kPa"


def test_plain_numbers_are_si_from_texts_and_from_mappings(scene):
    from_text = read_parameters(scene, [f"{MODULUS}=5e5:2e6"])
    from_mapping = read_parameters(scene, {MODULUS: (5e5, "2 MPa")})
    assert [(p.low, p.high, p.unit) for p in from_text + from_mapping] == [(5e5, 2e6, "")] * 2


def test_items_of_lists_are_addressed_as_by_set(scene):
    by_index, by_name = read_parameters(scene, ["gravity.2=-20:-5", "rods.strip.layers.gel.thickness=1mm:3mm"])
    assert (by_index.path, by_index.start) == ("gravity.2", -9.81)
    assert by_name.start == 2e-3 and by_name.shown(0.00125) == "1.25 mm"


def test_the_start_is_the_scenes_value_between_the_bounds_and_else_their_middle(scene):
    bounds = "0.5MPa:2MPa", "2MPa:4MPa", "2MPa:200MPa"
    inside, above, wide = (read_parameters(scene, [f"{MODULUS}={both}"])[0] for both in bounds)
    assert inside.start == 1e6 and above.start == pytest.approx(3e6) and wide.start == pytest.approx(2e7)


@pytest.mark.parametrize("bounds,logarithmic", [("1MPa:10MPa", False), ("1MPa:11MPa", True), ("0.1MPa:200MPa", True)])
def test_positive_parameters_over_more_than_a_decade_go_by_their_logarithm(scene, bounds, logarithmic):
    (found,) = read_parameters(scene, [f"{MODULUS}={bounds}"])
    assert found.logarithmic == logarithmic
    assert found.value(0.0) == found.low and found.value(1.0) == found.high
    for part in (0.1, 0.5, 0.9):
        assert found.part(found.value(part)) == pytest.approx(part, abs=1e-14)
        slope = (found.value(part + 1e-6) - found.value(part - 1e-6)) / 2e-6
        assert found.relative(part) == pytest.approx(slope / found.value(part), rel=1e-8)


def test_a_parameter_that_may_be_zero_goes_in_proportion(scene):
    (found,) = read_parameters(scene, ["damping.mass=0:20"])
    assert not found.logarithmic and found.value(0.25) == 5.0


@pytest.mark.parametrize(
    "asked,told",
    [
        ([], "none is given"),
        ([MODULUS], "must be PATH=LO:HI"),
        ([f"{MODULUS}=1MPa"], "must be PATH=LO:HI"),
        ([f"{MODULUS}=1MPa:"], "must be PATH=LO:HI"),
        ([f"{MODULUS}=1:2:3:4"], "must be PATH=LO:HI"),
        (f"{MODULUS}=1:2", "must be texts"),
        ([f"{MODULUS}=2MPa:1MPa"], "the lower bound 2MPa must be below the upper one, 1MPa"),
        ([f"{MODULUS}=1MPa:1MPa"], "must be below the upper one"),
        ([f"{MODULUS}=1MPa:2MPa:2MPa"], "the start 2MPa must be between 1MPa and 2MPa"),
        ([f"{MODULUS}=1MPa:2MPa", f" {MODULUS}=1MPa:3MPa"], f"parameter {MODULUS}: is given twice"),
        (["rods.strip.stations=10:60"], "is a whole number in this scene (51), which cannot be varied"),
        (["rods.strip.path=1:2"], "is no single number"),
        (["rods.strip.clamp_start=1:2"], "is no single number"),
        ({MODULUS: (1e6,)}, "must have (lower, upper) or (lower, upper, start)"),
        ({MODULUS: "1MPa:2MPa"}, "must have (lower, upper) or (lower, upper, start)"),
    ],
)
def test_what_is_no_parameter_is_refused_with_what_is_allowed(scene, asked, told):
    with pytest.raises(InputError) as refused:
        read_parameters(scene, asked)
    assert told in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "asked,told",
    [
        ("materials.gel.youngs_modulos=1MPa:2MPa", "did you mean youngs_modulus?"),
        ("material.gel.youngs_modulus=1MPa:2MPa", "did you mean materials?"),
        (f"{MODULUS}=-1MPa:2MPa", f'{MODULUS}: found "-1MPa"; must be a pressure [Pa] above 0'),
        (f"{MODULUS}=1mm:2MPa", f'{MODULUS}: found "1mm", a quantity in m; must be a pressure [Pa]'),
        (f"{MODULUS}=1MPa:.inf", f"{MODULUS}: found"),
        (f"{MODULUS}=soft:2MPa", "must be a pressure [Pa]"),
        ("materials.gel.poisson_ratio=0.1:0.7", "materials.gel.poisson_ratio: found 0.7; must be"),
        ("=1:2", "must be PATH=VALUE"),
    ],
)
def test_a_key_or_bound_that_the_scene_does_not_take_is_refused_with_its_path(scene, asked, told):
    with pytest.raises(SceneError) as refused:
        read_parameters(scene, [asked])
    assert told in str(refused.value) and str(refused.value).startswith("parameter ")
