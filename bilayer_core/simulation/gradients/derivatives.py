"""What a gradient is, and that of an equilibrium by quantities and parameters."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.log.run.quantities import unknown_quantity
from bilayer_core.simulation.gradients.equilibrium_response import NOTHING, Equilibrium
from bilayer_core.simulation.gradients.nearby import PLACES, slope
from bilayer_core.simulation.gradients.parameters import Parameter

Array = np.ndarray


@dataclass(frozen=True)
class Gradient(Mapping[tuple[str, str], Array]):
    """Derivatives by quantity and parameter: ``found["com", "humidity"]``.

    Attributes
    ----------
    derivatives : dict
        By quantity and parameter, in SI units, stimuli in those of their channels. The shape is that of the quantity,
        with one axis more behind for a list of numbers.
    errors : dict
        Likewise, the size of the error: by how much the last correction changed each value.
    residual : float
        Largest displacement that Newton's method still made at the equilibrium before it was differentiated [m].
    """

    derivatives: dict[tuple[str, str], Array]
    errors: dict[tuple[str, str], Array]
    residual: float

    def __getitem__(self, key: tuple[str, str]) -> Array:
        return self.derivatives[key]

    def __iter__(self) -> Iterator[tuple[str, str]]:
        return iter(self.derivatives)

    def __len__(self) -> int:
        return len(self.derivatives)


def differentiate(here: Equilibrium, known: Collection[str], of: Sequence[str], to: Sequence[str]) -> Gradient:
    """Return the derivatives of quantities by parameters.

    Raises
    ------
    InputError
        If there is no such quantity or parameter, or a parameter acts on nothing.
    """
    for name in of:
        if name not in known:
            raise unknown_quantity(name, known)
    derivatives: dict[tuple[str, str], Array] = {}
    errors: dict[tuple[str, str], Array] = {}
    for name, parameters in here.parameters(to).items():
        columns = [_column(here, parameter, of) for parameter in parameters]
        single = len(parameters) == 1 and parameters[0].name == name
        for k, quantity in enumerate(of):
            for found, part in ((derivatives, 0), (errors, 1)):
                stacked = np.stack([column[k][part] for column in columns], axis=-1)
                found[quantity, name] = stacked[..., 0] if single else stacked
    return Gradient(derivatives, errors, here.residual)


def _column(here: Equilibrium, parameter: Parameter, wanted: Sequence[str]) -> list[tuple[Array, Array]]:
    """Return the derivative of each quantity by a parameter, and the size of its error."""
    response = here.respond(parameter)
    slopes, largest = [], []
    for motion in (response.motion, response.motion + response.correction * -1.0):
        rows = [
            nearby.values(nearby.moved(motion * (place * response.h)), wanted)
            for nearby, place in zip(response.nearby, PLACES, strict=True)
        ]
        slopes.append([slope(row, response.h) for row in zip(*rows, strict=True)])
        largest = [max(float(np.abs(value).max(initial=0.0)) for value in row) for row in zip(*rows, strict=True)]
    moved = [response.h * np.abs(s).max(initial=0.0) for s in slopes[0]]
    if not response.moves and all(m <= NOTHING * most for m, most in zip(moved, largest, strict=True)):
        raise InputError(
            f"gradient: {parameter.name} acts on nothing here: neither the shape at rest nor "
            f"{', '.join(wanted)} depends on it; leave it out"
        )
    return [(one, np.abs(one - other)) for one, other in zip(*slopes, strict=True)]
