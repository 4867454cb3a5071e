"""Looks out of the plane of a run: what they find, what is no buckling, and that they change nothing."""

import math

import numpy as np
import pytest
from support.planar_scenes import snap
from support.sample_scenes import GEL, GROUND, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.model.plan import MODELS
from bilayer_core.simulation.linearised import Linearised
from bilayer_core.simulation.plane_watch import FIRST_LOOK, MOST_STEPS, turning_rate
from bilayer_core.verification.validate.plane import blade

STIFF = contact(1e-4, 0.3) | {"stiffness": 1e9}
"""Else the ends of what jumps come down faster than the barrier can hold."""


def warnings_of(simulator):
    """Those that name the remedy."""
    return [warning for warning in simulator.summary()["warnings"] if "--dimension 3" in warning]


def released(strain, **solver):
    """A bilayer on the ground whose upper layer grows at once; it jumps."""
    growing = layer("top", eigenstrain={"stimulus": "heat", "gain": strain})
    strip = rod([layer(), growing], length=0.05, start=(0, 0, 1.2e-3))
    held = {"heat": {"schedule": {"type": "hold", "value": 1.0}}}
    content = scene([strip], gravity=[0, 0, -9.81], obstacles=[GROUND], stimuli=held, contact=STIFF)
    return load_scene({**content, "solver": solver, "duration": 0.02})


def growth_in_space(config, time):
    """What nanometres out of the plane have become by a time [s], as multiples of themselves."""
    space = Simulator(config, dimension=3)
    shift = 1e-9 * np.random.default_rng(2).standard_normal(space.model.node_count - 1)
    space._state.position[1:, 1] += shift
    space.run(time)
    away = space.positions[: space.model.node_count, 1]
    return np.abs(away - away.mean()).max() / np.abs(shift).max()


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("part", "leaves"), [(0.9, False), (1.5, True)])
def test_a_run_tells_that_a_blade_would_have_turned_over(model, part, leaves):
    content = blade(part) | {"duration": 2.0}
    simulator = Simulator(load_scene(content), model=model)
    simulator.run()
    told = warnings_of(simulator)
    assert bool(told) == leaves
    assert (growth_in_space(load_scene(content), 1.5) > 100.0) == leaves
    if leaves:
        assert "leaves the plane y = 0 would have grown a hundredfold" in told[0] and "from the start" in told[0]
        simulator.reset()
        assert not warnings_of(simulator)


def test_a_warning_comes_at_the_time_at_which_a_disturbance_has_grown_in_space():
    content = load_scene(blade(1.5) | {"duration": 2.0})
    simulator = Simulator(content)
    simulator.run()
    since = simulator.plane_watch.since
    assert growth_in_space(content, 0.5 * since) < 100.0 < growth_in_space(content, 1.5 * since)


def test_a_crawler_that_stays_in_its_plane_does_not_warn():
    simulator = Simulator(load_scene("crawling_inchworm"))
    simulator.run()
    assert simulator.plane_watch.started and not warnings_of(simulator)


def test_a_robot_that_swings_in_flight_is_not_taken_for_one_that_buckles():
    content = load_scene({**snap(), "duration": 0.2, "solver": {"tolerance": 1e-6}})
    simulator = Simulator(content)
    simulator.run()
    assert simulator.statistics.steps > MOST_STEPS
    assert not warnings_of(simulator) and growth_in_space(content, 0.2) < 100.0


def test_a_release_that_does_buckle_is_told():
    content = released(0.22)
    simulator = Simulator(content)
    simulator.run(0.0028)
    assert warnings_of(simulator) and growth_in_space(content, 0.0028) > 100.0


def test_looks_change_nothing():
    seen, alone = (Simulator(released(0.3)) for _ in range(2))
    alone.plane_watch = None
    for simulator in (seen, alone):
        simulator.run(0.004)
    assert seen.statistics.steps > MOST_STEPS and seen.plane_watch.started
    np.testing.assert_array_equal(seen.save_state(), alone.save_state())
    assert seen.energy() == alone.energy()
    np.testing.assert_array_equal(seen.contact_forces, alone.contact_forces)


def test_looks_do_not_depend_on_how_a_run_is_made():
    together, apart = (Simulator(load_scene(blade(1.5) | {"duration": 2.0})) for _ in range(2))
    together.run(2.0)
    while apart.time < 2.0:
        apart.step(until=2.0)
    assert apart.plane_watch.since == together.plane_watch.since is not None


def test_short_runs_are_looked_at_too():
    simulator = Simulator(load_scene(blade(1.5)))
    for _ in range(FIRST_LOOK):
        assert not simulator.plane_watch.started
        simulator.step()
    assert simulator.plane_watch.started


def test_nobody_looks_out_of_space():
    assert Simulator(load_scene(blade(1.5)), dimension=3).plane_watch is None


def test_a_compressed_strip_that_flies_apart_seems_to_turn():
    """Its ends push with EA ε at L/2 from the middle, and m L²/12 is its moment of inertia."""
    length, strain, stations = 0.1, 1e-3, 41
    strip = rod([layer(thickness=2e-3)], length=length, stations=stations)
    simulator = Simulator(load_scene(scene([strip])), dimension=2)
    state = simulator._state
    state.position[:, 0] *= 1.0 - strain
    stiffness, density = 1e8, 1000.0
    expected = math.sqrt(12.0 * stiffness * strain / (density * length**2))
    stepper = simulator._in_dimension(2)
    stepper.evaluate(state)
    assert turning_rate(stepper, state) == pytest.approx(expected, rel=5e-3)


ARM = rod(
    [layer(thickness=2e-3)], length=0.05, stations=11, start=(0.05, 0, 0), clamp_start="hub", pattern={"count": 2}
)
HUB = {"name": "hub", "position": [0, 0, 0], "motion": {"type": "free", "mass": 1e-3, "inertia": [1e-6, 1e-4, 1e-4]}}
SLAB = rod(
    [layer("slab", thickness=4e-3), layer("film", thickness=1e-4) | {"material": "film"}], length=0.1, stations=21
)
FILM = {"gel": GEL, "film": GEL | {"youngs_modulus": 1e10, "density": 8000.0}}
AROUND = {"drag_along": 0.0, "drag_across": 0.0, "added_mass": True}


@pytest.mark.parametrize(
    ("robot", "model"),
    [
        pytest.param(scene([ARM], bodies=[HUB]), "laminate", id="arms of a wide and heavy hub"),
        pytest.param(scene([SLAB], materials=FILM), "laminate", id="unlike layers"),
        pytest.param(scene([SLAB], materials=FILM), "two_rod", id="unlike layers, each a strand"),
        pytest.param(scene([SLAB], materials=FILM, fluid=AROUND), "laminate", id="in a fluid"),
    ],
)
def test_the_rate_at_which_turning_seems_to_grow_is_that_of_the_matrices_in_space(robot, model):
    """−δᵀK δ/δᵀM δ of turns δ about the mass centre, of a robot that is shorter than it wants to be."""
    simulator = Simulator(load_scene(robot), dimension=2, model=model)
    state, stepper, space = simulator._state, simulator._in_dimension(2), simulator._in_dimension(3).model
    gap = 0.05 if space.free_bodies.mass.size else 0.0
    along = state.position[:, 0]
    along[:] = np.sign(along) * (gap + (np.abs(along) - gap) * (1.0 - 1e-3))
    told = turning_rate(stepper, state)
    matrices = Linearised(space, state, np.zeros(0))
    motions = matrices.chosen.T @ np.stack(list(rigid_motions(space, matrices.at)), axis=1)
    stiffness, mass = (motions.T @ of @ motions for of in (matrices.stiffness, matrices.mass))
    about_centre = mass[:2, :2] - np.outer(mass[:2, 2], mass[2, :2]) / mass[2, 2]
    rates = np.linalg.eigvals(np.linalg.solve(about_centre, -stiffness[:2, :2])).real
    assert told == pytest.approx(np.sqrt(rates.max()), rel=1e-8)


def rigid_motions(model, at):
    """Turns about x and z, and the shift along y, as motions of unknowns and bodies."""
    size, first = model.layout.size, model.layout.node[:, None] + np.arange(3)
    for turn, shift in ([1, 0, 0], [0, 0, 0]), ([0, 0, 1], [0, 0, 0]), ([0, 0, 0], [0, 1, 0]):
        motion = np.zeros(size)
        motion[first] = np.cross(turn, at.position) + shift
        motion[model.layout.attached[:, None] + np.arange(3)] = 0.0
        motion[model.rods.edge_unknown] = at.tangent[: model.rods.edge_count] @ turn
        bodies = [np.concatenate([np.cross(turn, place) + shift, turn]) for place in at.body_position]
        yield np.concatenate([motion, *bodies])


@pytest.mark.parametrize(("part", "leaves"), [(0.9, False), (1.5, True)])
def test_a_run_tells_that_a_flow_along_a_blade_would_turn_it_sideways(part, leaves):
    """M U² = π² EI/4 L² across the blade, which is thicker than wide: M = ρ π h²/4."""
    width, height, length, modulus = 1e-3, 1e-2, 0.1, 1e6
    compression = 0.25 * np.pi**2 * modulus * height * width**3 / 12.0 / length**2
    speed = np.sqrt(part * compression / (0.25 * np.pi * 1000.0 * height**2))
    blade = rod([layer(thickness=height)], length=length, stations=21, width=width, clamp_start="wall")
    content = scene(
        [blade],
        bodies=[fixed("wall")],
        materials={"gel": GEL | {"youngs_modulus": modulus}},
        fluid=AROUND | {"velocity": [speed, 0, 0]},
        duration=20.0,
    )
    simulator = Simulator(load_scene(content), dimension=2)
    simulator.run()
    assert bool(warnings_of(simulator)) == leaves
    assert (growth_in_space(load_scene(content), 20.0) > 100.0) == leaves
