"""One run under the judge."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from bilayer_core.observed.frame import Frame
from bilayer_core.scene.loader import load_scene
from bilayer_core.simulation.run_result import Termination
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.testing.judge import Judge

Array = np.ndarray


class Trial:
    """A simulator whose every step is judged.

    Parameters
    ----------
    content : mapping or str
        Of a scene file, or its path.
    most_steps : int
        Accepted steps after which runs end.
    cpu_limit : float
        Likewise CPU time [s].
    overrides : sequence of str
        ``KEY=VALUE``, as for ``--set``.
    look_every : int
        The judge's looks, in steps.
    judged, budget : bool
        Whether the judge looks at it, and whether its energy budget is kept.

    Attributes
    ----------
    simulator : Simulator
    judge : Judge
    length : float
        Of the longest strip [m].
    start : Frame
    cut : bool
        Whether a run ended before its time, by its steps or its CPU time.
    frames : list of Frame
        That are to be compared with those of a finer run.
    """

    def __init__(
        self,
        content: Mapping | str,
        most_steps: int,
        cpu_limit: float,
        overrides: Sequence[str] = (),
        look_every: int = 1,
        judged: bool = True,
        budget: bool = False,
    ):
        scene = load_scene(content, overrides)
        self.simulator = Simulator(scene, budget=budget)
        self.simulator.compile()
        self.judge = Judge(self.simulator, look_every)
        self.length = max(rod.path.length for rod in scene.rods)
        self.start = self.simulator.frame()
        self.cut = False
        self.frames: list[Frame] = []
        self._judged = judged
        self._most_steps, self._cpu_limit, self._cpu_start = most_steps, cpu_limit, clock.thread_time()

    def run(self, duration: float | None = None, each_step: Callable[[float], None] | None = None) -> None:
        """Run on for a time [s], by default to the end of the scene, or until the steps or the CPU time are used up.

        Parameters
        ----------
        duration : float, optional
        each_step : callable, optional
            Called with the time [s] after each step that the judge has passed.
        """

        def look(time: float) -> None:
            self.judge.look(time)
            if each_step is not None:
                each_step(time)

        self.simulator.run(duration, each_step=look if self._judged else None, interrupted=self._is_over)
        self.cut = self.simulator.termination == Termination.INTERRUPTED.value

    def _is_over(self) -> bool:
        steps = self.judge.steps if self._judged else self.simulator.statistics.steps
        return steps >= self._most_steps or clock.thread_time() - self._cpu_start > self._cpu_limit

    def ends(self, parts: int) -> list[float]:
        """Return the ends of so many equal parts of the scene [s].

        With fixed steps these are parts of what the allowed steps cover of the scene, each at the end of a step.
        """
        steps, duration = self.simulator.steps, self.simulator.scene.duration
        if steps.adaptive:
            return [duration * part / parts for part in range(1, parts + 1)]
        count = min(max(1, round(duration / steps.dt)), self._most_steps)
        return [steps.dt * number for number in sorted({max(1, round(count * p / parts)) for p in range(1, parts + 1)})]

    def looks(self, ends: Sequence[float]) -> list[Frame]:
        """Run on to each of these times [s]; frames at those that were reached."""
        frames = []
        for end in ends:
            if self.cut:
                break
            self.run(end - self.simulator.time)
            if not self.cut:
                frames.append(self.simulator.frame())
        return frames


def distance_of(first: Frame, second: Frame) -> float:
    """Return the largest distance of a node or a body of one frame from where it is in the other [m]."""
    apart = [np.linalg.norm(first.positions - second.positions, axis=1)]
    apart.append(np.linalg.norm(first.body_positions - second.body_positions, axis=1))
    return float(np.concatenate(apart).max())
