"""Records of a run, and the figures by which its error is judged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from bilayer_core.simulation.simulator import Simulator
from bilayer_core.studies.converge.quantities import peak

Array = np.ndarray


class Track:
    """The ways of a few points, step by step.

    Parameters
    ----------
    simulator : Simulator
        At its start; `look` is called after each of its steps.

    Attributes
    ----------
    times : list of float
        [s]
    points : dict of str to list of Array
        Places of ``tip`` (last node of the first strand), ``com`` (mass centre of the robot) and of each body by its
        name [m], shape (3,) each.
    """

    def __init__(self, simulator: Simulator):
        self._simulator = simulator
        first = simulator.model.strands[0]
        self._tip = first.first_node + first.node_count - 1
        self.times: list[float] = []
        self.points: dict[str, list[Array]] = {name: [] for name in ("tip", "com", *simulator.bodies)}
        self.look(simulator.time)

    def look(self, time: float) -> None:
        """Keep where the points are now."""
        self.times.append(time)
        self.points["tip"].append(self._simulator.positions[self._tip])
        self.points["com"].append(self._simulator.com)
        for name, body in self._simulator.bodies.items():
            self.points[name].append(body.position)

    def at(self, point: str, time: float) -> Array:
        """Return the position of a point at the end of the step nearest to `time` [m], shape (3,)."""
        return self.points[point][int(np.abs(np.array(self.times) - time).argmin())]


@dataclass(frozen=True)
class Trajectory:
    """The way of a point; its error: root mean square over time of the distance from the reference, over a length."""

    point: str  # As in `Track.points`
    until: float  # End of the time that counts [s]
    spacing: float  # Of the instants at which a reference is kept [s]; between them it is interpolated by cubic splines
    length: float  # What the distance is divided by [m]

    @property
    def error_label(self) -> str:
        """Description of the error in words."""
        name = {"com": "mass centre"}.get(self.point, self.point)
        return f"rms error of the {name} / length of the rod"

    @property
    def stops(self) -> tuple[float, ...]:
        """Times at which a step must end [s]."""
        return (self.until,)

    def values(self, track: Track) -> Array:
        """Return the times [s] and places [m] that count, shape (n_time, 4)."""
        way = np.column_stack([track.times, track.points[self.point]])
        return way[way[:, 0] <= self.until * (1.0 + 1e-9)]

    def error(self, found: Array, reference: Array) -> float:
        """Return the error of `found` against `reference`: the rms distance over `length`."""
        return rms_distance(found, reference) / self.length


@dataclass(frozen=True)
class Headline:
    """One number that says what a robot did; its error is relative to the reference."""

    name: str
    unit: str
    factor: float  # From SI to the unit
    figure: Callable[[Track], float]  # Takes a `Track`, returns the number in SI units
    stops: tuple[float, ...] = ()  # Times at which a step must end [s]

    @property
    def error_label(self) -> str:
        """Description of the error in words."""
        return f"relative error of {self.name}"

    def values(self, track: Track) -> Array:
        """Return the number, shape (1, 1)."""
        return np.array([[self.figure(track)]])

    def error(self, found: Array, reference: Array) -> float:
        """Return the error of `found` relative to `reference`."""
        return float(abs(found[0, 0] - reference[0, 0]) / abs(reference[0, 0]))


Measure = Trajectory | Headline


def rms_distance(found: Array, reference: Array) -> float:
    """Return the root mean square over `found`'s times of the distance between ways [m]; columns: time [s], coordinates
    [m].
    """
    times = found[:, 0]
    way = CubicSpline(reference[:, 0], reference[:, 1:])(times)
    squares = np.sum((found[:, 1:] - way) ** 2, axis=1)
    return float(np.sqrt(np.trapezoid(squares, times) / np.ptp(times)))


def rise(track: Track) -> float:
    """Return how far the mass centre rose above its start at most [m]."""
    return peak(np.array(track.times), np.array(track.points["com"])[:, 2])[0]


def advance(point: str, axis: int, begin: float, end: float) -> Callable[[Track], float]:
    """Return a function for the displacement of a point along an axis between two instants [m]."""
    return lambda track: float(track.at(point, end)[axis] - track.at(point, begin)[axis])
