"""A fit from its data to its result."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import chdtrc

from bilayer_core.errors import BilayerError, InputError
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.loader import load_scene, scene_content
from bilayer_core.scene.overrides import Overrides
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.studies.fitting.data import Data, read_data, with_sigma
from bilayer_core.studies.fitting.descent import Descent, descend
from bilayer_core.studies.fitting.differences import jacobian
from bilayer_core.studies.fitting.fit_result import FitResult, Fitted
from bilayer_core.studies.fitting.identify import refuse_undetermined, refuse_unseen, refuse_without_influence
from bilayer_core.studies.fitting.intervals import Spread, spread_of
from bilayer_core.studies.fitting.noise import Step, choose_steps, shares
from bilayer_core.studies.fitting.parameters import Parameter, Parameters, read_parameters
from bilayer_core.studies.fitting.runs import Runs, check_times, known_quantities

Array = np.ndarray
AT_BOUND = 1e-4
"""Part of the way between bounds within which a parameter that the data draw to a bound is at it."""
DOUBTFUL = 0.01
"""Probability of the residuals below which the fit warns that the model or the noise is not what it was taken for."""
ROUGH = "runs change roughly with parameters"
SMOOTHER = "fixed steps (--dt) or a smaller solver.tolerance may help, or data of times before bodies bounce"
MOST_STARTS, SAME = 100, 0.01
"""Of descents, and how far ends may be apart that are one minimum, as a part of the way between bounds."""
NOISY, RESOLVED = 0.3, 1e-6
"""Numerical noise, in that of the data and in their spread, from which on the fit warns of it."""


def fit(
    scene: SceneConfig | str | Path | Mapping[str, Any],
    data: str | Path | Mapping[str, Any],
    parameters: Parameters,
    *,
    sigma: Sequence[str] | Mapping[str, float | str] = (),
    overrides: Overrides = (),
    dt: float | str | None = None,
    starts: int = 1,
    progress: Callable[[str], None] | None = None,
) -> FitResult:
    """Find the values of parameters of a scene with which its run agrees best with data, by least squares.

    Parameters
    ----------
    scene : SceneConfig, str, Path or mapping
        As `load_scene` takes it.
    data : str, Path or mapping
        A csv file, or arrays by the names of their columns (a table of pandas is one): ``time`` and quantities, such as
        ``com.z [mm]`` or ``rod/strip/position[-1].x``; see `studies.fitting.data`.
    parameters : sequence of str or mapping
        ``PATH=LO:HI`` or ``PATH=LO:HI:START``, or ``(lo, hi)`` or ``(lo, hi, start)`` by paths. Without a start it is
        the scene's value, if that is between the bounds, else their middle.
    sigma : sequence of str or mapping
        Noise of columns, ``QUANTITY=VALUE``; if it is given for none it is estimated, the same for all.
    overrides : sequence of str or mapping
        As `load_scene` takes them.
    dt : float or str, optional
        Fixed steps of this length; by default what the scene says, adaptive ones as a rule.
    starts : int
        Places from which to go to the nearest minimum, of which the least one counts: the start of the parameters, and
        others spread over their bounds.
    progress : callable, optional
        Called with a line of text now and then.

    Returns
    -------
    FitResult

    Raises
    ------
    SceneError, InputError
        If anything that is given is not acceptable, or a parameter has no influence on the data.
    NotIdentifiable
        If the data cannot tell parameters apart; it names them.
    SimulationError
        If a run cannot go on with the start values, or near the solution; its message has the values.
    """
    if isinstance(starts, bool) or not isinstance(starts, int) or not 1 <= starts <= MOST_STARTS:
        raise InputError(f"starts: {starts!r} is not allowed; it must be a whole number from 1 to {MOST_STARTS}")
    config = _configured(scene, overrides, dt)
    simulator = Simulator(config)
    known, nodes = known_quantities(simulator)
    measured = with_sigma(read_data(data, known, nodes, config.duration), sigma)
    check_times(simulator, measured)
    sought = read_parameters(config, parameters)
    _refuse_few(measured, sought)
    return _Search(config, measured, sought, progress).result(starts)


def _configured(scene: Any, overrides: Overrides, dt: float | str | None) -> SceneConfig:
    config = load_scene(scene, overrides)
    return config if dt is None else load_scene(scene_content(config), {"solver.dt": dt, "solver.tolerance": None})


def _refuse_few(data: Data, parameters: Sequence[Parameter]) -> None:
    count, needed = int(data.present.sum()), len(parameters) + (data.sigma is None)
    if count < needed:
        why = "" if data.sigma is not None else ", one more than parameters, since the noise is estimated too"
        raise InputError(f"{data.source}: holds {count} values, fewer than needed for this fit: {needed}{why}")


class _Search:
    """The state of one fit."""

    def __init__(
        self, scene: SceneConfig, data: Data, parameters: Sequence[Parameter], progress: Callable[[str], None] | None
    ):
        self._data, self._parameters = data, parameters
        self._progress = progress or (lambda text: None)
        self._present = data.present
        self._observed = data.observed[self._present]
        self._weights = _weights(data)
        self._runs = Runs(scene, parameters, data)
        self._steps: list[Step] = []
        self._iterations = 0

    def result(self, starts: int) -> FitResult:
        """Return the best fit of those from so many starts."""
        start = np.array([p.part(p.start) for p in self._parameters])
        started = self._runs.evaluate(start)
        self._progress(f"start: {self._agreement(self._residuals(started))}")
        self._steps = choose_steps(self._runs, start, self._weights)
        self._progress(f"numerical noise measured in {self._runs.count} runs")
        matrix = self._jacobian(start)
        refuse_without_influence(self._parameters, matrix)
        self._refuse_unseen(start, matrix, "at the start")
        return self._concluded(self._descended([start, *_spread(starts - 1, start.size)]), started)

    def _descended(self, starts: list[Array]) -> Descent:
        """Return the descent to the least of the minima that are near starts; what of them cannot run is left out."""
        noise, found = 1.0 if self._data.sigma is not None else None, []
        for start in starts:
            try:
                found.append(descend(self._objective, self._derivatives, start, noise))
            except BilayerError as error:
                if not found:
                    raise
                self._progress(f"left a start out: {error}")
        sizes = [float(np.linalg.norm(of.residuals)) for of in found]
        best = found[int(np.argmin(sizes))]
        if len(starts) == 1:
            return best
        near = sum(bool(np.abs(of.parts - best.parts).max() <= SAME) for of in found)
        return replace(best, termination=f"{best.termination}; {near} of {len(starts)} starts end there")

    def _residuals(self, values: Array) -> Array:
        """Return fit less data, weighted, shape (residuals,)."""
        found: Array = (values[self._present] - self._observed) * self._weights[self._present]
        return found

    def _objective(self, parts: Array) -> Array:
        outcome = self._runs.evaluate_many([parts])[0]
        if isinstance(outcome, BilayerError):  # the search goes back from what is not finite
            self._progress(f"went back: {self._runs.explained(parts, outcome)}")
            return np.full(self._observed.size, np.inf)
        return self._residuals(outcome)

    def _derivatives(self, parts: Array) -> Array:
        self._iterations += 1
        self._progress(f"iteration {self._iterations}: {self._agreement(self._objective(parts))}")
        return self._jacobian(parts)

    def _jacobian(self, parts: Array) -> Array:
        found: Array = jacobian(self._runs, parts, self._steps)[self._present]
        return found * self._weights[self._present][:, None]

    def _agreement(self, residuals: Array) -> str:
        root = float(np.sqrt(np.mean(residuals**2)))
        unit = "times the noise" if self._data.sigma is not None else "of the data's spread"
        return f"residuals {root:.4g} {unit} (root mean square), {self._runs.count} runs"

    def _refuse_unseen(self, parts: Array, matrix: Array, where: str) -> None:
        rough = f"; {ROUGH}: {SMOOTHER}" if self._noise > RESOLVED else ""
        refuse_unseen(self._parameters, parts, matrix, shares(self._steps, self._observed.size), where, rough)

    def _concluded(self, at: Descent, started: Array) -> FitResult:
        parts = at.parts
        self._refuse_unseen(parts, at.matrix, "at the solution")
        known = self._data.sigma is not None
        whole = spread_of(at.matrix, at.residuals, known, self._noise)  # what is at a bound may be so by chance
        refuse_undetermined(self._parameters, parts, whole.covariance, whole.wide, "at the solution")
        bounds = _bounds_at(at)
        free = [k for k, bound in enumerate(bounds) if not bound]
        spread, correlations = None, np.full((parts.size, parts.size), np.nan)
        if free:
            spread = spread_of(at.matrix[:, free], at.residuals, known, self._noise)
            correlations[np.ix_(free, free)] = spread.correlations
        return self._result(at, bounds, free, spread, correlations, started)

    def _result(
        self,
        at: Descent,
        bounds: list[str],
        free: list[int],
        spread: Spread | None,
        correlations: Array,
        started: Array,
    ) -> FitResult:
        known = self._data.sigma is not None
        freedom = at.residuals.size - len(free)
        squares = float(at.residuals @ at.residuals)
        noise = 1.0 if known else float(np.sqrt(squares / freedom))
        probability = float(chdtrc(freedom, squares)) if known and freedom else None
        refused = tuple(str(self._runs.explained(point, error)) for point, error in self._runs.refused)
        return FitResult(
            scene=self._runs.scene_at(at.parts),
            parameters=tuple(self._fitted(k, at.parts, bounds, free, spread) for k in range(len(self._parameters))),
            correlations=correlations,
            data=self._data,
            fitted=self._runs.evaluate(at.parts),
            started=started,
            sigma=self._sigma(noise),
            sigma_known=known,
            freedom=freedom,
            chi_squared=squares if known else None,
            probability=probability,
            numerical_noise=self._noise / noise if noise > 0.0 else float("inf"),
            converged=at.converged,
            termination=at.termination,
            iterations=self._iterations,
            runs=self._runs.count,
            refused=refused,
            warnings=tuple(self._warnings(bounds, noise, probability)),
        )

    @property
    def _noise(self) -> float:
        """Largest numerical noise of a weighted residual."""
        return max(step.noise for step in self._steps)

    def _warnings(self, bounds: list[str], noise: float, probability: float | None) -> Iterator[str]:
        for parameter, bound in zip(self._parameters, bounds, strict=True):
            if bound:
                yield f"{parameter.path} ends at its {bound} bound: no interval; widen the bounds if it may be beyond"
        if self._noise > NOISY * noise and self._noise > RESOLVED:
            yield f"{ROUGH}, their numerical noise is {self._noise / noise:.2g} of the data's: {SMOOTHER}"
        if probability is not None and probability < DOUBTFUL:
            yield (
                f"residuals are larger than the noise that was given: chance has them so with a probability of "
                f"{probability:.1g}; intervals are too narrow, or the model lacks something"
            )

    def _fitted(self, k: int, parts: Array, bounds: list[str], free: list[int], spread: Spread | None) -> Fitted:
        parameter, part, interval = self._parameters[k], float(parts[k]), None
        if k in free and spread is not None:
            half = spread.wide * float(spread.deviations[free.index(k)])
            interval = parameter.value(part - half), parameter.value(part + half)
        step = self._steps[k]
        at_start = parameter.part(parameter.start)
        length = abs(parameter.value(at_start + step.step) - parameter.start)
        return Fitted(parameter, parameter.value(part), interval, bounds[k], length)

    def _sigma(self, noise: float) -> dict[str, float]:
        sigma, found = self._data.sigma, {}
        for k, column in enumerate(self._data.columns):
            here = self._present[:, k]
            own = noise / self._weights[here, k] if sigma is None else sigma[here, k]
            found[column.name] = float(np.sqrt(np.mean(own**2)))
        return found


def _spread(count: int, size: int) -> Array:
    """Return so many places spread over all that may be, in parts of the way between bounds, shape (count, size)."""
    from scipy.stats import qmc  # takes half a second

    found: Array = qmc.Halton(size, scramble=False).random(count + 1)[1:]  # without the corner
    return found


def _weights(data: Data) -> Array:
    """Return the weights of residuals, shape (times, columns), 0 where data are missing: 1/σ, or if that is not known
    1/spread of all.
    """
    observed, present = data.observed, data.present
    if data.sigma is not None:
        return np.where(present, 1.0 / np.where(present, data.sigma, 1.0), 0.0)
    spread = float(np.sqrt(np.mean([np.var(column[here]) for column, here in zip(observed.T, present.T, strict=True)])))
    largest = float(np.abs(observed[present]).max())
    return np.where(present, 1.0 / (spread or largest or 1.0), 0.0)


def _bounds_at(at: Descent) -> list[str]:
    """Return at which bound each parameter is, if the sum of squares gets smaller beyond it."""
    slope = at.matrix.T @ at.residuals
    lower = (at.parts <= AT_BOUND) & (slope > 0.0)
    upper = (at.parts >= 1.0 - AT_BOUND) & (slope < 0.0)
    return ["lower" if low else "upper" if high else "" for low, high in zip(lower, upper, strict=True)]
