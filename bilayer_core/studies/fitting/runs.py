"""Runs of a scene with values of its parameters, as what they come to at the times of the data."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bilayer_core.errors import BilayerError, InputError, SceneError, SimulationError
from bilayer_core.log.messages.encoders import SOLVER_LABELS
from bilayer_core.log.run.frame_values import FrameValues
from bilayer_core.log.run.quantities import Entry, entries
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.loader import load_scene, scene_content
from bilayer_core.scene.overrides import Override
from bilayer_core.simulation.at_rest import look_no_more
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.studies.fitting.data import Data
from bilayer_core.studies.fitting.parameters import Parameter, told

Array = np.ndarray
Outcome = Array | BilayerError
"""Values at the times of the data in SI units, shape (times, columns), or why there are none."""
MULTIPLE = 1e-6
"""Of a fixed step: how far a time may be from the end of one."""
KEPT = 2000
"""Outcomes that are remembered: differences come back to where the fit is."""


def known_quantities(simulator: Simulator) -> tuple[dict[str, Entry], dict[str, int]]:
    """Return the quantities of a scene by name, and the number of nodes of those that nodes have."""
    frame = simulator.frame()
    known = {entry.name: entry for entry in entries(simulator.description, frame.energy, SOLVER_LABELS)}
    values = FrameValues(simulator.description)
    return known, {name: len(values.of(entry, frame)) for name, entry in known.items() if entry.of_shape}


class Runs:
    """Makes runs and remembers what they came to.

    `make_many` is the one place where they are made, one after the other: what makes them in several processes replaces
    that alone.

    Parameters
    ----------
    scene : SceneConfig
    parameters : sequence of Parameter
    data : Data

    Attributes
    ----------
    count : int
        Of runs that were made.
    refused : list of (ndarray, BilayerError)
        Parts at which no run could be made, and why.
    """

    def __init__(self, scene: SceneConfig, parameters: Sequence[Parameter], data: Data):
        self._content, self._parameters, self._data = scene_content(scene), parameters, data
        self._simulator: Simulator | None = None
        self._outcomes: dict[bytes, Outcome] = {}
        self.count = 0
        self.refused: list[tuple[Array, BilayerError]] = []

    def evaluate_many(self, points: Sequence[Array]) -> list[Outcome]:
        """Return the outcomes of runs at several points.

        Parameters
        ----------
        points : sequence of ndarray
            Parts of the way between bounds, each of shape (parameters,).

        Returns
        -------
        list
            The values of each, or the error that kept it from its end.
        """
        keys = [np.ascontiguousarray(point, dtype=float).tobytes() for point in points]
        missing = {key: point for key, point in zip(keys, points, strict=True) if key not in self._outcomes}
        if len(self._outcomes) + len(missing) > KEPT:
            missing = dict(zip(keys, points, strict=True))
            self._outcomes.clear()
        made = self.make_many(list(missing.values()))
        self.count += len(missing)
        for (key, point), outcome in zip(missing.items(), made, strict=True):
            self._outcomes[key] = outcome
            if isinstance(outcome, BilayerError):
                self.refused.append((point.copy(), outcome))
        return [self._outcomes[key] for key in keys]

    def make_many(self, points: Sequence[Array]) -> list[Outcome]:
        """Make a run for each of some points, all of them different."""
        return [self._made(point) for point in points]

    def evaluate(self, point: Array) -> Array:
        """Return the values of one run at the times of the data, shape (times, columns).

        Raises
        ------
        BilayerError
            If the run cannot be made; its message has the values of the parameters.
        """
        return self.demand([point])[0]

    def demand(self, points: Sequence[Array]) -> list[Array]:
        """Return the values of runs that a fit cannot do without; raise the errors of `evaluate`."""
        found = []
        for point, outcome in zip(points, self.evaluate_many(points), strict=True):
            if isinstance(outcome, BilayerError):
                raise self.explained(point, outcome) from outcome
            found.append(outcome)
        return found

    def explained(self, point: Array, error: BilayerError) -> BilayerError:
        """Return an error of a run with the values of the parameters in its message."""
        values = told(self._parameters, point)
        if isinstance(error, SimulationError):
            return SimulationError(f"{error.reason}; this run has {values}", error.time, error.remedy)
        return type(error)(f"no run with {values}: {error}")

    def scene_at(self, point: Array) -> SceneConfig:
        """Return the scene with given values of the parameters."""
        for parameter, part in zip(self._parameters, point.tolist(), strict=True):
            value = parameter.value(part)
            Override(tuple(parameter.path.split(".")), value, f"{parameter.path}={value}").apply(self._content)
        return load_scene(self._content)

    def _made(self, point: Array) -> Outcome:
        try:
            return self._run(self._simulator_of(self.scene_at(point)))
        except (SceneError, SimulationError) as error:
            self._simulator = None
            return error

    def _simulator_of(self, scene: SceneConfig) -> Simulator:
        """Return a simulator at the start of a scene: that of the run before, where only what it can be reset to
        differs.
        """
        if self._simulator is not None and self._simulator.same_model(scene):
            self._simulator.reset(scene)
        else:
            self._simulator = Simulator(scene)
            look_no_more(self._simulator)
        return self._simulator

    def _run(self, simulator: Simulator) -> Array:
        values = np.empty((self._data.times.size, len(self._data.columns)))
        in_frames = FrameValues(simulator.description)
        for k, time in enumerate(self._data.times.tolist()):
            if time > simulator.time:
                simulator.run(until=time)
            frame = simulator.frame()
            values[k] = [in_frames.of(column.entry, frame)[column.place] for column in self._data.columns]
        return values


def check_times(simulator: Simulator, data: Data) -> None:
    """Refuse times at which no fixed step ends.

    Raises
    ------
    InputError
        Names the first one, and what to do.
    """
    if simulator.steps.adaptive:
        return
    steps = data.times / simulator.dt
    for time, off in zip(data.times.tolist(), np.abs(steps - np.round(steps)).tolist(), strict=True):
        if off > MULTIPLE:
            raise InputError(
                f"{data.source}: the time {time:g} s is no multiple of the fixed step, {simulator.dt:g} s, so no step "
                "ends there; give --dt of which all times are multiples, or leave it out for adaptive steps"
            )
