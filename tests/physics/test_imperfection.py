"""Imperfections: free of stress, of the size and shape that they say, and what they do to columns that buckle."""

import numpy as np
import pytest
from support.sample_scenes import fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SceneError
from bilayer_core.log.run.memory import MemoryRecorder
from bilayer_core.model.imperfect_shapes import departure
from bilayer_core.model.plan import MODELS
from bilayer_core.scene.bundled import bundled_scenes
from bilayer_core.verification.validate.beams import imperfect_column
from bilayer_core.verification.validate.plane import blade

SIZE = 1e-4
PATHS = {
    "straight": {"shape": "straight", "length": 0.1},
    "arc": {"shape": "arc", "radius": 0.05, "angle": 1.5},
    "spiral": {"shape": "spiral", "start_radius": 0.05, "end_radius": 0.03, "angle": 2.0},
}
CLAMPS = {
    "free": {},
    "start": {"clamp_start": "wall"},
    "end": {"clamp_end": "wall"},
    "both": {"clamp_start": "wall", "clamp_end": "wall"},
}


def strip(path="straight", clamps="start", layers=None, shape="random", **imperfection):
    """A strip of 41 stations with an imperfection of 0.1 mm, in the words of a scene."""
    part = rod(layers or [layer(), layer("top")], stations=41, **CLAMPS[clamps])
    part["path"] = {**PATHS[path], "start": [0, 0, 0], "direction": [1, 0, 0]}
    part["imperfection"] = {"shape": shape, "size": SIZE, **imperfection}
    return part


def strut(imperfection=None, **solver):
    """A strip between two walls that grows by 2 % within a second."""
    growing = layer(eigenstrain={"stimulus": "heat", "gain": 0.02})
    part = rod([growing], stations=41, clamp_start="left", clamp_end="right", imperfection=imperfection)
    soft = {"gel": {"youngs_modulus": 1e6, "poisson_ratio": 0.5, "density": 1000.0}}
    heat = {"schedule": {"type": "ramp", "start": 0, "end": 1, "from": 0, "to": 1}}
    walls = [fixed("left"), fixed("right", (0.1, 0, 0))]
    content = scene([part], bodies=walls, stimuli={"heat": heat}, materials=soft, damping={"mass": 5.0})
    return load_scene({**content, "solver": solver, "duration": 0.3})


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("clamps", CLAMPS)
@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("direction", ["normal", "across", "both"])
def test_the_start_is_free_of_stress(model, path, clamps, direction):
    content = scene([strip(path, clamps, direction=direction)], bodies=[fixed()])
    simulator = Simulator(load_scene(content), model=model, dimension=3)
    stretched = 1e8 * 0.01 * 2e-3 * 0.1 * 1e-6**2  # energy of a strain of 1e-6 [J]
    assert sum(abs(energy) for energy in simulator.energy().values()) < 1e-10 * stretched
    assert np.ptp(simulator.positions[:, 1 if direction == "across" else 2]) > 0.3 * SIZE


@pytest.mark.parametrize("model", MODELS)
def test_a_layer_with_a_natural_curvature_keeps_it(model):
    shapes = []
    for bent in ({}, {"natural_curvature": 0.0}):
        part = strip(layers=[layer("only", thickness=2e-3, **bent)], direction="both")
        simulator = Simulator(load_scene(scene([part], bodies=[fixed()])), model=model)
        simulator.solve_static()
        shapes.append(simulator.positions)
    np.testing.assert_allclose(shapes[1], shapes[0], atol=1e-6 * SIZE)


@pytest.mark.parametrize("clamps", CLAMPS)
@pytest.mark.parametrize("shape", ["bow", "random"])
def test_the_largest_departure_is_the_size_and_clamped_ends_stay(clamps, shape):
    part = load_scene(scene([strip(clamps=clamps, shape=shape, direction="both")], bodies=[fixed()])).rods[0]
    distance, slope = departure(part, np.linspace(0.0, 0.1, 2001))
    assert np.linalg.norm(distance, axis=1).max() == pytest.approx(SIZE, rel=1e-4)
    np.testing.assert_allclose(np.gradient(distance, 0.1 / 2000, axis=0)[1:-1], slope[1:-1], atol=1e-4 * SIZE / 0.1)
    for end, name in ((0, "clamp_start"), (-1, "clamp_end")):
        if name in CLAMPS[clamps]:
            assert np.abs(distance[end]).max() < 1e-12 * SIZE and np.abs(slope[end]).max() < 1e-12 * SIZE / 0.1


def test_random_shapes_follow_their_seed():
    def start(seed):
        content = scene([strip(seed=seed, direction="both")], bodies=[fixed()])
        return Simulator(load_scene(content)).positions

    assert np.array_equal(start(1), start(1))
    assert np.abs(start(1) - start(2)).max() > 0.1 * SIZE


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("direction", "dimension"), [("normal", 2), ("normal", 3), ("across", 3)])
@pytest.mark.parametrize("part", [0.3, 0.9])
def test_a_column_bows_as_far_as_its_imperfection_and_load_say(direction, dimension, part, model):
    found, answer = imperfect_column(part, direction, dimension, model)
    assert found == pytest.approx(answer, rel=1e-3)


def test_a_strut_that_grows_buckles_at_a_time_of_its_own():
    """Without an imperfection it stays straight as long as no rounding bends it: here for ever."""

    def time_of_snap(config):
        simulator, seen = Simulator(config), MemoryRecorder(rate=1e4)  # steps of milliseconds would round the time
        simulator.run(observers=[seen])
        return next((of.time for of in seen.frames if np.abs(of.positions[:, 2]).max() > 5e-4), None)

    assert time_of_snap(strut()) is None
    imperfect = {"shape": "random", "size": 1e-5, "seed": 3}
    times = [time_of_snap(strut(imperfect, tolerance=tolerance)) for tolerance in (1e-6, 1e-7)]
    assert times[0] == pytest.approx(times[1], rel=0.01)


def test_a_departure_from_the_plane_is_computed_in_space():
    content = blade(1.5) | {"duration": 2.0}
    assert Simulator(load_scene(content)).plan.dimension == 2
    content["rods"][0]["imperfection"] = {"shape": "bow", "size": 1e-5, "direction": "across"}
    with pytest.raises(SceneError, match=r"found 2, but rods\.rod\.imperfection leaves the plane y = 0"):
        Simulator(load_scene(content))
    simulator = Simulator(load_scene({**content, "solver": {}}))
    assert simulator.plan.dimension == 3
    simulator.run()
    assert np.abs(simulator.positions[:, 1]).max() > 1e-2  # the remedy that a run in the plane names


def pressed(force, **more):
    """A column along x that a force on its tip loads."""
    load = {"name": "press", "rod": "rod", "position": 0.1, "force": force}
    return load_scene(scene([rod([layer()], clamp_start="wall", **more)], bodies=[fixed()], loads=[load]))


def advice_of(config):
    return [text for text in Simulator(config).plan.warnings if "imperfection" in text]


def test_check_advises_where_rounding_decides():
    assert "declare `imperfection: {shape: random, size: 10 um}`" in advice_of(strut())[0]
    assert "is pressed along its axis" in advice_of(pressed([-1e-3, 0, 0]))[0]
    small = {"shape": "bow", "size": 1e-5}
    for config in (
        strut(small),
        pressed([-1e-3, 0, 0], imperfection=small),
        pressed([1e-3, 0, 0]),  # it is pulled
        pressed([-1e-3, 0, 1e-6]),  # it is bent
    ):
        assert advice_of(config) == []


@pytest.mark.parametrize("name", bundled_scenes())
def test_no_bundled_scene_needs_an_imperfection(name):
    assert advice_of(load_scene(name)) == []


@pytest.mark.parametrize(
    ("imperfection", "fault"),
    [
        ({"shape": "bow"}, "rods.rod.imperfection.size: is missing; must be a length [m] above 0"),
        ({"shape": "bow", "size": 0}, "rods.rod.imperfection.size: found 0; must be a length [m] above 0"),
        (
            {"shape": "bow", "size": "2 cm"},
            "imperfection.size: found 0.02; must be at most 0.01 m: a tenth of the path",
        ),
        ({"shape": "wavy", "size": 1e-5}, "rods.rod.imperfection.shape: found \"wavy\"; must be 'bow' or 'random'"),
        ({"shape": "bow", "size": 1e-5, "direction": "up"}, "imperfection.direction: found \"up\"; must be 'normal'"),
        ({"shape": "random", "size": 1e-5, "seed": -1}, "rods.rod.imperfection.seed: found -1; must be"),
    ],
)
def test_bad_imperfections_are_refused_by_key_value_and_what_is_allowed(imperfection, fault):
    with pytest.raises(SceneError) as refused:
        load_scene(scene([rod([layer()], imperfection=imperfection)]))
    assert fault in str(refused.value)
