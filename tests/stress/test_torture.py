"""Torture cases: their files, the references that decide them, and a rung or two of every ladder.

`bilayer stress --only 'torture/*'` runs all rungs.
"""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bilayer_core import Simulator, load_scene
from bilayer_core.scene.bundled import bundled_scenes
from bilayer_core.verification.stress.execute_case import execute
from bilayer_core.verification.stress.kirchhoff import cantilever, loaded_tip
from bilayer_core.verification.stress.ladder import content_of, torture_scenes
from bilayer_core.verification.stress.linking import gauss_integral, longer, twist
from bilayer_core.verification.stress.stress_case import Outcome, StressCase
from bilayer_core.verification.stress.torture import NOT_EXPRESSIBLE, TORTURES, torture_cases
from bilayer_core.verification.stress.torture_twist import critical_torque, ply
from bilayer_core.verification.validate.closed_forms import end_loaded_cantilever

X = np.array([1.0, 0.0, 0.0])
SLOW = {7, 8, 15, 16, 17}
"""Numbers of those of which every rung takes four seconds or more."""
QUICK_AT_LAST = {1, 2, 3}
"""Numbers of those whose first rung is the slower one."""


def two_rungs_each():
    """The first rung of each ladder, and the last one that is not long, of which `make verify` runs one."""
    for torture in TORTURES:
        cases = [case for case in torture.cases() if "/long" not in case.name]
        quick = cases[-1 if torture.number in QUICK_AT_LAST else 0]
        for case in (cases[0], cases[-1]):
            later = torture.number in SLOW or case is not quick
            yield pytest.param(case, id=case.name, marks=[pytest.mark.verify] if later else [])


@pytest.mark.parametrize("case", list(two_rungs_each()))
def test_what_must_come_out_comes_out(case):
    record = execute(case)
    assert record.outcome is Outcome.ACCURATE, record.reason


@pytest.mark.parametrize("name", torture_scenes())
def test_a_torture_scene_builds_and_has_the_name_of_its_file(name):
    scene = load_scene(torture_scenes()[name])
    assert scene.name == name
    assert Simulator(scene).model.node_count > 2


def test_every_rung_is_a_scene_that_differs_from_the_others_of_its_ladder():
    for torture in TORTURES:
        contents = [str(content_of(torture.scene, rung.overrides)) + str(rung.decide) for rung in torture.rungs]
        assert len(set(contents)) == len(contents) >= 3, torture.name


def test_every_number_of_the_list_is_a_case_or_says_why_it_is_none():
    numbers = {torture.number for torture in TORTURES} | {number for number, _, _ in NOT_EXPRESSIBLE}
    assert numbers == set(range(1, 26))
    assert {torture.scene for torture in TORTURES} - set(bundled_scenes()) == set(torture_scenes())
    names = [case.name for case in torture_cases()]
    assert len(set(names)) == len(names)


WRONG = {
    "a beam that is three percent stiffer": ("roll-up", ("materials.sheet.youngs_modulus=1.03e9",)),
    "damping that its equation does not have": ("delay at a saddle-node", ("damping.mass=20", "duration=0.5")),
    "a rod that passes through itself": (
        "twist buckling",
        ("contact.rods=false", "bodies.right.motion.rotations=[[0, 0, 0], [50.265482, 0, 0]]"),
    ),
    "a rough slope that is half as heavy": (
        "block on a slope",
        ("loads=[{name: lift, body: block, force: [0, 0, 0.2]}]",),
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_is_told(what):
    name, overrides = WRONG[what]
    torture = next(torture for torture in TORTURES if torture.name == name)
    rung = next(rung for rung in torture.rungs if rung.decide is None)
    wrong = StressCase(
        "wrong",
        lambda: content_of(torture.scene, (*rung.overrides, *overrides)),
        most_steps=10**5,
        decide=torture.decide,
    )
    record = execute(wrong)
    assert record.outcome is Outcome.FAILED
    assert "is not from" in record.reason


def circle(center, first, second):
    angle = np.linspace(0.0, 2.0 * np.pi, 121)[:, None]
    return np.array(center) + np.cos(angle) * np.array(first) + np.sin(angle) * np.array(second)


def test_two_rings_through_each_other_have_the_gauss_integral_one():
    ring = circle([0, 0, 0], [1, 0, 0], [0, 1, 0])
    through, beside = (circle([x, 0, 0.1], [1, 0, 0], [0, 0, 1]) for x in (1.0, 2.5))
    assert abs(gauss_integral(ring, through)) == pytest.approx(1.0, abs=1e-9)
    assert gauss_integral(ring, beside) == pytest.approx(0.0, abs=1e-9)


def test_two_helices_are_linked_by_their_turns():
    s = np.linspace(0.0, 1.0, 181)
    helix = np.stack([4.0 * s, np.cos(6.0 * np.pi * s), np.sin(6.0 * np.pi * s)], axis=1)
    assert gauss_integral(longer(helix, X), longer(helix * [1, -1, -1], X)) == pytest.approx(3.0, abs=1e-6)


def test_twist_counts_the_turns_of_directors_about_any_curve():
    line = np.linspace(0.0, 1.0, 61)[:, None] * X
    turns = np.linspace(0.0, 2.0, 60)
    directors = Rotation.from_rotvec(2.0 * np.pi * turns[:, None] * X).apply([0.0, 1.0, 0.0])
    assert twist(line, directors) == pytest.approx(2.0, abs=1e-12)
    turned = Rotation.from_rotvec([0.3, -0.4, 1.1])
    assert twist(turned.apply(line), turned.apply(directors)) == pytest.approx(2.0, abs=1e-12)


def test_the_kirchhoff_rod_is_an_elastica_in_the_plane():
    tip, frame = loaded_tip(np.array([0.0, 2.0, 0.0]), np.ones(3), np.zeros(3), 1.0, np.eye(3), 1.0)
    assert tip[2] == 0.0
    assert np.sort(np.abs(tip[:2])) == pytest.approx(np.sort(np.abs(end_loaded_cantilever(2.0, False))), abs=1e-6)
    assert frame.T @ frame == pytest.approx(np.eye(3), abs=1e-8)


def test_the_kirchhoff_bend_is_near_the_published_one_that_is_flexible_in_shear():
    scene = load_scene(torture_scenes()["bathe_bend"])
    start = 100.0 * np.array([math.sqrt(0.5), math.sqrt(0.5) - 1.0, 0.0])
    published = np.array([-23.64597, 13.72080, 53.57765])
    off = np.linalg.norm(cantilever(scene)[0] - start - published)
    assert off < 3e-3 * np.linalg.norm(published)


def test_critical_torques_are_those_of_clamped_rods_and_of_long_ones_under_tension():
    assert critical_torque(0.0) == pytest.approx(8.986819, abs=1e-4)  # tan(x/2) = x/2
    assert critical_torque(1e4) == pytest.approx(2.0 * math.sqrt(1e4), rel=0.01)  # M² = 4 B T


def test_energy_of_a_plectoneme_is_least_at_its_angle_and_length():
    tension, bending, radius = 0.16, 1.3e-5, 1e-3
    angle, torque = ply(tension, bending, radius)

    def energy(a):
        return 0.5 * bending * math.sin(a) ** 4 / radius**2 + tension - 0.5 * torque * math.sin(2.0 * a) / radius

    assert energy(angle) == pytest.approx(0.0, abs=1e-9 * tension)
    assert (energy(angle + 1e-4) - energy(angle - 1e-4)) / 2e-4 == pytest.approx(0.0, abs=1e-6 * tension)
