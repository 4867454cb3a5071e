"""A run of a robot whose every step was judged, and what can be said of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.log.run.memory import MemoryRecorder
from bilayer_core.log.run.quantities import Quantity
from bilayer_core.log.run.run_data import RunData
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.loader import load_scene
from bilayer_core.scene.overrides import Overrides
from bilayer_core.simulation.run_result import RunResult
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.testing.judge import MOST_MADE, Judge, Verdict

Scene = str | Path | Mapping[str, Any] | SceneConfig
Drive = Callable[[Simulator], object]


class RobotRun:
    """A run whose every step was judged; `run_scene` makes it.

    Attributes
    ----------
    simulator : Simulator
        As it stands at the end.
    result : RunResult
    data : RunData
        Quantities over time; ``run["com"]`` is ``run.data["com"]``.
    verdict : Verdict or None
        What was wrong with a step, which ended the run there.
    smallest_gap : float
        Of all steps, by a check that shares nothing with the solver but the geometry [m]; infinite where nothing can
        touch.
    energy_made : float
        The most that steps made beyond all that was supplied, as part of the largest energy of the run.
    """

    def __init__(self, simulator: Simulator, drive: Drive | None, until: float, rate: float):
        self.simulator, self._drive, self._until, self._start = simulator, drive, until, simulator.save_state()
        self._judge = Judge(simulator)
        self.verdict: Verdict | None = None
        recorder = MemoryRecorder(rate)
        detach = simulator.attach(recorder)
        try:
            self.result = self._run(judged=True)
            if self.verdict is None:
                self._judged(lambda: self._judge.end(inside=True))
        finally:
            detach()
        self.data: RunData = recorder.run_data()
        self.smallest_gap, self.energy_made = self._judge.min_gap, self._judge.numerical

    def __repr__(self) -> str:
        said = f"wrong: {self.verdict}" if self.verdict else "sound"
        return f"RobotRun({self.simulator.scene.name} to t = {self.simulator.time:g} s: {said})"

    def __getitem__(self, name: str) -> Quantity:
        """Return a quantity over time.

        Parameters
        ----------
        name : str
            Such as ``com``.

        Returns
        -------
        Quantity
        """
        return self.data[name]

    def _run(self, judged: bool) -> RunResult:
        def each(time: float) -> None:
            if judged:
                self._judged(lambda: self._judge.look(time))
            if self._drive is not None:
                self._drive(self.simulator)

        if self._drive is not None:
            self._drive(self.simulator)
        return self.simulator.run(until=self._until, stop=lambda: self.verdict is not None, each_step=each)

    def _judged(self, judge: Callable[[], object]) -> None:
        try:
            judge()
        except Verdict as verdict:
            self.verdict = verdict

    def assert_sound(self) -> None:
        """Fail unless each step was right: finite, nothing through anything, no energy from nothing, momentum kept, and
        the effort bounded; see `bilayer_core.testing.judge` for the limits.
        """
        if self.verdict is not None:
            raise AssertionError(f"{self.simulator.scene.name}: {self.verdict}")

    def assert_no_penetration(self, at_least: float = 0.0) -> None:
        """Fail if the smallest gap of any step was not larger than a limit.

        Parameters
        ----------
        at_least : float
            The limit [m].

        Raises
        ------
        InputError
            If nothing in the scene can touch, so that there is nothing to be asserted.
        """
        self.assert_sound()
        if math.isinf(self.smallest_gap):
            raise InputError(f"{self.simulator.scene.name}: nothing in this scene can touch; there is no gap to check")
        if not self.smallest_gap > at_least:
            raise AssertionError(
                f"{self.simulator.scene.name}: the smallest gap is {self.smallest_gap:.3g} m, not above {at_least:g} m"
            )

    def assert_energy(self, limit: float = MOST_MADE) -> None:
        """Fail if steps made more energy than a limit, beyond all that was supplied.

        Parameters
        ----------
        limit : float
            As a part of the largest energy of the run.
        """
        self.assert_sound()
        if not self.energy_made <= limit:
            made = f"steps made {self.energy_made:.3g} of the largest energy of the run"
            raise AssertionError(f"{self.simulator.scene.name}: {made}, more than {limit:g}")

    def assert_repeatable(self) -> None:
        """Fail unless the same run, made again from the same start, ends in the same state bit for bit."""
        self.assert_sound()
        before = self.simulator.save_state()
        self.simulator.reset()
        self.simulator.load_state(self._start)
        self._run(judged=False)
        again = self.simulator.save_state()
        if not np.array_equal(again, before, equal_nan=True):
            apart = float(np.nanmax(np.abs(again - before)))
            raise AssertionError(f"{self.simulator.scene.name}: made again it ends elsewhere, by up to {apart:.3g}")


def run_scene(
    scene: Scene,
    duration: float | None = None,
    *,
    overrides: Overrides = (),
    drive: Drive | None = None,
    rate: float = 50.0,
    **settings: Any,
) -> RobotRun:
    """Run a robot with a judge that looks at every step.

    Parameters
    ----------
    scene : str, Path, mapping or SceneConfig
        As for `bilayer_core.load_scene`.
    duration : float, optional
        Simulated time [s]; default: the scene's.
    overrides : sequence of str, or mapping
        Values to change, as for `bilayer_core.load_scene`.
    drive : callable, optional
        A controller: called with the simulator before the first step and after each, to set stimuli, loads and poses.
        For `RobotRun.assert_repeatable` it must depend on nothing but the simulator.
    rate : float
        Of the recorded quantities [Hz].
    **settings
        As for `bilayer_core.Simulator`: ``model``, ``dimension``, ``integrator``, ``dt``, ``tolerance``, ``budget``.
        With ``budget=True`` the energy budget must close too.

    Returns
    -------
    RobotRun

    Raises
    ------
    BilayerError
        If the scene is not acceptable, or a step cannot be made.
    """
    config = load_scene(scene, overrides)
    simulator = Simulator(config, **settings)
    simulator.compile()
    return RobotRun(simulator, drive, config.duration if duration is None else duration, rate)
