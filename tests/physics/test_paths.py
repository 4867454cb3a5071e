"""Rods on helices and on paths through points: free of stress at the start, and what they do under loads."""

import numpy as np
import pytest
from support.sample_scenes import GEL, contact, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.kinematics.rotation import rotation_matrix

HELIX = {
    "shape": "helix",
    "start": [0.02, 0, 0],
    "axis": [0, 0, 1],
    "radius": 0.02,
    "pitch": 0.03,
    "angle": "1.5 turns",
}
FLAT = [[0, 0, 0], [0.04, 0, 0.01], [0.07, 0, 0.04], [0.08, 0, 0.08]]
WILD = [[0, 0, 0], [0.04, 0.01, 0.01], [0.07, 0.04, 0.04], [0.05, 0.08, 0.08]]
TURNED = [[0, 0, 1], [0, -1, 2], [-1, -1, 1], [-1, 0, 1]]
PATHS = {
    "helix": (HELIX, (-1, 0, 0)),
    "helix, left": (HELIX | {"handedness": "left", "toward": "opposite"}, (1, 0, 0)),
    "flat polyline": ({"shape": "polyline", "points": FLAT}, (0, 0, 1)),
    "flat spline": ({"shape": "spline", "points": FLAT}, (0, 0, 1)),
    "polyline": ({"shape": "polyline", "points": WILD}, (0, 0, 1)),
    "spline": ({"shape": "spline", "points": WILD}, (0, 0, 1)),
    "polyline with normals": ({"shape": "polyline", "points": WILD, "normals": TURNED}, (-0.23, -0.06, 0.97)),
}
ONE, TWO = [layer()], [layer("bottom"), layer("top", thickness=0.7e-3)]
EXACT = {"dt": 1.0, "newton_tolerance": 1e-11}


def on_path(path, normal, layers, stations=31, **more):
    """A ribbon on a path, clamped at its start."""
    ribbon = rod(layers, stations=stations, width=2e-3, clamp_start="wall", **more)
    return ribbon | {"path": path, "normal": list(normal)}


def choices():
    for name in PATHS:
        for layers, model in ((ONE, "two_rod"), (TWO, "two_rod"), (TWO, "laminate")):
            for dimension in (2, 3) if name.startswith("flat") else (3,):
                yield pytest.param(name, layers, model, dimension, id=f"{name}, {len(layers)}, {model}, {dimension}-D")


@pytest.mark.parametrize(("name", "layers", "model", "dimension"), list(choices()))
def test_a_rod_on_a_path_starts_without_stress_and_stays(name, layers, model, dimension):
    ribbon = on_path(*PATHS[name], layers)
    simulator = Simulator(load_scene(scene([ribbon], bodies=[fixed()])), model=model, dimension=dimension)
    start = simulator.positions.copy()
    assert sum(simulator.energy().values()) < 1e-18
    simulator.run(0.02)
    assert np.abs(simulator.positions - start).max() < 1e-12


@pytest.mark.parametrize("model", ["two_rod", "laminate"])
def test_copies_profiles_imperfections_and_second_clamps_leave_it_without_stress(model):
    varying = [
        layer("bottom", thickness={"at": [0, 0.1], "value": [1e-3, 0.6e-3]}),
        layer("top", interval=[0.02, 0.09], stiffness={"at": [0, 0.1], "value": [1.0, 0.5]}),
    ]
    rods = []
    for index, (path, normal) in enumerate(PATHS.values()):
        ribbon = on_path(path, normal, varying, name=f"rod{index}", clamp_end="wall", pattern={"count": 2})
        ribbon["imperfection"] = {"shape": "random", "size": 1e-4, "direction": "both"}
        rods.append(ribbon)
    simulator = Simulator(load_scene(scene(rods, bodies=[fixed()])), model=model)
    start = simulator.positions.copy()
    assert sum(simulator.energy().values()) < 1e-16
    simulator.run(0.005)
    assert np.abs(simulator.positions - start).max() < 1e-11


@pytest.mark.parametrize("model", ["two_rod", "laminate"])
def test_a_spline_through_points_of_a_circle_bends_as_the_arc(model):
    arc = {"shape": "arc", "start": [0, 0, 0], "direction": [1, 0, 0], "radius": 0.05, "angle": 1.2}
    angle = np.linspace(0.0, 1.2, 25)
    points = 0.05 * np.stack([np.sin(angle), 0.0 * angle, 1.0 - np.cos(angle)], axis=1)
    pull = {"name": "pull", "rod": "rod", "position": 0.04, "force": [2e-3, 1e-3, -3e-3]}
    cargo = {"name": "cargo", "rod": "rod", "position": 0.05, "mass": 1e-4}
    ends = []
    for path in (arc, {"shape": "spline", "points": points.tolist()}):
        content = scene(
            [on_path(path, (0, 0, 1), TWO)], bodies=[fixed()], loads=[pull], masses=[cargo], gravity=[0, 0, -10]
        )
        simulator = Simulator(load_scene(content), model=model)
        before = simulator.positions.copy()
        simulator.solve_static()
        ends.append(simulator.positions - before)
    assert np.abs(ends[0]).max() > 1e-4
    assert ends[1] == pytest.approx(ends[0], abs=2e-3 * np.abs(ends[0]).max())


def frame_of_two_bars(stations):
    """Two bars of 50 mm at a right angle, the first clamped, a force at the end along the first [m, by theory]."""
    side, force = 0.05, 1e-6
    path = {"shape": "polyline", "points": [[0, 0, 0], [side, 0, 0], [side, 0, side]]}
    pull = {"name": "pull", "rod": "rod", "position": 2.0 * side, "force": [force, 0, 0]}
    content = scene([on_path(path, (0, 0, 1), ONE, stations)], bodies=[fixed()], loads=[pull])
    simulator = Simulator(load_scene(content))
    simulator.solve_static()
    bending = GEL["youngs_modulus"] * 2e-3 * 1e-3**3 / 12.0
    return simulator.positions[-1, 0] - side, 4.0 / 3.0 * force * side**3 / bending


@pytest.mark.parametrize("stations", [21, 41, 81])
def test_a_corner_of_a_polyline_passes_the_moment_on_with_one_stiff_joint(stations):
    found, expected = frame_of_two_bars(stations)
    missing = (1.0 - np.cos(0.25 * np.pi) ** 4) * (2.0 / (stations - 1)) / (4.0 / 3.0)  # of the length of an edge
    assert found / expected == pytest.approx(1.0 - missing, abs=2e-3)


@pytest.mark.parametrize("model", ["two_rod", "laminate"])
@pytest.mark.parametrize("name", ["helix", "spline", "polyline with normals"])
def test_a_turned_scene_has_the_turned_result(name, model):
    rotation = rotation_matrix(np.array([0.4, -1.1, 0.7]))
    results = []
    for turn in (np.eye(3), rotation):
        path, normal = PATHS[name]
        path = {key: value for key, value in path.items()}
        for key in {"start", "axis", "points", "normals"} & path.keys():
            path[key] = (np.array(path[key]) @ turn.T).tolist()
        ribbon = on_path(path, turn @ normal, [layer("bottom"), layer("top", natural_curvature=30.0)])
        gravity = turn @ np.array([1.0, 2.0, -10.0])
        simulator = Simulator(load_scene(scene([ribbon], bodies=[fixed()], gravity=gravity.tolist())), model=model)
        simulator.solve_static()
        results.append(simulator.positions @ turn)
    assert results[1] == pytest.approx(results[0], abs=1e-8)


def test_turns_of_a_helix_that_touch_push_each_other_apart():
    coil = HELIX | {"pitch": 1.6e-3, "angle": "2.5 turns"}
    content = scene([on_path(coil, (-1, 0, 0), ONE, 101)], bodies=[fixed()], contact=contact(barrier_distance=1e-3))
    simulator = Simulator(load_scene(content))
    assert simulator.model.rod_search.exists
    start = simulator.positions[-1, 2]
    simulator.run(0.01)
    assert simulator.positions[-1, 2] > start + 1e-6
