"""Closed rods: rings without a seam, whatever acts on them and wherever in memory they close."""

import numpy as np
import pytest
from support.evaluations import HESSIAN_LIMIT, Problem, dense
from support.sample_scenes import GEL, ball, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.log.messages.description_text import from_text, to_text
from bilayer_core.log.messages.node_frames import NodeFrames
from bilayer_core.model.laminate import NAME

RADIUS, EDGES = 0.03, 40
LENGTH = 2.0 * np.pi * RADIUS
ONE, TWO = [layer()], [layer("bottom"), layer("top", thickness=0.7e-3, natural_curvature=60.0)]
MODELS = pytest.mark.parametrize("model", ["two_rod", "laminate"])
DIMENSIONS = pytest.mark.parametrize("dimension", [2, 3])
EXACT = {"newton_tolerance": 1e-11}


def ring(layers, start=0, edges=EDGES, **more):
    """A ring in the x-z plane that closes `start` edges further round."""
    angle = 2.0 * np.pi * start / edges
    outward, along = np.array([np.cos(angle), 0, np.sin(angle)]), np.array([-np.sin(angle), 0, np.cos(angle)])
    path = {"shape": "arc", "start": (RADIUS * outward).tolist(), "direction": along.tolist(), "closed": True}
    path |= {"radius": RADIUS, "angle": "360 deg"}
    return rod(layers, stations=edges + 1, width=4e-3, **more) | {"path": path, "normal": (-outward).tolist()}


def place(part, start, edges=EDGES):
    """Length along the ring of the station nearest to a part of the circumference of one that closes elsewhere [m]."""
    return float(round((part * edges - start) % edges) * LENGTH / edges)


def nodes_of(simulator, start=0, edges=EDGES):
    """Positions of nodes in their order from angle 0 on, of each strand, shape (n_strand, edges, 3)."""
    return np.array(
        [
            np.roll(simulator.positions[s.first_node + 1 : s.first_node + edges + 1], start, axis=0)
            for s in simulator.model.strands
            if s.closed
        ]
    )


@MODELS
@DIMENSIONS
@pytest.mark.parametrize("layers", [ONE, TWO[:1] + [layer("top", thickness=0.7e-3)]], ids=["one", "two"])
def test_a_ring_starts_without_stress_and_stays(layers, model, dimension):
    simulator = Simulator(load_scene(scene([ring(layers)])), model=model, dimension=dimension)
    start = simulator.positions.copy()
    assert sum(simulator.energy().values()) < 1e-25
    simulator.run(0.02)
    assert np.abs(simulator.positions - start).max() < 1e-14


LIGHT = {"light": {"minimum": 0, "maximum": 1, "schedule": {"type": "hold", "value": 1.0}}}
LIT = layer("bottom", eigenstrain={"stimulus": "light", "gain": 0.05, "time_constant": 0.01})
BALL = {"name": "ball", "type": "sphere", "position": [0, 0, -RADIUS - 6.6e-3], "radius": 5e-3}
GROUND = {"name": "ground", "type": "plane", "point": [0, 0, -RADIUS - 2.2e-3], "normal": [0.05, 0, 1]}
SURROUNDINGS = {
    "weight, masses and loads": {},
    "eigenstrain": {"stimuli": LIGHT},
    "ground with friction": {"contact": contact(barrier_distance=1e-3, coefficient=0.3), "obstacles": [GROUND]},
    "ball with friction": {"contact": contact(barrier_distance=1e-3, coefficient=0.3), "obstacles": [BALL]},
    "a stream": {"fluid": {"drag_along": 0.1, "drag_across": 2.0, "velocity": [0.1, 0, 0.05], "added_mass": True}},
    "itself": {"contact": contact(barrier_distance=1e-3, coefficient=0.3) | {"rods": True}, "damping": {"mass": 300.0}},
    "viscosity": {"damping": {"mass": 1.0}},
}


def loaded_ring(start, what, model, dimension, **choices):
    """A ring under unlike loads at some places, which closes `start` edges further round."""
    layers = [LIT, TWO[1]] if what == "eigenstrain" else TWO
    loads = [
        {"name": "pull", "rod": "rod", "position": place(0.3, start), "force": [3e-4, 0, -2e-4]},
        {"name": "jet", "rod": "rod", "position": place(0.55, start), "force": [1e-4, 2e-4, 0], "frame": "material"},
    ]
    if what == "itself":
        ends = ((0.25, -1.5), (0.75, 1.5))  # with 2 N it folds out of its plane, and rounding decides which way
        loads = [
            {"name": f"press{k}", "rod": "rod", "position": place(part, start), "force": [0, 0, force]}
            for k, (part, force) in enumerate(ends)
        ]
    cargo = {"name": "cargo", "rod": "rod", "position": place(0.8, start), "mass": 1e-4}
    more = dict(SURROUNDINGS[what])
    if dimension == 3 and what != "itself":
        loads[0]["force"][1] = 1e-4
    content = scene([ring(layers, start)], gravity=[0, 0, -5], loads=loads, masses=[cargo], solver=EXACT, **more)
    if what == "viscosity":
        content["materials"]["gel"] = content["materials"]["gel"] | {"retardation_time": 5e-3}
    return Simulator(load_scene(content), model=model, dimension=dimension, **choices)


@MODELS
@DIMENSIONS
@pytest.mark.parametrize("what", SURROUNDINGS)
def test_where_a_ring_closes_changes_nothing(what, model, dimension):
    ends = []
    for start in (0, 12, 10, 29):  # at 12, or 10, a force acts where it closes
        simulator = loaded_ring(start, what, model, dimension, dt=2e-3)
        simulator.run(0.03 if what == "itself" else 0.08)
        ends.append(nodes_of(simulator, start))
    before = nodes_of(Simulator(load_scene(scene([ring(TWO)])), model=model, dimension=dimension))
    assert np.abs(ends[0] - before).max() > 1e-3
    for end in ends[1:]:
        assert end == pytest.approx(ends[0], abs=1e-12)
    if what == "itself":
        assert simulator.summary()["min_gap"] is not None  # its sides have met


@pytest.mark.parametrize("integrator", ["implicit_euler", "sdirk2", "tr_bdf2", "generalised_alpha"])
def test_where_a_ring_closes_changes_nothing_with_any_integrator_and_adaptive_steps(integrator):
    ends = []
    for start in (0, 7):
        simulator = loaded_ring(start, "eigenstrain", "laminate", 3, tolerance=1e-4, integrator=integrator)
        simulator.run(0.05)
        ends.append(nodes_of(simulator, start))
    assert ends[1] == pytest.approx(ends[0], abs=1e-12)


@DIMENSIONS
def test_where_a_ring_closes_changes_nothing_of_the_momentum_of_a_fluid(dimension):
    """The midpoint rule ends beyond its stage, where nodes take the momentum that is extrapolated."""
    ends = []
    for start in (0, 7):
        simulator = loaded_ring(start, "a stream", "laminate", dimension, dt=1e-3, integrator="implicit_midpoint")
        simulator.run(0.04)
        ends.append(nodes_of(simulator, start))
    assert ends[1] == pytest.approx(ends[0], abs=1e-12)


@MODELS
@DIMENSIONS
def test_a_layer_on_a_part_of_a_ring_may_be_anywhere_on_it(model, dimension):
    ends = []
    for start in (0, 9):
        part = [place(0.4, start), place(0.8, start)]
        varying = {"at": [0.0, LENGTH], "value": [1e-3, 1e-3]}
        layers = [layer("bottom", thickness=varying), layer("top", interval=part, natural_curvature=50.0)]
        pull = {"name": "pull", "rod": "rod", "position": place(0.1, start), "force": [1e-3, 0, 5e-4]}
        content = scene([ring(layers, start)], loads=[pull], solver=EXACT)
        simulator = Simulator(load_scene(content), model=model, dimension=dimension, dt=2e-3)
        simulator.run(0.05)
        ends.append(nodes_of(simulator, start)[0] if model == "laminate" else simulator.com)
        energy = simulator.energy()["bending"]
    assert energy > 0.0
    assert ends[1] == pytest.approx(ends[0], abs=1e-12)


@MODELS
@DIMENSIONS
def test_the_step_of_newton_is_that_of_the_whole_matrix_of_a_ring(model, dimension):
    """P (PᵀKP)⁻¹ Pᵀg, with K that of the strand with ends and P what gives copies the step of what they are of."""
    content = scene([ring(TWO, edges=8)], gravity=[0, 0, -5])
    problem = Problem(content, np.random.default_rng(3), model, dimension, noise=1e-7, origin_noise=1e-9, turns=1e-3)
    gradient, hessian = problem.derivatives()
    twice = np.stack([problem.model.joins.first, problem.model.joins.copy], axis=1)
    size = len(hessian)
    joined = np.eye(size)
    joined[twice[:, 1]] = joined[twice[:, 0]]
    joined = np.delete(joined, twice[:, 1], axis=1)
    assert joined.shape[1] == problem.model.unknowns
    expected = -joined @ np.linalg.solve(joined.T @ hessian @ joined, joined.T @ gradient)
    evaluator = problem.evaluator
    assert evaluator.factorise(problem.at) == (0.0, 0)
    step, _ = evaluator.newton_step(evaluator.sums.gradient.copy(), evaluator.sums.body.copy())
    found = np.linalg.lstsq(problem.basis, step, rcond=None)[0] / problem.scale
    assert found == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    assert dense(problem.evaluator.problem.system.band, 4)[0, 1:].any() is np.False_  # rows of joins are the identity's


def wide_ring_at_a_strip(start=0, edges=24):
    """A wide ring of unlike layers, and beside its foremost station the face of a strip."""
    unlike = [layer("outer"), layer("inner", material="paper")]
    beside = (RADIUS + 2e-3, 0, -0.011)
    strip = rod([layer()], 0.02, 9, beside, "strip", 5e-3, normal=(1, 0, 0), clamp_start="wall")
    strip["path"]["direction"] = [0, 0, 1]
    return scene(
        [ring(unlike, start, edges) | {"width": 6e-3}, strip],
        EXACT,
        bodies=[fixed(position=beside)],
        gravity=[20, 0, 0],
        contact=contact(barrier_distance=2e-3, coefficient=0.3, speed_threshold=10.0) | {"rods": True},
        materials={"gel": GEL, "paper": {**GEL, "youngs_modulus": 2e7}},
    )


@DIMENSIONS
def test_the_step_of_newton_is_right_where_a_wide_ring_closes_at_a_strip(dimension):
    rng = np.random.default_rng(3)
    problem = Problem(
        wide_ring_at_a_strip(), rng, "laminate", dimension, h=1e-5, noise=1e-6, origin_noise=1e-7, turns=1e-4
    )
    evaluator, scale, joins = problem.evaluator, problem.scale, problem.model.joins
    forces = evaluator.evaluate(problem.at, second=True)
    assert forces["rod barrier"] > 0.0 and forces["rod friction"] > 0.0
    assert set(evaluator.problem.rod_contact.contacts.node[:, 1]) >= {0, 23}  # on both sides of where it closes
    joined = np.eye(len(scale))
    joined[joins.copy] = joined[joins.first]
    joined = joined[problem.free][:, np.setdiff1d(problem.free, joins.copy[joins.copy != joins.first])]
    assert evaluator.factorise(problem.at) == (0.0, 0)
    load = np.zeros(len(scale))
    load[problem.free] = rng.standard_normal(len(problem.free)) / scale[problem.free]
    step = problem.basis.T @ np.concatenate(
        [part.ravel() for part in evaluator.newton_step(problem.basis @ load, np.zeros((0, 6)))]
    )
    wanted, errors = joined.T @ (load * scale)[problem.free], []
    for h in (3e-9, 1e-8, 3e-8):
        hessian = problem.differences(h)[1]
        off = joined.T @ (0.5 * (hessian + hessian.T) @ (step / scale)[problem.free]) + wanted
        errors.append(np.abs(off).max())
    assert min(errors) < HESSIAN_LIMIT * np.abs(wanted).max()


@DIMENSIONS
def test_where_a_wide_ring_closes_changes_nothing_of_its_contact(dimension):
    ends = []
    for start in (0, 1, 23, 12):
        simulator = Simulator(load_scene(wide_ring_at_a_strip(start)), dimension=dimension, dt=1e-3)
        simulator.run(0.01)
        ends.append(nodes_of(simulator, start, 24))
    assert simulator.statistics.min_gap < 2e-3  # the barrier distance
    for end in ends[1:]:
        assert end == pytest.approx(ends[0], abs=1e-12)


@MODELS
def test_a_saved_state_of_a_ring_goes_on_bit_for_bit_and_its_copies_stay_alike(model):
    first = loaded_ring(5, "ground with friction", model, 3, tolerance=1e-3)
    first.run(0.05)
    second = loaded_ring(5, "ground with friction", model, 3, tolerance=1e-3)
    second.load_state(first.save_state())
    for simulator in (first, second):
        simulator.run(0.05)
    assert np.array_equal(first.positions, second.positions)
    for node, copy in first.model.joined_node:
        assert np.array_equal(first.positions[node], first.positions[copy])
        assert np.array_equal(first.velocities[node], first.velocities[copy])
    for edge, copy in first.model.joined_edge:
        assert np.array_equal(first.frame().directors[edge], first.frame().directors[copy])


def ring_among_others(start, model, dimension):
    """A ring that falls onto the arm of a free body, over the ground and under a ball, with a strip in its inside."""
    hub = {"name": "hub", "position": [-0.05, 0, -0.0337]}
    hub["motion"] = {"type": "free", "mass": 1e-3, "inertia": [2e-7, 3e-7, 4e-7]}
    arm = rod([layer()], 0.1, 21, (-0.05, 0, -0.0337), "arm", 4e-3, clamp_start="hub")
    inner = rod([layer()], 0.024, 11, (-0.012, 0, -0.0225), "inner", 4e-3)
    content = scene(
        [arm, ring(TWO, start), inner],
        EXACT,
        bodies=[hub, ball((0.02, 0, 0.0565), radius=0.01, mass=2e-3)],
        gravity=[0, 0, -9.81],
        obstacles=[{"name": "ground", "type": "plane", "point": [0, 0, -0.05], "normal": [0, 0, 1]}],
        contact=contact(barrier_distance=1e-3, coefficient=0.3) | {"rods": True},
    )
    return Simulator(load_scene(content), model=model, dimension=dimension, dt=1e-3)


@MODELS
@DIMENSIONS
def test_where_a_ring_closes_changes_nothing_beside_free_bodies_and_other_rods(model, dimension):
    ends = []
    for start in (0, 30, 7):  # at 30 both rods touch it where it closes
        simulator = ring_among_others(start, model, dimension)
        simulator.run(0.06)
        own = [s for s in simulator.model.strands if s.rod == "rod"]
        nodes = [simulator.positions[s.first_node + 1 : s.last_node + 1] for s in own]
        ends.append(
            np.concatenate([*(np.roll(part, start, axis=0) for part in nodes), simulator.frame().body_positions])
        )
        assert simulator.summary()["min_gap"] < 1e-3
        assert simulator.energy()["rod barrier"] > 1e-7
    for end in ends[1:]:
        assert end == pytest.approx(ends[0], abs=1e-12)


@MODELS
@pytest.mark.parametrize("pattern", [{"count": 3}, {"type": "mirror", "axis": [1, 0, 0], "center": [0.5, 0, 0]}])
def test_copies_of_a_ring_are_rings_without_stress(pattern, model):
    bent = [layer("bottom"), layer("top", thickness=0.7e-3)]
    circle = ring(bent, pattern=pattern)
    circle["path"]["start"] = [0.2, 0, 0]
    simulator = Simulator(load_scene(scene([circle])), model=model, dimension=3)
    start = simulator.positions.copy()
    simulator.run(0.01)
    assert sum(simulator.energy().values()) < 1e-22
    assert np.abs(simulator.positions - start).max() < 1e-14


@MODELS
@pytest.mark.parametrize("shape", ["bow", "random"])
def test_an_imperfect_ring_is_closed_and_free_of_stress(shape, model):
    bent = [layer("bottom"), layer("top", thickness=0.7e-3)]
    size = 2e-4
    oval = ring(bent, imperfection={"shape": shape, "size": size, "direction": "both"})
    simulator = Simulator(load_scene(scene([oval])), model=model)
    start = simulator.positions.copy()
    round_one = Simulator(load_scene(scene([ring(bent)])), model=model).positions
    departure = np.linalg.norm(start - round_one, axis=1)
    assert departure.max() == pytest.approx(size, rel=0.05)
    if shape == "bow":  # an oval of two waves, the same at opposite places
        (strand, *_) = simulator.model.strands
        of_round = departure[strand.first_node : strand.last_node]
        assert of_round[: EDGES // 2] == pytest.approx(of_round[EDGES // 2 :], rel=1e-3, abs=1e-9)
    simulator.run(0.01)
    assert sum(simulator.energy().values()) < 1e-20
    assert np.abs(simulator.positions - start).max() < 1e-12


@MODELS
def test_a_ring_that_twists_by_whole_turns_is_as_free_of_stress(model):
    turn = 2.0 * np.pi * np.arange(24)[:, None] / 24
    outward = np.hstack([np.cos(turn), np.sin(turn), 0.0 * turn])
    normals = np.cos(2.0 * turn) * outward - np.sin(2.0 * turn) * [0, 0, 1]
    path = {"shape": "spline", "points": (RADIUS * outward).tolist(), "normals": normals.tolist(), "closed": True}
    wound = rod([layer(thickness=4e-4)], stations=97, width=1e-3) | {"path": path, "normal": [1, 0, 0]}
    simulator = Simulator(load_scene(scene([wound])), model=model)
    start = simulator.positions.copy()
    simulator.run(0.01)
    assert sum(simulator.energy().values()) < 1e-22
    assert np.abs(simulator.positions - start).max() < 1e-13


@MODELS
def test_a_free_ring_keeps_its_momentum_and_its_energy_budget_closes(model):
    wave = {"type": "sine", "mean": 0.5, "amplitude": 0.5, "period": 0.1, "phase": -0.5 * np.pi}
    part = layer("bottom", eigenstrain={"stimulus": "light", "gain": 0.02, "interval": [0.03, 0.12]})
    content = scene([ring([part, TWO[1]])], EXACT, stimuli={"light": {"schedule": wave}})
    lost = []
    for dt in (1e-3, 5e-4):
        simulator = Simulator(load_scene(content), model=model, dimension=3, dt=dt, budget=True)
        simulator.run(0.1)
        assert np.abs(simulator.momentum).max() < 1e-12
        budget = simulator.budget()
        lost.append(budget["lost"]["numerical"] / max(budget["stored"].values()))
    assert abs(lost[1]) < 0.6 * abs(lost[0])  # all that is missing is what implicit Euler loses, of first order


def test_frames_at_the_join_are_those_of_a_node_like_any_other():
    simulator = Simulator(load_scene(scene([ring(TWO)])), model="laminate", dimension=3)
    frame = simulator.frame()
    (strand,) = simulator.description.strands
    assert strand.closed and strand.nodes.stop - strand.nodes.start == EDGES + 1
    assert strand.name.endswith(NAME)
    for of_nodes in (frame.strain[strand.nodes], frame.curvature[strand.nodes], strand.curvature):
        assert of_nodes == pytest.approx(np.full(EDGES + 1, of_nodes[7]), rel=1e-12, abs=1e-13)
    assert np.array_equal(frame.positions[strand.nodes][0], frame.positions[strand.nodes][-1])
    nodes = NodeFrames(simulator.description)
    nodes.update(frame)
    assert nodes.quaternions[-1] == pytest.approx(nodes.quaternions[0], abs=1e-14)
    tangents = np.roll(nodes.positions[:-1], -1, axis=0) - np.roll(nodes.positions[:-1], 1, axis=0)
    assert (nodes.normals[:-1] * tangents).sum(axis=1) == pytest.approx(np.zeros(EDGES), abs=1e-15)
    read = from_text(to_text(simulator.description), simulator.description.scene_text)
    assert read.strands[0].closed and all(layer.closed for layer in read.layers)


@pytest.mark.parametrize(("part", "leaves"), [(0.85, False), (1.25, True)])
def test_a_twisted_ring_leaves_its_plane_above_the_torque_of_michell(part, leaves):
    side = 1e-3
    bending, torsion = 1e8 * side**4 / 12.0, 1e8 / 3.0 * 0.1406 * side**4
    twist = part * np.sqrt(3.0) * bending / (torsion * RADIUS)
    twisted = layer(thickness=side, natural_curvature=0.0, natural_twist=float(twist))
    uneven = {"shape": "bow", "size": 1e-5, "direction": "across"}
    circle = ring([twisted], imperfection=uneven) | {"width": side}
    content = scene([circle], {"integrator": "sdirk2"}, damping={"mass": 2.0})
    simulator = Simulator(load_scene(content), model="laminate", dimension=3, dt=2e-3)
    heights = []
    for _ in range(20):  # it then passes through itself, which nothing forbids here, and unwinds
        simulator.run(0.05)
        heights.append(np.ptp(simulator.positions[:, 1]))
    assert (max(heights) > 0.2 * RADIUS) == leaves
    assert leaves or max(heights) < 10.0 * 2e-5
