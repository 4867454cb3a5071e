"""Strips with fibres at an angle and layers of unlike Poisson's ratios, through the engine."""

import functools
import math

import numpy as np
import pytest
from oracles.plate_strip_across import Strip, orthotropic
from support.evaluations import Problem, check
from support.sample_scenes import GEL, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import SceneError, SimulationError

HUMID = {"stimulus": "humidity", "gain": 0.02}
STIFF = {"along": {"stiffness": 6.0, "swelling": 0.1}, "shear": 1.3}


def crossed(degrees=30.0, width=4e-3, stations=7, ratios=(0.4, 0.4), fibres=STIFF, **more):
    """A clamped strip 0.5 mm thick, of two layers whose fibres cross at right angles."""
    layers = [
        layer(name, h, name, eigenstrain=HUMID, fibres={"angle": math.radians(degrees + turn), **fibres})
        for name, h, turn in (("bottom", 0.2e-3, 0.0), ("top", 0.3e-3, 90.0))
    ]
    gel = {**GEL, "retardation_time": 1e-3}
    return scene(
        [rod(layers, 1.1e-3 * (stations - 1), stations, width=width, section="strip", clamp_start="wall") | more],
        bodies=[fixed()],
        stimuli={"humidity": {"schedule": {"type": "hold", "value": 0.5}}},
        materials={
            name: {**gel, "poisson_ratio": ratio} for name, ratio in zip(("bottom", "top"), ratios, strict=True)
        },
    )


def plain(**how):
    """The same strip without its fibres."""
    content = crossed(**how)
    for own in content["rods"][0]["layers"]:
        del own["fibres"]
    return content


@pytest.mark.parametrize(
    ("content", "dimension"),
    [(crossed(), 3), (crossed(90.0), 2), (plain(ratios=(0.1, 0.45)), 2), (plain(ratios=(0.1, 0.45)), 3)],
)
def test_derivatives_agree_with_differences(content, dimension):
    problem = Problem(content, np.random.default_rng(1), "laminate", dimension=dimension)
    check(problem)
    check(problem, ("viscosity",))


def test_fibres_that_run_across_are_a_layer_that_swells_along_only():
    ends = []
    for how in ({"fibres": {"angle": 0.5 * math.pi, "along": {"swelling": 0.0}}}, {"swelling": "along"}):
        content = plain()
        content["rods"][0]["layers"][1] |= how
        content["rods"][0]["layers"][0]["eigenstrain"] = None
        simulator = Simulator(load_scene(content), model="laminate")
        simulator.solve_static()
        ends.append(simulator.positions)
    assert ends[0] == pytest.approx(ends[1], abs=1e-12)


def test_opposite_angles_and_mirror_images_have_the_same_curvature_and_opposite_twist():
    pattern = {"pattern": {"type": "mirror", "axis": [0, 1, 0], "center": [0, 0.01, 0]}}
    ends = []
    for degrees, more in ((30.0, pattern), (-30.0, {})):
        simulator = Simulator(load_scene(crossed(degrees, stations=15, **more)), model="laminate")
        simulator.solve_static()
        ends += [view.positions for view in simulator.rods.values()]
    rod_itself, image, opposite = ends
    assert abs(rod_itself[-1, 1]) > 1e-4
    assert image == pytest.approx(rod_itself * [1, -1, 1] + [0, 0.02, 0], abs=1e-11)
    assert opposite == pytest.approx(rod_itself * [1, -1, 1], abs=1e-11)


def test_a_wide_strip_cut_at_45_degrees_folds_since_each_joint_may_bend_either_way():
    content = crossed(45.0, width=20e-3, stations=9, fibres={"along": {"swelling": 0.0}})
    content["rods"][0]["path"]["length"] = 0.1
    content["stimuli"]["humidity"]["schedule"]["value"] = 1.0
    simulator = Simulator(load_scene(content), model="laminate")
    with pytest.raises(SimulationError, match=r"rods\.rod folds: its parts are in two shapes of rest"):
        simulator.solve_static()


def test_fibres_at_an_angle_leave_the_plane():
    with pytest.raises(SceneError, match=r"rods\.rod\.layers\.bottom\.fibres turn the rod out of the plane"):
        Simulator(load_scene(crossed()), model="laminate", dimension=2)


def test_two_rods_cannot_have_fibres():
    with pytest.raises(SceneError, match="no part across the width"):
        Simulator(load_scene(crossed()), model="two_rod")


BENT = {"natural_curvature": {"at": [0.0, 6e-3], "value": [3.0, 9.0]}, "natural_twist": 5.0}


def varied(part=0.7, **how):
    """The strip of `crossed`, whose lower layer ends at a part of its length, and whose upper one grows thicker and
    stiffer along it; both are curved and twisted by themselves.
    """
    content = crossed(**how)
    length = content["rods"][0]["path"]["length"]
    for own in content["rods"][0]["layers"]:
        own |= BENT
    bottom, top = content["rods"][0]["layers"]
    bottom["interval"] = [0.0, part * length]
    top["thickness"] = {"at": [0.0, length], "value": [0.2e-3, 0.3e-3]}
    top["stiffness"] = {"at": [0.3 * length, 0.6 * length], "value": [1.0, 2.0]}
    if "fibres" in top:
        top["fibres"] |= {"angle": {"at": [0.0, length], "value": [-0.4, 1.2]}}
    return content


@pytest.mark.parametrize("part", [0.35, 0.7])
@pytest.mark.parametrize("ratios", [(0.4, 0.4), (0.1, 0.45)])
def test_derivatives_agree_with_differences_where_sections_with_fibres_vary(part, ratios):
    problem = Problem(varied(part, ratios=ratios), np.random.default_rng(1), "laminate", dimension=3)
    assert problem.model.off_axis.exists and problem.model.flattening.coupling.all()
    check(problem, ("flattening",))
    check(problem)


@pytest.mark.parametrize("sections", [crossed, functools.partial(varied, 0.4)], ids=["even", "varied"])
def test_the_work_of_a_stimulus_that_twists_a_strip_is_what_it_gains(sections):
    content = sections(stations=15) | {"gravity": [0.0, 0.0, -9.81]}
    ramp = {"type": "ramp", "start": 0.005, "end": 0.015, "from": 0.4, "to": 1.0}
    content["stimuli"]["humidity"]["schedule"] = ramp
    content["solver"] = {"integrator": "sdirk2", "dt": 2e-5, "newton_tolerance": 1e-10}
    simulator = Simulator(load_scene(content), model="laminate", budget=True)
    simulator.run(0.02)
    simulator.set_stimulus("humidity", 0.2)  # a jump
    simulator.run(0.01)
    assert abs(simulator.summary()["numerical_energy"]) < 1e-3 * simulator.summary()["largest_energy"]


def rest(content):
    """Curvature and twist at inner nodes at rest [1/m], shape (n_node − 2, 2)."""
    simulator = Simulator(load_scene(content), model="laminate")
    simulator.solve_static()
    model, twist = simulator.model, np.zeros(simulator.model.node_count)
    joints = np.arange(model.rods.bend_count)
    twist[model.joint_node[joints]] = simulator._state.twist[joints] / model.voronoi_length[joints]
    return np.stack([simulator.curvatures, twist], axis=1)[1:-1]


@pytest.mark.parametrize("fibres", [STIFF, {"across": {"swelling": 0.0}}, {}])
@pytest.mark.parametrize("part", [0.6, 0.4])
def test_a_patch_with_fibres_bends_and_twists_as_a_strip_of_its_section(fibres, part):
    """The curve is on the axis of the patch, or on that of the rest, which neither bends nor twists."""
    whole, patch = (crossed(stations=41, ratios=(0.1, 0.45), fibres=fibres) for _ in range(2))
    patch["rods"][0]["layers"][0]["interval"] = [0.0, part * patch["rods"][0]["path"]["length"]]
    for content in (whole, patch):
        content["rods"][0]["layers"][1]["eigenstrain"] = None
    wanted, found = rest(whole), rest(patch)
    assert np.abs(wanted[2]).max() > 1.0
    assert found[2:13] == pytest.approx(wanted[2:13], rel=1e-4, abs=1e-4)
    assert found[-10:] == pytest.approx(np.zeros((10, 2)), abs=1e-4)


def test_crossed_layers_that_grow_thicker_bend_and_twist_by_the_thickness_of_the_place():
    content = crossed(30.0, 1e-3, 41, fibres={"across": {"swelling": 0.0}})
    length = content["rods"][0]["path"]["length"]
    for own in content["rods"][0]["layers"]:
        own["thickness"] = {"at": [0.0, length], "value": [0.1e-3, 0.2e-3]}
        own["eigenstrain"] = {**HUMID, "gain": 1e-3}
    whole = 2.0 * np.interp(np.linspace(0.0, length, 41), [0.0, length], [0.1e-3, 0.2e-3])[1:-1]
    wanted = 1.5 * 0.5e-3 / whole[:, None] * [math.cos(math.pi / 3.0), math.sin(math.pi / 3.0)]
    assert np.abs(rest(content)) == pytest.approx(wanted, rel=2e-3)


def turning(*degrees, stations=41):
    """The strip of `crossed`, whose fibres turn along it, so narrow and swelling so little that it stays a beam."""
    content = crossed(0.0, 1e-3, stations, fibres={"across": {"swelling": 0.0}})
    length = content["rods"][0]["path"]["length"]
    for own, more in zip(content["rods"][0]["layers"], (0.0, 90.0), strict=True):
        value = [f"{angle + more} deg" for angle in degrees]
        own |= {"thickness": 0.15e-3, "eigenstrain": {**HUMID, "gain": 1e-3}}
        own["fibres"] |= {"angle": {"at": np.linspace(0.0, length, len(degrees)).tolist(), "value": value}}
    return content


def test_fibres_that_turn_along_a_strip_bend_and_twist_it_by_the_angle_of_the_place():
    angle = 2.0 * np.radians(np.linspace(-20.0, 40.0, 41))[1:-1]
    wanted = 1.5 * 0.5e-3 / 0.3e-3 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert np.abs(rest(turning(-20.0, 40.0)) - wanted).max() < 3e-3


def test_fibres_that_turn_along_a_strip_leave_its_plane():
    for degrees in ((0.0, 90.0), (20.0, 20.0)):
        with pytest.raises(SceneError, match=r"rods\.rod\.layers\.bottom\.fibres turn the rod out of the plane"):
            Simulator(load_scene(turning(*degrees)), model="laminate", dimension=2)


def test_profiles_of_angles_must_lie_on_the_path_and_close_with_it():
    content = turning(0.0, 90.0)
    content["rods"][0]["layers"][1]["fibres"]["angle"]["at"][1] = 0.2
    with pytest.raises(
        SceneError, match=r"layers\.top\.fibres\.angle\.at\[1\]: found 0.2; must be a length \[m\] along"
    ):
        load_scene(content)
    round_path = {"shape": "arc", "start": [0, 0, 0], "direction": [1, 0, 0], "radius": 0.05, "angle": "1 turn"}
    rings = [turning(0.0, last) for last in (180.0, 90.0)]
    for content in rings:
        content["rods"][0] |= {"path": round_path | {"closed": True}, "clamp_start": None}
    load_scene(rings[0])
    with pytest.raises(SceneError, match='angle: found "a profile"; must be the same direction where a closed path'):
        load_scene(rings[1])


@pytest.mark.parametrize(("width", "thin"), [(4e-3, 1.0), (20e-3, 0.1)])
@pytest.mark.parametrize("fibres", [STIFF, {}])
def test_layers_with_fibres_that_are_curved_and_twisted_bend_as_a_plate(width, thin, fibres):
    content = crossed(width=width, stations=31, ratios=(0.1, 0.45), fibres=fibres)
    content["rods"][0]["path"]["length"] = 0.1
    plates, bent = [], (6.0 * thin, 3.0 * thin)
    for own, ratio in zip(content["rods"][0]["layers"], (0.1, 0.45), strict=True):
        own |= {"thickness": thin * own["thickness"], "eigenstrain": None}
        own |= {"natural_curvature": bent[0], "natural_twist": bent[1]}
        stiff = own["fibres"].get("along", {}).get("stiffness", 1.0) * GEL["youngs_modulus"]
        shear = own["fibres"].get("shear", 1.0) * GEL["youngs_modulus"] / (2.0 * (1.0 + ratio))
        compliance = orthotropic(stiff, GEL["youngs_modulus"], ratio, shear)
        plates.append((own["thickness"], compliance, (0.0, 0.0), own["fibres"]["angle"], bent))
    plate = Strip(width, plates, strained=bent[1])
    assert rest(content)[15] == pytest.approx(plate.rest(rest(content)[15]), rel=2e-3)


@pytest.mark.parametrize(("width", "twist"), [(4e-3, 30.0), (20e-3, 3.0)])
@pytest.mark.parametrize("fibres", [None, {"angle": 0.5, **STIFF}])
def test_a_single_layer_rests_at_its_natural_twist_however_wide(width, twist, fibres):
    content = crossed(width=width, stations=21)
    content["rods"][0]["layers"] = [layer("top", 0.3e-3, "top", natural_twist=twist, fibres=fibres)]
    del content["stimuli"]
    assert rest(content) == pytest.approx(np.tile([0.0, twist], (19, 1)), abs=1e-6)
