"""Logs as named arrays with units, as tables of pandas and xarray, and compared with each other."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest
from support import synthetic_run
from support.sample_scenes import everything

import bilayer_core
from bilayer_core import Recorder, Simulator, compare, load_scene, read_log
from bilayer_core.cli import main
from bilayer_core.errors import InputError
from bilayer_core.forces.force_register import TERMS
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.run.quantities import entries
from bilayer_core.log.run.run_data import RunData

TIMES = np.arange(0, 26) * 0.02


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    synthetic_run.run(McapRecorder(path, rate=50.0, marker_rate=25.0), TIMES)
    return read_log(path)


@pytest.fixture(scope="module")
def bent(tmp_path_factory):
    """Logs of a strip that is bent to two ends, one of them recorded less often."""
    directory = tmp_path_factory.mktemp("bent")
    for name, value, rate in (("half", 0.5, 50.0), ("again", 0.5, 50.0), ("seldom", 0.5, 10.0), ("whole", 1.0, 50.0)):
        simulator = Simulator(load_scene("bending"))
        simulator.set_stimulus(next(iter(simulator.scene.stimuli)), value)
        simulator.run(0.4, observers=[McapRecorder(directory / f"{name}.mcap", rate=rate)])
    return directory


def test_every_quantity_has_a_name_a_unit_and_times(run):
    com = run["com"]
    assert (com.unit, com.axes, com.labels) == ("m", ("axis",), ("x", "y", "z"))
    np.testing.assert_array_equal(com.values, run.com)
    np.testing.assert_allclose(com.times, TIMES)
    assert run["energy/gravity"].unit == "J"
    assert run["body/ball/position"].values.shape == (len(TIMES), 3)
    for strand in run.description.strands:
        position = run[f"rod/{strand.name}/position"]
        np.testing.assert_array_equal(position.values, run.positions[:, strand.nodes])
        assert position.times is run.shape_times and position.axes == ("node", "axis")
        assert run[f"rod/{strand.name}/curvature"].unit == "1/m"
        frames = run[f"rod/{strand.name}/frame"].values
        np.testing.assert_allclose(np.linalg.norm(frames, axis=-1), 1.0, atol=1e-6)


def test_the_unit_of_a_channel_is_that_of_its_scene(bent):
    for name, channel in load_scene("bending").stimuli.items():
        unit = read_log(bent / "half.mcap")[f"stimulus/{name}"].unit
        assert unit == ("" if channel.unit == "1" else channel.unit)


def test_arrays_cannot_be_changed(run):
    with pytest.raises(ValueError, match="read-only"):
        run["com"].values[0] = 1.0


def test_a_name_that_is_none_is_told_with_those_near_it(run):
    with pytest.raises(InputError, match=r"quantity 'body/ball/positions': there is none; near it: body/ball/position"):
        run["body/ball/positions"]


def test_a_run_is_told_within_a_screen(run):
    assert len(repr(run)) < 400 and "26 frames" in repr(run)
    assert repr(run["com"]) == "Quantity(com [m], shape (26, 3), t = 0 to 0.5 s)"


def test_pandas_takes_all_but_shapes(run):
    table = run.to_dataframe()
    assert table.index.name == "time" and len(table) == len(TIMES)
    np.testing.assert_array_equal(table["com.z"], run.com[:, 2])
    np.testing.assert_array_equal(table["body/ball/contact_wrench.mz"], run.contact_wrenches[:, 0, 5])
    assert not any(name.startswith("rod/") for name in table)


def test_xarray_takes_all_with_units(run):
    data = run.to_xarray()
    assert set(data.data_vars) == set(run.quantities)
    assert data["com"].attrs["units"] == "m" and data["com"].dims == ("time", "axis")
    assert float(data["com"].sel(axis="z").isel(time=3)) == run.com[3, 2]
    strand = run.description.strands[0].name
    assert data[f"rod/{strand}/position"].dims == ("shape_time", f"node of rod/{strand}", "axis")


def test_reading_is_one_line_of_the_package():
    assert {"read_log", "compare"} <= set(bilayer_core.__all__)


# two runs


def test_a_run_is_equal_to_itself_made_again(bent):
    found = compare(bent / "half.mcap", bent / "again.mcap")
    assert found.equal and repr(found) == "Comparison(equal)"
    assert found.span == (0.0, 0.4)


def test_other_runs_differ_by_what_is_told_and_when(bent):
    found = compare(bent / "half.mcap", bent / "whole.mcap")
    one, other = read_log(bent / "half.mcap"), read_log(bent / "whole.mcap")
    apart = np.abs(one.com - other.com).max(axis=1)
    assert not found.equal
    assert found["com"].largest == apart.max() and found["com"].time == one.times[apart.argmax()]
    assert found["com"].part == pytest.approx(apart.max() / np.ptp(one.com))
    assert not any(of.interpolated for of in found.differences)
    assert "solver/cpu_time" not in {of.name for of in found.differences}


def test_runs_with_other_times_are_interpolated(bent):
    found = compare(bent / "half.mcap", bent / "seldom.mcap")
    assert found["com"].interpolated and 0.0 < found["com"].part < 0.2


def test_rotations_are_compared_and_not_signs_of_quaternions(run):
    held = {field.name: getattr(run, field.name) for field in fields(RunData)}
    held |= {"body_quaternions": -run.body_quaternions, "material_frames": -run.material_frames}
    turned = RunData(**held)
    assert compare(run, turned).equal


def test_runs_of_other_robots_or_times_are_refused(bent, tmp_path):
    later, finer = tmp_path / "later.mcap", tmp_path / "finer.mcap"
    simulator = Simulator(load_scene("bending"))
    simulator.run(0.5)
    simulator.run(0.1, observers=[McapRecorder(later)])
    with pytest.raises(InputError, match=r"in common: .*half\.mcap t = 0 to 0\.4 s, .*later\.mcap t = 0\.5 to 0\.6 s"):
        compare(bent / "half.mcap", later)
    name = load_scene("bending").rods[0].name
    Simulator(load_scene("bending", [f"rods.{name}.stations=11"])).run(0.1, observers=[McapRecorder(finer)])
    with pytest.raises(InputError, match=r"compare: rod/.* has shape"):
        compare(bent / "half.mcap", finer)


def test_the_command_tells_the_largest_first(bent, capsys):
    half, whole = str(bent / "half.mcap"), str(bent / "whole.mcap")
    assert main(["compare", half, str(bent / "again.mcap")]) == 0
    assert "equal to the last bit of the logs" in capsys.readouterr().out
    assert main(["compare", half, whole]) == 1
    first, _, *lines = capsys.readouterr().out.splitlines()
    parts = [float(line.split(" s")[0].split()[-2]) for line in lines]
    assert first.startswith("t = 0 to 0.4 s") and len(parts) > 5 and parts == sorted(parts, reverse=True)
    assert main(["compare", half, whole, "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["equal"] is False and {"name", "largest", "time", "part"} <= set(told["differences"][0])


def test_a_run_that_ends_earlier_is_not_equal_to_the_longer_one(bent, tmp_path, capsys):
    shorter = tmp_path / "shorter.mcap"
    simulator = Simulator(load_scene("bending"))
    simulator.set_stimulus(next(iter(simulator.scene.stimuli)), 0.5)
    simulator.run(0.2, observers=[McapRecorder(shorter, rate=50.0)])
    found = compare(shorter, bent / "half.mcap")
    assert not found.equal and 0.0 < found["com"].largest < 1e-6  # the end of a run ends a step
    assert main(["compare", str(shorter), str(bent / "half.mcap")]) == 1
    told = capsys.readouterr().out
    assert f"{shorter} has t = 0 to 0.2 s" in told and "half.mcap has t = 0 to 0.4 s" in told


def test_every_term_of_energy_has_a_name_that_logs_are_read_with(tmp_path):
    terms = dict.fromkeys(name for term in TERMS for name in term.names)
    frame = replace(synthetic_run.frame(0.0), energy=dict.fromkeys(terms, 1.0))
    recorder = McapRecorder(tmp_path / "run.mcap")
    recorder.start(synthetic_run.description())
    recorder.observe(frame)
    recorder.close(True)
    assert list(read_log(tmp_path / "run.mcap").energy) == list(terms)


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """Logs of one strip, with layers of unlike thickness of which one ends early, in both models."""
    directory = tmp_path_factory.mktemp("both")
    over = {"rods.strip.layers.0.thickness": 0.3e-3, "rods.strip.layers.1.interval": [0.0, 0.08]}
    found = {}
    for model in ("two_rod", "laminate"):
        simulator = Simulator(load_scene("bending", over), model=model)
        simulator.set_stimulus("swelling", 0.5)
        simulator.solve_static()
        simulator.run(0.01, log=directory / f"{model}.mcap")
        found[model] = simulator, read_log(directory / f"{model}.mcap")
    return found


def test_a_rod_has_the_same_rows_under_the_same_names_in_both_models(both):
    (two, of_two), (one, of_one) = both.values()
    names = [name for name in of_one.quantities if name.startswith("rod/")]
    assert set(names) <= set(of_two.quantities) and len(names) == 9
    curve = one.rods["strip"].positions
    for name, apart in (("rod/strip/position", 1e-5), ("rod/strip/strain", 2e-5), ("rod/strip/active/position", 1e-5)):
        values = of_two[name].values[-1], of_one[name].values[-1]
        assert values[0].shape == values[1].shape
        elsewhere = np.arange(len(values[0])) != (32 if "strain" in name else -1)  # where the layer ends, means differ
        np.testing.assert_allclose(*(found[elsewhere] for found in values), atol=apart)
    for simulator, run in both.values():
        middle = simulator.rods["strip"].middle_line
        assert middle.shape == curve.shape == (41, 3)
        np.testing.assert_allclose(run["rod/strip/position"].values[-1], middle, atol=1e-8)
        assert simulator.summary()["tip_positions"] == {"strip": middle[-1].tolist()}
    assert np.abs(of_one["rod/strip/position"].values[-1] - curve).max() > 1e-4  # where nodes are does not matter


def test_frames_and_forces_of_two_layers_are_those_of_the_rod(both):
    _, run = both["two_rod"]
    frames = run["rod/strip/frame"].values[-1]
    np.testing.assert_allclose(np.linalg.norm(frames, axis=-1), 1.0, atol=1e-6)
    np.testing.assert_allclose(frames, both["laminate"][1]["rod/strip/frame"].values[-1], atol=5e-3)
    np.testing.assert_array_equal(frames[-5:], run["rod/strip/passive/frame"].values[-1][-5:])
    assert run["rod/strip/contact_force"].values.shape == (*run["rod/strip/curvature"].values.shape, 3)


def test_the_names_of_older_versions_are_read_with_a_warning(both):
    _, run = both["laminate"]
    with pytest.warns(FutureWarning, match="'rod/strip/laminate/position' is now 'rod/strip/position'"):
        found = run["rod/strip/laminate/position"]
    np.testing.assert_array_equal(found.values, run["rod/strip/position"].values)
    with pytest.warns(FutureWarning, match=r"is now 'rod/strip/\*'"):
        Recorder(both["laminate"][0], "rod/strip/laminate/*").stop()
    with pytest.raises(InputError, match="there is none; near it"), pytest.warns(FutureWarning):
        run["rod/strap/laminate/position"]


def test_the_command_warns_of_an_older_name_in_one_line(bent, tmp_path, capsys):
    asked = ["plot", str(bent / "half.mcap"), "rod/strip/laminate/position.z", "--out", str(tmp_path / "figure.png")]
    assert main(asked) == 0
    told = "warning: quantity 'rod/strip/laminate/position' is now 'rod/strip/position', in the rod's middle line\n"
    assert capsys.readouterr().err == told


def test_forces_of_pairs_and_figures_of_joints_are_logged_as_they_are_seen(tmp_path):
    simulator = Simulator(load_scene(everything()))
    with Recorder(simulator, ["joint/*", "contact/*"], rate=1000) as recorder:
        simulator.run(0.01, observers=[McapRecorder(tmp_path / "run.mcap", rate=1000)])
    run, joints = read_log(tmp_path / "run.mcap"), simulator.joints
    assert recorder.quantities.keys() == {name for name in run.quantities if name.startswith(("joint/", "contact/"))}
    for name, quantity in recorder.quantities.items():
        assert run[name].unit == quantity.unit
        np.testing.assert_array_equal(run[name].values, quantity.values)
    last = {name: quantity.values[-1] for name, quantity in recorder.quantities.items()}
    np.testing.assert_array_equal(last["joint/knee/wrench"], joints["knee"].wrench)
    assert (last["joint/strut/angle"], run["joint/strut/angle"].unit) == (joints["strut"].turning.value, "rad")
    assert (last["joint/strut/travel"], run["joint/strut/travel"].unit) == (joints["strut"].sliding.value, "m")
    assert last["contact/ball/ground/force"] == simulator.pair_forces["ball", "ground"] > 0.0


def test_an_older_log_of_two_layers_lacks_the_rod_of_both():
    model = synthetic_run.description()
    older = replace(model, strands=tuple(replace(strand, first_station=None) for strand in model.strands))
    names = {entry.name for entry in entries(older, (), ())}
    assert "rod/arm_0/position" not in names and "rod/arm_0/active/position" in names
