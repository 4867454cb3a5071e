"""Rods that collapse: edges without length, joints that fold flat; runs that stop there say so, and what helps."""

import math

import numpy as np
import pytest
from support.sample_scenes import fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.engine.step import LEAST_LENGTH
from bilayer_core.errors import SimulationError
from bilayer_core.simulation.collapse import collapsed

LENGTH, STATIONS = 0.05, 11


def coiling(turns, **more):
    """A straight strip whose natural curve is a coil of so many turns, let go at once."""
    curl = layer(thickness=2e-3, natural_curvature=2.0 * math.pi * turns / LENGTH)
    strip = rod([curl], length=LENGTH, stations=STATIONS, clamp_start="wall")
    return {**scene([strip], bodies=[fixed()]), "solver": more, "duration": 0.1}


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_run_in_which_an_edge_collapses_names_it_and_a_remedy_that_works(dimension):
    content = coiling(40.0, dimension=dimension)
    simulator = Simulator(load_scene(content))
    with pytest.raises(SimulationError, match=r"edge \d of rod/only has .* % of its length left") as stop:
        simulator.run(0.1)
    assert set(stop.value.remedy.changes) == {"materials.gel.retardation_time"}
    simulator = Simulator(load_scene(content, stop.value.remedy.overrides()))
    simulator.run(0.1)
    assert not collapsed(simulator.model, simulator.positions)


def test_with_fixed_steps_the_remedy_is_adaptive_ones_as_well():
    simulator = Simulator(load_scene(coiling(40.0, dt=2e-6, integrator="implicit_midpoint")))
    with pytest.raises(SimulationError, match="of its length left") as stop:
        simulator.run(0.1)
    expected = {"materials.gel.retardation_time", "solver.dt", "solver.integrator"}
    assert set(stop.value.remedy.changes) == expected
    assert ", and leave `solver.dt` out for adaptive steps" in str(stop.value.remedy)


@pytest.mark.parametrize(
    ("integrator", "turns", "dt"), [("implicit_midpoint", 60.0, 2e-6), ("sdirk2", 40.0, 5e-6), ("tr_bdf2", 60.0, 5e-6)]
)
def test_no_step_ends_with_an_edge_that_has_no_length_left(integrator, turns, dt):
    """Such an edge turns by what Newton's method leaves: faces of its rod would then be anywhere."""
    simulator = Simulator(load_scene(coiling(turns, dt=dt, integrator=integrator)))
    rest, least = simulator.model.rods.rest_length, math.inf
    with pytest.raises(SimulationError, match="has less than 1 % of its length left"):
        while simulator.time < 0.05:
            simulator.step()
            edges = np.linalg.norm(np.diff(simulator.positions, axis=0), axis=1)
            least = min(least, float((edges / rest).min()))
    assert LEAST_LENGTH <= least < 0.9


def bent(angle, stretch=1.0):
    """A model of a strip, and positions at which its fifth node has such an angle between edges that are so long."""
    model = Simulator(load_scene(coiling(0.0))).model
    position = model.start_position.copy()
    position[:, 0] = (position[:, 0] - position[5, 0]) * stretch
    turned = position[6:, 0].copy()
    position[6:, 0], position[6:, 2] = math.cos(angle) * turned, math.sin(angle) * turned
    return model, position


@pytest.mark.parametrize("degrees", [0.0, 90.0, 174.0])
def test_a_sharp_bend_is_no_collapse(degrees):
    assert collapsed(*bent(math.radians(degrees))) == ""


def test_a_joint_that_is_folded_flat_is_one():
    assert collapsed(*bent(math.radians(179.0))) == "the joint behind edge 4 of rod/only is folded by 179.0°"


@pytest.mark.parametrize(("part", "told"), [(0.02, ""), (0.005, "of rod/only has 0.5 % of its length left")])
def test_edges_need_a_hundredth_of_their_length(part, told):
    assert collapsed(*bent(0.0, part)).endswith(told)
    assert bool(collapsed(*bent(0.0, part))) == bool(told)


def test_layers_of_two_rods_are_named_and_their_bonds_are_no_joints():
    strip = rod([layer("lower"), layer("upper")], length=LENGTH, stations=STATIONS)
    model = Simulator(load_scene(scene([strip])), model="two_rod").model
    position = model.start_position.copy()
    assert collapsed(model, position) == ""
    last = position[-1].copy()
    position[-1] = position[-2] + 1e-3 * (last - position[-2])
    assert collapsed(model, position) == "edge 9 of rod/upper has 0.1 % of its length left"
