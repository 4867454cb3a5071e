"""Runs by formulas, of which the truth is known, in place of those of a simulator."""

import numpy as np

from bilayer_core.errors import SimulationError


class FormulaRuns:
    """Makes runs of one column by a function of the parts; `stops` tells of which points no run can be made."""

    def __init__(self, function, stops=lambda point: False):
        self._function, self._stops = function, stops
        self.points = []

    def evaluate_many(self, points):
        self.points += list(points)
        stopped = SimulationError("too steep", 0.5)
        return [stopped if self._stops(point) else np.asarray(self._function(point))[:, None] for point in points]

    def evaluate(self, point):
        return self.demand([point])[0]

    def demand(self, points):
        found = self.evaluate_many(points)
        for outcome in found:
            if isinstance(outcome, SimulationError):
                raise outcome
        return found

    def explained(self, point, error):
        return SimulationError(f"{error.reason} at {point.tolist()}", error.time)


def deterministic_noise(point, size, count):
    """Noise of a standard deviation that is the same wherever it is asked for at a point, shape (count,)."""
    seed = np.frombuffer(np.asarray(point, dtype=float).tobytes(), dtype=np.uint32)
    return np.random.default_rng(seed).normal(0.0, size, count)
