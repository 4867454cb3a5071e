"""The matrix and its region of validity: fixed before anything was run, and readable by the simulator."""

import hashlib
import pickle

import pytest

from bilayer_core.scene.loader import load_scene
from bilayer_core.verification.stress.all_cases import QUICK, all_cases, quick_names
from bilayer_core.verification.stress.matrix import SEED, matrix
from bilayer_core.verification.stress.parameters import CHOICES, RANGES, ROBOTS, Parameters
from bilayer_core.verification.stress.region import outside
from bilayer_core.verification.stress.robots import scene_of

DECIDED = "77873c1528cca557"
"""Of names and reasons. Whoever changes the region or the sample to have better results changes this line."""


def test_there_are_over_two_thousand_cases_with_names_of_their_own():
    names = [case.name for case in matrix()]
    assert len(names) == len(set(names)) >= 2000
    assert SEED == 20261123


def test_the_sample_and_the_region_are_those_that_were_decided_on_before_any_run():
    text = "\n".join(f"{case.name}: {'; '.join(outside(case.parameters))}" for case in matrix())
    assert hashlib.sha256(text.encode()).hexdigest()[:16] == DECIDED


def test_about_half_of_the_cases_are_inside_the_region():
    inside = sum(not outside(case.parameters) for case in matrix())
    assert 0.45 * len(matrix()) < inside < 0.55 * len(matrix())


def test_every_axis_is_gone_through_alone_and_every_choice_is_made():
    cases = matrix()
    assert {case.axis for case in cases if case.axis} >= set(RANGES)
    assert {case.parameters.robot for case in cases} == set(ROBOTS)
    for name, choices in CHOICES.items():
        assert {getattr(case.parameters, name) for case in cases} == set(choices)


@pytest.mark.parametrize("robot", ROBOTS)
def test_easy_parameters_are_inside_the_region(robot):
    stiffness = {"contact_stiffness": 1e8} if robot in ("ball", "box") else {}
    assert outside(Parameters(robot=robot, **stiffness)) == []


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"eigenstrain": 0.3}, "eigenstrain"),
        ({"robot": "coil", "turns": 10.0}, "curvature x thickness"),
        ({"robot": "drop", "speed": 100.0, "gravity": 1e5}, "speed of sound"),
        ({"robot": "drop", "contact_stiffness": 1e2}, "barrier"),
        ({"dt": 0.1}, "a step is"),
        ({"tolerance": 1e-2}, "tolerance"),
        ({"gravity": 1e4}, "weight"),
        ({"robot": "drop", "barrier": 1e-2}, "half the thickness"),
    ],
)
def test_each_limit_of_the_region_is_named(changes, why):
    assert any(why in reason for reason in outside(Parameters(**changes)))


def test_every_tenth_case_is_a_scene_that_loads():
    for case in matrix()[::10]:
        scene = load_scene(scene_of(case.parameters))
        assert len(scene.rods[0].layers) == 2 and scene.rods[0].stations == case.parameters.stations


def test_every_case_finds_its_way_to_a_worker():
    cases = all_cases()
    assert pickle.loads(pickle.dumps(cases)).keys() == cases.keys()


def test_a_quick_run_has_some_cases_of_every_group():
    cases = all_cases()
    groups = {case.group for case in cases.values()} - {"stations", "long", "torture"}  # which the tests run
    assert {cases[name].group for name in quick_names()} == groups
    assert 0.9 * QUICK <= len(quick_names()) <= 1.15 * QUICK
