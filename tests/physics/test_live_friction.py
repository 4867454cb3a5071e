"""Coefficients of friction that change while a run goes on."""

import math

import numpy as np
import pytest
from support.crowded_scenes import crowded_simulator
from support.sample_scenes import GROUND, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.model.set_friction import OF_SCENE
from bilayer_core.observed.inputs import FRICTION, Input
from bilayer_core.runs.replay import branch, verify
from bilayer_core.verification.validate.friction import FAR, GRAVITY, MASS, SIZE, at_rest, block

SLOPE = 0.3  # tan α
ALPHA = math.atan(SLOPE)
THRESHOLD = 1e-5


def slope(coefficient, more=None, **solver):
    """A block on a slope down to +x: gravity is turned instead of the ground."""
    law = contact(1e-4, coefficient, THRESHOLD)
    law["friction"] |= more or {}
    content = scene(
        [rod([layer()], length=0.02, stations=3, start=FAR, clamp_start="wall")],
        gravity=[GRAVITY * math.sin(ALPHA), 0, -GRAVITY * math.cos(ALPHA)],
        obstacles=[GROUND],
        contact=law,
        bodies=[fixed(position=FAR), block((0, 0, SIZE[2]))],
    )
    content["solver"] = solver
    return content


def speed(simulator):
    return float(simulator.bodies["block"].velocity[0])


def values(simulator, *without):
    """All of a state but some parts, byte for byte."""
    flat, found, begin = simulator.save_state(), {}, 0
    for name, shape in simulator.description.state_layout:
        end = begin + math.prod(shape)
        if name not in without:
            found[name] = flat[begin:end].tobytes()
        begin = end
    return found


@pytest.mark.parametrize("solver", [{}, {"integrator": "generalised_alpha", "dt": 1e-3}], ids=["default", "alpha"])
def test_a_block_slides_as_soon_as_friction_is_below_the_slope(solver):
    simulator = at_rest(slope(1.1 * SLOPE, **solver))
    simulator.run(until=0.2)
    assert abs(speed(simulator)) < THRESHOLD
    simulator.set_friction(1.01 * SLOPE)
    simulator.run(until=0.4)
    assert abs(speed(simulator)) < THRESHOLD  # it creeps, as the smoothed law says
    simulator.set_friction(0.9 * SLOPE)
    simulator.run(until=0.9)
    gained = GRAVITY * (math.sin(ALPHA) - 0.9 * SLOPE * math.cos(ALPHA)) * 0.5
    assert speed(simulator) == pytest.approx(gained, rel=2e-3)
    simulator.set_friction(1.2 * SLOPE)
    simulator.run(until=1.0)
    lost = GRAVITY * (math.sin(ALPHA) - 1.2 * SLOPE * math.cos(ALPHA)) * 0.1
    assert speed(simulator) == pytest.approx(gained + lost, rel=5e-3)


def test_a_change_is_that_of_the_scene_itself_bit_for_bit():
    changed, rough = at_rest(slope(0.5)), at_rest(slope(0.1))
    changed.run(until=0.1)
    changed.set_friction(0.1)
    rough.load_state(changed.save_state())
    for simulator in (changed, rough):
        simulator.run(until=0.3)
    assert speed(changed) > 0.1
    apart = "account", "conditions", "seal"
    assert values(changed, *apart) == values(rough, *apart)


def test_without_a_change_nothing_is_another_bit():
    plain, told = at_rest(slope(0.2)), at_rest(slope(0.2))
    for simulator in (plain, told):
        simulator.run(until=0.1)
        if simulator is told:
            simulator.set_friction(0.2)
        simulator.run(until=0.2)
    assert values(plain, "friction", "seal") == values(told, "friction", "seal")
    assert told.friction == plain.friction == dict.fromkeys(("coefficient", "forward", "backward", "sideways"), 0.2)


@pytest.mark.parametrize(
    "chosen", [("laminate", 3, "sdirk2", "adaptive"), ("two_rod", 2, "generalised_alpha", "fixed")], ids=str
)
def test_a_saved_state_goes_on_with_its_friction_bit_for_bit(chosen):
    simulator = crowded_simulator(*chosen)
    simulator.run(until=0.01)
    simulator.set_friction(0.05)
    simulator.set_friction(0.9, "sideways")
    simulator.run(until=0.02)
    saved = simulator.save_state()
    other = crowded_simulator(*chosen)
    other.load_state(saved)
    assert other.friction == simulator.friction and other.friction["sideways"] == 0.9
    for each in (simulator, other):
        each.run(until=0.03)
        each.set_friction(None, "sideways")
        each.run(until=0.04)
    assert other.save_state().tobytes() == simulator.save_state().tobytes()
    plain = crowded_simulator(*chosen)
    plain.run(until=0.04)
    assert np.abs(plain.positions - simulator.positions).max() > 1e-9


def test_a_log_of_changes_is_made_again_bit_for_bit(tmp_path):
    simulator = at_rest(slope(0.5, {"forward": 0.4}))
    recorder = McapRecorder(tmp_path / "run.mcap")
    inputs = [
        Input(0, time, FRICTION, key, (value,))
        for time, key, value in [(0.03, "coefficient", 0.2), (0.0712, "coefficient", 0.0), (0.11, "coefficient", 0.35)]
    ]
    simulator.run(0.2, observers=[recorder], inputs=inputs)
    assert simulator.friction["forward"] == 0.4 and simulator.friction["coefficient"] == 0.35
    assert speed(simulator) > 0.05
    found = verify(tmp_path / "run.mcap")
    assert found.passed and found.inputs == 3
    same, later = branch(tmp_path / "run.mcap", 0.1)
    assert same.friction["coefficient"] == 0.0 and [told.values for told in later] == [(0.35,)]
    for value in (0.8, 0.0):
        other, later = branch(tmp_path / "run.mcap", 0.1, (f"contact.friction.coefficient={value}",))
        assert later == [] and other._state.friction[0] == OF_SCENE
        other.run(until=0.2, inputs=later)
        assert (speed(other) < speed(same)) == (value > SLOPE)


def test_friction_that_is_set_loses_what_it_takes():
    simulator = Simulator(at_rest(slope(0.2)).scene, budget=True)
    simulator.run(until=0.2)
    simulator.set_friction(0.05)
    simulator.run(until=0.4)
    way, budget = simulator.bodies["block"].position[0], simulator.budget()
    down, normal = GRAVITY * math.sin(ALPHA), MASS * GRAVITY * math.cos(ALPHA)
    first = 0.5 * (down - 0.2 * normal / MASS) * 0.2**2
    expected = normal * (0.2 * first + 0.05 * (way - first))
    assert budget["lost"]["friction"] == pytest.approx(expected, rel=5e-3)
    assert abs(budget["relative_residual"]) < 1e-3
    simulator.reset()
    assert simulator.friction["coefficient"] == 0.2 and (simulator._state.friction == OF_SCENE).all()


def test_rods_that_touch_each_other_take_the_change_too():
    simulator = Simulator(load_scene("knot"))
    assert "rod friction" in simulator.model.forces
    simulator.run(until=0.01)
    for value in (0.0, 0.7):
        simulator.set_friction(value)
        simulator.run(simulator.dt * 8)
        rods = simulator._stepper.engine.rod_contact
        assert rods.coefficient == value and rods.slides is (value > 0.0)
        assert bool(rods.sliding.count[0]) is (value > 0.0)


@pytest.mark.parametrize(
    ("value", "key", "fault"),
    [
        (-0.1, "coefficient", "-0.1 is not allowed; it must be a finite number from 0 up"),
        (math.nan, "coefficient", "nan is not allowed"),
        (math.inf, "forward", "friction 'forward': inf is not allowed"),
        (0.1, "sidewards", "'sidewards': no such coefficient; there are: coefficient, forward, backward, sideways"),
    ],
)
def test_a_coefficient_that_cannot_be_is_refused_and_changes_nothing(value, key, fault):
    simulator = at_rest(slope(0.2))
    before = simulator.save_state()
    with pytest.raises(InputError, match=fault):
        simulator.set_friction(value, key)
    np.testing.assert_array_equal(simulator.save_state(), before)


@pytest.mark.parametrize(
    ("name", "changes", "why"),
    [
        ("cantilever", [], "no contact.friction"),
        ("gripping_friction", ["contact.friction=null"], "no contact.friction"),
        ("gripping_friction", ["contact.friction.coefficient=0"], "no coefficient above zero"),
    ],
)
def test_a_scene_without_friction_refuses_a_change_with_its_reason(name, changes, why):
    simulator = Simulator(load_scene(name, changes))
    assert simulator.friction == {}
    with pytest.raises(InputError, match=f"nothing slides against friction in the scene .*, which has {why}; allowed"):
        simulator.set_friction(0.3)
