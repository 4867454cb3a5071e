"""Stability under forces without a potential, by the modes that grow; cases with a known load are validated."""

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from support.sample_scenes import GEL, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.model.section import sections
from bilayer_core.model.state import initial_state
from bilayer_core.simulation.growing_modes import growing_modes
from bilayer_core.simulation.linearised import Linearised
from bilayer_core.verification.validate.stability import BECK, column

SLOW = 1e-3
"""Of a load: beside a critical one."""


@pytest.mark.parametrize("dimension", [2, 3])
def test_becks_column_is_stable_below_its_load_and_flutters_above(dimension):
    below, above = (
        Simulator(load_scene(column(load, dimension=dimension))).solve_static() for load in (0.99 * BECK, 1.01 * BECK)
    )
    assert below.stable and below.unstable_directions == 0 and below.growth_rate == 0.0
    assert not above.stable and above.growth_rate > 0.0 and above.growth_frequency > 0.0
    assert above.unstable_directions == 2 and above.out_of_plane == 0


def test_a_column_that_flutters_does_so_in_a_run_at_the_rate_and_the_frequency_told():
    simulator = Simulator(load_scene(column(25.0)), integrator="sdirk2", dt=2e-4)
    report = simulator.solve_static()
    simulator._state.velocity[:, 2] = 1e-9 * np.linspace(0.0, 1.0, simulator.model.node_count) ** 2
    period = 1.0 / report.growth_frequency
    times, tip = [], []
    simulator.run(6.0 * period, each_step=lambda t: (times.append(t), tip.append(simulator.positions[-1, 2])))
    even = np.linspace(3.0 * period, 6.0 * period, 600)
    grown = np.interp(even, times, tip) * np.exp(-report.growth_rate * even)
    swing = [np.abs(part).max() for part in np.split(grown, 3)]
    assert swing == pytest.approx([swing[0]] * 3, rel=0.05)
    turns = np.flatnonzero(np.diff(np.sign(grown)))
    assert np.diff(even[turns]).mean() == pytest.approx(0.5 * period, rel=0.02)


def test_damping_in_a_material_brings_flutter_forward():
    """Ziegler's paradox: with viscosity the least load is 10.9 to 20.05 EI/L², 10.94 for a little of it."""
    little = {"retardation_time": 1e-3}
    assert Simulator(load_scene(column(10.0, 21, **little))).solve_static().stable
    assert not Simulator(load_scene(column(14.0, 21, **little))).solve_static().stable
    assert Simulator(load_scene(column(14.0, 21))).solve_static().stable


def test_the_modes_of_a_dead_load_are_those_that_pivots_count():
    """Of Euler's column beyond its first and before its second load: one mode that diverges."""
    for load, count in ((2.4, 0), (2.6, 1), (22.0, 1), (22.5, 2)):
        content = column(load)
        content["loads"][0] |= {"frame": "world"}
        space, plane = (Simulator(load_scene(content), dimension=dimension) for dimension in (3, 2))
        space.solve_static()
        found, in_plane = (
            growing_modes(space.model, space._state, np.ones(1), within) for within in (None, plane.model)
        )
        assert found.count == in_plane.count == count
        assert found.frequency == 0.0


@pytest.mark.parametrize("stations", [21, 41])
def test_the_roll_of_a_rod_at_a_body_without_mass_counts_once(stations):
    """A strip clamped at one end, its other end on a hinge about its axis, of no mass: ω = π/2L √(GJ/ρI)."""
    strip = rod([layer()], length=0.1, stations=stations, clamp_start="wall", clamp_end="hub")
    hub = {"name": "hub", "position": [0.1, 0, 0], "motion": {"type": "guided", "hinge": [1, 0, 0]}}
    scene_ = load_scene(scene([strip], bodies=[fixed("wall"), hub]))
    model = Simulator(scene_, dimension=3).model
    matrices = Linearised(model, initial_state(model), np.zeros(0))
    section = sections(scene_.rods[0], scene_.rods[0].layers[0], scene_.materials["gel"], np.array([0.0]))
    expected = 0.5 * np.pi / 0.1 * np.sqrt(section.twisting_stiffness[0] / section.spin_inertia[0])
    squares = np.linalg.eigvals(np.linalg.solve(matrices.mass.toarray(), matrices.stiffness.toarray()))
    found = np.sqrt(np.abs(squares.real))
    nearest = found[np.abs(found - expected).argmin()]
    assert nearest == pytest.approx(expected, rel=0.3 / (stations - 1) ** 2 + 1e-9)
    assert model.rods.spin_inertia.sum() + np.trace(model.free_bodies.second_moment[0]) == pytest.approx(
        section.spin_inertia[0] * 0.1, rel=0.03
    )


def test_a_strip_in_a_cross_flow_rests_where_a_run_ends_with_and_without_added_mass():
    for added in (False, True):
        speed = 0.3 if added else 0.5
        water = {"drag_along": 0.05, "drag_across": 2.0, "velocity": [0, 0, speed], "added_mass": added}
        soft = {"gel": {**GEL, "youngs_modulus": 1e6}}
        strip = rod([layer()], length=0.1, stations=21, clamp_start="wall")
        content = load_scene(scene([strip], bodies=[fixed("wall")], materials=soft, fluid=water))
        rest, run = (Simulator(content, dimension=2) for _ in range(2))
        report = rest.solve_static()
        run.run(6.0 if added else 3.0)
        assert np.abs(run.velocities).max() < 1e-9
        assert np.abs(rest.positions - run.positions).max() < 1e-9
        assert report.unstable_directions == report.out_of_plane  # small turns about its axis, which nothing damps
        assert report.stable == (not added)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_cantilever_along_a_flow_about_added_mass_diverges_as_under_a_dead_load(dimension):
    """M U² = π² EI/4 L² (`forces.added_mass`)."""
    width, length, modulus, height = 0.01, 0.1, 1e6, 1e-3
    compression = 0.25 * np.pi**2 * modulus * width * height**3 / 12.0 / length**2
    for share, stable in ((0.99, True), (1.01, False)):
        speed = np.sqrt(share * compression / (0.25 * np.pi * 1000.0 * width**2))
        water = {"drag_along": 0.0, "drag_across": 0.0, "velocity": [speed, 0, 0], "added_mass": True}
        soft = {"gel": {**GEL, "youngs_modulus": modulus}}
        strip = rod([layer()], length=length, stations=41, clamp_start="wall")
        content = scene([strip], bodies=[fixed("wall")], materials=soft, fluid=water, solver={"dimension": dimension})
        assert Simulator(load_scene(content)).solve_static().stable == stable


def test_a_cantilever_aslant_in_a_flow_about_added_mass_rests_on_the_elastica():
    """EI θ″ + M U² sin(θ − α) cos(θ − α) = 0, θ(0) = θ′(L) = 0, of an axis without length changes."""
    width, length, modulus, height, speed, slant = 0.01, 0.1, 1e6, 1e-3, 0.04, 0.5
    factor = 0.25 * np.pi * 1000.0 * (width * speed) ** 2 / (modulus * width * height**3 / 12.0)
    solved = solve_bvp(
        lambda s, y: np.vstack([y[1], -factor * np.sin(y[0] - slant) * np.cos(y[0] - slant)]),
        lambda start, end: np.array([start[0], end[1]]),
        np.linspace(0.0, length, 400),
        np.zeros((2, 400)),
        tol=1e-9,
        max_nodes=100_000,
    )
    assert solved.status == 0
    along = np.linspace(0.0, length, 20_001)
    expected = np.trapezoid(np.sin(solved.sol(along)[0]), along)
    errors = []
    for stations in (21, 41):
        flow = [speed * np.cos(slant), 0, speed * np.sin(slant)]
        water = {"drag_along": 0.0, "drag_across": 0.0, "velocity": flow, "added_mass": True}
        strip = rod([layer()], length=length, stations=stations, clamp_start="wall")
        soft = {"gel": {**GEL, "youngs_modulus": modulus}}
        simulator = Simulator(load_scene(scene([strip], bodies=[fixed("wall")], materials=soft, fluid=water)))
        assert simulator.solve_static().stable
        errors.append(abs(simulator.positions[-1, 2] / expected - 1.0))
    assert errors[1] < 3e-4
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.5)


WATER = {"drag_along": 0.0, "drag_across": 0.0, "added_mass": True}


def in_a_flow(velocity, stations=41, **water):
    """A soft cantilever along x in a flow, about added mass."""
    strip = rod([layer()], length=0.1, stations=stations, clamp_start="wall")
    soft = {"gel": {**GEL, "youngs_modulus": 1e6}}
    return scene([strip], bodies=[fixed("wall")], materials=soft, fluid=WATER | {"velocity": velocity} | water)


def test_a_cantilever_along_a_flow_vibrates_as_by_galerkins_method():
    """T = ½ ∫ m ẇ² + M (ẇ + U w′)², V = ½ ∫ EI w″², without a wake, by polynomials s² … s⁹."""
    length, bending, own, added = 0.1, 1e6 * 0.01 * 1e-9 / 12.0, 0.01, 0.25 * np.pi * 1000.0 * 0.01**2
    speed = np.sqrt(0.7 * 0.25 * np.pi**2 * bending / length**2 / added)
    shapes = [np.polynomial.Polynomial([0.0] * k + [1.0]) for k in range(2, 10)]
    points, weights = np.polynomial.legendre.leggauss(20)
    points, weights = 0.5 * (points + 1.0), 0.5 * weights * length
    value, slope, curvature = (
        np.array([shape.deriv(n)(points) if n else shape(points) for shape in shapes]) / length**n for n in range(3)
    )
    mass = (own + added) * (value * weights) @ value.T
    swirl = added * speed * (value * weights) @ slope.T
    stiffness = bending * (curvature * weights) @ curvature.T - added * speed**2 * (slope * weights) @ slope.T

    def frequencies(mass, damping, stiffness):
        nothing, unit = np.zeros_like(mass), np.eye(len(mass))
        first = np.linalg.solve(mass, np.hstack([-stiffness, -damping]))
        found = np.linalg.eigvals(np.vstack([np.hstack([nothing, unit]), first]))
        assert np.abs(found.real).max() < 1e-6 * np.abs(found).max()
        return np.sort(found.imag[found.imag > 0.0])[:3]

    expected = frequencies(mass, swirl - swirl.T, stiffness)
    errors = []
    for stations in (41, 81):
        simulator = Simulator(load_scene(in_a_flow([speed, 0, 0], stations)), dimension=2)
        space = simulator._in_dimension(3).model
        linear = Linearised(space, simulator._state, np.zeros(0), simulator.model)
        matrices = [of.toarray() for of in (linear.mass, linear.damping, linear.stiffness)]
        errors.append(np.abs(frequencies(*matrices) / expected - 1.0).max())
    assert errors[1] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.5)
    matrices[1] *= 0.0
    assert np.abs(frequencies(*matrices) / expected - 1.0).max() > 0.05


def test_the_gyroscopic_matrix_of_a_flow_is_antisymmetric():
    simulator = Simulator(load_scene(in_a_flow([0.05, 0.02, 0.1], 11, drag_across=2.0)), dimension=3)
    simulator.run(0.05)
    simulator._state.velocity[:], simulator._state.spin[:] = 0.0, 0.0
    matrices, without = (Linearised(simulator.model, simulator._state, np.zeros(0)) for _ in range(2))
    without._wet = []
    swirl = (matrices.damping - without.damping).toarray()
    assert np.abs(swirl + swirl.T).max() < 1e-6 * np.abs(swirl).max()


def test_turns_of_a_strip_across_a_flow_about_added_mass_grow_in_a_run_as_its_modes_do():
    content = load_scene(in_a_flow([0, 0, 0.1], 21, drag_along=0.05, drag_across=2.0))
    simulator = Simulator(content, dimension=3, integrator="sdirk2", dt=1e-4)
    report = simulator.solve_static()
    assert report.growth_frequency > 5.0
    simulator._state.spin[:] = 1e-4 * np.linspace(0.0, 1.0, simulator.model.rods.edge_count)
    times, tip = [], []
    simulator.run(1.5, each_step=lambda t: (times.append(t), tip.append(simulator.positions[-1, 1])))
    times, tip = np.array(times), np.array(tip)
    first, last = (np.abs(tip[(times > t) & (times < t + 0.4)]).max() for t in (0.6, 1.1))
    assert np.log(last / first) / 0.5 == pytest.approx(report.growth_rate, rel=0.1)
    late = times > 0.6
    crossings = times[late][np.flatnonzero(np.diff(np.sign(tip[late])))]
    assert 0.5 / np.diff(crossings).mean() == pytest.approx(report.growth_frequency, rel=0.01)
