"""Sections, natural shapes and moduli that vary along the path."""

from operator import attrgetter

import numpy as np
import pytest
from scipy.integrate import quad
from support.sample_scenes import GEL, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.model.build_model import build_model
from bilayer_core.model.validity import validity_warnings
from bilayer_core.verification.validate.profiles import LENGTH, between, linear


def test_a_bilayer_of_varying_thickness_starts_without_stress_and_stays():
    layers = [layer("bottom", thickness=linear(1e-3, 2e-3)), layer("top", thickness=linear(2e-3, 0.5e-3))]
    strip = rod(layers, length=LENGTH, clamp_start="wall", clamp_end="other", width=linear(10e-3, 5e-3))
    walls = [fixed(), fixed("other", (LENGTH, 0, 0))]
    simulator = Simulator(load_scene(scene([strip], bodies=walls)))
    start = simulator.positions.copy()
    assert start[:21, 2] == pytest.approx(-0.5 * np.linspace(1e-3, 2e-3, 21))
    assert start[21:, 2] == pytest.approx(0.5 * np.linspace(2e-3, 0.5e-3, 21))
    assert simulator.energy()["bending"] < 1e-20
    simulator.run(0.02)
    assert np.abs(simulator.positions - start).max() < 1e-12


def test_the_mass_is_the_integral_of_the_section():
    width = {"at": [0.02, 0.05, 0.08], "value": [4e-3, 10e-3, 6e-3]}
    thickness = linear(1e-3, 3e-3)
    model = build_model(load_scene(scene([rod([layer(thickness=thickness)], length=LENGTH, width=width)])))

    def section(s):
        return np.interp(s, width["at"], width["value"]) * between(1e-3, 3e-3, s)

    mass = 1000.0 * quad(section, 0, LENGTH, points=width["at"])[0]
    center = 1000.0 * quad(lambda s: s * section(s), 0, LENGTH, points=width["at"])[0] / mass
    assert model.rods.node_mass.sum() == pytest.approx(mass, rel=1e-3)
    assert model.rods.node_mass @ model.start_position[:, 0] / model.rods.node_mass.sum() == pytest.approx(
        center, rel=1e-3
    )
    flat = build_model(load_scene(scene([rod([layer()], length=LENGTH, width=width)])))
    exact = 1000.0 * 1e-3 * (0.02 * 4e-3 + 0.03 * 7e-3 + 0.03 * 8e-3 + 0.02 * 6e-3)
    assert flat.rods.node_mass.sum() == pytest.approx(exact, rel=1e-12)


def test_a_tapered_strip_sinks_as_fast_as_a_uniform_one_and_does_not_turn():
    sinking = scene(
        [rod([layer(thickness=2e-3)], length=LENGTH, width=linear(12e-3, 4e-3))],
        gravity=[0, 0, 5.0],
        fluid={"density": 800.0, "drag_along": 0.4, "drag_across": 1.2},
    )
    simulator = Simulator(load_scene(sinking), dt=5e-3)
    simulator.run(2.0)
    speed = np.sqrt(5.0 * 1000.0 * 2e-3 / (0.5 * 800.0 * 1.2))
    assert simulator.velocities[:, 2] == pytest.approx(np.full(21, speed), rel=1e-2)


def test_the_fluid_that_goes_along_is_the_integral_of_the_width_squared():
    fluid = {"density": 800.0, "drag_along": 0.0, "drag_across": 0.0, "added_mass": {}}
    layers = [layer("bottom"), layer("top", thickness=linear(1e-3, 2e-3))]
    model = build_model(load_scene(scene([rod(layers, length=LENGTH, width=linear(12e-3, 4e-3))], fluid=fluid)))
    expected = 0.25 * np.pi * 800.0 * quad(lambda s: between(12e-3, 4e-3, s) ** 2, 0, LENGTH)[0]
    assert model.fluid.mass[:, 0].sum() == pytest.approx(expected, rel=1e-3)


def test_a_constant_profile_is_the_number_and_stiffness_multiplies_the_moduli():
    constant = {"at": [0.03], "value": [10e-3]}
    strip = rod([layer("bottom"), layer("top", stiffness=3.0, natural_curvature=4.0)], length=LENGTH)
    same = rod(
        [
            layer("bottom", thickness={"at": [0], "value": [1e-3]}),
            layer("top", natural_curvature=linear(4.0, 4.0), material="stiff"),
        ],
        length=LENGTH,
        width=constant,
    )
    materials = {"gel": GEL, "stiff": {**GEL, "youngs_modulus": 3e8}}
    one, other = (build_model(load_scene(scene([r], materials=materials))) for r in (strip, same))
    of_rods = [f"rods.{name}" for name in ("axial_stiffness", "joint_stiffness", "node_mass", "spin_inertia")]
    for name in (*of_rods, "drives.joint_rest", "bonds.stiffness"):
        own = attrgetter(name)
        assert own(one) == pytest.approx(own(other), rel=1e-14, abs=1e-18), name


def test_the_section_is_drawn_and_touches_as_it_is():
    strip = rod([layer(thickness=linear(1e-3, 3e-3))], length=LENGTH, width=linear(10e-3, 2e-3))
    simulator = Simulator(load_scene(scene([strip])))
    (drawn,) = simulator.description.strands
    assert drawn.width == pytest.approx(np.linspace(10e-3, 2e-3, 21))
    assert drawn.thickness == pytest.approx(np.linspace(1e-3, 3e-3, 21))
    points, nodes = simulator.model.surfaces, simulator.model.node_count
    assert points.radius[:nodes] == pytest.approx(0.5 * drawn.thickness)
    border = 0.5 * (drawn.width - drawn.thickness)
    wide = border > 1e-12
    assert 10 < wide.sum() < 21
    assert np.unique(points.rod_points.node).tolist() == np.flatnonzero(wide).tolist()
    assert np.abs(points.rod_points.arm[:, 1]) == pytest.approx(np.repeat(border[wide], 2))
    assert points.radius[nodes:] == pytest.approx(np.repeat(0.5 * drawn.thickness[wide], 2))
    weight = points.weight[:nodes] + np.bincount(points.rod_points.node, points.weight[nodes:], nodes)
    assert weight == pytest.approx(simulator.model.node_length)


def test_the_warnings_are_about_the_worst_section():
    heat = {"heat": {"schedule": {"type": "hold", "value": 1}}}
    layers = [layer("bottom"), layer("top", eigenstrain={"stimulus": "heat", "gain": 0.05})]

    def warned(**more):
        strip = rod(layers, length=LENGTH, section="auto", **more)
        return " ".join(map(str, validity_warnings(load_scene(scene([strip], stimuli=heat)), "two_rod")))

    assert "would curl 7.7 % less than computed (w²κ/H 4)" in warned(width=linear(1e-3, 15e-3))
    assert warned(width=linear(1e-3, 10e-3)) == ""
    assert "a plate more than a rod" in warned(width={"at": [0.05, 0.06], "value": [1e-3, 30e-3]})
