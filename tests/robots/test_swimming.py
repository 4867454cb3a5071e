"""What the swimmer does, from its scene file alone."""

import numpy as np
import pytest
from support.paper import TWO_RODS

from bilayer_core import Simulator, load_scene

pytestmark = pytest.mark.slow
PERIOD = 0.6
# Arms do not touch, and the hub moves up and down alone: one arm with an eighth of the hub is the whole robot.
ONE_ARM = ("rods.arm.pattern.count=1", "bodies.hub.motion.mass=0.11875 g")
FINER = "rods.arm.stations=79"
ADDED = {"drag alone": "fluid.added_mass=false", "with added mass": "fluid.added_mass=true"}
STROKES = {"fluid.added_mass=false": 3.978e-3, "fluid.added_mass=true": 4.543e-3}
"""Rise once it repeats, of a finer mesh and shorter steps [m]."""


def height(simulator):
    """Of the mass centre of arms and hub [m]."""
    return simulator.com[2]


def strokes(count, *changes, **options):
    """Rise of the mass centre in each of the first strokes [m], and the simulator."""
    simulator = Simulator(load_scene("swimming", [*ONE_ARM, *changes]), **options)
    heights = [height(simulator)]
    for _ in range(count):
        simulator.run(PERIOD)
        heights.append(height(simulator))
    return np.diff(heights), simulator


@pytest.fixture(scope="module", params=ADDED)
def swimming(request):
    fluid = ADDED[request.param]
    return fluid, *strokes(3, fluid)


def test_the_swimmer_has_the_papers_parameters():
    simulator = Simulator(load_scene("swimming", [TWO_RODS]))
    strands = simulator.model.strands
    passive, active = (sum(s.node_count for s in strands if s.layer == name) for name in ("passive", "active"))
    assert (passive + 1, active) == (321, 288)  # the hub is one
    assert simulator.scene.gravity == (0.0, 0.0, 0.0)
    assert simulator.scene.fluid.added_mass is None
    drag = simulator.model.flow.coefficient[5]
    assert drag / drag[1] == pytest.approx([0.01, 1.0, 0.2])  # sideways the thickness counts, not the width


def test_one_arm_with_an_eighth_of_the_hub_moves_as_the_whole_robot():
    whole = Simulator(load_scene("swimming", ["fluid.added_mass=true"]), dt=1e-3)
    whole.run(0.02)
    one = Simulator(load_scene("swimming", [*ONE_ARM, "fluid.added_mass=true"]), dt=1e-3)
    one.run(0.02)
    assert abs(height(whole)) > 1e-4
    assert height(one) == pytest.approx(height(whole), abs=1e-9)


def test_every_stroke_lifts_it_and_by_the_same_from_the_second_on(swimming):
    fluid, rises, simulator = swimming
    assert (rises > 3e-3).all()
    assert rises[2] == pytest.approx(rises[1], rel=0.02)
    assert rises[2] == pytest.approx(STROKES[fluid], rel=0.015)
    assert np.abs(simulator.positions[:, 1]).max() < 1e-9
    assert simulator.summary()["converged"] is True


def test_twice_the_papers_step_or_twice_the_nodes_change_the_rise_little(swimming):
    fluid, rises, _ = swimming
    for changes, steps in ((), {"dt": 2e-3}), ((FINER,), {}):
        again, _ = strokes(2, fluid, *changes, **steps)
        assert again[1] == pytest.approx(rises[1], rel=0.01)
    coarse, fine = (strokes(2, fluid, TWO_RODS, *changes, dt=2e-3)[0] for changes in ((), (FINER,)))
    assert fine[1] == pytest.approx(coarse[1], rel=0.015)


def test_it_sinks_with_every_stroke_when_its_arms_beat_upwards(swimming):
    fluid, rises, _ = swimming
    turned, _ = strokes(1, fluid, "rods.arm.normal=[0, 0, -1]")
    assert turned[0] == pytest.approx(-rises[0], rel=1e-6)


def test_without_a_fluid_nothing_moves_its_mass_centre():
    simulator = Simulator(load_scene("swimming", [*ONE_ARM, "fluid=null", "solver.newton_tolerance=1e-9"]))
    start, largest = height(simulator), 0.0
    while simulator.time < 0.06:
        simulator.step()
        largest = max(largest, abs(height(simulator) - start))
    assert simulator.bodies["hub"].position[2] > 2e-2  # while the arms go down
    assert largest < 1e-9


def test_a_slower_cycle_moves_it_as_far():
    """Drag and inertia both grow with the square of the speed; the shape follows the light."""
    times = [f"rods.arm.layers.active.eigenstrain.time_constant_{way}=0" for way in ("rising", "falling")]
    ends = []
    for period in (3.0, 10.0):
        light = f"stimuli.light.schedule={{type: sine, mean: 0.5, amplitude: 0.5, period: {period} s, phase: -90 deg}}"
        simulator = Simulator(load_scene("swimming", [*ONE_ARM, light, *times]))
        simulator.run(2 * period)
        ends.append(height(simulator))
    assert ends[0] > 5e-3
    assert ends[1] == pytest.approx(ends[0], rel=0.01)


@pytest.mark.parametrize(
    "fluid",
    [
        pytest.param(ADDED["drag alone"], id="drag alone", marks=pytest.mark.verify),
        pytest.param(ADDED["with added mass"], id="with added mass"),
    ],
)
def test_drag_takes_what_the_stimulus_supplies_over_a_stroke(fluid):
    budgets = [strokes(1, fluid, dt=dt, budget=True)[1].budget() for dt in (1e-3, 5e-4)]
    for budget in budgets:
        supplied = budget["supplied"]["stimulus"]
        assert abs(budget["residual"]) < 1e-4 * supplied
        assert budget["lost"]["drag"] + sum(budget["stored"].values()) == pytest.approx(supplied, rel=0.01)
    numerical = [abs(budget["lost"]["numerical"]) for budget in budgets]
    assert numerical[1] < 0.4 * numerical[0] and numerical[1] < 0.005 * budgets[1]["supplied"]["stimulus"]
