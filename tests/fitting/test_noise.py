"""Numerical noise of runs, and steps of differences: known noise is found, steps follow from it, a naive step fails."""

import numpy as np
import pytest
from support.rough_runs import FormulaRuns, deterministic_noise

from bilayer_core import Simulator, fit, load_scene
from bilayer_core.studies.fitting import fit as whole
from bilayer_core.studies.fitting.data import read_data
from bilayer_core.studies.fitting.differences import jacobian
from bilayer_core.studies.fitting.noise import LARGEST_STEP, Step, choose_steps, shares
from bilayer_core.studies.fitting.parameters import read_parameters
from bilayer_core.studies.fitting.runs import Runs, known_quantities

TIMES = np.linspace(0.1, 1.0, 40)
NAIVE = 1.5e-8
"""Square root of the rounding of numbers, which programs take by default."""


def waves(point):
    """Smooth, with the third derivatives of sines."""
    return np.sin(6.0 * point[0] * TIMES) + point[1:].sum()


def slope_of_waves(point):
    return 6.0 * TIMES * np.cos(6.0 * point[0] * TIMES)


def steps_of(runs, start):
    return choose_steps(runs, np.array(start), np.ones((TIMES.size, 1)))


@pytest.mark.parametrize("size", [1e-9, 1e-7, 1e-5, 1e-3])
def test_noise_of_known_size_is_found_within_a_third(size):
    runs = FormulaRuns(lambda point: waves(point) + deterministic_noise(point, size, TIMES.size))
    (step,) = steps_of(runs, [0.4])
    assert step.noise == pytest.approx(size, rel=1 / 3)


def test_noise_on_a_constant_is_found_and_the_step_is_the_longest():
    runs = FormulaRuns(lambda point: deterministic_noise(point, 1e-4, TIMES.size))
    (step,) = steps_of(runs, [0.4])
    assert step.noise == pytest.approx(1e-4, rel=1 / 3) and step.step > LARGEST_STEP / 2.0


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3])
def test_the_error_of_a_derivative_is_no_larger_than_told(size):
    runs = FormulaRuns(lambda point: waves(point) + deterministic_noise(point, size, TIMES.size))
    start = np.array([0.4])
    (step,) = steps_of(runs, start)
    error = jacobian(runs, start, [step])[:, 0, 0] - slope_of_waves(start)
    assert np.linalg.norm(error) <= 2.0 * shares([step], TIMES.size)[0]
    best = min(
        np.linalg.norm(jacobian(runs, start, [Step(h, size, 0.0)])[:, 0, 0] - slope_of_waves(start))
        for h in np.geomspace(1e-7, 0.1, 40)
    )
    assert np.linalg.norm(error) <= max(10.0 * best, 1e-6)


def test_a_staircase_that_is_smooth_nearby_has_the_noise_of_its_jumps():
    def stairs(point):
        return waves(point) + 1e-4 * np.sin(1e3 * np.floor(point[0] / 3e-4) * TIMES)  # flat over 3e-4

    runs = FormulaRuns(stairs)
    start = np.array([0.40005])
    (step,) = steps_of(runs, start)
    assert 3e-5 < step.noise < 3e-4
    error = np.abs(jacobian(runs, start, [step])[:, 0, 0] - slope_of_waves(start)).max()
    assert error < 0.05


def test_tables_stay_within_the_bounds_where_the_start_is_at_one():
    runs = FormulaRuns(waves)
    for start in ([0.0, 1.0], [1.0, 0.001]):
        steps = steps_of(runs, start)
        jacobian(runs, np.array(start), steps)
    points = np.array(runs.points)
    assert points.min() >= 0.0 and points.max() <= 1.0


@pytest.mark.parametrize("start", [0.0, 0.02, 0.98, 1.0])
def test_a_difference_next_to_a_bound_is_of_second_order(start):
    runs, point = FormulaRuns(waves), np.array([start])
    coarse, fine = (
        np.abs(jacobian(runs, point, [Step(h, 0.0, 0.0)])[:, 0, 0] - slope_of_waves(point)).max() for h in (0.08, 0.04)
    )
    assert 2.8 < coarse / fine < 5.6


def test_where_a_run_to_one_side_stops_the_derivative_is_of_the_other_side():
    runs, point = FormulaRuns(waves, stops=lambda at: at[0] > 0.5), np.array([0.5])
    found = jacobian(runs, point, [Step(1e-3, 0.0, 0.0)])[:, 0, 0]
    assert np.abs(found - slope_of_waves(point)).max() < 1e-3


def test_where_runs_to_both_sides_stop_the_error_has_the_values():
    runs = FormulaRuns(waves, stops=lambda at: at[0] != 0.5)
    with pytest.raises(Exception, match=r"too steep at \[0.50"):
        jacobian(runs, np.array([0.5]), [Step(1e-3, 0.0, 0.0)])


# a strip that hits the ground: steps end where contact begins, and each value of the modulus has others

STRIP = {
    "schema": 1,
    "name": "slap",
    "title": "A clamped strip falls onto the ground",
    "duration": "0.2 s",
    "gravity": [0, 0, "-9.81 m/s^2"],
    "materials": {"gel": {"youngs_modulus": "1 MPa", "poisson_ratio": 0.5, "density": "1000 kg/m^3"}},
    "rods": [
        {
            "name": "strip",
            "width": "10 mm",
            "path": {"shape": "straight", "start": [0, 0, 0], "direction": [1, 0, 0], "length": "100 mm"},
            "normal": [0, 0, 1],
            "stations": 21,
            "clamp_start": "wall",
            "layers": [{"name": "gel", "material": "gel", "thickness": "2 mm"}],
        }
    ],
    "bodies": [{"name": "wall", "position": [0, 0, 0], "motion": {"type": "prescribed"}}],
    "obstacles": [{"name": "ground", "type": "plane", "point": [0, 0, "-40 mm"], "normal": [0, 0, 1]}],
    "contact": {
        "stiffness": "1 MPa",
        "barrier_distance": "1 mm",
        "friction": {"coefficient": 0.3, "speed_threshold": "0.1 mm/s"},
    },
    "damping": {"mass": "20 1/s"},
}
MODULUS = "materials.gel.youngs_modulus"
TIP = "rod/strip/gel/position[-1].z"
MOMENTS = np.array([0.06, 0.08, 0.1, 0.12, 0.14, 0.16, 0.2])
BOUNDS = ("0.5 MPa", "2 MPa")


@pytest.fixture(scope="module")
def slap():
    """The scene, its parameter, its data without noise, and runs of it."""
    scene = load_scene(STRIP)
    known, nodes = known_quantities(Simulator(scene))
    exact = Runs(scene, [], read_data({"time": MOMENTS, TIP: 0.0 * MOMENTS}, known, nodes, 1.0)).evaluate(np.array([]))
    columns = {"time": MOMENTS, TIP: exact[:, 0]}
    parameters = read_parameters(scene, {MODULUS: BOUNDS})
    return parameters, columns, Runs(scene, parameters, read_data(columns, known, nodes, 1.0))


@pytest.mark.verify
def test_a_step_from_measured_noise_has_the_slope_of_impacts_and_a_naive_one_not(slap):
    """At most of several moduli: seven values tell a noise to a factor of two or so, and the best step with it."""
    (parameter,), _, runs = slap
    offsets, measured, naive = np.linspace(-0.03, 0.03, 21), [], []
    for modulus in np.linspace(0.9e6, 1.1e6, 7):
        here = np.array([parameter.part(modulus)])
        near = np.array([runs.evaluate(here + offset)[:, 0] for offset in offsets])
        trend = np.polynomial.polynomial.polyfit(offsets, near, 3)[1]  # over so many runs that jumps hardly matter
        steps = choose_steps(runs, here, np.ones((MOMENTS.size, 1)))
        for found, by in ((measured, steps), (naive, [Step(NAIVE, 0.0, 0.0)])):
            found.append(np.abs(jacobian(runs, here, by)[:, 0, 0] - trend).max() / np.abs(trend).max())
    assert np.median(measured) < 0.2
    assert np.median(naive) > 10.0


def test_a_fit_with_naive_steps_misses_the_truth_and_measured_steps_find_it(slap, monkeypatch):
    _, columns, _ = slap
    asked = {MODULUS: (*BOUNDS, "0.8 MPa")}
    found = fit(STRIP, columns, asked)
    assert found[MODULUS].value == pytest.approx(1e6, rel=2e-3) and found.converged
    monkeypatch.setattr(whole, "choose_steps", lambda *_: [Step(NAIVE, 0.0, 0.0)])
    naive = fit(STRIP, columns, asked)
    assert abs(naive[MODULUS].value - 1e6) > 0.05e6
