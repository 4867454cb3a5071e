"""Strips whose section bends: derivatives, the table of wide strips, and their energy account."""

import math

import numpy as np
import pytest
from support.evaluations import Problem, check
from support.sample_scenes import GEL, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SceneError, SimulationError
from bilayer_core.forces.flattening import SERIES, flatness
from bilayer_core.simulation.strip_sections import folded

TABLE = {
    0.3: {0.5: 0.997, 1.0: 0.989, 2.6: 0.941, 3.0: 0.927, 4.3: 0.888, 6.0: 0.863, 10.0: 0.974, 20.0: 1.141}
    | {100.0: 1.237},
    0.5: {0.5: 0.998, 1.0: 0.992, 2.0: 0.971, 2.6: 0.956, 3.0: 0.946, 4.3: 0.918, 5.0: 0.911, 6.0: 0.919}
    | {10.0: 1.156, 20.0: 1.326, 36.0: 1.38, 100.0: 1.432},
}
"""κ/κ₀ of layers that swell alike in all directions, by ν and w²κ₀/H."""
WIDTH, THICKNESS = 20e-3, 0.2e-3


def swollen(ratio, poisson, swelling="isotropic", dimension=3, values=(1.0,)):
    """A clamped strip of two like layers, by its w²κ₀/H, at rest after each value of its stimulus: the last report, and
    κ/κ₀.
    """
    curvature = ratio * THICKNESS / WIDTH**2
    law = {"stimulus": "heat", "gain": curvature * THICKNESS / 1.5}
    half = {"thickness": 0.5 * THICKNESS}
    layers = [layer("bottom", eigenstrain=law, swelling=swelling, **half), layer("top", **half)]
    strip = rod(layers, length=0.2, stations=11, width=WIDTH, clamp_start="wall") | {"section": "strip"}
    simulator = Simulator(
        load_scene(
            scene(
                [strip],
                bodies=[fixed()],
                materials={"gel": {**GEL, "poisson_ratio": poisson}},
                stimuli={"heat": {"schedule": {"type": "hold", "value": 0}}},
            )
        ),
        model="laminate",
        dimension=dimension,
    )
    for value in values:
        simulator.set_stimulus("heat", value)
        report = simulator.solve_static()
    return report, simulator.curvatures / curvature


HUMID = {"stimulus": "humidity", "gain": 0.02}


def wide(swelling="isotropic", stations=7, poisson=0.4, width=4e-3, **more):
    """A clamped bilayer strip of two moduli, 0.5 mm thick, whose layers both swell."""
    layers = [
        layer("bottom", thickness=0.2e-3, material="base", swelling=swelling, eigenstrain={**HUMID, "gain": -0.01}),
        layer("top", thickness=0.3e-3, eigenstrain=HUMID),
    ]
    strip = rod(layers, length=1.1e-3 * (stations - 1), stations=stations, width=width, clamp_start="wall")
    gel = {**GEL, "poisson_ratio": poisson, "retardation_time": 1e-3}
    return scene(
        [strip | {"section": "strip"} | more],
        bodies=[fixed()],
        stimuli={"humidity": {"schedule": {"type": "hold", "value": 0.5}}},
        materials={"gel": gel, "base": {**gel, "youngs_modulus": 3.0 * gel["youngs_modulus"]}},
    )


@pytest.mark.parametrize("swelling", ["isotropic", "along", "across"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_derivatives_of_flattening_agree_with_differences(swelling, dimension):
    problem = Problem(wide(swelling), np.random.default_rng(1), "laminate", dimension=dimension)
    check(problem, ("flattening",))
    assert problem.terms["flattening"] > 0.0
    check(problem)


def test_flatness_and_its_derivatives_are_smooth_where_its_series_ends():
    for z in (1.0, SERIES, 30.0, 1e4):
        psi = z**0.25
        g = 2.0 * (math.cosh(psi) - math.cos(psi)) / (psi * (math.sinh(psi) + math.sin(psi)))
        assert flatness(z)[0] == pytest.approx((1.0 - g) / z, rel=1e-12)
        h = 1e-3 * z
        near, low, high = (np.array(flatness(z + step)) for step in (0.0, -h, h))
        assert near[1:] == pytest.approx((high - low)[:2] / (2.0 * h), rel=1e-5)
    series, closed = flatness(np.nextafter(SERIES, 0.0)), flatness(SERIES)
    assert series == pytest.approx(closed, rel=1e-10)
    assert np.isfinite(flatness(1e30)).all()


@pytest.mark.parametrize("poisson", [0.3, 0.5])
def test_strips_of_every_width_that_were_held_flat_curl_as_plates_do(poisson):
    for ratio, wanted in TABLE[poisson].items():
        report, curvature = swollen(ratio, poisson)
        assert curvature == pytest.approx(np.full(11, wanted), rel=2e-3), ratio
        assert (report.stable, dict(report.strips)) == (True, {"rod": "curled along"})


@pytest.mark.parametrize("poisson", [0.3, 0.5])
def test_strips_in_a_plane_curl_as_plates_do_while_their_stimulus_grows(poisson):
    for ratio, wanted in TABLE[poisson].items():
        _, curvature = swollen(ratio, poisson, dimension=2, values=np.geomspace(0.05, 1.0, 20))
        assert curvature == pytest.approx(np.full(11, wanted), rel=2e-3), ratio


def test_a_strip_held_flat_in_a_plane_rolls_up_across_where_only_twist_leads_on():
    report, curvature = swollen(36.0, 0.5, dimension=2)
    assert np.abs(curvature).max() < 0.03
    assert dict(report.strips) == {"rod": "rolled across"}
    assert report.out_of_plane == report.unstable_directions > 0


def test_a_strip_that_folds_at_rest_is_refused_since_the_mesh_would_say_where():
    with pytest.raises(SimulationError, match=r"rods\.rod folds: .* raise its stimulus in steps"):
        swollen(100.0, 0.5, dimension=2, values=(0.1, 0.2, 0.3))


def test_a_run_warns_of_a_strip_of_which_a_part_curls_along_and_a_part_across():
    curvature = 36.0 * THICKNESS / WIDTH**2
    law = {"stimulus": "heat", "gain": curvature * THICKNESS / 1.5}
    half = {"thickness": 0.5 * THICKNESS}
    layers = [layer("bottom", eigenstrain=law, **half), layer("top", **half)]
    heat = {"heat": {"schedule": {"type": "hold", "value": 1}}}
    strip = rod(layers, length=0.2, stations=21, width=WIDTH) | {"section": "strip"}
    simulator = Simulator(load_scene(scene([strip], stimuli=heat)), model="laminate")
    assert list(folded(simulator.model, simulator._state)) == []  # flat: all of it rolls up across
    angle = np.repeat([0.0, 1.3 * curvature * 0.01], 10) * np.arange(20)
    turned = np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=1)
    simulator._state.position[1:] = simulator._state.position[0] + np.cumsum(0.01 * turned, axis=0)
    simulator._state.director1[:] = turned[:, [2, 1, 0]] * [-1.0, 0.0, 1.0]
    (warning,) = folded(simulator.model, simulator._state)
    assert "rods.rod has folded" in warning
    assert warning in simulator.summary()["warnings"]


@pytest.mark.parametrize(("swelling", "wanted"), [("along", 1.0), ("across", 0.0)])
def test_fibres_leave_the_curvature_along_at_that_of_a_narrow_strip(swelling, wanted):
    assert swollen(6.0, 0.3, swelling)[1] == pytest.approx(np.full(11, wanted), abs=1e-9)


def test_layers_that_swell_across_make_a_strip_no_longer():
    content = wide("across")
    content["stimuli"]["humidity"]["schedule"]["value"] = 1.0
    content["rods"][0]["layers"][0]["swelling"] = content["rods"][0]["layers"][1]["swelling"] = "across"
    simulator = Simulator(load_scene(content), model="laminate")
    simulator.solve_static()
    assert simulator.positions[-1, :2] == pytest.approx([6.6e-3, 0.0], abs=1e-12)
    across = simulator.rods["rod"].section_curvature
    assert (across < -1.0).all() and across == pytest.approx(np.full(7, across[3]))


@pytest.mark.parametrize("swelling", ["isotropic", "across"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_the_work_of_a_stimulus_on_a_strip_is_what_it_gains(swelling, dimension):
    content = wide(swelling, stations=15) | {"gravity": [0.0, 0.0, -9.81]}
    ramp = {"type": "ramp", "start": 0.005, "end": 0.015, "from": 0.4, "to": 1.0}
    content["stimuli"]["humidity"]["schedule"] = ramp
    content["solver"] = {"integrator": "sdirk2", "dt": 2e-5, "newton_tolerance": 1e-10}
    simulator = Simulator(load_scene(content), model="laminate", dimension=dimension, budget=True)
    simulator.run(0.02)
    simulator.set_stimulus("humidity", 0.2)  # a jump
    simulator.run(0.01)
    assert abs(simulator.summary()["numerical_energy"]) < 1e-3 * simulator.summary()["largest_energy"]


def test_two_rods_refuse_strips_and_so_do_unlike_ratios():
    with pytest.raises(SceneError, match="no part across the width"):
        Simulator(load_scene(wide()), model="two_rod")
    content = wide()
    content["materials"]["base"]["poisson_ratio"] = 0.2
    with pytest.raises(SceneError, match="one poisson_ratio, has 0.2 and 0.4"):
        Simulator(load_scene(content), model="laminate")
