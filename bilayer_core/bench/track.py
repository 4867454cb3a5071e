"""What is recorded of a run, and the figures by which its error is judged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from ..converge.quantities import peak
from ..integrate.frame import Description, Frame

Array = np.ndarray


class Track:
    """An observer that keeps the way of a few points.

    Parameters
    ----------
    rate : float
        Times a simulated second.

    Attributes
    ----------
    times : Array
        [s], shape (n_time,), after the run.
    points : dict of str to Array
        Ways of ``tip`` (last node of the first strand), ``com`` (mass centre of the robot) and of each body by its
        name [m], shape (n_time, 3).
    """

    def __init__(self, rate: float):
        self.rate = rate
        self._times: list[float] = []
        self._ways: dict[str, list[Array]] = {}

    def start(self, description: Description) -> None:
        """Note which node is the tip, and the bodies' names."""
        self._tip = description.strands[0].nodes.stop - 1
        self._bodies = [body.name for body in description.bodies]
        self._ways = {name: [] for name in ("tip", "com", *self._bodies)}

    def observe(self, frame: Frame) -> None:
        """Keep one instant."""
        self._times.append(frame.time)
        self._ways["tip"].append(frame.positions[self._tip])
        self._ways["com"].append(frame.com)
        for name, position in zip(self._bodies, frame.body_positions, strict=True):
            self._ways[name].append(position)

    def close(self, complete: bool, termination: str = "") -> None:
        """Make arrays of it."""
        self.times = np.array(self._times)
        self.points = {name: np.array(way) for name, way in self._ways.items()}

    def at(self, point: str, time: float) -> Array:
        """Place of a point at the recorded instant nearest to `time` [m], shape (3,)."""
        return self.points[point][int(np.abs(self.times - time).argmin())]


@dataclass(frozen=True)
class Trajectory:
    """The way of a point; its error: the root mean square over time of the distance from the reference, over a length.

    Attributes
    ----------
    point : str
        As in `Track.points`.
    until : float
        End of the time that counts [s].
    spacing : float
        Of the instants at which a reference is kept [s]; between them it is interpolated by cubic splines.
    length : float
        What the distance is divided by [m].
    """

    point: str
    until: float
    spacing: float
    length: float

    @property
    def error_label(self) -> str:
        """What the error is, in words."""
        name = {"com": "mass centre"}.get(self.point, self.point)
        return f"rms error of the {name} over {self.until:g} s / length of the rod"

    def rate(self, dt: float) -> float:
        """How often a run with this step is looked at [1/s]."""
        return 1.0 / max(dt, self.spacing)

    def values(self, track: Track) -> Array:
        """Times [s] and places [m] that count, shape (n_time, 4)."""
        counted = track.times <= self.until * (1.0 + 1e-9)
        return np.column_stack([track.times, track.points[self.point]])[counted]

    def error(self, found: Array, reference: Array) -> float:
        """Of `values` against those of a reference."""
        return rms_distance(found, reference) / self.length


@dataclass(frozen=True)
class Headline:
    """One number that says what a robot did; its error is relative to the reference.

    Attributes
    ----------
    name, unit : str
    factor : float
        From SI to the unit.
    figure : callable
        Takes a `Track`, returns the number in SI units.
    sampling : float
        Instants looked at in a simulated second [1/s].
    """

    name: str
    unit: str
    factor: float
    figure: Callable[[Track], float]
    sampling: float

    @property
    def error_label(self) -> str:
        """What the error is, in words."""
        return f"relative error of {self.name}"

    def rate(self, dt: float) -> float:
        """How often a run with this step is looked at [1/s]."""
        return min(self.sampling, 1.0 / dt)

    def values(self, track: Track) -> Array:
        """The number, shape (1, 1)."""
        return np.array([[self.figure(track)]])

    def error(self, found: Array, reference: Array) -> float:
        """Of `values` against those of a reference."""
        return float(abs(found[0, 0] - reference[0, 0]) / abs(reference[0, 0]))


Measure = Trajectory | Headline


def rms_distance(found: Array, reference: Array) -> float:
    """Root mean square over `found`'s times of the distance between ways [m]; columns: time [s], coordinates [m]."""
    way = CubicSpline(reference[:, 0], reference[:, 1:])(found[:, 0])
    return float(np.sqrt(np.mean(np.sum((found[:, 1:] - way) ** 2, axis=1))))


def rise(track: Track) -> float:
    """How far the mass centre rose above its start at most [m]."""
    return peak(track.times, track.points["com"][:, 2])[0]


def advance(point: str, axis: int, begin: float, end: float) -> Callable[[Track], float]:
    """The figure: displacement of a point along an axis between two instants [m]."""
    return lambda track: float(track.at(point, end)[axis] - track.at(point, begin)[axis])
