"""Tests of your own robots: run a scene under a judge, and say what must hold.

In the ``conftest.py`` of your tests::

    pytest_plugins = ["bilayer_core.testing.plugin"]

and in a test::

    def test_my_gripper_lifts_the_ball(run_robot):
        run = run_robot("my_gripper.yaml", overrides={"contact.friction.coefficient": 0.3})
        run.assert_sound()
        run.assert_no_penetration()
        run.assert_repeatable()
        assert run["body/ball/position"].values[-1, 2] > 0.05

`run_scene` is the same without pytest.
"""

from bilayer_core.testing.robot_run import RobotRun, run_scene

__all__ = ["RobotRun", "run_scene"]
