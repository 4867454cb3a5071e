"""Friction under normal forces that change: orders of integrators, what is counted, and very rough ground."""

import numpy as np
import pytest
from support.sample_scenes import GROUND, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.verification.validate.friction import FAR, GRAVITY, MASS, SECOND_ORDER, SIZE, at_rest, block

PERIOD, COEFFICIENT, SPEED = 0.1, 0.3, 5.0


def speed_after(time, solver):
    """Speed of a block that slides while a force presses on it in turns [m/s], and its simulator."""
    press = {"type": "sine", "mean": 0, "amplitude": 1, "period": PERIOD}
    content = scene(
        [rod([layer()], length=0.02, stations=3, start=FAR, clamp_start="wall")],
        gravity=[0, 0, -GRAVITY],
        obstacles=[GROUND],
        # stiff: the block itself hardly moves up and down
        contact=contact(1e-5, COEFFICIENT) | {"stiffness": 1e11},
        bodies=[fixed(position=FAR), block((0, 0, SIZE[2]), SPEED)],
        loads=[{"name": "press", "body": "block", "force": [0, 0, -0.8 * MASS * GRAVITY], "schedule": press}],
    )
    content["solver"] = solver
    simulator = at_rest(content)
    simulator.run(time)
    return simulator.frame().body_velocities[1, 0], simulator


def exact(time):
    phase = 2.0 * np.pi / PERIOD
    return SPEED - COEFFICIENT * GRAVITY * (time + 0.8 * (1.0 - np.cos(phase * time)) / phase)


DAMPED = [name for name in SECOND_ORDER if name != "implicit_midpoint"]
"""Those that bring a stiff surface to rest: the midpoint rule rings on it for ever, and its normal force with it."""


@pytest.mark.parametrize("integrator", DAMPED)
def test_integrators_keep_their_order_under_a_normal_force_that_changes(integrator):
    time = 0.64  # no whole number of periods
    errors = [speed_after(time, {"integrator": integrator, "dt": dt})[0] - exact(time) for dt in (8e-3, 4e-3, 2e-3)]
    coarse, fine = np.abs(errors[:-1]) / np.abs(errors[1:])
    assert 3.0 < coarse < 5.5 and 3.0 < fine < 5.5
    assert abs(errors[-1]) < 1e-3


def test_what_friction_is_frozen_anew_for_is_counted():
    _, simulator = speed_after(0.1, {"integrator": "sdirk2", "dt": 1e-3})
    summary = simulator.summary()
    assert 2 * summary["steps"] <= summary["friction_updates"] <= 6 * summary["steps"]
    content = scene([rod([layer()], clamp_start="wall")], bodies=[fixed()], gravity=[0, 0, -GRAVITY])
    content["solver"] = {"integrator": "sdirk2", "dt": 1e-3}
    free = Simulator(load_scene(content))
    free.run(0.01)
    assert free.summary()["friction_updates"] == 0


@pytest.mark.parametrize("threshold", ["0.1 mm/s", "0.001 mm/s"])
@pytest.mark.parametrize("solver", [[], ["solver.integrator=sdirk2", "solver.dt=2 ms"]], ids=["default", "fixed"])
def test_ground_so_rough_that_feet_jam_stops_no_run(solver, threshold):
    # within the cone of friction what a foot presses with depends on what holds it by a factor above one
    rough = [f"contact.friction.{key}=5" for key in ("coefficient", "forward", "backward", "sideways")]
    changes = [*rough, f"contact.friction.speed_threshold={threshold}", *solver]
    simulator = Simulator(load_scene("crawling_inchworm", changes))
    simulator.run(2.4)
    summary = simulator.summary()
    assert summary["converged"] is True and summary["friction_updates"] > 2 * summary["steps"]
    assert simulator.frame().min_gap > 0.0
