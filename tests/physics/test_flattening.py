"""Strips whose section bends: derivatives, the table of wide strips, and their energy account."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support.evaluations import Problem, at_rest, check
from support.sample_scenes import GEL, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene, read_log
from bilayer_core.errors import SceneError, SimulationError
from bilayer_core.forces.flattening import SERIES, flatness
from bilayer_core.jit import UNALLOCATED
from bilayer_core.kinematics.rotation import rotation_matrix
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.log.run.memory import MemoryRecorder
from bilayer_core.model.build_model import build_model
from bilayer_core.model.plate_strip import flattening_series
from bilayer_core.simulation.strip_sections import shapes
from bilayer_core.verification.validate.closed_forms import PlateStrip
from bilayer_core.view.colouring import choose_colouring

TABLE = {
    0.3: {0.5: 0.997, 1.0: 0.989, 2.6: 0.941, 3.0: 0.927, 4.3: 0.888, 6.0: 0.863, 10.0: 0.974, 20.0: 1.141}
    | {100.0: 1.237},
    0.5: {0.5: 0.998, 1.0: 0.992, 2.0: 0.971, 2.6: 0.956, 3.0: 0.946, 4.3: 0.918, 5.0: 0.911, 6.0: 0.919}
    | {10.0: 1.156, 20.0: 1.326, 36.0: 1.38, 100.0: 1.432},
}
"""κ/κ₀ of layers that swell alike in all directions, by ν and w²κ₀/H."""
WIDTH, THICKNESS = 20e-3, 0.2e-3


def swollen(ratio, poisson, swelling="isotropic", dimension=3, values=(1.0,)):
    """A clamped strip of two like layers, by its w²κ₀/H, at rest after each value of its stimulus: the last report, and
    κ/κ₀.
    """
    curvature = ratio * THICKNESS / WIDTH**2
    law = {"stimulus": "heat", "gain": curvature * THICKNESS / 1.5}
    half = {"thickness": 0.5 * THICKNESS}
    layers = [layer("bottom", eigenstrain=law, swelling=swelling, **half), layer("top", **half)]
    strip = rod(layers, length=0.2, stations=11, width=WIDTH, clamp_start="wall") | {"section": "strip"}
    simulator = Simulator(
        load_scene(
            scene(
                [strip],
                bodies=[fixed()],
                materials={"gel": {**GEL, "poisson_ratio": poisson}},
                stimuli={"heat": {"schedule": {"type": "hold", "value": 0}}},
            )
        ),
        model="laminate",
        dimension=dimension,
    )
    for value in values:
        simulator.set_stimulus("heat", value)
        report = simulator.solve_static()
    return report, simulator.curvatures / curvature


HUMID = {"stimulus": "humidity", "gain": 0.02}


def wide(swelling="isotropic", stations=7, poisson=0.4, width=4e-3, **more):
    """A clamped bilayer strip of two moduli, 0.5 mm thick, whose layers both swell."""
    layers = [
        layer("bottom", thickness=0.2e-3, material="base", swelling=swelling, eigenstrain={**HUMID, "gain": -0.01}),
        layer("top", thickness=0.3e-3, eigenstrain=HUMID),
    ]
    strip = rod(layers, length=1.1e-3 * (stations - 1), stations=stations, width=width, clamp_start="wall")
    gel = {**GEL, "poisson_ratio": poisson, "retardation_time": 1e-3}
    return scene(
        [strip | {"section": "strip"} | more],
        bodies=[fixed()],
        stimuli={"humidity": {"schedule": {"type": "hold", "value": 0.5}}},
        materials={"gel": gel, "base": {**gel, "youngs_modulus": 3.0 * gel["youngs_modulus"]}},
    )


@pytest.mark.parametrize("swelling", ["isotropic", "along", "across"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_derivatives_of_flattening_agree_with_differences(swelling, dimension):
    problem = Problem(wide(swelling), np.random.default_rng(1), "laminate", dimension=dimension)
    check(problem, ("flattening",))
    assert problem.terms["flattening"] > 0.0
    check(problem)


BUILD = "bilayer_core.simulation.simulator.build_model"


def anisotropic(model, hand=1.0, skew=0.3, coupling=0.2, offset=-0.3):
    """A model whose strips have a₃ and β, couple bending with twist, and are twisted by what bends them."""
    strips, drives, rods = model.flattening, model.drives, model.rods
    count, twists = len(strips.joint), drives.driven_joint < strips.first
    offsets = np.full(count, offset)
    changed = {
        "skew": np.full(count, hand * skew),
        "coupling": hand * coupling * rods.joint_stiffness[strips.joint, 0],
        "offset": offsets,
        "series": flattening_series(offsets),
        "stiffness": strips.stiffness * (1.0 - offset**2),
    }
    more = {
        "driven_joint": drives.driven_joint,
        "driven_joint_column": np.full(len(twists), 2),
        "driven_joint_law": drives.driven_joint_law,
        "driven_joint_weight": 0.7 * hand * drives.driven_joint_weight,
    }
    more = {name: np.concatenate([getattr(drives, name), values[twists]]) for name, values in more.items()}
    kept = {name: getattr(drives, name) for name in drives.names}
    fixed = {name: getattr(strips, name) for name in strips.names if name not in strips.shapes}
    flattening = type(strips).zeros(UNALLOCATED, **fixed | changed)
    return replace(model, flattening=flattening, drives=type(drives)(**kept | more))


@pytest.mark.parametrize("swelling", ["isotropic", "across"])
def test_derivatives_of_anisotropic_strips_agree_with_differences(swelling):
    problem = Problem(wide(swelling), np.random.default_rng(1), "laminate", change=anisotropic)
    assert (problem.model.drives.driven_joint_column == 2).any() or swelling == "across"
    check(problem, ("flattening",))
    check(problem)


def test_derivatives_of_strips_with_unlike_layers_in_a_plane_agree_with_differences():
    change = dict(skew=0.0, coupling=0.0)
    problem = Problem(
        wide("across"), np.random.default_rng(1), "laminate", dimension=2, change=lambda m: anisotropic(m, **change)
    )
    check(problem, ("flattening",))
    check(problem)


def bent_strip(change=lambda model: model, size=1.0, length=1e3):
    """An evaluator of a free strip over a stage of a length [s], and a configuration in which it is bent and twisted at
    random, by so much.
    """
    content = wide() | {"bodies": []}
    content["rods"][0].pop("clamp_start")
    evaluator, start = at_rest(change(build_model(load_scene(content), "laminate")), length)
    model, rng, shape = evaluator.model, np.random.default_rng(2), evaluator.new()
    step = np.zeros(model.layout.size)
    step[model.layout.node[:, None] + np.arange(3)] = 5e-5 * size * rng.standard_normal((model.node_count, 3))
    step[model.layout.edge] = 0.2 * size * rng.standard_normal(model.rods.edge_count)
    evaluator.move(start, step, np.zeros((0, 6)), shape)
    return evaluator, shape


def test_rigid_motion_leaves_the_energy_of_an_anisotropic_strip_unchanged():
    evaluator, shape = bent_strip(anisotropic)
    before = evaluator.evaluate(shape, ("flattening",))["flattening"]
    turn, moved = rotation_matrix(np.array([0.4, -1.1, 2.0])), evaluator.new()
    moved.position[:] = shape.position @ turn.T + [0.3, -0.2, 0.7]
    for name in ("tangent", "director1", "director2"):
        getattr(moved, name)[:] = getattr(shape, name) @ turn.T
    moved.length[:] = shape.length
    assert before != 0.0
    assert evaluator.evaluate(moved, ("flattening",))["flattening"] == pytest.approx(before, rel=1e-10)


def test_viscosity_has_all_of_the_stiffness_of_a_narrow_strip_with_fibres():
    evaluator, shape = bent_strip(lambda model: anisotropic(model, coupling=0.5), 1e-4, length=2e-3)
    names = ("stretching", "bending", "twisting", "flattening")
    found = evaluator.evaluate(shape, (*names, "viscosity"))
    assert abs(found["flattening"]) > 1e-4 * found["bending"]
    assert found["viscosity"] == pytest.approx(0.5 * sum(found[name] for name in names), rel=1e-5)


def section_energy(x, offset, degree=30):
    """1 − g of a section: the least energy, over all ways in which it may curve across, of the mean of p² + D* v²."""
    places, weights = np.polynomial.legendre.leggauss(80)
    across, plate = math.copysign(1.0, x), 4.0 / x**2  # κ and D₂₂ for Ẽ = 1 and w = 2
    even = [np.polynomial.Polynomial.basis(n) for n in range(0, degree, 2)]
    curved = np.stack([of(places) for of in even], axis=1)
    strain = -across * np.stack([of.integ(2)(places) for of in even], axis=1)
    force = np.column_stack([strain + offset * math.sqrt(plate) * curved, np.ones(len(places))])
    stiff = plate * (1.0 - offset**2)
    bend = math.sqrt(stiff) * np.column_stack([curved, np.zeros(len(places))])
    root = np.sqrt(0.5 * weights)
    matrix = np.concatenate([root[:, None] * force, root[:, None] * bend])
    right = np.concatenate([root * 0.5 * across * places**2, 0.0 * root])
    _, rest, _, _ = np.linalg.lstsq(matrix / np.abs(matrix).max(axis=0), right, rcond=None)
    return float(rest[0]) / stiff


@pytest.mark.parametrize("offset", [0.0, 0.3, -0.3, -0.7])
def test_flatness_is_the_least_energy_of_a_section(offset):
    series = flattening_series([offset])
    for x in (1.0, -1.0, 6.0, -6.0, 20.0, -20.0):
        assert x**2 * flatness(series, 0, offset, x)[0] == pytest.approx(section_energy(x, offset), rel=1e-7), x


def test_strips_of_like_layers_have_the_energy_of_their_closed_form():
    evaluator, shape = bent_strip()
    model = evaluator.model
    strips, rods, poisson = model.flattening, model.rods, 0.4
    found = evaluator.evaluate(shape, ("flattening",))["flattening"]
    width, length = 2.0 * rods.half_width[0], model.voronoi_length[strips.joint]
    stiffness = width**4 * rods.axial_stiffness[0] / (4.0 * length**3)
    scale = stiffness * (1.0 - poisson**2) / rods.joint_stiffness[strips.joint, 0]
    along, across = (evaluator.stage.rest_joint[rows, 0] for rows in (strips.joint, slice(strips.first, None)))
    kappa, _, twist = shape.joint_strain[strips.joint].T
    missing = kappa * (across + poisson * (along - kappa)) - twist**2
    x = np.sqrt(scale) * kappa
    energy = 0.5 * stiffness * missing**2 * (1.0 - exact_factor(x, 0.0)) / x**2
    assert found == pytest.approx(energy.sum(), rel=1e-9) != 0.0


def test_the_mirror_image_of_an_anisotropic_strip_twists_the_other_way(monkeypatch):
    shapes = []
    for hand in (1.0, -1.0):
        monkeypatch.setattr(BUILD, lambda *model, hand=hand: anisotropic(build_model(*model), hand))
        simulator = Simulator(load_scene(wide(stations=11)), model="laminate", dimension=3)
        assert simulator.solve_static().stable
        shapes.append((simulator.positions, simulator._state.twist.copy()))
    (position, twist), (mirrored, opposite) = shapes
    assert np.abs(twist).max() > 1e-3
    assert opposite == pytest.approx(-twist, abs=1e-9)
    assert mirrored * [1.0, -1.0, 1.0] == pytest.approx(position, abs=1e-10)


def exact_factor(x, offset):
    """g of a section, from the roots of its equation."""
    up, down = (np.sqrt((offset + sign) * x + 0j) for sign in (1.0, -1.0))
    return (2.0 * (np.cosh(up) - np.cosh(down)) / (x * (np.sinh(up) / up + np.sinh(down) / down))).real


@pytest.mark.parametrize("offset", [0.0, 0.3, -0.6])
def test_flatness_and_its_derivatives_are_smooth_where_its_series_ends(offset):
    series, end = flattening_series([offset]), math.sqrt(SERIES)

    def found(x):
        return np.array(flatness(series, 0, offset, x))

    for x in (3.0, -3.0, 20.0, -20.0, 50.0, -50.0, 200.0):
        assert found(x)[0] == pytest.approx((1.0 - exact_factor(x, offset)) / x**2, rel=1e-12)
    for x in (0.0, 1.0, -2.0, 20.0, -20.0, 50.0, -50.0):
        h = 1e-3 * max(abs(x), 1.0)
        near, low, high = (found(x + step) for step in (0.0, -h, h))
        assert near[1:] == pytest.approx((high - low)[:2] / (2.0 * h), rel=1e-5, abs=1e-9)
    for sign in (1.0, -1.0):
        assert found(sign * np.nextafter(end, 0.0)) == pytest.approx(found(sign * end), rel=1e-10)
    assert found(0.0)[0] == pytest.approx(1.0 / 180.0, rel=1e-14)
    assert np.isfinite(found(1e15)).all()


@pytest.mark.parametrize("poisson", [0.3, 0.5])
def test_strips_of_every_width_that_were_held_flat_curl_as_plates_do(poisson):
    for ratio, wanted in TABLE[poisson].items():
        report, curvature = swollen(ratio, poisson)
        assert curvature == pytest.approx(np.full(11, wanted), rel=2e-3), ratio
        assert (report.stable, dict(report.strips)) == (True, {"rod": "curled along"})


@pytest.mark.parametrize("poisson", [0.3, 0.5])
def test_strips_in_a_plane_curl_as_plates_do_while_their_stimulus_grows(poisson):
    for ratio, wanted in TABLE[poisson].items():
        _, curvature = swollen(ratio, poisson, dimension=2, values=np.geomspace(0.05, 1.0, 20))
        assert curvature == pytest.approx(np.full(11, wanted), rel=2e-3), ratio


def test_a_strip_held_flat_in_a_plane_rolls_up_across_where_only_twist_leads_on():
    report, curvature = swollen(36.0, 0.5, dimension=2)
    assert np.abs(curvature).max() < 0.03
    assert dict(report.strips) == {"rod": "rolled across"}
    assert report.out_of_plane == report.unstable_directions > 0


def test_a_strip_that_folds_at_rest_is_refused_since_the_mesh_would_say_where():
    with pytest.raises(SimulationError, match=r"rods\.rod folds: .* raise its stimulus in steps"):
        swollen(100.0, 0.5, dimension=2, values=(0.1, 0.2, 0.3))


def free_strip(ratio, stations, swelling=(0.0, 1.0)):
    """A simulator of a strip clamped at its start that swells in two seconds, on a part of it."""
    law = {"stimulus": "heat", "gain": ratio * (THICKNESS / WIDTH) ** 2 / 1.5}
    if swelling != (0.0, 1.0):
        law["interval"] = [0.2 * end for end in swelling]
    half = {"thickness": 0.5 * THICKNESS}
    layers = [layer("bottom", eigenstrain=law, **half), layer("top", **half)]
    strip = rod(layers, length=0.2, stations=stations, width=WIDTH, clamp_start="wall") | {"section": "strip"}
    ramp = {"type": "ramp", "start": 0.0, "end": 2.0, "from": 0.0, "to": 1.0}
    content = scene(
        [strip],
        {"tolerance": 1e-3, "dimension": 2},
        bodies=[fixed()],
        materials={"gel": {**GEL, "poisson_ratio": 0.5, "retardation_time": 0.05}},
        stimuli={"heat": {"schedule": ramp}},
        duration=4.0,
    )
    return Simulator(load_scene(content), model="laminate")


@pytest.mark.parametrize("stations", [21, 41, 81])
def test_a_run_stops_when_a_strip_folds_since_the_mesh_would_say_where(stations):
    simulator = free_strip(36.0, stations)
    with pytest.raises(SimulationError, match=r"rods\.rod folds: .* a slower stimulus, less of it"):
        simulator.run()
    assert simulator.time < 4.0 and simulator.termination == "failed"


def test_strips_that_swell_less_than_they_may_or_only_in_part_do_not_fold():
    for strip in (free_strip(8.0, 41), free_strip(8.0, 41, (0.0, 0.52))):
        strip.run()
        assert shapes(strip.model, strip._state) == {"rod": "curled along"}


def test_a_strip_of_which_a_part_curls_along_and_a_part_across_has_folded():
    simulator = free_strip(36.0, 21)
    simulator.set_stimulus("heat", 1.0)
    state, curvature = simulator._state, 36.0 * THICKNESS / WIDTH**2
    assert simulator.solve_static().strips == {"rod": "rolled across"}
    angle = 1.3 * curvature * 0.01 * np.maximum(np.arange(20) - 9, 0)
    turned = np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=1)
    state.position[1:] = state.position[0] + np.cumsum(0.01 * turned, axis=0)
    state.director1[:] = turned[:, [2, 1, 0]] * [-1.0, 0.0, 1.0]
    assert shapes(simulator.model, state) == {"rod": "folded"}


@pytest.mark.parametrize("stations", [33, 65])
@pytest.mark.parametrize(("width", "shape"), [(0.1 / 12, {}), (0.1 / 4, {"rod": "creased"})])
def test_a_wide_ribbon_sheared_sideways_creases_and_its_run_warns(stations, width, shape):
    ways = [[0.0, 0.0, 0.0], [-0.025, 0.0, 0.0], [-0.025, 0.045, 0.0]]
    motion = {"type": "prescribed", "times": [0.0, 1.0, 2.0], "displacements": ways}
    imperfection = {"shape": "bow", "size": 1e-4}
    ends = {"clamp_start": "wall", "clamp_end": "moved", "imperfection": imperfection}
    content = scene(
        [rod([layer()], 0.1, stations, width=width, section="strip", **ends)],
        {"tolerance": 1e-3, "dimension": 3},
        bodies=[fixed(), {"name": "moved", "position": [0.1, 0.0, 0.0], "motion": motion}],
        materials={"gel": {**GEL, "poisson_ratio": 0.5, "retardation_time": 1e-2}},
        duration=2.0,
    )
    simulator = Simulator(load_scene(content), model="laminate")
    simulator.run()
    assert shapes(simulator.model, simulator._state) == shape
    told = [warning for warning in simulator.summary()["warnings"] if "rods.rod is creased from t = 1." in warning]
    assert len(told) == len(shape)


@pytest.mark.parametrize(("swelling", "wanted"), [("along", 1.0), ("across", 0.0)])
def test_fibres_leave_the_curvature_along_at_that_of_a_narrow_strip(swelling, wanted):
    assert swollen(6.0, 0.3, swelling)[1] == pytest.approx(np.full(11, wanted), abs=1e-9)


def test_layers_that_swell_across_make_a_strip_no_longer():
    content = wide("across")
    content["stimuli"]["humidity"]["schedule"]["value"] = 1.0
    content["rods"][0]["layers"][0]["swelling"] = content["rods"][0]["layers"][1]["swelling"] = "across"
    simulator = Simulator(load_scene(content), model="laminate")
    simulator.solve_static()
    assert simulator.positions[-1, :2] == pytest.approx([6.6e-3, 0.0], abs=1e-12)
    across = simulator.rods["rod"].section_curvature
    assert (across < -1.0).all() and across == pytest.approx(np.full(7, across[3]))


@pytest.mark.parametrize(("swelling", "dimension"), [("isotropic", 2), ("across", 3)])
def test_the_work_of_a_stimulus_on_a_strip_is_what_it_gains(swelling, dimension):
    content = wide(swelling, stations=15) | {"gravity": [0.0, 0.0, -9.81]}
    ramp = {"type": "ramp", "start": 0.005, "end": 0.015, "from": 0.4, "to": 1.0}
    content["stimuli"]["humidity"]["schedule"] = ramp
    content["solver"] = {"integrator": "sdirk2", "dt": 2e-5, "newton_tolerance": 1e-10}
    simulator = Simulator(load_scene(content), model="laminate", dimension=dimension, budget=True)
    simulator.run(0.02)
    simulator.set_stimulus("humidity", 0.2)  # a jump
    simulator.run(0.01)
    assert abs(simulator.summary()["numerical_energy"]) < 1e-3 * simulator.summary()["largest_energy"]


def patched(part, **more):
    """The strip of `wide`, whose lower layer ends at a part of its length."""
    content = wide(**more)
    content["rods"][0]["layers"][0]["interval"] = [0.0, part * content["rods"][0]["path"]["length"]]
    return content


@pytest.mark.parametrize("swelling", ["isotropic", "along"])
@pytest.mark.parametrize("part", [0.35, 0.7])
@pytest.mark.parametrize("dimension", [2, 3])
def test_derivatives_of_strips_agree_with_differences_where_a_layer_ends(swelling, part, dimension):
    problem = Problem(patched(part, swelling=swelling), np.random.default_rng(1), "laminate", dimension=dimension)
    assert problem.model.off_axis.exists
    check(problem, ("flattening",))
    check(problem)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_work_of_a_stimulus_on_a_strip_off_its_axis_is_what_it_gains(dimension):
    content = patched(0.4, stations=15) | {"gravity": [0.0, 0.0, -9.81]}
    ramp = {"type": "ramp", "start": 0.005, "end": 0.015, "from": 0.4, "to": 1.0}
    content["stimuli"]["humidity"]["schedule"] = ramp
    content["solver"] = {"integrator": "sdirk2", "dt": 2e-5, "newton_tolerance": 1e-10}
    simulator = Simulator(load_scene(content), model="laminate", dimension=dimension, budget=True)
    simulator.run(0.02)
    simulator.set_stimulus("humidity", 0.2)  # a jump
    simulator.run(0.01)
    assert abs(simulator.summary()["numerical_energy"]) < 1e-3 * simulator.summary()["largest_energy"]


def swollen_step_by_step(layers):
    """A simulator of a clamped strip of such layers at rest, swollen in twenty steps."""
    strip = rod(layers, length=0.2, stations=41, width=WIDTH, clamp_start="wall", section="strip")
    heat, gel = {"heat": {"schedule": {"type": "hold", "value": 0}}}, {"gel": {**GEL, "poisson_ratio": 0.3}}
    content = scene([strip], bodies=[fixed()], materials=gel, stimuli=heat)
    simulator = Simulator(load_scene(content), model="laminate", dimension=2)
    for value in np.geomspace(0.05, 1.0, 20):
        simulator.set_stimulus("heat", value)
        simulator.solve_static()
    return simulator


@pytest.mark.parametrize("part", [0.6, 0.4])
def test_strips_curl_as_far_whichever_of_their_parts_has_the_curve_on_its_axis(part):
    curvature = 6.0 * THICKNESS / WIDTH**2
    law = {"stimulus": "heat", "gain": curvature * THICKNESS / 1.5}
    half = {"thickness": 0.5 * THICKNESS}
    layers = [layer("bottom", eigenstrain=law, interval=[0.0, 0.2 * part], **half), layer("top", **half)]
    simulator = swollen_step_by_step(layers)
    assert simulator.curvatures[[4, 10, 30]] / curvature == pytest.approx([0.863, 0.863, 0.0], abs=1e-3)


@pytest.mark.parametrize("part", [0.6, 0.4])
def test_strips_are_as_stiff_whichever_of_their_parts_has_the_curve_on_its_axis(part):
    thickness, moment = 0.5 * THICKNESS, 36.0 * GEL["youngs_modulus"] * (0.5 * THICKNESS) ** 4 / (12.0 * WIDTH)
    layers = [layer("bottom", thickness, interval=[0.0, 0.05 * part]), layer("top", thickness)]
    crank = {"name": "crank", "position": [0.05, 0, 0], "motion": {"type": "free", "mass": 1e-3, "inertia": [1e-7] * 3}}
    ends = {"clamp_start": "wall", "clamp_end": "crank"}
    strip = rod(layers, length=0.05, stations=41, width=WIDTH, section="strip", **ends)
    load = {"name": "moment", "body": "crank", "moment": [0, -moment, 0]}
    gel = {"gel": {**GEL, "poisson_ratio": 0.5}}
    content = scene([strip], bodies=[fixed(), crank], loads=[load], materials=gel)
    simulator = Simulator(load_scene(content), model="laminate")
    simulator.solve_static()
    for node, high in ((5, THICKNESS), (35, thickness)):
        curvature = abs(float(simulator.curvatures[node]))
        wanted = PlateStrip(0.5).stiffness(WIDTH**2 * curvature / high)
        bending = GEL["youngs_modulus"] * WIDTH * high**3 / 12.0
        assert moment / (bending * curvature) == pytest.approx(wanted, rel=1e-4) != 1.0


def test_a_strip_that_thins_curls_as_much_as_it_is_thin():
    profile = {"at": [0.0, 0.2], "value": [0.5 * THICKNESS, 0.4 * THICKNESS]}
    law = {"stimulus": "heat", "gain": 6.0 * (THICKNESS / WIDTH) ** 2 / 1.5}
    layers = [layer("bottom", profile, eigenstrain=law), layer("top", profile)]
    simulator = swollen_step_by_step(layers)
    for node in (5, 20, 35):
        thickness = THICKNESS * (1.0 - 0.2 * node / 40)
        curvature = 6.0 * (THICKNESS / WIDTH) ** 2 / thickness
        found = PlateStrip(0.3).swollen_curvature(WIDTH**2 * curvature / thickness)
        assert simulator.curvatures[node] / curvature == pytest.approx(found, rel=2e-3)


def test_two_rods_refuse_strips():
    with pytest.raises(SceneError, match="no part across the width"):
        Simulator(load_scene(wide()), model="two_rod")


def test_logs_of_strips_hold_their_section_curvature_and_pictures_can_show_it(tmp_path):
    simulator, held = Simulator(load_scene(wide()), model="laminate"), MemoryRecorder()
    simulator.run(0.1, observers=[McapRecorder(tmp_path / "run.mcap"), held])
    wanted = simulator.rods["rod"].section_curvature
    logged, name = read_log(tmp_path / "run.mcap"), "rod/rod/section_curvature"
    assert np.abs(wanted).max() > 1.0
    for run in (logged, held.run_data()):
        assert run.quantities[name].values[-1] == pytest.approx(wanted, rel=1e-6)
        colours = choose_colouring(run, "section")
        assert colours.title == "curvature across [1/m]"
        assert colours.values(run, run.description.strands[0])[-1] == pytest.approx(wanted, rel=1e-6)
    beam = Simulator(load_scene(wide(section="beam")), model="laminate")
    held = MemoryRecorder()
    beam.run(0.1, observers=[held])
    assert name not in held.run_data().quantities
    assert (held.run_data().section_curvature == 0.0).all()
