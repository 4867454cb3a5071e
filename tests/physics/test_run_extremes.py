"""Figures of a run are those of the run: extremes over its start and the ends of all its steps."""

import numpy as np
import pytest
from support.sample_scenes import ball, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.engine.evaluator import Evaluator

PULSE = {"type": "table", "times": [0, 0.02, 0.04], "values": [0, 1, 0]}
ROUNDING = 1e-12


def strip(gain=0.02):
    """A clamped bilayer that bends and comes back, above a ball that is thrown up and falls."""
    layers = [layer("lower"), layer("upper", eigenstrain={"stimulus": "heat", "gain": gain})]
    thrown = ball((0, 0, -1), velocity=[0, 0, 0.1])
    weight = {"name": "weight", "body": "ball", "force": [0, 0, -9.81 * thrown["motion"]["mass"]]}
    return scene(
        [rod(layers, stations=11, clamp_start="wall")],
        stimuli={"heat": {"schedule": PULSE}},
        bodies=[fixed("wall"), thrown],
        contact={"barrier_distance": 1e-4, "stiffness": 1e7},
        damping={"mass": 200.0},
        loads=[weight],
    )


class Watched:
    """Extremes of a simulator by looking at it after each step."""

    def __init__(self, simulator):
        self.simulator, self.curvature, self.strain, self.top = simulator, 0.0, 0.0, -np.inf
        self.evaluator = Evaluator(simulator.model)
        simulator.compile()
        self.look()

    def look(self, time=None):
        simulator, model = self.simulator, self.simulator.model
        curvature = np.abs(simulator.curvatures[: model.node_count]).max()
        stepper, state = simulator._stepper, simulator._state
        rest = self.evaluator.rest_strains_of(state.transduction).edge
        strain = np.abs(stepper.end.length[: model.rods.edge_count] / model.rods.rest_length - 1.0 - rest).max()
        self.curvature, self.strain = max(self.curvature, curvature), max(self.strain, strain)
        self.top = max(self.top, simulator.bodies["ball"].position[2])

    def run(self, duration):
        self.simulator.run(duration, each_step=self.look)
        return self.simulator.summary()


SETTINGS = {
    "adaptive in a plane": {"tolerance": 1e-4},
    "fixed": {"model": "two_rod", "dt": 1e-3},
    "one by one, with a budget": {"model": "two_rod", "dt": 1e-3, "budget": True},
}


@pytest.mark.parametrize("kind", SETTINGS)
def test_curvature_strain_and_lift_are_the_largest_of_all_steps(kind):
    simulator = Simulator(load_scene(strip()), **SETTINGS[kind])
    watched = Watched(simulator)
    found = watched.run(0.06)
    assert found["max_curvature"] == pytest.approx(watched.curvature, rel=ROUNDING)
    assert found["max_strain"] == pytest.approx(watched.strain, rel=ROUNDING)
    thrown = found["bodies"]["ball"]
    assert thrown["lift"] == pytest.approx(watched.top - thrown["start"][2], rel=ROUNDING)
    assert thrown["lift"] > 3e-4 and thrown["lift_end"] < -1e-2  # it rose by v²/2g and fell
    assert found["max_curvature"] > 2.0 * np.abs(simulator.curvatures).max()  # it bent and came back
    assert found["max_curvature"] > 2.0 * found["mean_curvature"]


def test_many_steps_at_once_have_the_extremes_of_steps_one_by_one():
    one, many = (Simulator(load_scene(strip()), tolerance=1e-4) for _ in range(2))
    one.run(0.06, each_step=lambda time: None)
    many.run(0.06)
    found = [simulator.summary() for simulator in (one, many)]
    for key in ("max_curvature", "max_strain"):
        assert found[0][key] == found[1][key] > 0.0
    assert found[0]["bodies"] == found[1]["bodies"]


def test_a_loaded_state_begins_the_extremes_anew_with_itself():
    simulator = Simulator(load_scene(strip()), tolerance=1e-4)
    simulator.run(0.02)
    snapshot = simulator.save_state()
    bent = np.abs(simulator.curvatures).max()
    simulator.run(0.06)
    assert simulator.summary()["max_curvature"] >= bent
    simulator.load_state(snapshot)
    found = simulator.summary()
    assert found["max_curvature"] == pytest.approx(bent, rel=1e-9)
    assert found["bodies"]["ball"]["lift"] == 0.0
    simulator.reset()
    assert simulator.summary()["max_curvature"] == 0.0


def test_a_run_of_large_strain_has_a_warning_and_one_of_small_strain_has_none():
    pulled = scene([rod([layer()], stations=11, clamp_start="wall")], bodies=[fixed("wall")], damping={"mass": 200.0})
    config = load_scene(pulled)
    (strand,) = config.rods
    area = strand.width * strand.layers[0].thickness
    modulus = config.materials[strand.layers[0].material].youngs_modulus
    for strain, warned in ((0.05, False), (0.15, True)):
        load = {"name": "pull", "rod": "rod", "position": 0.1, "force": [strain * area * modulus, 0, 0]}
        simulator = Simulator(load_scene({**pulled, "gravity": [0, 0, 0], "loads": [load]}))
        simulator.solve_static()
        found = simulator.summary()
        assert found["max_strain"] == pytest.approx(strain, rel=1e-6)
        told = [f"largest strain of an edge {100 * strain:.3g} % (at most 10 %): the law of the material is linear"]
        assert found["warnings"] == (told if warned else [])


def test_a_step_that_was_never_made_is_in_no_figure():
    ready, new = (Simulator(load_scene(strip(gain=0.2)), dt=5e-3, model="two_rod") for _ in range(2))
    ready.compile()
    for simulator in (ready, new):
        simulator.set_stimulus("heat", 0.0)
        simulator.run(0.01)
    told, expected = ready.summary(), new.summary()
    timed = {"cpu_time", "wall_time", "compile_time", "real_time_factor"}
    assert {key: told[key] for key in told.keys() - timed} == {key: expected[key] for key in expected.keys() - timed}
    assert told["max_curvature"] < 1e-3
