"""Data of fits: names of columns, units, missing values, noise, and what is refused."""

import numpy as np
import pandas
import pytest

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError
from bilayer_core.studies.fitting.data import read_data, with_sigma
from bilayer_core.studies.fitting.runs import Runs, check_times, known_quantities

GOOD = "time,com.z\n0.1,1\n0.2,2\n"


@pytest.fixture(scope="module")
def simulator():
    return Simulator(load_scene("cantilever", {"rods.strip.stations": 6}))


@pytest.fixture(scope="module")
def known(simulator):
    return known_quantities(simulator)


@pytest.fixture
def read(known, tmp_path):
    def read(content):
        if isinstance(content, str):
            (tmp_path / "points.csv").write_text(content)
            content = tmp_path / "points.csv"
        return read_data(content, *known, 1.0)

    return read


def test_columns_are_converted_from_the_units_of_their_headings(read):
    data = read("time [ms],com.z [mm],body/wall/clamp_wrench.mx [N mm],rod/strip/gel/curvature[2] [1/mm]\n100,2,3,4\n")
    assert data.times.tolist() == [0.1]
    assert data.observed[0] == pytest.approx([2e-3, 3e-3, 4e3], rel=1e-15)
    assert [(c.name, c.unit, c.shown_unit) for c in data.columns] == [
        ("com.z", "m", "mm"),
        ("body/wall/clamp_wrench.mx", "N m", "N mm"),
        ("rod/strip/gel/curvature[2]", "1/m", "1/mm"),
    ]


def test_empty_cells_and_nan_in_arrays_are_missing_values(read):
    expected = [[1.0, np.nan], [np.nan, 2.0]]
    from_file = read("time,com.x,com.z\n0.1,1,\n\n0.2,,2\n")
    from_arrays = read({"time": [0.1, 0.2], "com.x": [1.0, np.nan], "com.z": np.array([np.nan, 2.0])})
    from_table = read(pandas.DataFrame({"time": [0.1, 0.2], "com.x": [1.0, np.nan], "com.z": [np.nan, 2.0]}))
    for data in (from_file, from_arrays, from_table):
        np.testing.assert_array_equal(data.observed, expected)
        assert data.present.tolist() == [[True, False], [False, True]]


def test_columns_of_noise_are_in_the_unit_of_their_quantity_or_their_own(read):
    data = read("time,com.x [mm],com.x.sigma,com.z,com.z.sigma [um]\n0.1,1,0.5,2,7\n0.2,1,0.25,,\n")
    assert data.sigma[0] == pytest.approx([5e-4, 7e-6]) and data.sigma[1, 0] == 2.5e-4
    assert with_sigma(data, []).sigma is not None


def test_given_noise_has_units_and_patterns_and_an_exact_name_goes_first(read):
    data = read("time,com.x [mm],com.z,rod/strip/gel/position[-1].x\n0.1,1,2,3\n")
    found = with_sigma(data, ["com*=0.5mm", "rod/*=2", "com.x=3"])
    assert found.sigma[0] == pytest.approx([3e-3, 5e-4, 2.0])
    assert with_sigma(data, {"*": 1.0, "rod/strip/gel/position[-1].x": "1 um"}).sigma[0, 2] == pytest.approx(1e-6)


@pytest.mark.parametrize(
    "content,told",
    [
        ("", "is empty"),
        ("com.z\n1\n", "must have a column time; its columns are com.z"),
        ("time\n0.1\n", "must have a column of a quantity"),
        ("time,com.z\n", "must hold one line or more"),
        ("time,com.z,com.z\n0.1,1,2\n", "'com.z' is there twice"),
        ("time,com.z,com.z [mm]\n0.1,1,2\n", "there is a column of com.z already"),
        ("time,time [ms],com.z\n0.1,1,2\n", "there is a column of times already"),
        ("time,,com.z\n0.1,1,2\n", "one is without a name"),
        ("time,com.z\n0.1\n", "line 2: has 1 cells, must have 2"),
        ("time,com.z\n0.1,1,2\n", "line 2: has 3 cells, must have 2"),
        ("time,com.z\n0.1,nan\n", "line 2, column com.z: found 'nan'; must be a finite number; leave the cell empty"),
        ("time,com.z\n0.1,1\n0.2,inf\n", "line 3, column com.z: found 'inf'"),
        ("time,com.z\n0.1,one\n", "found 'one'"),
        ("time,com.z\n0.1,1\n,2\n", "line 3: has no time"),
        ("time,com.z\n0.1,\n", "column com.z: has no value"),
        ("time,com.z\n0.2,1\n0.1,2\n", "line 3: times must increase, found 0.1 s after 0.2 s"),
        ("time,com.z\n0.2,1\n0.2,2\n", "line 3: times must increase"),
        ("time,com.z\n-0.2,1\n", "line 2: the time -0.2 s is before the start"),
        ("time,com.z\n0.2,1\n1.5,2\n", "line 3: the time 1.5 s is beyond the end of the scene, 1 s; lengthen"),
        ("time,com\n0.1,1\n", "column com: must name a component, .x, .y, .z"),
        ("time,con.z\n0.1,1\n", "near it: com"),
        ("time,com.w\n0.1,1\n", "must name a component"),
        ("time,com[1].z\n0.1,1\n", "com is not of nodes"),
        ("time,energy/bending.x\n0.1,1\n", "energy/bending has no components"),
        ("time,rod/strip/gel/position.x\n0.1,1\n", "needs one of its nodes, 0 to 5 or -1 for the last"),
        ("time,rod/strip/gel/position[6].x\n0.1,1\n", "needs one of its nodes, 0 to 5"),
        ("time,rod/strip/gel/curvature[-7]\n0.1,1\n", "needs one of its nodes, 0 to 5"),
        ("time,rod/strip/jel/curvature[1]\n0.1,1\n", "near it: rod/strip/gel/curvature"),
        ("time,solver/iterations\n0.1,1\n", "is a figure of the solver"),
        ("time,body/wall/quaternion.x\n0.1,1\n", "is a quaternion"),
        ("time,rod/strip/gel/frame[1].x\n0.1,1\n", "is a quaternion"),
        ("time,com.z [N]\n0.1,1\n", "the unit must be one like m, found 'N'"),
        ("time,com.z [furlongz]\n0.1,1\n", "the unit must be one like m, found 'furlongz'"),
        ("time [m],com.z\n0.1,1\n", "the unit must be one like s"),
        ("time,com..z\n0.1,1\n", "must be named like com.z"),
        ("time,com.z,com.x.sigma\n0.1,1,1\n", "there is no column com.x that it could be of"),
        ("time,com.z,com.z.sigma\n0.1,1,0\n", "line 2, column com.z.sigma: must be above 0 where com.z has a value"),
        ("time,com.z,com.z.sigma\n0.1,1,\n", "must be above 0 where com.z has a value"),
        ('time,com.z\n0.1,"1\n', "must be csv"),
        ({"time": [0.1], "com.z": [1.0, 2.0]}, "columns must have one length above 0"),
        ({"time": [], "com.z": []}, "columns must have one length above 0"),
        ({"time": [0.1], "com.z": [[1.0]]}, "must have one axis, has shape (1, 1)"),
        ({"time": [0.1], "com.z": ["a"]}, "must be numbers"),
        ({"time": [0.1], "com.z": [np.inf]}, "must be finite"),
        ({"time": [0.1, 0.1], "com.z": [1.0, 2.0]}, "row 1: times must increase"),
        ([1.0, 2.0], "found list; must be a csv file, or arrays"),
    ],
)
def test_what_is_no_data_is_refused_in_one_line(read, content, told):
    with pytest.raises(InputError) as refused:
        read(content)
    assert told in str(refused.value) and "\n" not in str(refused.value)
    assert "points.csv: " in str(refused.value) or str(refused.value).startswith("data: ")


def test_a_file_that_is_not_there_is_named(known, tmp_path):
    with pytest.raises(InputError, match="none.csv: "):
        read_data(tmp_path / "none.csv", *known, 1.0)


@pytest.mark.parametrize(
    "sigma,told",
    [
        (["com.z"], "must be QUANTITY=VALUE"),
        (["com.y=1mm"], "has no such column; it has com.z, com.x"),
        (["com.z=0"], "must be a number [m] above 0"),
        (["com.z=-1mm"], "must be a number [m] above 0"),
        (["com.z=nan"], "must be a number [m] above 0"),
        (["com.z=1N"], "must be a number [m] above 0"),
        (["com.z=1mm"], "is given for some columns and not for com.x; give it for all or for none"),
    ],
)
def test_noise_that_is_none_is_refused_in_one_line(read, sigma, told):
    data = read("time,com.z,com.x\n0.1,1,2\n")
    with pytest.raises(InputError) as refused:
        with_sigma(data, sigma)
    assert told in str(refused.value) and "\n" not in str(refused.value)


def test_columns_of_several_units_need_their_noise(read):
    data = read("time,com.z,energy/bending\n0.1,1,2\n")
    with pytest.raises(InputError, match=r"several units \(m, J\), which are weighed against each other by it"):
        with_sigma(data, [])
    assert with_sigma(data, ["com.z=1mm", "energy/bending=1e-6"]).sigma is not None


def test_values_of_a_run_are_those_at_the_very_times_in_double_precision(read):
    scene = load_scene("cantilever", {"rods.strip.stations": 6})
    times = [0.0, 0.0123, 0.02, 0.1]
    of_rod, of_body = ["rod/strip/gel/position[-1].z", "rod/strip/gel/curvature[1]"], ["body/wall/clamp_wrench.fz"]
    names = [*of_rod, *of_body, "energy/bending"]
    data = read({"time": times} | {name: np.zeros(4) for name in names})
    values = Runs(scene, [], data).evaluate(np.array([]))
    simulator = Simulator(scene)
    for time, row in zip(times, values, strict=True):
        simulator.run(until=time)
        assert simulator.time == time
        rod, wrench = simulator.rods["strip"], simulator.bodies["wall"].clamp_wrench
        assert row[0] == rod.positions[-1, 2] and row[1] == pytest.approx(rod.curvature[1], rel=1e-12, abs=1e-12)
        assert row[2:] == pytest.approx([wrench[2], simulator.energy()["bending"]], rel=1e-12, abs=1e-15)


def test_fixed_steps_take_times_at_which_a_step_ends_alone(read):
    fixed = Simulator(load_scene("cantilever", {"solver.dt": 1e-3}))
    check_times(fixed, read({"time": 1e-3 * np.arange(1, 900), "com.z": np.zeros(899)}))
    with pytest.raises(InputError, match=r"the time 0\.0125 s is no multiple of the fixed step, 0\.001 s"):
        check_times(fixed, read({"time": [0.01, 0.0125], "com.z": [0.0, 0.0]}))
    check_times(Simulator(load_scene("cantilever")), read({"time": [0.0125], "com.z": [0.0]}))
