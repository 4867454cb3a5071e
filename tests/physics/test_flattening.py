"""Strips whose section bends: derivatives, the table of wide strips, and their energy account."""

import math

import numpy as np
import pytest
from support.evaluations import Problem, check
from support.sample_scenes import GEL, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SceneError
from bilayer_core.forces.flattening import SERIES, flatness

TABLE = {
    0.3: {0.5: 0.997, 1.0: 0.989, 2.6: 0.941, 3.0: 0.927, 4.3: 0.888, 6.0: 0.863, 10.0: 0.974, 20.0: 1.141}
    | {100.0: 1.237},
    0.5: {0.5: 0.998, 1.0: 0.992, 2.0: 0.971, 2.6: 0.956, 3.0: 0.946, 4.3: 0.918, 5.0: 0.911, 6.0: 0.919}
    | {10.0: 1.156, 20.0: 1.326, 36.0: 1.38, 100.0: 1.432},
}
"""κ/κ₀ of layers that swell alike in all directions, by ν and w²κ₀/H."""
WIDTH, THICKNESS = 20e-3, 0.2e-3


def free_curvature(ratio, poisson, swelling="isotropic"):
    """κ/κ₀ of a clamped strip of two like layers at rest, by its w²κ₀/H."""
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
                stimuli={"heat": {"schedule": {"type": "hold", "value": 1}}},
            )
        ),
        model="laminate",
    )
    simulator.solve_static()
    return float(np.mean(simulator.curvatures)) / curvature


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
def test_free_strips_of_every_width_curl_as_plates_do(poisson):
    for ratio, wanted in TABLE[poisson].items():
        assert free_curvature(ratio, poisson) == pytest.approx(wanted, rel=2e-3), ratio


@pytest.mark.parametrize(("swelling", "wanted"), [("along", 1.0), ("across", 0.0)])
def test_fibres_leave_the_curvature_along_at_that_of_a_narrow_strip(swelling, wanted):
    assert free_curvature(6.0, 0.3, swelling) == pytest.approx(wanted, abs=1e-9)


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
