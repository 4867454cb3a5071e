"""Gradients of equilibria and of runs, by the names of quantities and parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.log.run.quantities import unknown_quantity
from bilayer_core.model.state import State
from bilayer_core.observed.frame import Description
from bilayer_core.simulation.gradients.course import Course
from bilayer_core.simulation.gradients.equilibrium_response import NOTHING, Equilibrium
from bilayer_core.simulation.gradients.nearby import PLACES, Builders, slope
from bilayer_core.simulation.gradients.parameters import Parameter
from bilayer_core.simulation.stepper import Stepper

if TYPE_CHECKING:
    from bilayer_core.simulation.gradients.run_response import RunResponse

Array = np.ndarray
Column = list[tuple[Array, Array]]


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
    off : dict
        Of a run, by quantity: difference between the derivatives and one more run with all numbers changed by a
        hundredth of their size, over the larger of both. Much of it is told by a warning.
    """

    derivatives: dict[tuple[str, str], Array]
    errors: dict[tuple[str, str], Array]
    residual: float
    off: dict[str, float] = field(default_factory=dict)

    def __getitem__(self, key: tuple[str, str]) -> Array:
        return self.derivatives[key]

    def __iter__(self) -> Iterator[tuple[str, str]]:
        return iter(self.derivatives)

    def __len__(self) -> int:
        return len(self.derivatives)


def _listed(names: str | Sequence[str]) -> list[str]:
    return [names] if isinstance(names, str) else list(names)


def differentiate(here: Equilibrium, of: str | Sequence[str], to: str | Sequence[str]) -> Gradient:
    """Return the derivatives of quantities by parameters.

    Raises
    ------
    InputError
        If there is no such quantity or parameter, or a parameter acts on nothing.
    """
    wanted = _known(here, of)
    found = {
        name: [(parameter.name, _column(here, parameter, wanted)) for parameter in parameters]
        for name, parameters in here.parameters(_listed(to)).items()
    }
    return _gathered(wanted, found, here.residual)


def _known(here: Equilibrium | RunResponse, of: str | Sequence[str]) -> list[str]:
    """Return the names of quantities, all of which are known."""
    wanted, known = _listed(of), here.known
    for name in wanted:
        if name not in known:
            raise unknown_quantity(name, known)
    return wanted


def _gathered(wanted: Sequence[str], found: dict[str, list[tuple[str, Column]]], residual: float) -> Gradient:
    """Return columns by the names of parameters as a gradient; lists of numbers have an axis."""
    derivatives: dict[tuple[str, str], Array] = {}
    errors: dict[tuple[str, str], Array] = {}
    for name, columns in found.items():
        single = len(columns) == 1 and columns[0][0] == name
        for k, quantity in enumerate(wanted):
            for into, part in ((derivatives, 0), (errors, 1)):
                stacked = np.stack([column[k][part] for _, column in columns], axis=-1)
                into[quantity, name] = stacked[..., 0] if single else stacked
    return Gradient(derivatives, errors, residual)


class DifferentiableRun:
    """A run whose steps are kept.

    Parameters
    ----------
    stepper : Stepper
        That makes its steps.
    state : State
        In which they end.
    builders : Builders
    description : Description
        Of the run.
    room : bool or int
        For states [bytes]; True for that of `Course`.
    """

    def __init__(
        self, stepper: Stepper, state: State, builders: Builders, description: Description, room: bool | int = True
    ):
        if room is not True and (not isinstance(room, int) or room < 1):
            raise InputError(f"run: gradients: found {room!r}; allowed are True, False and a number of bytes above 0")
        self._course = Course(stepper, state) if room is True else Course(stepper, state, room)
        self._builders, self._description = builders, description
        self._stepper, self._model = stepper, stepper.model

    def keeping(self, each_step: Callable[[float], None] | None) -> Callable[[float], None]:
        """Return what is to be called after each step, and calls another function then."""

        def keep(time: float) -> None:
            self._course.take()
            if each_step is not None:
                each_step(time)

        return keep

    @property
    def made(self) -> list[tuple[float, bool]]:
        """Times at which steps ended [s], and whether another method stood in."""
        return self._course.made

    def response(self) -> RunResponse:
        """Return what goes along the steps and back."""
        if self._stepper.model.drives is not self._model.drives:
            raise InputError("gradient: the scene has other values than in the run; differentiate before set_values")
        from bilayer_core.simulation.gradients.run_response import RunResponse  # brings scipy's sparse solvers

        return RunResponse(self._course, self._builders.stepper_of(self._model), self._builders, self._description)

    def gradient(self, of: str | Sequence[str], to: str | Sequence[str]) -> Gradient:
        """Return derivatives of quantities at the end of the run; see `RunResult.gradient`."""
        run = self.response()
        wanted, numbers = _known(run, of), run.numbers(_listed(to))
        each = [number for of_name in numbers.values() for number in of_name]
        along, found, tried = run.forward(each), {}, []
        for name, of_name in numbers.items():
            found[name] = []
            for number in of_name:
                k = len(tried)
                slopes, errors = run.values(number, along, k, wanted)
                if not any(np.any(slope != 0.0) for slope in slopes) and not np.any(along.place[:, k]):
                    raise InputError(
                        f"gradient: {number.path} acts on nothing in this run: neither the motion nor "
                        f"{', '.join(wanted)} depends on it; leave it out"
                    )
                found[name].append((number.path, list(zip(slopes, errors, strict=True))))
                tried.append((number, slopes))
        from bilayer_core.simulation.gradients.trial import try_derivatives

        off = try_derivatives(run, self._course, self._builders, self._description, wanted, tried)
        return replace(_gathered(wanted, found, run.residual), off=off)

    def pull_back(self, seeds: Mapping[str, Array], to: str | Sequence[str]) -> dict[str, Array]:
        """Return the derivatives of Σ seed · quantity; see `RunResult.pull_back`."""
        run = self.response()
        numbers = run.numbers(_listed(to))
        each = [number for of_name in numbers.values() for number in of_name]
        found = iter(run.backward(seeds, each))
        return {
            name: np.array(
                next(found) if len(of_name) == 1 and of_name[0].path == name else [next(found) for _ in of_name]
            )
            for name, of_name in numbers.items()
        }


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
