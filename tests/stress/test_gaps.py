"""The judge's own check of gaps: it agrees with the engine, and it sees what an engine must never do."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.testing.gaps import GapCheck, PairsOfEdges
from bilayer_core.verification.stress.matrix import matrix
from bilayer_core.verification.stress.robots import scene_of


def simulator_of(name):
    case = next(case for case in matrix() if case.name == name)
    simulator = Simulator(load_scene(scene_of(case.parameters)))
    simulator.compile()
    return simulator


@pytest.mark.parametrize(
    ("robot", "model"), [("drop", "laminate"), ("ball", "two_rod"), ("bat", "laminate"), ("pile", "two_rod")]
)
def test_the_engine_s_smallest_gap_is_found_again(robot, model):
    simulator = simulator_of(f"integrator/sdirk2/{robot}/{model}/3")
    check, smallest, steps = GapCheck(simulator.model), [], itertools.count()

    def look(time):
        if next(steps) % 3:
            return
        frame = simulator.frame()
        smallest.append((check.smallest(check.moment(frame)), frame.min_gap))

    simulator.run(0.3 * simulator.scene.duration, each_step=look)
    touching = [pair for pair in smallest if pair[1] < simulator.scene.contact.barrier_distance]
    assert touching
    ours, engine = np.array(touching).T
    np.testing.assert_allclose(ours, engine, rtol=2e-2, atol=check.unsure)  # the engine's is before the last correction


@pytest.mark.parametrize("kind", ["laminate", "two_rod"])
def test_near_pairs_of_very_many_edges_are_those_of_all(kind):
    simulator = simulator_of(f"integrator/sdirk2/pile/{kind}/3")
    model = simulator.model
    few, many = PairsOfEdges(model), PairsOfEdges(model, most=0)
    simulator.run(0.1 * simulator.scene.duration)
    nodes = simulator.frame().positions[: model.node_count]
    middle = 0.5 * (nodes[model.rods.edge_node] + nodes[model.rods.edge_node + 1])
    first, second = few.at(nodes)
    longest = np.linalg.norm(nodes[model.rods.edge_node + 1] - nodes[model.rods.edge_node], axis=1).max()
    reach = longest + 2.0 * model.rod_search.edge_radius.max() + simulator.scene.contact.barrier_distance
    near = np.linalg.norm(middle[first] - middle[second], axis=1) < reach
    expected = set(zip(first[near].tolist(), second[near].tolist(), strict=True))
    found = {(min(pair), max(pair)) for pair in zip(*(part.tolist() for part in many.at(nodes)), strict=True)}
    assert expected and expected <= found
    assert len(found) < few.count < many.count
    start = model.start_position
    many.leave_out(start, np.ones(len(many.at(start)[0]), dtype=bool))
    assert len(many.at(start)[0]) == 0


def test_a_node_under_the_ground_is_seen():
    simulator = simulator_of("integrator/sdirk2/drop/laminate/3")
    check, frame = GapCheck(simulator.model), simulator.frame()
    assert check.smallest(check.moment(frame)) > 0.0
    down = replace(frame, positions=frame.positions - [0.0, 0.0, 1.0])
    assert check.smallest(check.moment(down)) < 0.0


def test_contact_across_air_is_seen():
    simulator = simulator_of("integrator/sdirk2/pile/laminate/3")
    check, frame = GapCheck(simulator.model), simulator.frame()
    unit = simulator.scene.contact.barrier_distance

    def seen(pair, height):
        """With everything moved so that its least gap to the ground is a height."""
        lowest = check._surface_gaps(check._ribbons.sheet(check.moment(frame).sections), check.moment(frame), math.inf)
        moved = replace(frame, positions=frame.positions + [0.0, 0.0, height - lowest[0]])
        return check.floating(check.moment(moved), [pair])

    assert [seen((f"strip{k}", "ground"), 0.9 * unit) for k in range(3)].count("") == 1
    assert all("touch across" in seen((f"strip{k}", "ground"), 2.0 * unit) for k in range(3))
    assert seen(("strip0", "strip2"), unit).startswith("strip0 and strip2 touch across")


def crossing(name, moved):
    """What is seen when a part of what moves is somewhere else at the next look."""
    simulator = simulator_of(name)
    check, frame = GapCheck(simulator.model), simulator.frame()
    assert check.crossed(check.moment(frame)) == ""
    after = moved(simulator, frame)
    moment = check.moment(after)
    assert check.smallest(moment) > 0.0  # at its end nothing is wrong
    return check.crossed(moment)


def test_a_ball_that_leaves_its_box_through_the_wall_is_seen():
    def moved(_, frame):
        way = np.zeros_like(frame.body_positions)
        way[1, 0] = 0.5
        return replace(frame, body_positions=frame.body_positions + way)

    assert crossing("integrator/sdirk2/box/laminate/3", moved) == "something passed through right"


def test_a_strip_that_changes_places_with_the_one_below_is_seen():
    def moved(simulator, frame):
        strand, positions = simulator.model.strands[1], frame.positions + [0.0, 0.0, 1.0]
        nodes = slice(strand.first_node, strand.first_node + strand.node_count)
        positions[nodes, 2] -= 2.0 * (positions[nodes, 2] - positions[0, 2])
        return replace(frame, positions=positions)

    simulator = simulator_of("integrator/sdirk2/pile/laminate/3")
    check, frame = GapCheck(simulator.model), simulator.frame()
    lifted = replace(frame, positions=frame.positions + [0.0, 0.0, 1.0])
    check.crossed(check.moment(lifted))
    assert check.crossed(check.moment(moved(simulator, frame))) == "a rod passed through a rod"


def test_what_moves_and_touches_nothing_has_crossed_nothing():
    def moved(_, frame):
        return replace(frame, positions=frame.positions + [0.02, 0.0, 0.1])

    assert crossing("integrator/sdirk2/pile/laminate/3", moved) == ""


def test_nothing_that_could_meet_has_no_gap():
    simulator = simulator_of("integrator/sdirk2/beam/laminate/3")
    check = GapCheck(simulator.model)
    assert not check.checks_anything
    assert check.smallest(check.moment(simulator.frame())) == math.inf
