"""Masses, loads and fluids off the curve of a laminate: derivatives, momentum, order, energy."""

import numpy as np
import pytest
from support.budgets import EXACT
from support.evaluations import Problem, check
from support.planar_scenes import AHEAD, everything_in_plane
from support.planar_scenes import HUBS as PLANAR_HUBS
from support.sample_scenes import GEL, everything, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.model.build_model import build_model
from bilayer_core.model.state import turn_directors
from bilayer_core.verification.validate.unlike import frequency_with_mass

FORCES = ("inertia", "damping", "gravity", "loads", "followers", "drag", "added mass")
HUBS = {
    "prescribed hub": {"type": "prescribed"},
    "free hub": {"type": "free", "mass": 1e-3, "inertia": [2e-8, 3e-8, 4e-8]},
}


def unlike(content):
    """A scene with rods whose second layer is of another material and three times as thick."""
    content["materials"]["stiff"] = {**GEL, "youngs_modulus": 5e6, "density": 2500, "retardation_time": 1e-3}
    for own in content["rods"]:
        if len(own["layers"]) == 2:
            own["layers"][1] |= {"material": "stiff", "thickness": 3 * own["layers"][0]["thickness"]}
    return content


def problem_in_space(hub):
    content = unlike(everything())
    content["bodies"][0]["motion"] = HUBS[hub]
    content["contact"]["rods"] = False  # borders of arms meet beside the hub; `test_rails` has the derivatives of that
    content["bodies"][1]["position"] = (0.0, 0.0, 0.0204)  # clear of the thicker arms also where the start is uneven
    return Problem(content, np.random.default_rng(1), "laminate")


def problem_in_plane(hub, ahead):
    return Problem(unlike(everything_in_plane(AHEAD[ahead], hub)), np.random.default_rng(1), "laminate", dimension=2)


@pytest.mark.parametrize("hub", HUBS)
def test_derivatives_in_space_agree_with_differences(hub):
    problem = problem_in_space(hub)
    raised = problem.model.raised
    assert (raised.first_moment != 0.0).any() and (raised.middle != 0.0).any()
    assert len(problem.model.loads.lever) and len(problem.model.followers.lever)
    for forces in (*((name,) for name in FORCES), None):
        check(problem, forces)


@pytest.mark.parametrize("hub", PLANAR_HUBS)
@pytest.mark.parametrize("ahead", AHEAD)
def test_derivatives_in_a_plane_agree_with_differences(ahead, hub):
    problem = problem_in_plane(hub, ahead)
    assert problem.model.raised.exists
    for forces in (*((name,) for name in FORCES), FORCES):
        check(problem, forces)


STIFF = {**GEL, "youngs_modulus": 1e6}
MATERIALS = {"gel": {**GEL, "youngs_modulus": 1e5}, "stiff": STIFF}
UNLIKE = [layer("soft", 3e-3), layer("top", 1e-3, "stiff")]
EQUAL_MASS = [layer("soft", 3e-3), layer("top", 1e-3)]  # the mass centre is on the axis, the path is not
ALIKE = [layer("soft", 2e-3), layer("top", 2e-3)]


def strip(layers, held=False, stations=11, **more):
    clamp = {"clamp_start": "wall"} if held else {}
    bodies = {"bodies": [fixed()]} if held else {}
    return load_scene(scene([rod(layers, 0.1, stations, **clamp)], EXACT, materials=MATERIALS, **bodies, **more))


def thrown(integrator, dt, dimension=3):
    """A free strip that flies, spins and bends after 50 ms, with its momentum and angular momentum at the start."""
    simulator = Simulator(strip(UNLIKE), model="laminate", dimension=dimension, integrator=integrator, dt=dt)
    state, arms = simulator._state, simulator.positions - simulator.com
    state.velocity[:] = np.cross([0.0, 20.0, 0.0], arms) + [0.3, 0.0, 0.1]
    if dimension == 3:
        state.velocity[:] += np.cross([5.0, 0.0, 3.0], arms)
        state.spin[:] = 5.0
    turn_directors(simulator.model, state)
    start = simulator.momentum, simulator.angular_momentum
    simulator.run(0.05)
    return simulator, start


def test_alike_layers_have_nothing_off_the_curve():
    model = build_model(strip(ALIKE, held=True), "laminate")
    assert not model.raised.exists and model.kept_directors == 0
    assert build_model(strip(UNLIKE, held=True), "laminate").raised.edge.tolist() == list(range(10))


def test_only_the_part_where_layers_differ_is_raised():
    part = [layer("soft", 2e-3), layer("top", 2e-3, interval=[0.04, 0.06])]
    model = build_model(strip(part, held=True), "laminate")
    assert model.raised.edge.tolist() == [4, 5]


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(
    "integrator", ["implicit_euler", "implicit_midpoint", "sdirk2", "tr_bdf2", "generalised_alpha"]
)
def test_a_free_strip_of_unlike_layers_keeps_its_momentum(integrator, dimension):
    simulator, (momentum, _) = thrown(integrator, 1e-3, dimension)
    assert np.abs(simulator.momentum - momentum).max() < 1e-13 * np.abs(momentum).max() + 1e-15


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("integrator, order", [("implicit_euler", 1), ("implicit_midpoint", 1), ("tr_bdf2", 2)])
def test_it_keeps_its_angular_momentum_to_an_order(integrator, order, dimension):
    lost = []
    for dt in (1e-3, 5e-4):
        simulator, (_, before) = thrown(integrator, dt, dimension)
        lost.append(np.linalg.norm(simulator.angular_momentum - before) / np.linalg.norm(before))
    assert np.log2(lost[0] / lost[1]) > order - 0.2
    assert lost[1] < 0.05


@pytest.mark.parametrize("dimension", [2, 3])
def test_integrators_of_second_order_keep_it(dimension):
    ends = [thrown("tr_bdf2", dt, dimension)[0].positions for dt in (2e-4, 1e-4, 5e-5)]
    changes = [np.abs(a - b).max() for a, b in zip(ends, ends[1:], strict=False)]
    assert np.log2(changes[0] / changes[1]) > 1.8


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_energy_budget_of_a_shaken_strip_closes(dimension):
    hub = fixed() | {
        "motion": {"type": "prescribed", "times": [0, 0.05, 0.1], "displacements": [[0] * 3, [4e-3, 0, 2e-3], [0] * 3]}
    }
    load = {"name": "push", "rod": "rod", "position": 0.07, "force": [2e-3, 1e-3, 0], "frame": "material"}
    fluid = {"drag_along": 0.3, "drag_across": 1.2, "added_mass": True}
    content = scene(
        [rod(UNLIKE, 0.1, 11, clamp_start="wall")],
        EXACT,
        materials=MATERIALS,
        bodies=[hub],
        gravity=[0, 0, -9.81],
        loads=[load],
        fluid=fluid,
        damping={"mass": 2.0},
    )
    residuals = []
    for dt in (1e-3, 5e-4):
        simulator = Simulator(
            load_scene(content), model="laminate", dimension=dimension, integrator="sdirk2", dt=dt, budget=True
        )
        simulator.run(0.1)
        residuals.append(abs(simulator.budget()["relative_residual"]))
    assert residuals[1] < 0.5 * residuals[0] < 1e-3
    assert simulator.budget()["lost"]["drag"] > 0.0


def test_a_state_goes_on_under_a_load_off_the_curve():
    load = {"name": "pull", "rod": "rod", "position": 0.02, "force": [0.05, 0, 0]}
    before = Simulator(strip(EQUAL_MASS, held=True, loads=[load]), model="laminate", dimension=2, dt=1e-3)
    before.run(0.01)
    load["position"] = 0.1
    after = Simulator(strip(EQUAL_MASS, held=True, loads=[load]), model="laminate", dimension=2, dt=1e-3)
    raised = [simulator.model.raised.edge.tolist() for simulator in (before, after)]
    assert raised == [[1, 2], [9]]
    after.load_state(before.save_state())
    after.run(0.02)
    assert abs(after.positions[-1, 2] - before.positions[-1, 2]) > 1e-5


def test_a_state_whose_velocities_someone_sets_has_directors_that_turn_with_them():
    simulator = Simulator(strip(UNLIKE), model="laminate", dimension=2, dt=1e-3)
    spun, begin = simulator.save_state(), 0
    for name, shape in simulator.description.state_layout:
        size = int(np.prod(shape))
        if name == "velocity":
            spun[begin : begin + size] = np.cross([0.0, 20.0, 0.0], simulator.positions).ravel()
        begin += size
    simulator.load_state(spun)
    model = simulator.model
    density, width, length = 1000.0, 0.01, 0.1
    x = 0.5 * length  # of the mass centre, which moves at 20 rad/s about the origin at the height of the mass centre
    height = model.start_position[0, 2] + model.raised.first_moment.sum() / model.rods.node_mass.sum()
    mass = density * width * 4e-3 * length
    assert simulator.momentum == pytest.approx(20.0 * mass * np.array([height, 0.0, -x]), rel=1e-12)


@pytest.mark.parametrize(("mode", "limit"), [(0, 2e-4), (1, 2e-3), (2, 5e-4)])
def test_vibrations_with_a_mass_off_the_axis_at_the_end_converge_at_second_order(mode, limit):
    """Bending twice and stretching, which turns the end by its moment: 0.95 without the half edge beyond the last."""
    coarse, fine = (abs(found / expected - 1.0) for found, expected in (frequency_with_mass(mode, n) for n in (41, 81)))
    assert fine < limit
    assert np.log2(coarse / fine) == pytest.approx(2.0, abs=0.1)
