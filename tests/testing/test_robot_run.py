"""What users assert of their own robots."""

import numpy as np
import pytest
from support.sample_scenes import everything

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError, SceneError
from bilayer_core.testing import run_scene

pytest_plugins = ["pytester"]


@pytest.fixture(scope="module")
def bouncing():
    return run_scene(everything(), 0.05, overrides={"duration": 0.05})


def test_a_sound_run_passes_all_that_can_be_asserted(bouncing):
    bouncing.assert_sound()
    bouncing.assert_no_penetration()
    bouncing.assert_energy()
    bouncing.assert_repeatable()
    assert 0.0 < bouncing.smallest_gap < 1.0
    assert bouncing["com"].times[-1] == bouncing.simulator.time == pytest.approx(0.05)


def test_a_gap_and_an_energy_beyond_the_asked_limit_fail(bouncing):
    with pytest.raises(AssertionError, match="the smallest gap is .* m, not above 1 m"):
        bouncing.assert_no_penetration(at_least=1.0)
    with pytest.raises(AssertionError, match="steps made .* more than -1"):
        bouncing.assert_energy(limit=-1.0)


def test_a_scene_in_which_nothing_can_touch_has_no_gap_to_assert():
    with pytest.raises(InputError, match="nothing in this scene can touch"):
        run_scene("cantilever", 0.01).assert_no_penetration()


def test_a_step_that_is_wrong_ends_the_run_and_fails(monkeypatch):
    def wrong(self):
        frame = frame_of(self)
        if self.time > 0.01:
            frame.positions[:, 2] -= 1.0  # below the ground
        return frame

    frame_of = Simulator.frame
    monkeypatch.setattr(Simulator, "frame", wrong)
    run = run_scene(everything(), 0.05)
    assert run.simulator.time < 0.02 and run.verdict is not None
    for claim in (run.assert_sound, run.assert_no_penetration, run.assert_energy, run.assert_repeatable):
        with pytest.raises(AssertionError, match="gap"):
            claim()


def test_a_controller_is_asked_before_the_first_step_and_after_each():
    asked = []

    def drive(simulator):
        asked.append(simulator.time)
        simulator.set_stimulus("humidity", min(1.0, 20.0 * simulator.time))

    run = run_scene(everything(), 0.02, drive=drive)
    assert asked[0] == 0.0 and len(asked) == run.result.steps + 1
    assert run["stimulus/humidity"].values[-1] > 0.3
    run.assert_repeatable()


def test_a_controller_that_depends_on_more_is_not_repeatable():
    calls = []

    def drive(simulator):
        calls.append(0)
        simulator.set_stimulus("humidity", (len(calls) % 17) / 17.0)

    with pytest.raises(AssertionError, match="made again it ends elsewhere"):
        run_scene(everything(), 0.02, drive=drive).assert_repeatable()


def test_settings_and_overrides_reach_the_simulator():
    run = run_scene(everything(), 0.01, overrides=["duration=0.02"], model="two_rod", dt=1e-3, budget=True)
    assert run.simulator.plan.model == "two_rod" and run.simulator.scene.duration == 0.02
    assert abs(run.simulator.budget()["relative_residual"]) < 0.02
    assert run_scene(load_scene(everything()), 0.01, overrides={"duration": 0.03}).simulator.scene.duration == 0.03
    with pytest.raises(SceneError, match="did you mean duration"):
        run_scene(everything(), overrides={"durration": 1.0})


def test_the_fixture_serves_tests_of_a_users_own_robot(pytester):
    pytester.makeconftest('pytest_plugins = ["bilayer_core.testing.plugin"]')
    pytester.makepyfile(
        """
        def test_it_bends(run_robot):
            run = run_robot("bending", 0.05)
            run.assert_sound()
            assert run["com"].values[-1, 2] != run["com"].values[0, 2]

        def test_it_fails(run_robot):
            run_robot("bending", 0.01).assert_energy(limit=-1.0)
        """
    )
    outcome = pytester.runpytest_inprocess("-p", "no:cacheprovider")
    outcome.assert_outcomes(passed=1, failed=1)
    outcome.stdout.fnmatch_lines(["*AssertionError: bending: steps made*"])


def test_data_of_a_run_are_those_of_its_simulator(bouncing):
    np.testing.assert_allclose(bouncing.data.com[-1], bouncing.simulator.com)
