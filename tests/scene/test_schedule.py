import pytest
from pydantic import TypeAdapter

from bilayer_core.scene.schedule import Schedule


def schedule(**content):
    return TypeAdapter(Schedule).validate_python(content)


def test_a_held_value_holds_at_all_times():
    assert [schedule(type="hold", value=0.3).value(t) for t in (-1.0, 0.0, 1e9)] == [0.3] * 3


def test_a_ramp_is_linear_between_its_ends_and_constant_outside():
    ramp = schedule(type="ramp", start=1.0, end=3.0, **{"from": 0.2, "to": 1.0})
    assert [ramp.value(t) for t in (0.0, 1.0, 3.0, 9.0)] == [0.2, 0.2, 1.0, 1.0]
    assert ramp.value(1.5) == pytest.approx(0.4)


def test_a_ramp_reaches_its_last_value_exactly():
    ramp = schedule(type="ramp", start=0.1, end=0.7, **{"from": 0.1, "to": 0.3})
    assert ramp.value(0.7) == 0.3


def test_a_table_is_linear_between_points_and_constant_outside():
    table = schedule(type="table", times=[0.0, 1.0, 2.0], values=[0.0, 1.0, 0.5])
    assert [table.value(t) for t in (-1.0, 0.0, 1.0, 2.0, 5.0)] == [0.0, 0.0, 1.0, 0.5, 0.5]
    assert table.value(0.25) == pytest.approx(0.25)
    assert table.value(1.5) == pytest.approx(0.75)


def test_a_table_of_one_point_is_that_value():
    assert schedule(type="table", times=[2.0], values=[0.4]).value(7.0) == 0.4
