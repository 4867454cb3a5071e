"""Figures of a run are those of the run: extremes over its start and the ends of all its steps."""

import re

import numpy as np
import pytest
from support.sample_scenes import GEL, ball, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.engine.evaluator import Evaluator
from bilayer_core.log.messages.events import WARN, EventDetector
from bilayer_core.log.run.memory import MemoryRecorder

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
        strain = np.abs(stepper.engine.end.length[: model.rods.edge_count] / model.rods.rest_length - 1.0 - rest).max()
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
        assert found["max_fibre_strain"] == pytest.approx(strain, rel=1e-6)
        each = f"{100 * strain:.3g} %"
        told = [
            f"largest strain of a fibre {each} (at most 10 %), of an edge {each}: the law of the material is linear"
        ]
        assert found["warnings"] == (told if warned else [])


def bent(turn, thickness=2e-3, **more):
    """A strip of one layer whose natural curvature turns it by `turn` [rad] from a straight path."""
    strip = rod([layer(thickness=thickness)], length=0.05, stations=26, clamp_start="wall", clamp_end="hand", **more)
    hand = {"name": "hand", "position": [0.05, 0, 0], "motion": {"type": "free", "mass": 1e-4, "inertia": [1e-8] * 3}}
    moment = GEL["youngs_modulus"] * strip["width"] * thickness**3 / 12.0 * turn / 0.05
    load = {"name": "twirl", "body": "hand", "moment": [0, moment, 0]}
    return scene([strip], bodies=[fixed("wall"), hand], loads=[load])


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_outermost_fibre_in_pure_bending_strains_by_half_thickness_times_curvature(dimension):
    """κ = M/EI everywhere: 40 1/m, on 2 mm."""
    simulator = Simulator(load_scene(bent(2.0)), dimension=dimension)
    simulator.solve_static()
    found = simulator.summary()
    assert found["max_curvature"] == pytest.approx(40.0, rel=2e-3)  # of 25 edges
    assert found["max_curvature_by_thickness"] == pytest.approx(2e-3 * found["max_curvature"], rel=1e-9)
    assert found["max_fibre_strain"] == pytest.approx(1e-3 * found["max_curvature"], rel=1e-6)
    assert found["max_strain"] < 1e-7
    assert not found["warnings"]


@pytest.mark.parametrize("width", [0.02, 0.04])
def test_a_beam_that_loads_bend_where_a_plate_is_stiffer_is_told_by_how_much(width):
    def simulated(turn, model="laminate", **more):
        simulator = Simulator(load_scene(bent(turn, thickness=1e-3, width=width, **more)), model=model, dimension=2)
        simulator.solve_static()
        return simulator

    turns = {}
    for section in ("strip", "beam"):
        simulator = simulated(2.0, section=section)
        turns[section] = simulator.curvatures[13] / 40.0
        assert "loads bend" not in str(simulator.summary()["warnings"])
    stiffer = turns["beam"] / turns["strip"]
    (told,) = simulated(2.0 / stiffer, section="auto").summary()["warnings"]  # as far as the strip
    found = re.match(r"rods\.rod: loads bend it to w²κ/H (\d+), where a plate as wide is stiffer by (\d+) %", told)
    assert float(found[1]) == pytest.approx(width**2 * 40.0 / stiffer / 1e-3, rel=0.03)
    assert float(found[2]) == pytest.approx(100.0 * (stiffer - 1.0), abs=1.0)
    assert told.endswith("can be had by `section: strip`; `section: beam` says that a beam is meant")
    (told,) = simulated(2.0 / stiffer, model="two_rod", section="auto").summary()["warnings"]
    assert "a strip takes the model laminate" in told
    assert not simulated(0.01, section="auto").summary()["warnings"]


def test_bending_beyond_the_limits_of_a_thin_rod_is_warned_of_and_an_event_once():
    simulator = Simulator(load_scene(bent(6.0)))
    simulator.solve_static()
    recorder = MemoryRecorder()
    simulator.run(0.01, observers=[recorder])
    found, detector = simulator.summary(), EventDetector(recorder.description)
    fibre, bend = found["warnings"]
    assert fibre.startswith("largest strain of a fibre 12 % (at most 10 %), of an edge ")
    assert bend == "largest curvature × thickness 0.239 (at most 0.2): it is no thin rod"
    events = [event for frame in recorder.frames for event in detector.see(frame) if event.name == "validity"]
    assert [event.text for event in events] == [
        "a fibre is strained by more than 10 %: the law of the material is linear",
        "curvature × thickness is above 0.2: it is no thin rod",
    ]
    assert {event.level for event in events} == {WARN}


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_free_bending_by_swelling_multiplies_curvature_with_the_thickness_of_both_layers(model):
    layers = [layer("lower"), layer("upper", eigenstrain={"stimulus": "heat", "gain": 0.02})]
    free = scene(
        [rod(layers, stations=41, clamp_start="wall")],
        stimuli={"heat": {"schedule": {"type": "hold", "value": 1.0}}},
        bodies=[fixed("wall")],
    )
    simulator = Simulator(load_scene(free), model=model)
    simulator.solve_static()
    simulator.load_state(simulator.save_state())  # which begins with the shape at rest
    found = simulator.summary()
    assert found["max_curvature_by_thickness"] == pytest.approx(1.5 * 0.02, rel=0.02)  # Timoshenko
    if model == "laminate":  # beyond the shape at rest; a layer by itself has the stress of the other
        assert found["max_fibre_strain"] < 1e-6


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
