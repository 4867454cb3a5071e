"""Gains of eigenstrains as profiles along a rod."""

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SceneError
from bilayer_core.simulation.at_rest import equilibrium_of

GAIN = "rods.strip.layers.active.eigenstrain.gain"
HANGING = {"gravity": [0, 0, -9.81]}
KINDS = {
    "laminate": {},
    "two rods": {"solver.model": "two_rod"},
    "strip": {"rods.strip.section": "strip"},
    "in space": {"solver.dimension": 3},
}


def hanging(gain, kind="laminate", **overrides):
    simulator = Simulator(load_scene("bending", HANGING | KINDS[kind] | overrides | {GAIN: gain}))
    simulator.set_stimulus("swelling", 0.5)
    return simulator


def at_rest(*args, **overrides):
    simulator = hanging(*args, **overrides)
    simulator.solve_static()
    return simulator


def sloping(points, ends=(0.0, 0.01)):
    return {"at": np.linspace(0, 0.1, points).tolist(), "value": np.linspace(*ends, points).tolist()}


@pytest.mark.parametrize("kind", KINDS)
def test_a_profile_that_is_the_same_everywhere_is_a_number(kind):
    even = {"at": [0.0, 0.031, 0.0777], "value": [0.01, 0.01, 0.01]}
    assert np.abs(at_rest(0.01, kind).positions - at_rest(even, kind).positions).max() < 1e-12


@pytest.mark.parametrize("kind", KINDS)
def test_points_on_a_straight_profile_change_nothing(kind):
    few, many = (at_rest(sloping(points), kind).positions for points in (2, 24))
    assert np.abs(few - many).max() < 1e-11
    assert np.abs(few - at_rest(0.01, kind).positions).max() > 1e-3


def test_a_linear_profile_bends_a_free_strip_to_a_linear_curvature():
    scene = load_scene("bending", {GAIN: sloping(2), "rods.strip.stations": 101})
    simulator = Simulator(scene)
    simulator.set_stimulus("swelling", 1.0)
    simulator.solve_static()
    strip = simulator.rods["strip"]
    expected = -1.5 * np.interp(strip.arc_length, [0, 0.1], [0, 0.01]) / 2e-3  # Timoshenko, equal layers
    assert np.abs(strip.curvature - expected)[1:-1].max() < 0.01 * np.abs(expected).max()


def test_a_profile_follows_a_lag_as_a_number_does():
    lag = {"rods.strip.layers.active.eigenstrain.time_constant": 0.5}
    even = {"at": [0.0, 0.1], "value": [0.01, 0.01]}
    one, other = (hanging(gain, **lag) for gain in (0.01, even))
    for simulator in (one, other):
        simulator.run(0.2)
    assert np.abs(one.positions - other.positions).max() < 1e-9


@pytest.mark.parametrize(
    ("profile", "fault"),
    [
        ({"at": [0, 0.2], "value": [0, 0]}, r"gain.at\[1\]: found 0.2; must be a length .* from 0 to 0.1"),
        ({"at": [0, 0.1], "value": [0]}, "must be as many as `at`, 2"),
        ({"at": [0, 0.1], "value": [0, -2]}, "must leave the layer a length"),
    ],
)
def test_a_profile_of_gains_that_cannot_be_is_refused(profile, fault):
    with pytest.raises(SceneError, match=fault):
        load_scene("bending", {GAIN: profile})


def test_a_profile_of_gains_takes_no_saturation():
    limited = {GAIN: sloping(2), "rods.strip.layers.active.eigenstrain.saturation": 0.1}
    with pytest.raises(SceneError, match="saturation: found 0.1; must be left out where `gain` is a profile"):
        load_scene("bending", limited)


def test_a_pattern_multiplies_a_profile_of_gains():
    pattern = {"type": "translation", "step": [0, 0.05, 0], "count": 2, "gains": [1, 0.5]}
    simulator = at_rest(sloping(3), **{"rods.strip.pattern": pattern})
    turned = [simulator.rods[name].curvature[20] for name in ("strip_0", "strip_1")]
    alone = [at_rest(sloping(3, (0.0, end))).rods["strip"].curvature[20] for end in (0.01, 0.005)]
    assert turned == pytest.approx(alone, rel=1e-6)


def test_copies_follow_the_gain_of_their_rod_by_their_factors():
    pattern = {"type": "translation", "step": [0, 0.05, 0], "count": 2, "gains": [1, -0.5]}
    copies = {"rods.strip.pattern": pattern, "rods.strip.section": "beam"}
    here = equilibrium_of(at_rest(0.01, **copies))
    here.go_to(here.parameters([GAIN])[GAIN], [0.02])
    assert np.abs(here.positions - at_rest(0.02, **copies).positions).max() < 1e-10


@pytest.mark.parametrize("path", ["rods.strip.layers.active.thickness", f"{GAIN}.value.1", "swelling"])
def test_an_equilibrium_at_other_gains_moves_as_one_that_was_built_with_them(path):
    gains, found = {**sloping(5), "value": [0.03, -0.02, 0.01, 0.0, 0.02]}, []
    for begin in (sloping(5), gains):
        here, name = equilibrium_of(at_rest(begin, **{"rods.strip.section": "beam"})), f"{GAIN}.value"
        here.go_to(here.parameters([name])[name], gains["value"])
        assert here.scene.rods[0].layers[1].eigenstrain[0].gain.value == gains["value"]
        found.append([here.velocities(here.parameters([path])[path])[0], here.respond(*here.parameters([path])[path])])
    (other, response), (own, again) = found
    assert other == pytest.approx(own, rel=1e-6, abs=1e-6 * np.abs(own).max())
    assert np.abs((response.motion + again.motion * -1.0).unknowns).max() < 1e-6 * np.abs(again.motion.unknowns).max()
