"""Impacts that a barrier can hold, and those that it cannot; rebounds are cases of `bilayer validate`."""

import re

import numpy as np
import pytest
from support.sample_scenes import GROUND, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SimulationError
from bilayer_core.model.findings import told
from bilayer_core.model.impacts import impact_warnings
from bilayer_core.verification.validate.impacts import SPEED, rebound, thrown

METHODS = ["implicit_euler", "sdirk2", "tr_bdf2", "generalised_alpha"]


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_barrier_that_cannot_hold_an_impact_is_named_before_and_after_the_run(dimension):
    simulator = Simulator(load_scene(thrown(1e7, dimension)), tolerance=1e-4)
    (before,) = told(impact_warnings(simulator.model))
    assert "body 'ball' meets a plane at 10 m/s with 6.75 J per metre" in before
    assert "stiffness 4e+08 Pa or barrier_distance 0.6 mm" in before
    try:
        simulator.run(2e-3)
    except SimulationError as stopped:
        after = str(stopped)
    else:
        after = " ".join(simulator.summary()["warnings"])
        assert "did not resolve an impact on the barrier" in after
    assert re.search(r"`contact\.stiffness` (to )?[34]e\+08 Pa", after)


def test_the_stiffness_that_is_named_holds_the_impact():
    assert not list(impact_warnings(Simulator(load_scene(thrown(4e8, 2))).model))
    assert rebound(2, "sdirk2", 1e-4, stiffness=4e8) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("steps", [{"dt": 1e-4}, {"dt": 1e-5}, {"dt": 3e-6}, {"tolerance": 1e-3}, {"tolerance": 1e-5}])
@pytest.mark.parametrize("integrator", METHODS)
def test_no_step_of_any_integrator_returns_more_than_came_where_the_barrier_is_too_weak(integrator, steps):
    simulator = Simulator(load_scene(thrown(1e7, 2)), integrator=integrator, **steps)
    fastest = 0.0
    while simulator.time < 2e-3 - 1e-9:
        height, time = simulator.bodies["ball"].position[2], simulator.time
        try:
            simulator.step(until=2e-3)
        except SimulationError as stopped:
            assert re.search(r"remedy: set `contact\.stiffness` to [34]e\+08 Pa", str(stopped))  # noqa: PT017
            break
        if simulator.time - time > 1e-7:
            fastest = max(fastest, (simulator.bodies["ball"].position[2] - height) / (simulator.time - time))
    assert fastest < 1.001 * SPEED


def test_a_fall_and_a_free_rod_count_too():
    strip = rod([layer()], length=0.05, stations=11, start=(0, 0, 2.0))
    content = scene([strip], gravity=[0, 0, -9.81], obstacles=[GROUND], contact=contact(1e-5))
    (warning,) = told(impact_warnings(Simulator(load_scene(content)).model))
    assert "rod 'rod/only' meets a plane at 6.26 m/s" in warning
    content["contact"]["barrier_distance"] = 1e-3
    assert not list(impact_warnings(Simulator(load_scene(content)).model))


@pytest.mark.parametrize("speed", ["10 m/s", 12.0])
def test_a_barrier_takes_the_stiffness_that_its_impacts_need_and_says_so(speed):
    content = thrown(1e7, 2)
    content["contact"]["impact_speed"] = speed
    simulator = Simulator(load_scene(content), tolerance=1e-4)
    assert not list(impact_warnings(simulator.model))
    assert "not 1e+07 Pa, to hold impacts at `contact.impact_speed`, 1" in simulator.reasons["contact_stiffness"]
    simulator.run(2e-3)
    summary = simulator.summary()
    assert summary["contact_stiffness"] == (6e8 if speed == 12.0 else 4e8)
    assert not summary["warnings"]
    height = simulator.bodies["ball"].position[2]
    simulator.run(1e-4)
    assert (simulator.bodies["ball"].position[2] - height) / 1e-4 == pytest.approx(SPEED, rel=0.02)


def test_a_barrier_that_holds_its_impacts_keeps_its_stiffness():
    content = thrown(1e9, 2)
    content["contact"]["impact_speed"] = 10.0
    simulator = Simulator(load_scene(content))
    assert simulator.model.contact_stiffness == 1e9
    assert "contact_stiffness" not in simulator.reasons


def test_the_barrier_between_rods_has_that_stiffness_too():
    def fallen(**keys):
        strips = [
            rod([layer()], name="lower", length=0.05, stations=11, start=(0, 0, 0.01), clamp_start="base"),
            rod([layer()], name="upper", length=0.05, stations=11, start=(0, 0, 0.015)),
        ]
        base = fixed("base", (0, 0, 0.01))
        content = scene(strips, gravity=[0, 0, -9.81], bodies=[base], contact=contact(1e-3) | {"rods": True} | keys)
        simulator = Simulator(load_scene(content), dimension=3)
        simulator.run(0.04)
        return simulator

    adapted = fallen(stiffness=10.0, impact_speed=1.0)
    assert adapted.model.contact_stiffness > 10.0
    meant = fallen(stiffness=adapted.model.contact_stiffness)
    assert meant.summary()["max_contact_force"] > 0.0
    np.testing.assert_array_equal(adapted.positions, meant.positions)
