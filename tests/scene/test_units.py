from typing import Annotated

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError
from support.processes import python

from bilayer_core.scene import units
from bilayer_core.scene.units import in_si, parse_quantity


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("1 mm", "m", 1e-3),
        ("53.9mm", "m", 0.0539),
        ("100 MPa", "Pa", 1e8),
        ("-10 m/s^2", "m/s^2", -10.0),
        ("40 deg", "rad", 0.6981317007977318),
        ("60 rpm", "rad/s", 6.283185307179586),
        ("6.4 %", "1", 0.064),
        ("20 1/s", "1/s", 20.0),
        ("20/s", "1/s", 20.0),
        ("1.2 g/cm^3", "kg/m^3", 1200.0),
        ("5 µm", "m", 5e-6),
        ("1e9", "Pa", 1e9),
        ("1e-4", "m", 1e-4),
        (" .5 ", "m", 0.5),
    ],
)
def test_a_text_is_the_number_that_its_conversion_gives_when_rounded_once(text, unit, value):
    assert parse_quantity(text, unit) == value


@pytest.mark.parametrize(
    ("text", "unit", "reason"),
    [
        ("10 kg", "m", "a quantity in kg"),
        ("3 m^2", "m", "a quantity in m ** 2"),
        ("3 %", "m", "a quantity without dimension"),
        ("40 deg", "1", "a quantity in rad"),
        ("1 Hz", "rad/s", "a quantity in 1 / s"),
        ("20 degC", "m", "a quantity in K"),
        ("3%%", "1", "whose unit '%%' has more than one %"),
        ("1 foo", "m", "whose unit 'foo' is not known"),
        ("1 m 2", "m", "whose unit 'm 2' is not known"),
        ("1 m (", "m", "whose unit 'm (' is not known"),
        ("1 mm/0", "m", "whose unit 'mm/0' is not known"),
        ("1,5 mm", "m", "not a number with a unit"),
        ("mm", "m", "not a number with a unit"),
        ("", "m", "not a number with a unit"),
        ("nan", "m", "not a number with a unit"),
        ("nan mm", "m", "not a number with a unit"),
        ("1e999999999 km", "m", "too large a number"),
        ("1e9999999999999999999 mm", "m", "too large a number"),
    ],
)
def test_a_text_that_is_no_such_quantity_is_refused_and_the_reason_says_what_it_is(text, unit, reason):
    with pytest.raises(ValueError) as refused:
        parse_quantity(text, unit)
    assert str(refused.value) == reason


@pytest.mark.parametrize(
    "value", [True, None, [1.0], float("nan"), float("inf"), -1e-9, "1e400", 10**400, "0.001 kg", 1j]
)
def test_a_length_that_is_not_a_finite_number_of_its_range_is_refused_with_its_unit(value):
    with pytest.raises(ValidationError, match=r"must be a length \[m\] at least 0, such as 1 mm"):
        TypeAdapter(units.NonNegativeLength).validate_python(value)


@pytest.mark.parametrize(
    ("annotation", "limit", "beside"),
    [
        (units.PositiveLength, 0.0, units.SMALLEST),
        (units.NonNegativeLength, -units.SMALLEST, 0.0),
        (Annotated[int, *units.whole(3)], 2, 3),
    ],
)
def test_the_ends_of_a_range_belong_to_it_as_its_words_say(annotation, limit, beside):
    adapter = TypeAdapter(annotation)
    assert adapter.validate_python(beside) == beside
    with pytest.raises(ValidationError):
        adapter.validate_python(limit)


@pytest.mark.parametrize("value", ["1 A", "50 %", True, "x"])
def test_a_plain_number_takes_no_unit(value):
    with pytest.raises(ValidationError, match="must be a plain number"):
        TypeAdapter(units.PlainNumber).validate_python(value)


@pytest.mark.parametrize("value", [3.0, 3.5, "3", True])
def test_a_count_must_be_a_whole_number(value):
    with pytest.raises(ValidationError, match="must be a whole number of at least 1"):
        TypeAdapter(Annotated[int, *units.whole(1)]).validate_python(value)


@pytest.mark.parametrize(
    ("unit", "written"), [(unit, written) for unit, factors in units.USUAL_UNITS.items() for written in factors]
)
def test_a_usual_unit_is_converted_to_the_bits_that_the_units_library_gives(unit, written, monkeypatch):
    random = np.random.default_rng(0)
    numbers = (random.normal(size=40) * 10.0 ** random.integers(-9, 9, 40)).tolist()
    texts = [f"{number!r} {written}" for number in numbers]
    usual = [parse_quantity(text, unit) for text in texts]
    assert [in_si(number, written) for number in numbers] == usual
    monkeypatch.setattr(units, "USUAL_UNITS", {})
    assert [parse_quantity(text, unit) for text in texts] == usual
    assert [in_si(number, written) for number in numbers] == usual


def test_scenes_in_usual_units_do_not_load_the_units_library():
    load = "import sys; from bilayer_core import load_scene; from bilayer_core.scene import bundled; "
    load += "paths = [*bundled.bundled_scenes().values(), *bundled.bundled_templates().values()]; "
    load += "[load_scene(path) for path in paths]; print(len(paths), 'pint' in sys.modules); "
    load += "load_scene('cantilever', ['duration=1 minute']); print('pint' in sys.modules)"
    count, *loaded = python(load).split()
    assert int(count) > 5 and loaded == ["False", "True"]
