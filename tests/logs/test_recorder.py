"""Quantities recorded in memory."""

import numpy as np
import pytest
from support.sample_scenes import everything

from bilayer_core import Recorder, Simulator, compare, load_scene
from bilayer_core.errors import InputError
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.run.memory import MemoryRecorder


@pytest.fixture
def simulator():
    return Simulator(load_scene(everything()))


def test_all_quantities_are_those_of_the_frames(simulator):
    recorder, memory = Recorder(simulator, rate=100.0), MemoryRecorder(100.0)
    simulator.run(0.05, observers=[memory])
    frames = memory.run_data()
    assert list(recorder.quantities) == list(frames.quantities)
    for name, quantity in recorder.quantities.items():
        expected = frames[name]
        np.testing.assert_array_equal(quantity.values, expected.values, err_msg=name)
        np.testing.assert_array_equal(quantity.times, expected.times)
        assert (quantity.unit, quantity.axes, quantity.labels) == (expected.unit, expected.axes, expected.labels)


def test_only_what_is_asked_for_is_kept(simulator):
    recorder = Recorder(simulator, ["com", "body/*/position", "energy/kinetic"], rate=200.0)
    simulator.run(0.02)
    assert list(recorder.quantities) == ["com", "body/hub/position", "body/ball/position", "energy/kinetic"]
    assert recorder["com"].values.shape == (5, 3) and recorder["com"].unit == "m"
    np.testing.assert_allclose(recorder["com"].values[-1], simulator.com)
    np.testing.assert_array_equal(recorder["body/ball/position"].values[-1], simulator.bodies["ball"].position)
    held = sum(array.nbytes for values in recorder._values.values() for array in values)
    assert held <= 5 * 8 * 10
    with pytest.raises(InputError, match="quantity 'com2': there is none; near it: com"):
        recorder["com2"]


def test_it_records_steps_and_runs_until_it_is_stopped(simulator):
    with Recorder(simulator, "com", rate=500.0) as recorder:
        simulator.run(0.01)
        for _ in range(10):
            simulator.step()
        simulator.run(until=0.03)
    simulator.run(0.01)
    times = recorder.times
    assert times[0] == 0.0 and times[-1] == 0.03 and (np.diff(times) > 0.0).all()
    assert len(times) == 16
    np.testing.assert_allclose(times, np.arange(16) / 500.0, atol=1e-9)


def test_going_back_drops_what_was_recorded_from_there_on(simulator):
    recorder = Recorder(simulator, "stimulus/humidity", rate=100.0)
    simulator.run(0.03)
    saved = simulator.save_state()
    simulator.run(0.03)
    simulator.load_state(saved)
    simulator.set_stimulus("humidity", 0.123)
    simulator.run(0.02)
    np.testing.assert_allclose(recorder.times, [0.0, 0.01, 0.02, 0.03, 0.04, 0.05], atol=1e-9)
    assert recorder["stimulus/humidity"].values[-2:].tolist() == [0.123, 0.123]
    simulator.reset()
    assert recorder.times.tolist() == [0.0]


def test_tables_of_pandas_and_xarray_have_names_and_units(simulator):
    recorder = Recorder(simulator, ["com", "stimulus/*", "rod/*/curvature"], rate=100.0)
    simulator.run(0.05)
    table = recorder.to_dataframe()
    assert list(table) == ["com.x", "com.y", "com.z", "stimulus/humidity"] and len(table) == 6
    data = recorder.to_xarray()
    assert data["com"].attrs["units"] == "m"
    curvature = next(name for name in data if name.endswith("curvature"))
    assert data[curvature].dims[0] == "shape_time" and data[curvature].attrs["units"] == "1/m"


def test_what_it_hands_out_is_read_only_or_a_copy(simulator):
    recorder = Recorder(simulator, ["com"], rate=100.0)
    simulator.run(0.02)
    with pytest.raises(ValueError, match="read-only"):
        recorder["com"].values[0] = 7.0
    recorder.times[:] = 7.0
    assert recorder.times[-1] == pytest.approx(0.02)
    recorder["com"].times[:] = 7.0
    assert recorder["com"].times[-1] == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("asked", "fault"),
    [
        ({"quantities": ["body/bal/position"]}, "near it: body/ball/position"),
        ({"quantities": "energy/xyz*"}, "quantity 'energy/xyz\\*': there is none"),
        ({"rate": 0.0}, "rate: 0.0 is not allowed"),
        ({"rate": float("nan")}, "rate: nan is not allowed"),
    ],
)
def test_what_cannot_be_recorded_is_refused(simulator, asked, fault):
    with pytest.raises(InputError, match=fault):
        Recorder(simulator, **asked)
    simulator.run(0.01)


def test_a_recorder_shows_itself_within_a_line(simulator):
    recorder = Recorder(simulator, rate=100.0)
    simulator.run(0.02)
    assert repr(recorder).startswith("Recorder(sample: t = 0 to 0.02 s, 3 frames; ") and len(repr(recorder)) < 400


def test_what_is_recorded_changes_no_step():
    ends = []
    for record in (False, True):
        simulator = Simulator(load_scene("crawling_inchworm"))
        recorder = Recorder(simulator, rate=997.0) if record else None
        simulator.run(0.1)
        ends.append(simulator.save_state())
    assert recorder.times.size > 10
    np.testing.assert_array_equal(*ends)


def test_recorded_runs_are_compared_with_each_other_and_with_logs(simulator, tmp_path):
    recorder = Recorder(simulator, ["com", "body/*/position"], rate=simulator.scene.output.rate)
    simulator.run(0.05, observers=[McapRecorder(tmp_path / "run.mcap")])
    recorder.stop()
    found = compare(tmp_path / "run.mcap", recorder)
    assert [of.name for of in found.differences] == ["com", "body/hub/position", "body/ball/position"]
    assert all(of.largest == 0.0 for of in found.differences)
    other = Simulator(load_scene(everything(), {"gravity.2": -1.0}))
    again = Recorder(other, "com", rate=simulator.scene.output.rate)
    other.run(0.05)
    assert 0.0 < compare(recorder, again)["com"].largest < 1e-6
