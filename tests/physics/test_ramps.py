"""Stimuli and loads that are set from outside by ramps."""

import numpy as np
import pytest
from support.sample_scenes import everything

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.observed.inputs import SHAPES
from bilayer_core.runs.replay import verify

CORNERS = (0.0, 0.04, 0.1, 0.16, 0.2)
VALUES = (0.0, 0.5, 0.3, 0.9, 0.9)


def bender(values=(0.0, 0.0), **settings):
    """A bending strip whose schedule is a line from corner to corner."""
    table = {"type": "table", "times": list(CORNERS[: len(values)]), "values": list(values)}
    return Simulator(load_scene("bending", {"stimuli.swelling.schedule": table}), **settings)


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"model": "two_rod"},
        {"integrator": "generalised_alpha"},
        {"integrator": "tr_bdf2", "dimension": 3},
        {"dt": 1e-3},
        {"dt": 1e-3, "integrator": "implicit_euler"},
    ],
    ids=str,
)
def test_a_ramp_from_outside_is_the_same_ramp_of_a_schedule(settings):
    scheduled, driven = bender(VALUES, **settings), bender(**settings)
    scheduled.run(until=CORNERS[-1])
    for begin, end, value in zip(CORNERS[:-1], CORNERS[1:], VALUES[1:], strict=True):
        driven.set_stimulus("swelling", value, over=end - begin)
        driven.run(until=end)
    apart = np.abs(driven.positions - scheduled.positions).max()
    assert np.abs(scheduled.positions - bender(**settings).positions).max() > 1e-4
    assert apart < 1e-9
    assert driven.statistics.substeps == scheduled.statistics.substeps


def test_a_smooth_ramp_is_half_a_wave_that_rests_at_both_ends():
    driven = bender()
    driven.set_stimulus("swelling", 0.2)
    driven.set_stimulus("swelling", 0.8, over=0.1, shape="smooth")
    reached = {}
    for part in (0.01, 0.25, 0.5, 0.75, 0.99, 1.2):
        driven.run(until=0.1 * part)
        reached[part] = driven.stimulus["swelling"]
    expected = [0.5 - 0.3 * np.cos(np.pi * min(part, 1.0)) for part in reached]
    np.testing.assert_allclose(list(reached.values()), expected, rtol=1e-12)


def test_smooth_ramps_of_the_same_commands_take_fewer_steps():
    counts = {}
    for shape in SHAPES:
        driven, chance = Simulator(load_scene("gripping")), np.random.default_rng(2)
        for _ in range(5):
            driven.set_stimulus("humidity", 0.3 * chance.random(), over=0.04, shape=shape)
            driven.run(0.04)
        counts[shape] = driven.statistics.substeps
    assert counts["smooth"] < 0.8 * counts["linear"]


def test_a_ramp_that_is_replaced_goes_on_from_where_it_is():
    driven = bender()
    driven.set_stimulus("swelling", 1.0, over=0.1)
    driven.run(until=0.05)
    assert driven.stimulus["swelling"] == pytest.approx(0.5)
    driven.set_stimulus("swelling", 0.0, over=0.1)
    driven.run(until=0.1)
    assert driven.stimulus["swelling"] == pytest.approx(0.25)
    driven.run(until=0.2)
    assert driven.stimulus["swelling"] == 0.0


def test_ramps_that_come_often_do_not_make_steps_short():
    counts = {}
    for over in (0.0, 0.02):
        driven = bender()
        while driven.time < 0.3:
            driven.set_stimulus("swelling", 0.5 + 0.4 * np.sin(6.0 * driven.time), over=over)
            driven.run(until=round(driven.time + 0.02, 9))
        counts[over] = driven.statistics.substeps
    assert counts[0.02] < 0.5 * counts[0.0]


@pytest.mark.parametrize("shape", SHAPES)
def test_a_saved_state_goes_on_with_its_ramp_bit_for_bit(shape):
    driven = bender()
    driven.set_stimulus("swelling", 1.0, over=0.1, shape=shape)
    driven.run(until=0.06)
    saved = driven.save_state()
    driven.run(until=0.16)
    other = bender()
    other.load_state(saved)
    other.run(until=0.16)
    np.testing.assert_array_equal(other.save_state(), driven.save_state())


@pytest.mark.parametrize("shape", SHAPES)
def test_a_log_of_ramps_is_made_again_bit_for_bit(tmp_path, shape):
    simulator = Simulator(load_scene(everything()))
    simulator.set_stimulus("humidity", 0.8, over=0.03, shape=shape)
    simulator.set_load(simulator.scene.loads[0].name, 2.0, over=0.03, shape=shape)
    simulator.run(0.05, observers=[McapRecorder(tmp_path / "run.mcap")])
    driven = bender()
    times = iter(range(1000))

    def act(_):
        if next(times) % 5 == 0:
            driven.set_stimulus("swelling", 0.5 + 0.5 * np.sin(40.0 * driven.time), over=0.013, shape=shape)

    driven.run(until=0.2, observers=[McapRecorder(tmp_path / "bender.mcap")], each_step=act)
    for name in ("run", "bender"):
        found = verify(tmp_path / f"{name}.mcap")
        assert found.passed and found.states > 3, name


def test_loads_may_be_set_by_ramps():
    simulator = Simulator(load_scene(everything()))
    load = simulator.scene.loads[0].name
    simulator.set_load(load, 3.0, over=0.02)
    simulator.run(until=0.01)
    row = simulator._state.override[len(simulator.scene.stimuli)]
    assert row.tolist() == [3.0, row[1], 0.0, 0.02, 0.0]
    simulator.run(until=0.03)
    assert simulator._stepper.surroundings.load_factor(simulator._state)[0] == 3.0


@pytest.mark.parametrize(
    ("value", "over", "fault"),
    [
        (0.5, -1.0, "over = -1.0 is not allowed"),
        (0.5, float("nan"), "over = nan is not allowed"),
        (0.5, float("inf"), "over = inf is not allowed"),
        (None, 0.1, "over = 0.1 s needs a value to get to"),
        (2.0, 0.1, "2.0 is not allowed; it must be from 0 to 1"),
        (1.00000001, 0.1, "1.00000001 is not allowed; it must be from 0 to 1"),
    ],
)
def test_a_ramp_that_cannot_be_is_refused_and_changes_nothing(value, over, fault):
    driven = bender()
    before = driven.save_state()
    with pytest.raises(InputError, match=fault):
        driven.set_stimulus("swelling", value, over=over)
    np.testing.assert_array_equal(driven.save_state(), before)


def test_a_ramp_of_no_known_shape_is_refused():
    with pytest.raises(InputError, match="shape = 'cubic' is not allowed; it must be one of linear, smooth"):
        bender().set_stimulus("swelling", 0.5, over=0.1, shape="cubic")


@pytest.mark.parametrize(("value", "end"), [(1.0000000000000002, 1.0), (-1e-17, 0.0), (1.0 + 5e-10, 1.0)])
def test_a_stimulus_that_passes_its_range_by_rounding_is_the_end_of_the_range(value, end):
    driven, told = bender(), []
    driven.listen(told.append)
    driven.set_stimulus("swelling", value)
    driven.run(until=0.001)
    assert driven.stimulus["swelling"] == end
    assert told[0].values[0] == end


def test_a_ramp_shorter_than_what_counts_as_one_time_is_a_jump():
    driven = bender()
    driven.set_stimulus("swelling", 0.7, over=1e-300)
    driven.run(until=0.001)
    assert driven.stimulus["swelling"] == 0.7
