"""The bundled flagellum swims as fast as resistive-force theory says, and the way it says."""

from functools import cache

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene

PERIOD, WAVE, STREAM = 0.5, 96e-3, 80e-3
CURVATURE = 1.5 * 0.05 / 2e-3
"""Timoshenko's, of 5 % on 1 + 1 mm [1/m]."""
AT_REST = "fluid.velocity=[0, 0, 0]"
NO_ADDED_MASS = "fluid.added_mass=false"
ROUGH = ("fluid.drag_along=1", "fluid.drag_across=0.05")
SWAPPED = ("stimuli.a.schedule.phase=-120 deg", "stimuli.c.schedule.phase=0 deg")


def resistive_speed(along, across):
    """Speed [m/s] along the wave at which the quadratic drag on an endless ribbon with it has no mean.

    Without inertia, in six steps of phase a wave, as the intervals make it; negative against the wave.
    """
    edges, times = 600, 120
    arc = (np.arange(edges) + 0.5) * WAVE / edges
    phase = np.floor(6.0 * arc / WAVE) * np.pi / 3.0
    clock = np.arange(times) * PERIOD / times
    curvature = CURVATURE * np.sin(2.0 * np.pi * clock[:, None] / PERIOD - phase)
    angle = np.cumsum(curvature, axis=1) * WAVE / edges
    angle -= angle.mean(axis=1, keepdims=True)
    tangent = np.stack([np.cos(angle), np.sin(angle)])
    place = np.cumsum(tangent, axis=2) * WAVE / edges
    place -= place.mean(axis=2, keepdims=True)
    velocity = (np.roll(place, -1, axis=1) - np.roll(place, 1, axis=1)) * times / (2.0 * PERIOD)
    normal = np.stack([-tangent[1], tangent[0]])

    def force(speed):
        seen = velocity + np.array([speed, 0.0])[:, None, None]
        t, n = (seen * tangent).sum(axis=0), (seen * normal).sum(axis=0)
        return -(along * abs(t) * t * tangent[0] + across * abs(n) * n * normal[0]).mean()

    low, high = -WAVE / PERIOD, WAVE / PERIOD
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if force(middle) > 0.0 else (low, middle)
    return 0.5 * (low + high)


@cache
def speeds(*changes, seconds=8.0, **options):
    """Mean speed of the mass centre [m/s] over each of the last two periods."""
    simulator = Simulator(load_scene("flagellum", list(changes)), **options)
    simulator.run(seconds - 2.0 * PERIOD)
    places = [simulator.com[2]]
    for _ in range(2):
        simulator.run(PERIOD)
        places.append(simulator.com[2])
    assert simulator.summary()["converged"] is True
    return np.diff(places) / PERIOD


@pytest.mark.parametrize("change", [(), (NO_ADDED_MASS,)], ids=str)
def test_it_swims_upstream_as_fast_as_resistive_force_theory_says(change):
    """Two waves, not endlessly many, and inertia change its speed by 1 %."""
    expected = -resistive_speed(0.01, 1.0)  # the wave runs down
    assert expected == pytest.approx(123.3e-3, abs=0.1e-3)
    assert speeds(*change) + STREAM == pytest.approx(expected, rel=0.015)


@pytest.mark.parametrize("stream", [(0.0, 0.1), (0.03, -0.15)])
def test_a_stream_carries_it_along_and_changes_nothing_else(stream):
    carried = speeds(f"fluid.velocity=[{stream[0]}, 0, {stream[1]}]", seconds=16.0)[1]
    assert carried - stream[1] == pytest.approx(speeds(AT_REST, seconds=16.0)[1], rel=0.01)


def test_a_ribbon_rougher_along_than_across_swims_with_its_wave():
    expected = -resistive_speed(1.0, 0.05)
    light = "materials.film.density=10 kg/m^3"  # what is heavy turns as it starts, where water hardly holds it
    assert expected == pytest.approx(-21.5e-3, abs=0.1e-3)
    assert speeds(AT_REST, NO_ADDED_MASS, light, *ROUGH, seconds=2.0) == pytest.approx(expected, rel=0.06)


def test_the_wave_the_other_way_swims_the_other_way():
    assert speeds(AT_REST, *SWAPPED)[1] == pytest.approx(-speeds(AT_REST)[1], rel=0.02)


def test_half_the_frequency_gives_half_the_speed():
    slow = [f"stimuli.{channel}.schedule.period=1 s" for channel in "abc"]
    simulator = Simulator(load_scene("flagellum", [AT_REST, NO_ADDED_MASS, *slow]))
    simulator.run(8.0)
    start = simulator.com[2]
    simulator.run(1.0)
    assert 2.0 * (simulator.com[2] - start) == pytest.approx(speeds(AT_REST, NO_ADDED_MASS)[1], rel=0.02)


@pytest.mark.parametrize(
    "method",
    [
        {"model": "two_rod"},
        {"dimension": 3},
        pytest.param({"tolerance": 1e-3}, marks=pytest.mark.verify),
        pytest.param({"tolerance": 1e-5}, marks=pytest.mark.verify),
        pytest.param({"integrator": "tr_bdf2"}, marks=pytest.mark.verify),
        pytest.param({"integrator": "generalised_alpha"}, marks=pytest.mark.verify),
        {"integrator": "implicit_euler", "dt": 2e-3},
    ],
    ids=str,
)
def test_no_model_dimension_tolerance_or_integrator_changes_the_speed(method):
    assert speeds(AT_REST, **method)[1] == pytest.approx(speeds(AT_REST)[1], rel=0.015)
