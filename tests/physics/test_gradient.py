"""Derivatives of equilibria against differences of equilibria that were found anew."""

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError, SceneError, SimulationError
from bilayer_core.scene.loader import scene_content
from bilayer_core.scene.overrides import read_overrides

HANGING = {"gravity": [0, 0, -9.81]}
POST = {"name": "post", "type": "sphere", "radius": 0.005, "position": [0.03, 0, -0.0068]}
ON_A_POST = HANGING | {"obstacles": [POST], "contact": {"barrier_distance": 2e-4, "stiffness": "1 MPa"}}
SWOLLEN, GAIN = {"swelling": 0.6}, "rods.strip.layers.active.eigenstrain.gain"
MODULUS, LENGTH, THICKNESS = (
    "materials.active.youngs_modulus",
    "rods.strip.path.length",
    "rods.strip.layers.0.thickness",
)
SLIDES = {
    "bodies.wall.motion": {"type": "guided", "axis": [0, 0, 1], "mass": 1e-3, "sliding": {"spring": 10.0}, "speed": 0.2}
}
OF = ["com", "energy/bending", "body/wall/clamp_wrench"]


def at_rest(name, overrides, stimuli, tolerance=1e-14):
    simulator = Simulator(load_scene(name, overrides))
    for channel, value in stimuli.items():
        simulator.set_stimulus(channel, value)
    simulator.solve_static(tolerance)
    return simulator


def seen(simulator, of):
    values = {"com": simulator.com, "positions": simulator.positions} | {
        f"energy/{term}": value for term, value in simulator.energy().items()
    }
    for name, body in simulator.bodies.items():
        values[f"body/{name}/clamp_wrench"] = body.clamp_wrench
    values |= {f"rod/{name}/position": rod.middle_line for name, rod in simulator.rods.items()}
    return [np.asarray(values[name]) for name in of]


def differences(name, overrides, stimuli, to, step, of=OF):
    """Differences of fourth order of equilibria that are `step` of the parameter apart."""
    scene = load_scene(name, overrides)
    if to in stimuli:
        value = stimuli[to]
    else:
        holder, place = read_overrides({to: 0.0})[0].find(scene_content(scene))
        value = holder[place]
    h = step * abs(value)

    def at(other):
        own = (overrides, stimuli | {to: other}) if to in stimuli else (overrides | {to: other}, stimuli)
        return seen(at_rest(name, *own), of)

    rows = zip(*(at(value + k * h) for k in (-1.0, -0.5, 0.5, 1.0)), strict=True)
    return [(8.0 * (c - b) - (d - a)) / (6.0 * h) for a, b, c, d in rows]


def error(found, other):
    return np.abs(found - other).max() / np.abs(other).max()


CASES = {
    "a hanging bilayer in a plane": ("bending", HANGING, SWOLLEN, ["swelling", GAIN, MODULUS, LENGTH, THICKNESS]),
    "the same in space": ("bending", HANGING | {"solver.dimension": 3}, SWOLLEN, ["swelling", MODULUS, THICKNESS]),
    "two rods": ("bending", HANGING | {"solver.model": "two_rod"}, SWOLLEN, ["swelling", MODULUS, LENGTH]),
    "a strip that curls": (
        "bending",
        HANGING | {"rods.strip.section": "strip"},
        {"swelling": 0.1},
        ["swelling", LENGTH],
    ),
    "two rods in space": ("helix", {"gravity": [0, 0, -0.2]}, {}, ["gravity.2", "rods.strip.layers.1.thickness"]),
    "a robot that starts in motion": ("bending", HANGING | SLIDES, SWOLLEN, [MODULUS, LENGTH]),
    "arms that hang from a body": ("gripping", {}, {"humidity": 0.8}, ["humidity", "materials.film.density"]),
}


@pytest.mark.parametrize("case", CASES)
def test_gradients_agree_with_differences_of_equilibria_to_1e_6(case):
    name, overrides, stimuli, to = CASES[case]
    found = at_rest(name, overrides, stimuli).gradient(OF[:2], to)
    for path in to:
        for of, other in zip(OF[:2], differences(name, overrides, stimuli, path, 1e-3, OF[:2]), strict=True):
            assert error(found[of, path], other) < 1e-6, (of, path)
            assert found.errors[of, path].max() < 1e-6 * np.abs(other).max(), (of, path)


@pytest.mark.parametrize("to", ["swelling", LENGTH, THICKNESS, "obstacles.post.radius"])
def test_gradients_through_contact_agree_with_differences_to_1e_4(to):
    of, stimuli = [*OF, "energy/barrier"], {"swelling": 0.03}
    simulator = at_rest("bending", ON_A_POST, stimuli)
    assert np.abs(simulator.contact_forces).max() > 1e-3
    found = simulator.gradient(of, to)
    for name, other in zip(of, differences("bending", ON_A_POST, stimuli, to, 1e-4, of), strict=True):
        assert error(found[name, to], other) < 1e-4, name


def test_differences_over_a_ladder_of_steps_reach_a_plateau_at_the_gradient():
    found = at_rest("bending", HANGING, SWOLLEN).gradient("com", THICKNESS)["com", THICKNESS]
    ladder = [
        error(differences("bending", HANGING, SWOLLEN, THICKNESS, step, ["com"])[0], found)
        for step in (0.3, 0.1, 1e-2, 1e-3, 1e-6, 1e-9)
    ]
    assert ladder[0] > 30.0 * ladder[1] > 1e-6  # fourth order: 81 times
    assert max(ladder[2:4]) < 1e-8
    assert ladder[-1] > 100.0 * ladder[3]  # rounding


def test_a_rod_that_grows_sideways_bears_its_weight_at_the_wall():
    simulator = at_rest("cantilever", {}, {})
    found = simulator.gradient("body/wall/clamp_wrench", ["materials.gel.density", "gravity.2"])
    weight = simulator.bodies["wall"].clamp_wrench[2]
    density = simulator.scene.materials["gel"].density
    assert found["body/wall/clamp_wrench", "materials.gel.density"][2] == pytest.approx(weight / density, rel=1e-6)
    assert found["body/wall/clamp_wrench", "gravity.2"][2] == pytest.approx(weight / -9.81, rel=1e-6)


def test_the_mass_centre_of_a_robot_goes_with_the_body_at_its_end():
    end = {"name": "block", "position": [0.1, 0, 0], "motion": {"type": "free", "mass": 1e-4, "inertia": [1e-9] * 3}}
    wall = {"name": "wall", "position": [0, 0, 0], "motion": {"type": "prescribed"}}
    overrides = {"bodies": [wall, end], "rods.strip.clamp_end": "block"}
    found = at_rest("bending", overrides, SWOLLEN).gradient("com", "swelling")["com", "swelling"]
    (other,) = differences("bending", overrides, SWOLLEN, "swelling", 1e-3, ["com"])
    assert error(found, other) < 1e-6


def test_a_load_that_turns_with_the_rod_counts_in_full():
    load = {"name": "jet", "rod": "strip", "position": 0.1, "force": [0, 0, 0.02], "frame": "material"}
    overrides = HANGING | {"loads": [load]}
    found = at_rest("bending", overrides, SWOLLEN).gradient("com", "swelling")["com", "swelling"]
    (other,) = differences("bending", overrides, SWOLLEN, "swelling", 1e-3, ["com"])
    assert error(found, other) < 1e-6


def test_at_the_default_tolerance_the_residual_bounds_the_error():
    loose = at_rest("bending", HANGING, SWOLLEN, tolerance=1e-8)
    found = loose.gradient("com", "swelling")
    exact = at_rest("bending", HANGING, SWOLLEN).gradient("com", "swelling")
    assert 0.0 < found.residual < 1e-8
    assert error(found["com", "swelling"], exact["com", "swelling"]) < 1e-9


@pytest.mark.parametrize("model", ["laminate", "two_rod"])
def test_middle_lines_move_with_the_layers_that_they_are_the_middle_of(model):
    scene, of = HANGING | {"solver.model": model}, ["rod/strip/position"]
    (reference,) = differences("bending", scene, SWOLLEN, THICKNESS, 1e-3, of)
    found = at_rest("bending", scene, SWOLLEN).gradient(of, THICKNESS)
    assert error(found[of[0], THICKNESS], reference) < 1e-6


def test_a_rod_that_is_put_elsewhere_moves_as_a_whole():
    simulator = at_rest("bending", {}, SWOLLEN)
    found = simulator.gradient("rod/strip/position", "rods.strip.path.start")[
        "rod/strip/position", "rods.strip.path.start"
    ]
    np.testing.assert_allclose(found, np.broadcast_to(np.eye(3), found.shape), atol=1e-9)


def test_a_list_of_numbers_gives_a_column_for_each():
    profile = {"at": [0.0, 0.1], "value": [1e-3, 1e-3]}
    scene = HANGING | {THICKNESS: profile}
    found = at_rest("bending", scene, SWOLLEN).gradient("rod/strip/position", [f"{THICKNESS}.value"])
    columns = found["rod/strip/position", f"{THICKNESS}.value"]
    whole = at_rest("bending", HANGING, SWOLLEN).gradient("rod/strip/position", THICKNESS)
    assert columns.shape == (41, 3, 2)
    assert error(columns.sum(axis=2), whole["rod/strip/position", THICKNESS]) < 1e-8


def test_a_state_away_from_rest_is_refused_with_how_far_it_is():
    simulator = Simulator(load_scene("bending", HANGING))
    with pytest.raises(InputError, match=r"not at rest: Newton's method would still move it by .* call solve_static"):
        simulator.gradient("com", "swelling")


def test_an_unstable_equilibrium_is_refused():
    gravity = {
        "gravity": [9.81, 0, 0],
        "materials.gel.youngs_modulus": "0.2 MPa",
        "rods.strip.path.direction": [-1, 0, 0],
    }
    simulator = Simulator(load_scene("cantilever", gravity))
    assert not simulator.solve_static().stable
    with pytest.raises(SimulationError, match="gradient: the shape is unstable"):
        simulator.gradient("com", "gravity.0")


@pytest.mark.parametrize(
    ("of", "to", "message"),
    [
        ("come", "swelling", "quantity 'come': there is none; near it: com"),
        ("com", "swellin", "gradient: swellin: there is no swellin.*channels of stimuli are swelling"),
        ("com", "rods.strip.width", "rods.strip.width acts on nothing here.*com depends on it"),
        ("com", "rods.strip.stations", "rods.strip.stations is a whole number"),
        ("com", "name", "name is no number in this scene"),
        ("com", "materials.active.poisson_ratio", "cannot be varied about its value, to 0.50025: .*at most 0.5"),
        ("com", "rods.strip.path.direction.1", "direction.1 turns the plane in which this model moves"),
    ],
)
def test_what_has_no_derivative_is_refused_by_name(of, to, message):
    simulator = at_rest("bending", {}, SWOLLEN)
    with pytest.raises((InputError, SceneError), match=message):
        simulator.gradient(of, to)


def test_a_gradient_leaves_the_run_as_it_is():
    one, other = (at_rest("bending", HANGING, SWOLLEN) for _ in range(2))
    one.gradient("com", ["swelling", GAIN, MODULUS])
    for simulator in (one, other):
        simulator.set_stimulus("swelling", 0.2)
        simulator.run(0.01)
    assert np.array_equal(one.save_state(), other.save_state())
