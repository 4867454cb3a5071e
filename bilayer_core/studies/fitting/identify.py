"""Which parameters the data can tell apart.

Each column of the Jacobian of weighted residuals is divided by the size of its own numerical error, which is taken for
a millionth of the column at least. A singular value of that matrix below a few then belongs to a direction along which
nothing was seen but error: the data do not tell parameters along it from each other. Where the noise of the data is
known, or found from a fit, a direction along which the 95 % interval is as wide as the bounds are is not told by the
data either.

The directions that are not determined span a space; its basis is made such that each vector has a parameter of its own
and few others, and each is told as parts by which parameters may change together without any difference to be seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from bilayer_core.errors import BilayerError, InputError
from bilayer_core.studies.fitting.parameters import Parameter

Array = np.ndarray
SEEN = 4.0
"""Singular values, in sizes of the numerical error, from which on a direction was seen."""
MODEL = 1e-6
"""Smallest error of a derivative, relative: nothing that is measured follows a scene more closely."""
NOTHING = 1e-9
"""Change of a weighted value from bound to bound, below which a parameter has no influence on it."""
PART = 0.02
"""Smallest part of a direction, of its largest, whose parameter is named."""
UNSEEN = "what they change is within the numerical error of the derivatives"
WIDE = "intervals would be wider than their bounds"
REMEDY = "set one of each with --set PATH=VALUE and leave its --parameter out, or add data that tell them apart"


@dataclass(frozen=True)
class Direction:
    """Parameters that may change together without any difference in the data.

    Attributes
    ----------
    changes : dict of str to float
        By key paths: relative changes, that of the first one 1 (of a parameter that is 0, its change).
    relative : bool
        Whether all of them are relative.
    """

    changes: dict[str, float]
    relative: bool = True

    def __str__(self) -> str:
        names = list(self.changes)
        if len(names) == 1:
            return f"{names[0]}: the data tell nothing of it"
        if len(names) == 2 and self.relative:
            power = -1.0 / self.changes[names[1]]
            return f"{names[0]} and {names[1]}: the data tell only {names[0]} · {names[1]}^{power:.3g}"
        unit = " %" if self.relative else ""
        together = ", ".join(f"{name} by {change:+.3g}{unit}" for name, change in self.changes.items())
        return f"{', '.join(names)}: the data are the same when they change together, {together}"


class NotIdentifiable(BilayerError):
    """The data cannot tell some parameters apart, so these have no values.

    Attributes
    ----------
    directions : tuple of Direction
    where : str
        At what values that was found.
    """

    exit_code = 1

    def __init__(self, directions: tuple[Direction, ...], where: str, reason: str, note: str = ""):
        lines = "\n".join(f"  {direction}" for direction in directions)
        told = f"nothing was fitted: the data cannot tell parameters apart {where} ({reason}):"
        super().__init__(f"{told}\n{lines}\n  {REMEDY}{note}")
        self.directions, self.where, self.reason, self.note = directions, where, reason, note

    def __reduce__(self) -> tuple[object, ...]:
        """Reduce the error to what makes it again in another process."""
        return type(self), (self.directions, self.where, self.reason, self.note)


def refuse_without_influence(parameters: Sequence[Parameter], matrix: Array) -> None:
    """Refuse parameters on which nothing depends.

    Parameters
    ----------
    parameters : sequence of Parameter
    matrix : ndarray
        Jacobian of weighted residuals, shape (residuals, parameters).

    Raises
    ------
    InputError
        Names them.
    """
    sizes, nothing = np.linalg.norm(matrix, axis=0), NOTHING * np.sqrt(len(matrix))
    without = [p.path for p, size in zip(parameters, sizes, strict=True) if size <= nothing]
    if without:
        raise InputError(
            f"parameter {', '.join(without)}: has no influence on any value of the data; leave it out, or add data "
            "that depend on it"
        )


def refuse_unseen(
    parameters: Sequence[Parameter], parts: Array, matrix: Array, errors: Array, where: str, note: str = ""
) -> None:
    """Refuse parameters that cannot be told apart whatever the noise of the data.

    Parameters
    ----------
    parameters : sequence of Parameter
    parts : ndarray
        Where, in parts of the way between bounds, shape (parameters,).
    matrix : ndarray
        Jacobian of weighted residuals there, shape (residuals, parameters).
    errors : ndarray
        Size of the numerical error of each of its columns, shape (parameters,).
    where, note : str
        For the message; the note where a parameter by itself is not seen.

    Raises
    ------
    NotIdentifiable
    """
    smallest = np.finfo(float).tiny
    scale = np.maximum(np.maximum(errors, MODEL * np.linalg.norm(matrix, axis=0)), smallest)
    _, values, rows = np.linalg.svd(matrix / scale, full_matrices=True)
    values = np.append(values, np.zeros(len(rows) - values.size))
    unseen = rows[values < SEEN].T / scale[:, None]
    if unseen.size:
        directions = _directions(parameters, parts, unseen)
        alone = any(len(direction.changes) == 1 for direction in directions)
        raise NotIdentifiable(directions, where, UNSEEN, note if alone else "")


def refuse_undetermined(
    parameters: Sequence[Parameter], parts: Array, covariance: Array, wide: float, where: str
) -> None:
    """Refuse parameters that the data, with their noise, tell no better than the bounds do.

    Parameters
    ----------
    parameters : sequence of Parameter
    parts : ndarray
        The solution, shape (parameters,).
    covariance : ndarray
        Of it, in parts of the way between bounds.
    wide : float
        Half widths of intervals, in standard deviations.
    where : str

    Raises
    ------
    NotIdentifiable
    """
    values, columns = np.linalg.eigh(covariance)
    widths = 2.0 * wide * np.sqrt(np.maximum(values, 0.0)) * np.abs(columns).max(axis=0)
    undetermined = columns[:, widths >= 1.0]
    if undetermined.size:
        raise NotIdentifiable(_directions(parameters, parts, undetermined), where, WIDE)


def _directions(parameters: Sequence[Parameter], parts: Array, space: Array) -> tuple[Direction, ...]:
    """Return a basis of a space of directions, shape (parameters, n), in relative changes."""
    relative = np.array([p.relative(u) for p, u in zip(parameters, parts.tolist(), strict=True)])
    space = space * relative[:, None]
    _, _, order = qr(space.T, pivoting=True, mode="economic")
    own = order[: space.shape[1]]
    basis = space @ np.linalg.inv(space[own])
    found = []
    for vector in basis.T:
        largest = np.abs(vector).max()
        named = [k for k in range(len(parameters)) if abs(vector[k]) > PART * largest]
        nonzero = all(parameters[k].value(float(parts[k])) != 0.0 for k in named)
        found.append(Direction({parameters[k].path: float(vector[k] / vector[named[0]]) for k in named}, nonzero))
    return tuple(found)
