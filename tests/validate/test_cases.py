"""Every case with a known answer, as `bilayer validate` computes it; and that cases can fail."""

import dataclasses
import math

import pytest
from support.sample_scenes import fixed, rod, scene

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError, SimulationError
from bilayer_core.verification.validate import torsion
from bilayer_core.verification.validate.case_register import CASES, FAMILIES, select
from bilayer_core.verification.validate.closed_forms import timoshenko_as_printed
from bilayer_core.verification.validate.validation_case import Case


@pytest.mark.parametrize(
    "case", [pytest.param(case, id=case.name, marks=[pytest.mark.verify] if case.long else []) for case in CASES]
)
def test_the_answer_is_met(case):
    result = case.run()
    assert result.passed, f"{result.computed} instead of {result.reference}: {result.error} > {case.limit}"


def test_names_are_unique_and_say_the_family_and_every_case_says_its_reference():
    assert len({case.name for case in CASES}) == len(CASES) >= 60
    assert all("/" in case.name and case.against for case in CASES)
    assert all(family.CASES for family in FAMILIES)


def test_the_curvature_of_the_printed_formula_would_fail():
    case = select("bending/two_rod/m = 10")[0]
    result = case.run()
    printed = timoshenko_as_printed(10.0, 1.0)
    assert abs(result.computed / printed - 1.0) > 0.5 > case.limit


@pytest.mark.parametrize(("multiple", "passes"), [(10.0, True), (1000.0, False)])
def test_varying_curvature_locks_only_with_bonds_a_hundred_times_stiffer(multiple, passes):
    layers, strain = torsion.wave_strip(20)
    config = scene(
        [rod(layers, stations=21, clamp_start="wall")],
        bodies=[fixed()],
        stimuli={"heat": {"schedule": {"type": "hold", "value": 1}}},
        coupling={"translation": multiple, "bending": multiple, "twist": multiple},
    )
    simulator = Simulator(load_scene(config))
    simulator.solve_static()
    chi = simulator.curvatures.reshape(2, 21)[:, 1:-1].mean(axis=0)
    error = abs(torsion.amplitude(chi, strain) / 1.5 - 1.0)
    assert (error < 0.01) == passes


def case_of(measure, **more):
    return Case("family/case", "nothing", 0.01, measure, **more)


def test_an_error_is_relative_to_the_answer_or_to_a_scale():
    assert case_of(lambda: (1.02, 1.0)).run().error == pytest.approx(0.02)
    assert case_of(lambda: (0.02, 0.0), scale=4.0).run().error == pytest.approx(0.005)
    assert not case_of(lambda: (1.02, 1.0)).run().passed
    assert case_of(lambda: (0.02, 0.0), scale=4.0).run().passed


def test_a_figure_that_is_not_a_number_fails():
    result = case_of(lambda: (math.nan, 1.0)).run()
    assert not result.passed
    assert result.record()["computed"] is None


def test_a_simulation_that_cannot_go_on_is_a_failed_case_with_its_message():
    def stop():
        raise SimulationError("the rod broke", 0.5)

    result = case_of(stop).run()
    assert not result.passed
    assert "the rod broke" in result.record()["message"]


def test_a_limit_is_kept_by_equality():
    case = case_of(lambda: (2.0, 1.0))
    assert dataclasses.replace(case, limit=1.0).run().passed


def test_cases_are_chosen_by_a_part_of_their_name_or_with_wildcards():
    assert {case.family for case in select("HELIX")} == {"helix", "laminate"}
    assert [case.name for case in select("beams/euler's load")] == ["beams/Euler's load"]
    assert len(select("helix/la*/radius")) == 6
    assert not any(case.long for case in select(quick=True))
    assert len(select()) == len(CASES)
    with pytest.raises(InputError, match="no case matches 'wrong'.*bending, helix"):
        select("wrong")
