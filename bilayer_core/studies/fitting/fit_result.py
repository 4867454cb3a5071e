"""Result of a fit."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bilayer_core.errors import UnknownName
from bilayer_core.printable import html_table
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.faults import listed, suggestion
from bilayer_core.studies.fitting.data import Data
from bilayer_core.studies.fitting.parameters import Parameter

Array = np.ndarray


@dataclass(frozen=True)
class Fitted:
    """A parameter with its value.

    Attributes
    ----------
    parameter : Parameter
        What was asked for: path, bounds, start, unit.
    value : float
        In SI units.
    interval : (float, float) or None
        95 % confidence interval, in SI units; None at a bound.
    at_bound : str
        ``lower`` or ``upper`` if the fit ends at a bound, beyond which the data draw it; else empty.
    step : float
        Of differences, in SI units at the start.
    """

    parameter: Parameter
    value: float
    interval: tuple[float, float] | None
    at_bound: str
    step: float

    @property
    def path(self) -> str:
        """Key path of the parameter."""
        return self.parameter.path

    def __str__(self) -> str:
        shown = self.parameter.shown
        if self.interval is None:
            return f"{self.path} = {shown(self.value)}, at its {self.at_bound} bound, no interval"
        return f"{self.path} = {shown(self.value)}, 95 % from {shown(self.interval[0])} to {shown(self.interval[1])}"


@dataclass(frozen=True, eq=False, repr=False)
class FitResult:
    """Fitted values, how well they are known, and how well runs agree with the data.

    Attributes
    ----------
    scene : SceneConfig
        With the fitted values.
    parameters : tuple of Fitted
    correlations : ndarray
        Of all parameters, NaN for those at a bound, shape (parameters, parameters).
    data : Data
        What was measured: `times`, `observed`, `sigma`.
    fitted, started : ndarray
        What runs come to with the fitted and with the start values, in SI units, shape (times, columns).
    sigma : dict of str to float
        Noise of each column in SI units, root mean square: as it was given, or as the residuals have it.
    sigma_known : bool
    freedom : int
        Degrees of freedom: values of the data less fitted parameters.
    chi_squared : float or None
        Sum of squared residuals, each divided by its noise, where that is known; about `freedom` if the model holds.
    probability : float or None
        That it would be larger by chance.
    numerical_noise : float
        Of the runs themselves, by how roughly they change with parameters: in standard deviations of the data's noise.
    converged : bool
    termination : str
        Why the fit ended.
    iterations, runs : int
    refused : tuple of str
        Runs that could not be made on the way, each with why; the fit goes back from them.
    warnings : tuple of str
    """

    scene: SceneConfig
    parameters: tuple[Fitted, ...]
    correlations: Array
    data: Data
    fitted: Array
    started: Array
    sigma: dict[str, float]
    sigma_known: bool
    freedom: int
    chi_squared: float | None
    probability: float | None
    numerical_noise: float
    converged: bool
    termination: str
    iterations: int
    runs: int
    refused: tuple[str, ...] = ()
    warnings: tuple[str, ...] = field(default=())

    @property
    def values(self) -> dict[str, float]:
        """Fitted values in SI units by key paths; `load_scene` takes them as overrides."""
        return {parameter.path: parameter.value for parameter in self.parameters}

    @property
    def residuals(self) -> Array:
        """Data less fit in SI units, shape (times, columns), NaN where data are missing."""
        found: Array = self.data.observed - self.fitted
        return found

    def __getitem__(self, path: str) -> Fitted:
        """Return the parameter of a key path.

        Parameters
        ----------
        path : str
            Such as ``materials.gel.youngs_modulus``.

        Returns
        -------
        Fitted

        Raises
        ------
        UnknownName
            If it was not fitted; the message has the nearest path. It is a KeyError too.
        """
        for parameter in self.parameters:
            if parameter.path == path:
                return parameter
        names = list(self.values)
        raise UnknownName(f"parameter {path!r}: was not fitted{suggestion(path, names)}; fitted were {listed(names)}")

    def _repr_html_(self) -> str:
        """Return the fit as a table for notebooks."""
        values = {of.path: str(of).partition(" = ")[2] for of in self.parameters}
        rest = f"{int(self.data.present.sum())} values, {self.freedom} degrees of freedom, {self.runs} runs"
        agreement = {} if self.probability is None else {"probability of the residuals": f"{self.probability:.2g}"}
        warnings = {f"warning {k}": text for k, text in enumerate(self.warnings, 1)}
        return html_table(f"Fit of {self.scene.name}", values | {"data": rest} | agreement | warnings)

    def __repr__(self) -> str:
        values = "; ".join(map(str, self.parameters))
        return f"FitResult({self.scene.name}: {values}; {int(self.data.present.sum())} values, {self.runs} runs)"
