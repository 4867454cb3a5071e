"""Whole fits: what they find, what they refuse, and what they do where no run can be made."""

import numpy as np
import pytest
from benchmarks.fit_coverage import PARAMETERS, TIMES, TIP, TRUTH
from benchmarks.fit_coverage import SCENE as STUDIED

import bilayer_core
from bilayer_core import Simulator, fit, load_scene
from bilayer_core.errors import InputError, SceneError, SimulationError, UnknownName
from bilayer_core.studies.fitting import descent
from bilayer_core.studies.fitting import fit as whole
from bilayer_core.studies.fitting.identify import NotIdentifiable
from bilayer_core.studies.fitting.runs import Runs, known_quantities

SCENE = STUDIED | {"solver": {"dimension": 3}}
"""In space, where no run builds a second model to see whether it would leave its plane."""
MODULUS, GAIN = TRUTH
NOISE = 0.5e-3
ONE = {GAIN: PARAMETERS[GAIN]}
"""Parameter, where one is enough: half the runs."""


@pytest.fixture(scope="module")
def exact():
    return data_of(load_scene(SCENE), TIMES, [f"{TIP}.x", f"{TIP}.z"])


@pytest.fixture(scope="module")
def noisy(exact):
    noise = np.random.default_rng(8)
    return {name: at if name == "time" else at + noise.normal(0.0, NOISE, at.size) for name, at in exact.items()}


@pytest.fixture(scope="module")
def found(noisy):
    return fit(SCENE, noisy, PARAMETERS)


def data_of(scene, times, names):
    """What a scene comes to at some times, without noise."""
    simulator = Simulator(scene)
    known, nodes = known_quantities(simulator)
    zeros = {"time": np.array(times)} | {name: np.zeros(len(times)) for name in names}
    data = whole.read_data(zeros, known, nodes, scene.duration)
    values = Runs(scene, [], data).evaluate(np.array([]))
    return zeros | {name: values[:, k] for k, name in enumerate(names)}


@pytest.mark.parametrize("dt", [None, "2 ms"])
def test_data_without_noise_give_the_truth_within_a_millionth(exact, dt):
    if dt:
        scene = load_scene(SCENE, {"solver.dt": dt, "solver.tolerance": None})
        exact = data_of(scene, exact["time"], [f"{TIP}.x", f"{TIP}.z"])
    found = fit(SCENE, exact, PARAMETERS, dt=dt)
    assert found.converged and found.values == pytest.approx(TRUTH, rel=1e-6)
    assert found.scene.materials["gel"].youngs_modulus == found[MODULUS].value


def test_data_with_noise_give_the_truth_within_the_intervals(found):
    for path, value in TRUTH.items():
        low, high = found[path].interval
        assert low < value < high and high - low < 0.15 * value
    assert found.sigma[f"{TIP}.x"] == found.sigma[f"{TIP}.z"] == pytest.approx(NOISE, rel=0.4)
    assert found.freedom == 14 and not found.sigma_known and found.chi_squared is None
    assert 0.0 < found.correlations[0, 1] < 1.0 and found.warnings == ()


@pytest.mark.verify
def test_two_fits_of_the_same_data_are_equal_bit_for_bit(noisy, found):
    again = fit(SCENE, noisy, PARAMETERS)
    assert again.values == found.values
    assert [p.interval for p in again.parameters] == [p.interval for p in found.parameters]
    np.testing.assert_array_equal(again.fitted, found.fitted)
    np.testing.assert_array_equal(again.correlations, found.correlations)


def test_the_result_is_that_of_the_nearest_run_to_the_data(noisy, found):
    best = np.sum(found.residuals**2)
    for path, value in found.values.items():
        for factor in (0.99, 1.01):
            scene = load_scene(SCENE, found.values | {path: factor * value})
            other = data_of(scene, noisy["time"], [f"{TIP}.x", f"{TIP}.z"])
            assert sum(np.sum((noisy[name] - other[name]) ** 2) for name in (f"{TIP}.x", f"{TIP}.z")) > best


def test_intervals_with_estimated_and_with_given_noise_agree_where_both_are_right(noisy, found):
    given = fit(SCENE, noisy, PARAMETERS, sigma={"rod/*": found.sigma[f"{TIP}.x"]})
    assert given.values == pytest.approx(found.values, rel=1e-5)
    assert given.chi_squared == pytest.approx(given.freedom, rel=1e-4) and 0.3 < given.probability < 0.6
    for path in TRUTH:
        widths = [np.ptp(of[path].interval) for of in (given, found)]
        assert widths[0] / widths[1] == pytest.approx(1.959964 / 2.144787, rel=1e-3)  # normal, and t of 14


def test_residuals_larger_than_the_given_noise_are_warned_of(noisy):
    found = fit(SCENE, noisy, ONE, sigma=["rod/*=0.1mm"])
    assert found.chi_squared > 10.0 * found.freedom
    assert any("residuals are larger than the noise that was given" in warning for warning in found.warnings)


def test_values_with_a_large_sigma_hardly_count(noisy, found):
    wrong = noisy[f"{TIP}.z"].copy()
    wrong[3] += 0.02
    sigma = np.where(np.arange(8) == 3, 1e3, NOISE)
    columns = noisy | {f"{TIP}.z": wrong, f"{TIP}.z.sigma": sigma, f"{TIP}.x.sigma": np.full(8, NOISE)}
    known = fit(SCENE, columns, ONE)
    missing = fit(SCENE, noisy | {f"{TIP}.z": np.where(sigma > 1.0, np.nan, wrong)}, ONE)
    assert known.values == pytest.approx(missing.values, rel=1e-6)
    assert missing.freedom == found.freedom  # a parameter less, and a value less
    assert np.isnan(missing.residuals[3, 1]) and np.isfinite(missing.fitted).all()


def test_a_parameter_at_its_bound_has_no_interval_and_is_named(noisy):
    found = fit(SCENE, noisy, PARAMETERS | {GAIN: ("1 %", "3.5 %", "2.5 %")})
    at_bound = found[GAIN]
    assert at_bound.at_bound == "upper" and at_bound.interval is None
    assert at_bound.value == pytest.approx(0.035, rel=1e-3)
    assert found[MODULUS].interval is not None
    assert np.isnan(found.correlations[1]).all() and found.correlations[0, 0] == 1.0
    assert any(f"{GAIN} ends at its upper bound" in warning for warning in found.warnings)
    assert "no interval" in repr(found) and "no interval" in found._repr_html_()


def test_curvature_and_forces_are_data_too():
    names = ["rod/strip/curvature[5]", "body/wall/clamp_wrench.my"]
    columns = data_of(load_scene(SCENE), 0.04 * np.arange(1, 9), names)
    sigma = {names[0]: 0.1, names[1]: "1 mN*mm"}
    assert fit(SCENE, columns, PARAMETERS, sigma=sigma).values == pytest.approx(TRUTH, rel=1e-6)


def test_schedules_are_fitted_by_resetting_one_simulator(exact, monkeypatch):
    built = []
    monkeypatch.setattr(
        "bilayer_core.studies.fitting.runs.Simulator", lambda scene: built.append(1) or Simulator(scene)
    )
    path = "stimuli.swelling.schedule.end"
    found = fit(SCENE, exact, {path: ("0.2 s", "0.32 s", "0.25 s")})
    assert found.values == {path: pytest.approx(0.3, rel=1e-6)}
    assert sum(built) == 1 and found.runs > 10


def test_a_scene_of_every_kind_is_taken_with_overrides(exact):
    overrides = {MODULUS: "0.8 MPa"}
    one = fit(SCENE, exact, {GAIN: ("1 %", "10 %")}, overrides=overrides)
    other = fit(load_scene(SCENE), exact, {GAIN: ("1 %", "10 %")}, overrides=[f"{MODULUS}=0.8MPa"])
    assert one.values == other.values and one.scene.materials["gel"].youngs_modulus == 8e5
    assert one.values[GAIN] != pytest.approx(TRUTH[GAIN], rel=1e-3)


def test_what_the_data_cannot_tell_apart_is_named_instead_of_fitted():
    weightless = load_scene(SCENE, {"gravity": [0, 0, 0], "damping.mass": 0.0})
    columns = data_of(weightless, 0.04 * np.arange(1, 9), [f"{TIP}.x", f"{TIP}.z"])
    asked = {MODULUS: ("0.5 MPa", "2 MPa"), "materials.gel.density": (500, 2000), GAIN: ("2 %", "6 %")}
    with pytest.raises(NotIdentifiable) as refused:
        fit(weightless, columns, asked)
    (direction,) = refused.value.directions
    assert direction.changes == pytest.approx({MODULUS: 1.0, "materials.gel.density": 1.0}, abs=0.03)
    assert f"{MODULUS} and materials.gel.density: the data tell only" in str(refused.value)


@pytest.mark.parametrize(("bounds", "noise"), [(("2 mm", "30 mm"), 0.0), (("5 mm", "15 mm"), 0.2e-3)])
def test_modulus_and_width_under_a_force_are_told_by_their_product_alone(bounds, noise):
    slowly = {"type": "ramp", "start": 0, "end": "0.3 s", "from": 0, "to": 1}
    pull = {"name": "pull", "rod": "strip", "position": "50 mm", "force": [0, 0, "-2 mN"], "schedule": slowly}
    light = {"gravity": [0, 0, 0], "materials.gel.density": 1e-6, "damping.mass": 1e3, "loads": [pull]}
    scene = load_scene(SCENE, light)
    columns = data_of(scene, 0.04 * np.arange(1, 9), [f"{TIP}.x", f"{TIP}.z"])
    for name in (f"{TIP}.x", f"{TIP}.z"):
        columns[name] += np.random.default_rng(4).normal(0.0, noise, 8)
    with pytest.raises(NotIdentifiable) as refused:
        fit(scene, columns, {MODULUS: ("0.5 MPa", "2 MPa", "0.9 MPa"), "rods.strip.width": bounds})
    (direction,) = refused.value.directions
    assert direction.changes == pytest.approx({MODULUS: 1.0, "rods.strip.width": -1.0}, abs=0.03)


def test_data_too_noisy_to_narrow_the_bounds_have_no_values(exact):
    names = [f"{TIP}.x", f"{TIP}.z"]
    ends = [data_of(load_scene(SCENE, TRUTH | {GAIN: gain}), exact["time"], names) for gain in (0.039, 0.041)]
    slope = np.concatenate([ends[1][name] - ends[0][name] for name in names])
    noise = np.random.default_rng(3).normal(0.0, 0.02, slope.size)
    noise -= slope * (noise @ slope) / (slope @ slope)  # which leaves the gain where it is
    rough = {"time": exact["time"], names[0]: exact[names[0]] + noise[:8], names[1]: exact[names[1]] + noise[8:]}
    with pytest.raises(NotIdentifiable, match="wider than their bounds") as refused:
        fit(SCENE, rough, {GAIN: ("3.8 %", "4.2 %")})
    assert refused.value.where == "at the solution"
    assert fit(SCENE, rough, {GAIN: ("0.5 %", "10 %")})[GAIN].interval is not None


def test_a_parameter_without_influence_is_refused(exact):
    with pytest.raises(InputError, match="parameter materials.gel.poisson_ratio: has no influence"):
        fit(SCENE, exact, {"materials.gel.poisson_ratio": (0.1, 0.4)})


def test_fewer_values_than_parameters_and_noise_are_refused(exact):
    few = {name: values[:1] for name, values in exact.items()}
    with pytest.raises(InputError, match=r"data: holds 2 values, fewer than needed for this fit: 3, one more than"):
        fit(SCENE, few, PARAMETERS)
    one = {name: few[name] for name in ("time", f"{TIP}.x")}
    with pytest.raises(InputError, match=r"holds 1 values, fewer than needed for this fit: 2$"):
        fit(SCENE, one, PARAMETERS, sigma={"*": NOISE})


def test_with_as_many_values_as_parameters_given_noise_has_intervals(exact):
    few = {name: exact[name][6:7] for name in ("time", f"{TIP}.z")}
    found = fit(SCENE, few, ONE, sigma={"*": 1e-5})
    assert found.freedom == 0 and found.probability is None
    assert found[GAIN].value == pytest.approx(TRUTH[GAIN], rel=1e-5) and found[GAIN].interval


class Stopping(Runs):
    """Runs that stop where the modulus is above a limit."""

    limit = 0.0

    def make_many(self, points):
        stopped = SimulationError("the strip is too stiff", 0.1)
        return [
            stopped if self._parameters[0].value(point[0]) > self.limit else super(Stopping, self).make_many([point])[0]
            for point in points
        ]


def test_a_fit_goes_back_from_runs_that_stop_and_tells_of_them(exact, monkeypatch):
    monkeypatch.setattr(whole, "Runs", Stopping)
    monkeypatch.setattr(Stopping, "limit", 1.1e6)  # without it this search comes to 1.16 MPa
    asked, told = {MODULUS: ("0.1 MPa", "10 MPa", "0.2 MPa"), GAIN: ("1 %", "10 %", "8 %")}, []
    found = fit(SCENE, exact, asked, progress=told.append)
    assert found.values == pytest.approx(TRUTH, rel=1e-5)
    assert found.refused and "the strip is too stiff; this run has materials.gel.youngs_modulus = " in found.refused[0]
    assert any(line.startswith("went back: stopped at t = 0.1 s") for line in told)


def test_a_run_that_stops_with_the_start_values_ends_the_fit_with_the_values(exact, monkeypatch):
    monkeypatch.setattr(whole, "Runs", Stopping)
    with pytest.raises(SimulationError, match=r"too stiff; this run has .* = 0\.6 MPa, .*gain = 2\.5 %"):
        fit(SCENE, exact, PARAMETERS)


def test_values_that_the_scene_does_not_take_together_end_the_fit_with_the_values(exact):
    path = "rods.strip.layers.active.interval"
    scene = load_scene(SCENE, {path: ["10 mm", "30 mm"], "rods.strip.stations": 51})
    asked = {f"{path}.0": ("0 mm", "25 mm", "24 mm"), f"{path}.1": ("15 mm", "50 mm", "16 mm")}
    with pytest.raises(SceneError, match=r"no run with .*interval\.0 = 24 mm, .*interval\.1 = 16 mm: "):
        fit(scene, exact, asked)


def test_a_fit_that_is_cut_short_says_so(exact, monkeypatch):
    monkeypatch.setattr(descent, "MOST_EVALUATIONS", 2)
    found = fit(SCENE, exact, ONE)
    assert not found.converged and "not converged" in found.termination


def test_the_package_offers_the_function_after_its_parts_were_imported():
    assert bilayer_core.fit is fit and callable(bilayer_core.fit)


def test_a_parameter_that_was_not_fitted_is_told_with_the_nearest_name(found):
    with pytest.raises(UnknownName, match=r"did you mean materials\.gel\.youngs_modulus\?"):
        found["materials.gel.youngs_module"]


@pytest.mark.slow
def test_the_least_of_several_minima_is_found_from_several_starts():
    modulus, swing = "materials.gel.youngs_modulus", load_scene("cantilever", {"duration": 1.0, "solver.dt": 4e-3})
    late = np.arange(0.52, 1.0, 0.04)  # after so many periods that others fit nearly as well
    wanted = swing.materials["gel"].youngs_modulus
    data = data_of(load_scene(swing, {"solver.tolerance": None}), late, ["rod/strip/position[-1].z"])
    near, least = (fit(swing, data, {modulus: (3e5, 5e6, 5e5)}, dt=4e-3, starts=starts) for starts in (1, 5))
    assert near.converged and abs(near.values[modulus] - wanted) > 0.2 * wanted
    assert least.values[modulus] == pytest.approx(wanted, rel=1e-4)
    assert "of 5 starts end there" in least.termination and least.runs > near.runs


@pytest.mark.parametrize("starts", [0, 101, 2.0, True])
def test_a_number_of_starts_that_is_none_is_refused(exact, starts):
    with pytest.raises(InputError, match=r"starts: .* is not allowed; it must be a whole number from 1 to 100"):
        fit(SCENE, exact, PARAMETERS, starts=starts)
