"""Which runs a sweep has."""

import numpy as np
import pytest

from bilayer_core.studies.sweeps.design import count_of, runs_of
from bilayer_core.studies.sweeps.run_sweep import read_sweep
from bilayer_core.studies.sweeps.spec import read_spec


def runs(content):
    spec = read_spec(content)[0]
    found = list(runs_of(spec))
    assert len(found) == count_of(spec)
    return found


def test_a_grid_has_each_value_with_each(strip):
    found = runs(strip)
    assert [run["gain"] for run in found] == [0.5, 0.5, 1.0, 1.0, 1.5, 1.5, 2.0, 2.0]
    assert [run["length"] for run in found] == [80.0, 100.0] * 4


def test_a_list_takes_values_side_by_side(strip):
    strip["design"] = "list"
    strip["parameters"]["gain"]["count"] = 2
    assert runs(strip) == [{"gain": 0.5, "length": 80.0}, {"gain": 2.0, "length": 100.0}]


@pytest.mark.parametrize("design", ["sobol", "latin_hypercube"])
def test_samples_fill_the_ranges_evenly_and_depend_on_the_seed_alone(strip, design):
    del strip["parameters"]["gain"]["count"]
    strip |= {"design": design, "samples": 64, "seed": 5}
    found = runs(strip)
    gains = np.array([run["gain"] for run in found])
    counts = np.histogram(gains, bins=8, range=(0.5, 2.0))[0]
    assert counts.tolist() == [8] * 8
    assert sum(run["length"] == 80.0 for run in found) == 32
    assert found == runs(strip)
    assert found != runs(strip | {"seed": 6})


def test_ends_of_ranges_are_exact_and_logarithmic_steps_have_one_ratio(strip):
    strip["parameters"]["gain"] |= {"from": "0.1 %", "to": "0.7 %", "count": 5, "spacing": "log"}
    gains = np.unique([run["gain"] for run in runs(strip)])
    assert gains[0] == 0.1 and gains[-1] == 0.7
    assert gains[1:] / gains[:-1] == pytest.approx(7.0**0.25, rel=1e-14)


def test_units_of_one_kind_become_that_of_the_first(strip):
    strip["parameters"]["length"]["values"] = ["80 mm", "10 cm", "0.12 m"]
    assert sorted({run["length"] for run in runs(strip)}) == pytest.approx([80.0, 100.0, 120.0], rel=1e-15)


def test_counts_are_whole(strip):
    strip["parameters"]["gain"] = {"path": "rods.strip.stations", "from": 10, "to": 21, "count": 4, "whole": True}
    assert sorted({run["gain"] for run in runs(strip)}) == [10, 14, 17, 21]
    assert all(isinstance(run["gain"], int) for run in runs(strip))


def test_repeats_give_each_run_several_seeds(strip):
    strip["repeats"] = {"path": "imperfection.seed", "count": 3}
    found = runs(strip)
    assert len(found) == 24
    assert [run["seed"] for run in found[:4]] == [0, 1, 2, 0]


def test_keys_tell_apart_scenes_parameters_settings_and_units(strip):
    def keys(**changes):
        return read_sweep(strip | changes).keys()

    first = keys()
    assert len(first) == 8
    assert first == keys(title="another", metrics={"steps": "steps"})
    for changes in ({"set": {"duration": "0.31 s"}}, {"set": {"solver.tolerance": 1e-5, "duration": "0.3 s"}}):
        assert not first & keys(**changes)
    finer = {**strip["parameters"], "length": {"path": "rods.strip.path.length", "values": ["80 mm", "0.1 m"]}}
    assert len(first & keys(parameters=finer)) == 8
    other = {**strip["parameters"], "length": {"path": "rods.strip.width", "values": ["80 mm", "100 mm"]}}
    assert not first & keys(parameters=other)
