"""Dimension 2: the same motion, equilibria and energies as in space, where all stays in a plane."""

import numpy as np
import pytest
from support.planar_scenes import AHEAD, everything_in_plane, mechanism, snap
from support.sample_scenes import PAPER, fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError
from bilayer_core.integrators.integrator_register import INTEGRATORS
from bilayer_core.model.plan import MODELS

SAME = 1e-8
"""Of the length of a rod: difference of positions in two and in three dimensions, Newton's method run to rounding."""


def pair(content, integrator="implicit_euler", dt=1e-3, **more):
    """The same scene in three and in two dimensions, solved to rounding."""
    if isinstance(content, dict):
        content = content | {"solver": {**PAPER, "newton_tolerance": 1e-10}}
    config = load_scene(content)
    return [Simulator(config, dimension=d, integrator=integrator, dt=dt, **more) for d in (3, 2)]


def difference(space, plane):
    """Largest difference of positions of nodes and bodies, over the longest rod."""
    apart = np.abs(space.positions - plane.positions).max()
    for name, body in space.bodies.items():
        apart = max(apart, np.abs(body.position - plane.bodies[name].position).max())
        apart = max(apart, 0.02 * np.abs(body.quaternion - plane.bodies[name].quaternion).max())
    return apart / max(rod.path.length for rod in space.scene.rods)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("content", [mechanism(AHEAD["y = 0"]), mechanism(AHEAD["oblique"]), snap()])
def test_the_trajectory_before_contact_is_that_in_space(content, model, integrator):
    space, plane = pair(content, integrator, model=model)
    for simulator in (space, plane):
        simulator.run(0.04)
    moved = np.abs(space.positions - space.model.start_position).max()
    assert moved > 1e-3
    assert difference(space, plane) < SAME
    assert plane.model.unknowns < 0.55 * space.model.unknowns


@pytest.mark.parametrize("model", MODELS)
def test_a_cycle_of_the_inchworm_is_that_in_space(model):
    space, plane = pair("crawling_inchworm", model=model)
    for simulator in (space, plane):
        simulator.run(2.4)
    stride = plane.com[0] - plane.start_com[0]
    assert stride > 1e-3
    assert difference(space, plane) < SAME


@pytest.mark.parametrize("ahead", AHEAD)
def test_with_contact_and_friction_of_bodies_all_moves_as_in_space(ahead):
    space, plane = pair(everything_in_plane(AHEAD[ahead], "free"))
    for simulator in (space, plane):
        simulator.run(0.05)
    assert plane.energy()["barrier"] > 0.0
    assert np.abs(plane.bodies["ball"].quaternion[:2]).max() > 1e-4  # it turns
    assert difference(space, plane) < SAME


def test_an_equilibrium_is_that_in_space():
    content = mechanism(AHEAD["oblique"]) | {"fluid": None}
    space, plane = pair(content)
    for simulator in (space, plane):
        simulator.set_stimulus("light", 0.8)
        assert simulator.solve_static().stable
    assert np.abs(plane.positions - plane.model.start_position).max() > 1e-3
    assert difference(space, plane) < SAME


def strut(width, thickness):
    """A strip that stands on its clamped end, under a load on top."""
    column = rod([layer(thickness=thickness)], 0.1, 21, width=width, clamp_start="wall")
    column["path"] |= {"direction": [0, 0, 1]}
    column["normal"] = [1, 0, 0]
    load = {"name": "weight", "rod": "rod", "position": 0.1, "force": [0, 0, -0.02]}
    return scene([column], bodies=[fixed()], loads=[load])


def test_stability_is_that_in_space_whatever_the_dimension():
    # critical load π² E I/(4 L²): 8 mN about the weak axis of 4 mm × 1 mm, 130 mN about the other
    for width, thickness, outward in ((4e-3, 1e-3, 0), (1e-3, 4e-3, 1)):
        space, plane = (simulator.solve_static() for simulator in pair(strut(width, thickness)))
        assert (space.unstable_directions, space.out_of_plane) == (1, 0)
        assert (plane.unstable_directions, plane.out_of_plane) == (1, outward)
        assert not (space.stable or plane.stable)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("part", "outward"), [(0.97, 0), (1.03, 1), (1.5, 1)])
def test_a_blade_in_a_plane_is_told_where_it_would_turn_over(model, part, outward):
    # lateral-torsional buckling of a cantilever under a force at its tip: 4.013 √(E I₂ G J)/L² (Prandtl, Michell)
    length, width, thickness, modulus = 0.1, 0.6e-3, 12e-3, 1e8
    bending, shear = modulus * thickness * width**3 / 12.0, modulus / 3.0
    torsion = shear * thickness * width**3 / 3.0 * (1.0 - 0.63 * width / thickness)
    force = part * 4.013 * np.sqrt(bending * torsion) / length**2
    blade = rod([layer(thickness=thickness)], length, 41, width=width, clamp_start="wall")
    load = {"name": "tip", "rod": "rod", "position": length, "force": [0, 0, -force]}
    content = scene([blade], bodies=[fixed()], loads=[load])
    report = Simulator(load_scene(content), model=model, dimension=2).solve_static()
    assert (report.stable, report.out_of_plane) == (outward == 0, outward)


def test_a_saved_state_continues_bit_for_bit():
    content = everything_in_plane(AHEAD["oblique"], "free")
    first, second = (Simulator(load_scene(content), dimension=2, integrator="tr_bdf2") for _ in range(2))
    first.run(0.01)
    snapshot = first.save_state()
    first.run(0.01)
    second.load_state(snapshot)
    second.run(0.01)
    assert np.array_equal(first.save_state(), second.save_state(), equal_nan=True)


def test_a_state_out_of_the_plane_is_refused():
    space, plane = pair(snap())
    state = space.save_state()
    plane.load_state(state)
    snapshot = plane.save_state()
    space._state.velocity[3, 1] = 1e-3
    with pytest.raises(InputError, match="velocity leaves the plane"):
        plane.load_state(space.save_state())
    assert np.array_equal(plane.save_state(), snapshot, equal_nan=True)


def test_a_node_has_two_unknowns_and_couples_with_few_others():
    for layers, half_bandwidth in (([layer()], 5), ([layer(), layer("top")], 9)):
        model = Simulator(load_scene(scene([rod(layers)])), dimension=2).model
        assert model.unknowns == 2 * model.node_count
        assert model.solved_layout.half_bandwidth == half_bandwidth


@pytest.mark.parametrize("model", MODELS)
def test_the_energy_budget_is_that_in_space_and_closes(model):
    content = everything_in_plane(AHEAD["oblique"], "free")
    ramp = {"type": "ramp", "start": 0, "end": 0.01, "from": 0, "to": 1}
    space, plane = pair(content | {"stimuli": {"humidity": {"schedule": ramp}}}, budget=True, model=model)
    for simulator in (space, plane):
        simulator.run(0.02)
    books = [simulator.budget() for simulator in (space, plane)]
    largest = max(abs(value) for value in books[0]["stored"].values())
    for part in ("supplied", "stored", "lost"):
        for name, value in books[0][part].items():
            assert books[1][part].get(name, 0.0) == pytest.approx(value, abs=1e-8 * largest), name
    assert books[1]["stored"].keys() == books[0]["stored"].keys() - {"twisting"}
    assert abs(books[1]["supplied"]["stimulus"]) > 1e-5 * largest
