"""The planar beam of Appendix A: derivatives, invariance, statics, dynamics, and which scenes it can be."""

import math

import numpy as np
import pytest
from support.sample_scenes import fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError, SceneError, SimulationError
from bilayer_core.verification.beam2d.beam import PlanarBeam
from bilayer_core.verification.beam2d.energy import BeamEnergy, Section
from bilayer_core.verification.beam2d.scene import beam_of, set_stimuli
from bilayer_core.verification.validate import beams
from bilayer_core.verification.validate.bending import strip

NODES, EDGE = 7, 0.3
SECTION = Section(axial=3.0, coupling=0.7, bending=0.5, mass=1.0)
WALL = np.array([1.0, 0.0])


def bent(wall, seed=0):
    """A law, a shape far from straight, and N and M of its edges."""
    rng = np.random.default_rng(seed)
    position = np.column_stack([EDGE * np.arange(NODES), np.zeros(NODES)]) + 0.06 * rng.standard_normal((NODES, 2))
    law = BeamEnergy(SECTION, EDGE, NODES, wall)
    return law, position, rng.standard_normal(NODES - 1), rng.standard_normal(NODES - 1)


def dense(band):
    """The symmetric matrix of a lower band."""
    n = band.shape[1]
    matrix = np.zeros((n, n))
    for r in range(min(6, n)):
        matrix += np.diag(band[r, : n - r], -r) + (np.diag(band[r, : n - r], r) if r else 0.0)
    return matrix


@pytest.mark.parametrize("wall", [None, WALL], ids=["free", "clamped"])
def test_gradient_and_hessian_are_those_of_the_energy(wall):
    law, position, force, moment = bent(wall)
    gradient, band = law.derivatives(position, force, moment)
    slope, matrix = np.zeros_like(gradient), np.zeros((len(gradient), len(gradient)))
    for i in range(len(gradient)):
        step = np.zeros_like(gradient)
        step[i] = 1e-6
        ahead, behind = position + step.reshape(-1, 2), position - step.reshape(-1, 2)
        slope[i] = (law.value(ahead, force, moment) - law.value(behind, force, moment)) / 2e-6
        matrix[i] = (law.derivatives(ahead, force, moment)[0] - law.derivatives(behind, force, moment)[0]) / 2e-6
    assert np.abs(slope - gradient).max() < 1e-8 * np.abs(gradient).max()
    assert np.abs(matrix - dense(band)).max() < 1e-8 * np.abs(matrix).max()


def test_a_rigid_motion_costs_nothing_and_forces_and_moments_sum_to_zero():
    law, position, force, moment = bent(None)
    c, s = math.cos(0.7), math.sin(0.7)
    turned = position @ np.array([[c, s], [-s, c]]) + [0.3, -0.2]
    assert law.value(turned, force, moment) == pytest.approx(law.value(position, force, moment), rel=1e-12)
    forces = law.derivatives(position, force, moment)[0].reshape(-1, 2)
    about = position[:, 0] * forces[:, 1] - position[:, 1] * forces[:, 0]
    assert np.abs(forces.sum(axis=0)).max() < 1e-13 * np.abs(forces).max()
    assert abs(about.sum()) < 1e-13 * np.abs(forces).max()


def test_a_strain_that_alternates_from_edge_to_edge_costs_energy():
    # with the printed mean strains it would cost nothing
    law = BeamEnergy(SECTION, EDGE, NODES, None)
    lengths = EDGE * (1.0 + 0.01 * np.array([1, -1, 1, -1, 1, -1]))
    position = np.column_stack([np.concatenate([[0.0], np.cumsum(lengths)]), np.zeros(NODES)])
    nothing = np.zeros(NODES - 1)
    assert np.abs(law.mean_strain(law.strains(position).axial)).max() < 1e-15
    assert law.value(position, nothing, nothing) == pytest.approx(0.5 * SECTION.axial * 0.01**2 * 6 * EDGE)


def heavy(stations):
    """The common cantilever as two layers of 1 mm each."""
    material = {"youngs_modulus": 1e6, "poisson_ratio": 0.5, "density": 1000.0}
    ribbon = rod([layer("bottom"), layer("top")], stations=stations, clamp_start="wall")
    return scene([ribbon], gravity=[0, 0, -9.81], bodies=[fixed()], materials={"gel": material})


def test_its_heavy_cantilever_converges_at_second_order_to_the_elastica():
    errors = []
    for stations in (51, 101, 201):
        beam = beam_of(load_scene(heavy(stations)))
        beam.solve_static()
        errors.append(math.dist(beam.position[-1], beams.elastica_tip()) / 0.1)
    assert errors[-1] < 1e-4
    assert math.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.1)


def test_it_vibrates_at_its_first_frequency():
    beam = beam_of(load_scene(heavy(21) | {"gravity": [0, 0, -1e-3]}))
    frequency = 1.875104**2 * math.sqrt(beam.section.bending / beam.section.mass) / 0.1**2 / (2 * math.pi)
    dt = 1.0 / (200 * frequency)
    tip = []
    for _ in range(500):
        beam.step(dt)
        tip.append(beam.position[-1, 1])
    lowest = [k for k in range(1, 499) if tip[k] < tip[k - 1] and tip[k] <= tip[k + 1]]
    assert 1.0 / ((lowest[1] - lowest[0]) * dt) == pytest.approx(frequency, rel=0.005)


def test_damping_slows_a_free_beam_exponentially():
    beam = PlanarBeam(SECTION, 1.0, 11, clamped=False, gravity=(0.0, -10.0), damping=3.0)
    for _ in range(400):
        beam.step(1e-3)
    assert beam.velocity[:, 1] == pytest.approx(np.full(11, -10.0 / 3.0 * (1.0 - math.exp(-1.2))), rel=2e-3)


def test_a_free_beam_that_falls_has_no_equilibrium_and_stays_where_it_was():
    beam = PlanarBeam(SECTION, 1.0, 11, clamped=False, gravity=(0.0, -9.81))
    before = beam.position.copy()
    with pytest.raises(SimulationError, match="planar beam"):
        beam.solve_static()
    assert np.array_equal(beam.position, before)


BAD = {
    "pattern": lambda s: s["rods"][0].update(pattern={"count": 2}),
    "straight": lambda s: s["rods"][0].update(
        path={"shape": "arc", "start": [0, 0, 0], "direction": [1, 0, 0], "radius": 0.1, "angle": 1}
    ),
    "two over the whole path": lambda s: s["rods"][0]["layers"].pop(),
    "must not vary": lambda s: s["rods"][0].update(width={"at": [0, 0.01], "value": [0.01, 0.02]}),
    "natural curvature": lambda s: s["rods"][0]["layers"][0].update(natural_curvature=10.0),
    "plane of path and normal": lambda s: s.update(gravity=[0, 1, 0]),
    "loads": lambda s: s.update(loads=[{"name": "pull", "rod": "rod", "position": 0.05, "force": [0, 0, 1]}]),
}


@pytest.mark.parametrize("demand", BAD)
def test_scenes_that_are_no_straight_planar_bilayer_are_refused_with_the_reason(demand):
    content = strip(1.0, 1.0, 0.01)
    BAD[demand](content)
    with pytest.raises(SceneError, match=f"planar beam of Appendix A cannot be this scene: .*{demand}"):
        beam_of(load_scene(content))


def test_both_layers_of_the_bundled_strip_follow_their_laws_as_two_rods_do():
    config = load_scene("bending")
    beam = beam_of(config)
    values = {name: 0.7 * channel.maximum for name, channel in config.stimuli.items()}
    set_stimuli(beam, config, values)
    beam.solve_static()
    simulator = Simulator(config)
    for name, value in values.items():
        simulator.set_stimulus(name, value)
    simulator.solve_static()
    middle = config.rods[0].stations // 2
    assert beam.curvatures[middle] == pytest.approx(simulator.curvatures[middle], rel=1e-3)


@pytest.mark.parametrize("values", [{}, {"heat": 1.0, "light": 1.0}])
def test_stimuli_that_do_not_fit_the_scene_are_refused(values):
    config = load_scene(strip(1.0, 1.0, 0.01))
    with pytest.raises(InputError, match="the scene 'sample' has: heat"):
        set_stimuli(beam_of(config), config, values)
