"""Inertia of the fluid: derivatives, conservation, and vibrations; more are in `verification.validate.fluid`."""

import math

import numpy as np
import pytest
from support.evaluations import end_of_step, left_of_step, undriven
from support.fluid_energy import energy_of_fluid, momentum_of_fluid, survey_fluid
from support.sample_scenes import GEL, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.engine.evaluator import Evaluator
from bilayer_core.kinematics.rotation import rotation_matrix
from bilayer_core.model.build_model import build_model
from bilayer_core.model.immersed import missing_wake
from bilayer_core.model.records.step import AT_REST, IN_MOTION, LOOKED_AT
from bilayer_core.model.section import rectangle
from bilayer_core.model.state import initial_state

WIDTH, THICKNESS = 0.01, 2e-3
OWN = 1000.0 * WIDTH * THICKNESS  # [kg/m]
ADDED = 0.25 * math.pi * 1000.0 * WIDTH**2
TURNING = math.pi / 128 * 1000.0 * (WIDTH**2 - THICKNESS**2) ** 2
SIDEWAYS = 0.25 * math.pi * 1000.0 * THICKNESS**2
WHOLE, HALVES = [layer(thickness=THICKNESS)], [layer("bottom"), layer("top")]
UNLIKE = [layer("slab"), layer("film", 1e-4) | {"material": "film"}]
TWO = {"gel": GEL, "film": GEL | {"youngs_modulus": 1e10}}


def water(**more):
    """A fluid without drag."""
    return {"drag_along": 0.0, "drag_across": 0.0, "added_mass": True, **more}


STIFF = {"youngs_modulus": 1e10, "poisson_ratio": 0.5, "density": 1000.0}


def thrown(motion, spin, dt, duration, integrator="implicit_euler", material=STIFF, **fluid):
    """A free strip with the velocity of a rigid motion about its middle, before and after `duration`."""
    strip = rod(WHOLE, length=0.05, stations=11)
    content = scene([strip], materials={"gel": material}, fluid=water(**fluid), solver={"newton_tolerance": 1e-9})
    simulator = Simulator(load_scene(content), dt=dt, integrator=integrator)
    state = simulator._state
    state.velocity[:] = np.array(motion) + np.cross(spin, state.position - state.position.mean(axis=0))
    state.spin[:] = spin[0]
    simulator.compile()
    before = momentum(simulator), sum(simulator.energy().values())
    simulator.run(duration)
    return simulator, before


def momentum(simulator):
    """Of rods and fluid together [N s]."""
    model, state = simulator.model, simulator._state
    fluid = momentum_of_fluid(model, simulator._stepper.engine.end, state.velocity)
    return model.rods.node_mass @ state.velocity + (fluid + state.fluid_excess).sum(axis=0)


def random_problem(seed=0):
    """A bent bilayer, its configuration, and random velocities of its nodes and edges."""
    rng = np.random.default_rng(seed)
    content = scene([rod(HALVES, length=0.02, stations=7)], fluid=water(velocity=[0.1, -0.2, 0.05]))
    model = build_model(load_scene(content))
    state = initial_state(model)
    evaluator = Evaluator(model)
    start, bent = evaluator.new(), evaluator.new()
    evaluator.take_state(state, start)
    bent.position[:] = start.position + 4e-4 * rng.standard_normal((model.node_count, 3))
    evaluator.transport_frames(start, 0.3 * rng.standard_normal(model.rods.edge_count), bent)
    return evaluator, bent, rng.standard_normal((model.node_count, 3)), rng.standard_normal(model.rods.edge_count)


def shape_gradient_of(model, at, velocity):
    return survey_fluid(model, at, velocity, np.zeros(model.rods.edge_count))[1].shape_gradient


def test_momentum_and_shape_force_are_derivatives_of_the_fluids_energy():
    evaluator, at, velocity, spin = random_problem()
    model, moved, h = evaluator.model, evaluator.new(), 1e-6
    by_velocity = np.zeros_like(velocity)
    for entry in np.ndindex(velocity.shape):
        unit = np.zeros_like(velocity)
        unit[entry] = h
        energies = [energy_of_fluid(model, at, velocity + sign * unit, spin) for sign in (1, -1)]
        by_velocity[entry] = (energies[0] - energies[1]) / (2 * h)
    found = momentum_of_fluid(model, at, velocity)
    assert found == pytest.approx(by_velocity, abs=1e-7 * np.abs(found).max())

    def displaced(position, angle):
        moved.position[:] = at.position + position
        evaluator.transport_frames(at, angle, moved)
        return energy_of_fluid(model, moved, velocity, spin)

    gradient = shape_gradient_of(model, at, velocity)
    on_nodes, h = np.zeros_like(velocity), 1e-9
    np.add.at(on_nodes, model.rods.edge_node, -gradient[:, :3])
    np.add.at(on_nodes, model.rods.edge_node + 1, gradient[:, :3])
    for entry in np.ndindex(velocity.shape):
        unit = np.zeros_like(velocity)
        unit[entry] = h
        still = np.zeros(model.rods.edge_count)
        difference = (displaced(unit, still) - displaced(-unit, still)) / (2 * h)
        assert difference == pytest.approx(on_nodes[entry], abs=1e-6 * np.abs(on_nodes).max())
    for edge in range(model.rods.edge_count):
        angle = np.zeros(model.rods.edge_count)
        angle[edge] = 1e-6
        difference = (displaced(0.0, angle) - displaced(0.0, -angle)) / 2e-6
        assert difference == pytest.approx(gradient[edge, 3], abs=1e-7 * np.abs(gradient[:, 3]).max())


def test_a_turn_of_body_motion_and_flow_leaves_the_fluids_energy_unchanged():
    evaluator, at, velocity, spin = random_problem()
    model = evaluator.model
    flow = np.array(model.scene.fluid.velocity)
    turn, turned = rotation_matrix(np.array([0.4, -1.1, 2.0])), evaluator.new()
    for name in ("tangent", "director1", "director2"):
        getattr(turned, name)[:] = getattr(at, name) @ turn.T
    turned.length[:] = at.length
    relative = velocity - flow
    energy = energy_of_fluid(model, at, velocity, spin)
    assert energy_of_fluid(model, turned, relative @ turn.T + flow, spin) == pytest.approx(energy, rel=1e-12)
    # the same for a small turn, in the forces: they make no moment
    gradient, moments = shape_gradient_of(model, at, velocity), momentum_of_fluid(model, at, velocity)
    edges = at.length[:, None] * at.tangent
    moment = np.cross(edges, gradient[:, :3]).sum(axis=0) + gradient[:, 3] @ at.tangent
    moment += np.cross(relative, moments).sum(axis=0)
    assert np.abs(moment).max() < 1e-12 * np.abs(relative).max() * np.abs(moments).sum()


def test_multiples_of_the_flat_plates_mass_are_the_scenes():
    content = scene([rod(WHOLE)], fluid=water(added_mass={"through": 0.5, "sideways": 3.0, "turning": 2.0}))
    model = build_model(load_scene(content))
    assert model.fluid.mass.sum(axis=0) == pytest.approx([0.05 * ADDED, 0.3 * SIDEWAYS, 0.2 * TURNING])


@pytest.mark.parametrize("integrator", ["implicit_euler", "sdirk2", "implicit_midpoint"])
def test_momentum_of_rods_and_fluid_together_is_conserved(integrator):
    bending = [layer("bottom"), layer("top", eigenstrain={"stimulus": "heat", "gain": 0.02})]
    content = scene(
        [rod(bending, length=0.06, stations=13)],
        stimuli={"heat": {"schedule": {"type": "sine", "mean": 0.5, "amplitude": 0.5, "period": 0.1}}},
        fluid=water(),
        solver={"newton_tolerance": 1e-10},
    )
    simulator = Simulator(load_scene(content), integrator=integrator)
    simulator._state.velocity[:] = (0.2, 0.05, 0.1)
    simulator.compile()
    start, largest = momentum(simulator), 0.0
    for _ in range(100):
        before = momentum(simulator)
        simulator.step()
        largest = max(largest, np.abs(momentum(simulator) - before).max())
    assert largest < 1e-9 * np.abs(start).max()
    assert np.ptp(simulator.positions[:, 2]) > 5e-3  # it bends


@pytest.mark.parametrize("integrator", ["sdirk2", "implicit_midpoint", "generalised_alpha"])
def test_velocities_at_the_end_of_a_step_agree_with_the_fluids_momentum(integrator):
    """They differed by what a method extrapolates, and the first instant of the step after it changed the energy."""
    bending = [layer("bottom"), layer("top", eigenstrain={"stimulus": "heat", "gain": 0.02})]
    sine = {"type": "sine", "mean": 0.5, "amplitude": 0.5, "period": 0.1}
    content = scene([rod(bending, length=0.06, stations=13)], stimuli={"heat": {"schedule": sine}}, fluid=water())
    before = Simulator(load_scene(content), dt=1e-3, integrator=integrator)
    before._state.velocity[:] = (0.2, 0.05, 0.1)
    before.run(5e-3)
    after = Simulator(load_scene(content), dt=1e-9, integrator=integrator)
    after.load_state(before.save_state())
    after.step()
    assert sum(after.energy().values()) == pytest.approx(sum(before.energy().values()), rel=1e-6)
    assert after.frame().velocities == pytest.approx(before.frame().velocities, abs=1e-3)


def test_a_twisted_strip_swings_back_with_the_fluids_moment_of_inertia():
    """Torsional vibration of a strip clamped at one end: ω = π/2 √(GJ/(I + j))/L."""
    section = rectangle(load_scene(scene([rod(WHOLE)])).materials["gel"], WIDTH, THICKNESS)
    periods = []
    for fluid in (None, water()):
        content = scene([rod(WHOLE, stations=21, clamp_start="wall")], bodies=[fixed()], fluid=fluid)
        simulator = Simulator(load_scene(content), dt=2e-6)
        middles = 0.5 * (simulator.positions[1:, 0] + simulator.positions[:-1, 0])
        simulator._state.spin[:] = 1.0 * np.sin(0.5 * math.pi * middles / 0.1)
        simulator.compile()
        before = 1.0
        while True:
            simulator.step()
            now = simulator._state.spin[-1]
            if now < 0.0:
                break
            before = now
        periods.append(4.0 * (simulator.time - simulator.dt * (0.5 + now / (now - before))))
        inertia = section.spin_inertia + (TURNING if fluid else 0.0)
        expected = 4.0 * 0.1 * math.sqrt(inertia / section.twisting_stiffness)
        assert periods[-1] == pytest.approx(expected, rel=0.01)
    assert periods[1] / periods[0] == pytest.approx(math.sqrt(1.0 + TURNING / section.spin_inertia), rel=0.002)


@pytest.mark.parametrize(
    ("motion", "spin"),
    [((0.2, 0.0, 0.1), (0.0, 8.0, 0.0)), ((0.2, 0.05, 0.1), (3.0, 8.0, 1.0))],
    ids=["in a plane", "in space"],
)
def test_energy_of_a_tumbling_plate_and_its_fluid_is_lost_at_the_integrators_order_only(motion, spin):
    losses = []
    for dt in (5e-4, 2.5e-4, 1.25e-4):
        simulator, (_, energy) = thrown(motion, spin, dt, 0.1)
        losses.append(1.0 - sum(simulator.energy().values()) / energy)
    order = math.log2((losses[0] - losses[1]) / (losses[1] - losses[2]))
    assert order == pytest.approx(1.0, abs=0.15)
    assert 0.0 < losses[2] < 0.02


@pytest.mark.parametrize(
    ("integrator", "order"), [("implicit_euler", 1.0), ("sdirk2", 2.0), ("implicit_midpoint", 2.0)]
)
def test_a_soft_tumbling_strip_converges_at_the_integrators_order(integrator, order):
    soft = {"youngs_modulus": 1e5, "poisson_ratio": 0.5, "density": 1000.0}  # no vibration too fast for the step
    ends = []
    for dt in (1e-3, 5e-4, 2.5e-4, 1.25e-4):
        simulator, _ = thrown((0.2, 0.0, 0.1), (0, 8.0, 0), dt, 0.1, integrator, soft)
        ends.append(simulator.positions[-1])
    differences = np.linalg.norm(np.diff(ends, axis=0), axis=1)
    assert math.log2(differences[1] / differences[2]) == pytest.approx(order, abs=0.3)


def test_a_uniform_flow_acts_as_motion_through_fluid_at_rest():
    still, _ = thrown((0.3, 0.1, 0.2), (0, 4.0, 0), 1e-3, 0.05)
    flow = np.array([-0.2, 0.4, 0.1])
    carried, _ = thrown(np.array([0.3, 0.1, 0.2]) + flow, (0, 4.0, 0), 1e-3, 0.05, velocity=flow.tolist())
    assert carried.velocities - flow == pytest.approx(still.velocities, abs=1e-7)
    assert carried.positions - 0.05 * flow == pytest.approx(still.positions, abs=1e-9)


def test_a_clamped_strip_swings_more_slowly_by_the_root_of_its_whole_mass():
    beta, length = 1.875104, 0.1
    material = {"youngs_modulus": 1e6, "poisson_ratio": 0.5, "density": 1000.0}
    periods = []
    for fluid in (None, water()):
        content = scene(
            [rod(WHOLE, length=length, stations=41, clamp_start="wall")],
            bodies=[fixed()],
            materials={"gel": material},
            fluid=fluid,
            solver={"newton_tolerance": 1e-9},
        )
        simulator = Simulator(load_scene(content), dt=2e-3)
        s = beta * simulator.positions[:, 0] / length
        ratio = (math.sinh(beta) - math.sin(beta)) / (math.cosh(beta) + math.cos(beta))
        simulator._state.velocity[:, 2] = 2e-3 * (np.cosh(s) - np.cos(s) - ratio * (np.sinh(s) - np.sin(s)))
        simulator.compile()
        crossings, before = [], 0.0
        while len(crossings) < 2:
            simulator.step()
            now = simulator.positions[-1, 2]
            if before * now < 0.0:
                crossings.append(simulator.time - simulator.dt * now / (now - before))
            before = now
        periods.append(2.0 * (crossings[1] - crossings[0]))
    own = 2.0 * math.pi / (beta**2 * math.sqrt(1e6 * WIDTH * THICKNESS**3 / 12.0 / (OWN * length**4)))
    assert periods[0] == pytest.approx(own, rel=0.005)
    assert periods[1] / periods[0] == pytest.approx(math.sqrt(1.0 + ADDED / OWN), rel=0.005)


def test_without_added_mass_there_is_nothing_to_compute():
    for fluid in (None, water(added_mass=False)):
        simulator = Simulator(load_scene(scene([rod(WHOLE)], fluid=fluid)))
        assert len(simulator.model.fluid.mass) == 0
        simulator.run(0.002)
        assert "added mass" not in simulator.model.forces
        assert "fluid" not in simulator.energy()
        assert simulator.plan.terms["added mass"].startswith("skipped")
    assert Simulator(load_scene(scene([rod(WHOLE)], fluid=water()))).plan.terms["added mass"] == "active"


def force_of_drag(simulator, state, at):
    """On all nodes [N], with the directions of a configuration and the velocities of a state."""
    evaluator, (rest, load_factor) = Evaluator(simulator.model), undriven(simulator.model)
    present = evaluator.new()
    evaluator.take_state(state, present)
    evaluator.stand_still(state, present, 1.0, rest.edge, rest.joint, load_factor)
    evaluator.update_lagged(at)
    evaluator.forces(present, ("drag",))
    return -evaluator.sums.node.sum(axis=0)


@pytest.mark.parametrize("added", [False, True], ids=["drag alone", "with added mass"])
def test_forces_of_the_fluid_act_along_the_directions_at_the_end_of_the_step(added):
    fluid, dt = {"drag_along": 0.1, "drag_across": 1.0, "added_mass": added}, 1e-3
    description = scene([rod(HALVES, length=0.05, stations=11)], fluid=fluid, solver={"newton_tolerance": 1e-9})
    simulator = Simulator(load_scene(description), dt=dt, integrator="implicit_euler")
    state, middle = simulator._state, simulator.positions.mean(axis=0)
    state.velocity[:] = np.array([0.3, 0.0, 0.2]) + np.cross((0, 60.0, 0), state.position - middle)
    simulator.compile()
    before, held = state.copy(), momentum(simulator)
    simulator.step()  # turns by 3 degrees
    evaluator, start, end = end_of_step(simulator, before)
    lost = momentum(simulator) - held
    along_the_end, along_the_start = (dt * force_of_drag(simulator, state, at) for at in (end, start))
    largest = np.abs(lost).max()
    assert np.abs(lost - along_the_end).max() < 1e-6 * largest
    assert np.abs(lost - along_the_start).max() > 1e-2 * largest
    assert evaluator.speed(*left_of_step(evaluator, end)) < simulator.scene.solver.newton_tolerance
    evaluator.update_lagged(start)
    assert evaluator.speed(*left_of_step(evaluator, end)) > 100.0 * simulator.scene.solver.newton_tolerance


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("looked_at", [AT_REST, LOOKED_AT], ids=["at rest", "in motion"])
@pytest.mark.parametrize("strip", [HALVES, UNLIKE], ids=["alike", "unlike"])
def test_the_stiffness_of_a_flow_is_that_of_its_energy_at_held_velocities(strip, looked_at, dimension):
    """−∂²T/∂q² along directions v, by second differences of T, at random shapes and velocities."""
    rng = np.random.default_rng(3)
    flow = water(velocity=[0.1, 0.0 if dimension == 2 else -0.2, 0.05])
    bent_strip = scene([rod(strip, length=0.02, stations=7)], fluid=flow, materials=TWO)
    model = build_model(load_scene(bent_strip), "laminate", dimension)
    evaluator, state = Evaluator(model), initial_state(model)
    start, at, moved = (evaluator.new() for _ in range(3))
    evaluator.take_state(state, start)
    in_plane = np.array([1.0, dimension == 3, 1.0])

    def motion():
        return rng.standard_normal((model.node_count, 3)) * in_plane

    def turn():
        return rng.standard_normal(model.rods.edge_count) * (dimension == 3)

    at.position[:] = start.position + 4e-4 * motion()
    evaluator.transport_frames(start, 0.3 * turn(), at)
    if looked_at == LOOKED_AT:
        state.velocity[:] = motion() * 0.3
    kept = rng.standard_normal((model.kept_directors, 3)) * in_plane * (looked_at == LOOKED_AT)
    state.strain_rate[:] = kept.ravel()
    rest, load_factor = undriven(model)
    matrices = []
    for still in (IN_MOTION, looked_at):
        evaluator.stand_still(state, at, 1.0, rest.edge, rest.joint, load_factor)
        evaluator.stage.still[0] = still
        evaluator.start_stage(at)
        evaluator.evaluate(at, ("added mass",), second=True)
        band = evaluator.assemble(at)[0].copy()
        size = model.solved_layout.size
        lower = sum(np.diag(band[: size - r, r], -r) for r in range(min(band.shape[1], size)))
        matrices.append(lower + np.tril(lower, -1).T)
    found = matrices[1] - (matrices[0] if looked_at == LOOKED_AT else 0.0)
    no_spin = np.zeros(model.rods.edge_count)

    def energy(position, angle):
        moved.position[:] = at.position + position
        evaluator.transport_frames(at, angle, moved)
        return energy_of_fluid(model, moved, state.velocity, no_spin, kept)

    for _ in range(3):
        shift, angle, h = 1e-3 * motion(), turn(), 1e-4
        unknowns = np.zeros(size)
        unknowns[model.solved_layout.node[:, None] + np.arange(dimension)] = shift @ model.rods.axes.T
        if dimension == 3:
            unknowns[model.rods.edge_unknown] = angle
        second = energy(h * shift, h * angle) - 2.0 * energy(0.0, no_spin) + energy(-h * shift, -h * angle)
        assert unknowns @ found @ unknowns == pytest.approx(-second / h**2, rel=1e-5)


def test_only_a_flow_about_added_mass_lacks_a_wake():
    for fluid, told in (
        (None, False),
        (water(), False),
        (water(velocity=[0.1, 0, 0], added_mass=False), False),
        (water(velocity=[0.1, 0, 0]), True),
    ):
        assert any("wake" in line for line in missing_wake(load_scene(scene([rod(WHOLE)], fluid=fluid)).fluid)) == told
