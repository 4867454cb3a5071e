"""Edges that go through surfaces between their nodes: no barrier feels that, so runs stop there and name the edge."""

import math

import numpy as np
import pytest
from support.records_by_hand import record_of
from support.sample_scenes import HALF_SIZES, ball, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.contact.crossing import crossing
from bilayer_core.errors import SimulationError
from bilayer_core.jit import kernel, record_at
from bilayer_core.kinematics.rotation import rotation_matrix
from bilayer_core.model.records.contacts import Surfaces
from bilayer_core.model.records.parts import Strands
from bilayer_core.model.records.step import Configuration
from bilayer_core.model.shape_numbers import NUMBER, Shape, signed_distance

surfaces_at, strands_at, configuration_at = record_at(Surfaces), record_at(Strands), record_at(Configuration)
RADIUS = 0.02
SPIKE = {"name": "spike", "type": "cylinder", "position": [0.006, 0, 0.01], "radius": 0.5e-3, "length": 0.02}
FALLING = {"gravity": [0, 0, -9.81], "duration": 0.2}


@kernel
def first_crossing(strands, surfaces, at):
    return crossing(strands_at(strands), surfaces_at(surfaces), configuration_at(at))


def strip(stations, length=0.02, start=(0, 0, 0.0215), **more):
    return rod([layer(thickness=0.5e-3)], length=length, stations=stations, start=start, **more)


def over_spike(stations, **more):
    """A strip that falls on a spike, which is narrower than its edges are long."""
    content = scene([strip(stations)], obstacles=[SPIKE], contact=contact(), **FALLING)
    return content | {"solver": more}


@pytest.mark.parametrize("kind", ["sphere", "box", "cylinder"])
def test_edges_cross_a_shape_where_a_point_of_them_is_inside(kind):
    rng, counts = np.random.default_rng(3), [0, 0]
    for _ in range(150):
        rounding = 0.2 if kind == "sphere" else rng.choice([0.0, 0.05])
        turn, place = rotation_matrix(rng.standard_normal(3)), rng.uniform(-0.1, 0.1, 3)
        nodes = rng.uniform(-0.6, 0.6, (3, 3))
        size = np.array(HALF_SIZES[kind])
        core = Shape(kind, size, 0.0, turn)
        if (signed_distance(core, nodes - place) < rounding).any():
            continue
        lengths = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
        surfaces = record_of(
            Surfaces,
            kind=np.array([NUMBER[kind]]),
            size=size[None],
            rounding=np.array([rounding]),
            bound=np.array([float(np.linalg.norm(size)) + rounding]),
            edge_can_cross=np.ones((1, 2), dtype=bool),
            first_position=nodes.copy(),
            first_surface_position=place[None].copy(),
            first_surface_rotation=turn[None].copy(),
        )
        strands = record_of(Strands, edge_count=2, edge_node=np.arange(2))
        at = record_of(
            Configuration,
            position=nodes,
            length=lengths,
            surface_position=place[None],
            surface_rotation=turn[None],
        )
        along = np.linspace(0.0, 1.0, 4001)[:, None]
        depth = [
            float((signed_distance(core, nodes[e] + along * (nodes[e + 1] - nodes[e]) - place) - rounding).min())
            for e in range(2)
        ]
        if min(map(abs, depth)) < 1e-6:  # too near for samples to tell
            continue
        expected = next((e for e in range(2) if depth[e] < 0.0), -1)
        assert first_crossing(strands.address, surfaces.address, at.address) == expected
        counts[expected >= 0] += 1
    assert min(counts) > 20


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("model", ["laminate", "two_rod"])
@pytest.mark.parametrize("dt", [None, 1e-3])
def test_a_strip_lies_on_a_spike_that_stands_between_its_stations(dimension, model, dt):
    content = over_spike(6, dimension=dimension, model=model, **({} if dt is None else {"dt": dt}))
    simulator = Simulator(load_scene(content))
    simulator.run(0.06)
    assert simulator.positions[:, 2].max() > 0.02  # it lies on the spike


@pytest.mark.parametrize("solver", [{}, {"dt": None}, {"dt": 2e-4}])
def test_a_bead_that_is_thrown_between_stations_does_not_pass(solver):
    bead = ball((0.006, 0, 0.03), radius=0.5e-3, velocity=[0, 0, -2.0])
    held = strip(6, clamp_start="wall", clamp_end="other")
    walls = [fixed("wall", (0, 0, 0.0215)), fixed("other", (0.02, 0, 0.0215))]
    simulator = Simulator(load_scene(scene([held], solver=solver, bodies=[*walls, bead], contact=contact())))
    simulator.run(0.02)
    lowest = simulator.positions[:, 2].min()
    assert simulator.bodies["ball"].position[2] > lowest + 0.5e-3


@pytest.mark.parametrize("turn", range(6))
def test_a_ring_is_crossed_where_it_closes_as_elsewhere(turn):
    """Of six edges of a ring that moves across its plane, a spike stands in the way of one after the other."""
    angle, half = math.radians(60.0 * turn), math.radians(30.0)
    outward, along = np.array([math.cos(angle), 0, math.sin(angle)]), np.array([-math.sin(angle), 0, math.cos(angle)])
    path = {"shape": "arc", "start": (RADIUS * outward).tolist(), "direction": along.tolist(), "closed": True}
    path |= {"radius": RADIUS, "angle": "360 deg"}
    ring = rod([layer(thickness=0.5e-3)], stations=7, width=1e-3) | {"path": path, "normal": (-outward).tolist()}
    inner = RADIUS * math.cos(half)
    spike = SPIKE | {"position": [inner * math.cos(half), -0.0115, inner * math.sin(half)], "axis": [0, 1, 0]}
    content = scene([ring], obstacles=[spike], contact=contact(), gravity=[0, -9.81, 0])
    with pytest.raises(SimulationError, match=r"edge \d of rod/\w+ goes through spike between its nodes"):
        Simulator(load_scene(content)).run(0.2)


def test_a_static_shape_lies_on_a_spike_between_its_stations():
    content = over_spike(6) | {"duration": 1.0}
    content["rods"][0] |= {"clamp_start": "wall"}
    content["bodies"] = [fixed("wall", (0, 0, 0.0215))]
    content["gravity"] = [0, 0, -2000.0]
    simulator = Simulator(load_scene(content))
    simulator.solve_static()
    assert 0.0 < simulator.frame().min_gap < contact()["barrier_distance"]


def test_a_rod_may_grow_out_of_the_body_that_holds_it():
    hub = fixed("hub", (0, 0, 0.0215), surface={"shape": "box", "size": [2e-3, 2e-3, 2e-3]})
    content = scene([strip(6, clamp_start="hub")], bodies=[hub], contact=contact(), **FALLING)
    simulator = Simulator(load_scene(content))
    root = simulator.positions[[0, 1]]
    assert root[0, 0] < 1e-3 < root[1, 0]  # its first edge goes through the face of the hub
    simulator.run(0.02)
    assert simulator.time == pytest.approx(0.02)
    assert simulator.positions[-1, 2] < root[0, 2] - 1e-6  # it sags, held as it is
