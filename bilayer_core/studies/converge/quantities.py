"""The figures of a run by which its convergence is judged.

| name | what |
| --- | --- |
| ``com.x``, ``com.y``, ``com.z`` | displacement of the robot's mass centre over the run [m] |
| ``com.rise``, ``com.rise_time`` | how far it rose above its start at most [m], and when [s] |
| ``take_off`` | when nodes lost their last contact, if they end the run without any [s] |
| ``body.<name>.x``, ``.y``, ``.z`` | displacement of a body [m] |
| ``body.<name>.first_contact`` | when a node first touched it [s] |
| ``mean_curvature`` | mean size of the curvature through the thickness at the end [1/m] |
| ``max_curvature`` | its largest size in the run [1/m] |
| ``tip.<rod>.x``, ``.y``, ``.z`` | displacement of the end of a rod's middle line [m] |
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.scene.faults import suggestion
from bilayer_core.simulation.simulator import Simulator

AXES = "xyz"
NEGLIGIBLE = 1e-3
"""Displacements below this part of the largest one are not among the headline numbers."""


class Watch:
    """Observer that collects the data for a run's figures at every step.

    Parameters
    ----------
    simulator : Simulator
        At the start of the run.
    """

    def __init__(self, simulator: Simulator):
        self._simulator, self._com, self._tips = simulator, simulator.com, _tips(simulator)
        self._times, self._heights = [simulator.time], [self._com[2]]
        self._touched, self._take_off = False, None

    def look(self, time: float) -> None:
        """Note what the run shows at a time [s]; to be called after each step."""
        self._times.append(time)
        self._heights.append(self._simulator.com[2])
        touches = bool(self._simulator.contact_forces.any())
        if self._touched and not touches:
            self._take_off = time
        self._touched = touches

    def figures(self) -> dict[str, float]:
        """Return every quantity that the run has."""
        simulator, summary = self._simulator, self._simulator.summary()
        found = _by_axis("com", simulator.com - self._com)
        rise, when = peak(np.array(self._times), np.array(self._heights))
        if rise > 0.0:
            found |= {"com.rise": rise, "com.rise_time": when}
        if self._take_off is not None and not self._touched:
            found["take_off"] = self._take_off
        for name, body in summary["bodies"].items():
            found |= _by_axis(f"body.{name}", np.subtract(body["end"], body["start"]))
            if body["first_contact"] is not None:
                found[f"body.{name}.first_contact"] = body["first_contact"]
        found |= {key: summary[key] for key in ("mean_curvature", "max_curvature")}
        for name, tip in _tips(simulator).items():
            found |= _by_axis(f"tip.{name}", tip - self._tips[name])
        return found


def is_event(name: str) -> bool:
    """Return whether a quantity is the time of a contact, which is known to within a step."""
    return name.endswith(("take_off", "first_contact"))


def measure(simulator: Simulator, duration: float) -> dict[str, float]:
    """Run a scene for so long [s] and return every quantity that it has.

    Raises
    ------
    SimulationError
        If a step cannot be made.
    """
    watch = Watch(simulator)
    simulator.run(duration, each_step=watch.look)
    return watch.figures()


def headline(found: dict[str, float], prescribed: Sequence[str]) -> list[str]:
    """Return the names of the quantities that say what a robot did: no tips, no prescribed motion, no negligible
    displacement.
    """
    chosen = [
        name
        for name in found
        if not name.startswith("tip.") and name.rpartition(".")[0] not in {f"body.{body}" for body in prescribed}
    ]
    moves = [name for name in chosen if name.rpartition(".")[2] in AXES]
    largest = max((abs(found[name]) for name in moves), default=0.0)
    return [name for name in chosen if name not in moves or abs(found[name]) > NEGLIGIBLE * largest]


def check_names(simulator: Simulator, asked: Sequence[str]) -> None:
    """Refuse quantities that no run of this scene can have.

    Raises
    ------
    InputError
        Names the quantity, and lists those that there are.
    """
    bodies = simulator.model.bodies.names
    points = ["com", *(f"body.{body}" for body in bodies), *(f"tip.{rod}" for rod in simulator.rods)]
    known = [f"{point}.{axis}" for point in points for axis in AXES]
    known += ["com.rise", "com.rise_time", "take_off", "mean_curvature", "max_curvature"]
    known += [f"body.{body}.first_contact" for body in bodies]
    for name in asked:
        if name not in known:
            raise InputError(
                f"--quantity {name}: no such figure{suggestion(name, known)}; there are {', '.join(known)}"
            )


def unit_of(name: str) -> tuple[str, float]:
    """Return the unit in which a quantity is shown, and the factor from SI units to it."""
    if name.endswith(("take_off", "time", "first_contact")):
        return "s", 1.0
    if name.endswith("curvature"):
        return "1/m", 1.0
    return "mm", 1e3


def _by_axis(name: str, vector: np.ndarray) -> dict[str, float]:
    return {f"{name}.{axis}": float(value) for axis, value in zip(AXES, vector, strict=True)}


def _tips(simulator: Simulator) -> dict[str, np.ndarray]:
    return {name: rod.middle_line[-1] for name, rod in simulator.rods.items()}


def peak(times: np.ndarray, heights: np.ndarray) -> tuple[float, float]:
    """Return the rise of the highest point over the first [m] and its time [s], from the parabola through its
    neighbours.
    """
    top = int(heights.argmax())
    rise, when = heights[top] - heights[0], times[top]
    if 0 < top < len(heights) - 1:
        before, after = times[top] - times[top - 1], times[top + 1] - times[top]
        up, down = (heights[top] - heights[top - 1]) / before, (heights[top + 1] - heights[top]) / after
        bend = (down - up) / (before + after)
        if bend < 0.0:
            slope = (up * after + down * before) / (before + after)
            rise -= 0.25 * slope**2 / bend
            when -= 0.5 * slope / bend
    return float(rise), float(when)
