"""The lattice shrinks alike both ways to the chords of its strips' arcs."""

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene

# Timoshenko: 1.5 × 4 % / 1 mm on strips of 40 mm; blocks have arms of 3 mm.
CURVATURE, LENGTH, ARM = 60.0, 40e-3, 3e-3
HALF_ANGLE = 0.5 * CURVATURE * LENGTH
DISTANCE = 2.0 * np.sin(HALF_ANGLE) / CURVATURE + 2.0 * ARM * np.cos(HALF_ANGLE)


@pytest.mark.parametrize("method", [{}, {"dimension": 3}, {"model": "two_rod"}], ids=str)
def test_the_lattice_shrinks_by_28_percent_in_both_directions(method):
    simulator = Simulator(load_scene("lattice"), **method)
    simulator.run(3.0)
    places = np.array([[simulator.bodies[f"{column}{row}"].position for column in "abc"] for row in "123"])
    along_rows, along_columns = (np.linalg.norm(np.diff(places, axis=axis), axis=2) for axis in (1, 0))
    assert DISTANCE == pytest.approx((1.0 - 0.277) * 46e-3, rel=1e-3)
    for distances in (along_rows, along_columns):  # of strips that grow on one side, and of those that shrink
        assert distances.mean() == pytest.approx(DISTANCE, rel=0.01)
        assert distances == pytest.approx(np.full(distances.shape, DISTANCE), rel=0.04)
