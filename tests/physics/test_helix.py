"""A naturally helical layer bonded to a straight one (Fig. 4 of the paper) against the minimum of its energy per
length.
"""

import numpy as np
import pytest
from sample_scenes import fixed, layer, rod, scene

from bilayer_core import Simulator, load_scene

# radius and pitch [mm] of the curve midway between the layers, for (χ̄, τ̄) [1/m] of the top layer
REFERENCES = {
    ("layers", 40, 20): (40.9411, 506.054),
    ("layers", 100, 50): (16.9434, 204.392),
    ("layers", -80, 30): (29.5733, 287.481),
    ("laminate", 40, 20): (163.059, 486.670),
    ("laminate", 100, 50): (65.2266, 194.071),
    ("laminate", -80, 30): (88.7018, 199.648),
}


def screw(points):
    """Radius and pitch of the helix through equidistant points, shape (4, 3)."""
    d = np.diff(points, axis=0)
    axis = np.cross(d[1] - d[0], d[2] - d[1])
    axis /= np.linalg.norm(axis)
    advance = d[1] @ axis
    a, b = (v - (v @ axis) * axis for v in (d[0], d[1]))
    angle = np.arctan2(np.cross(a, b) @ axis, a @ b)
    return np.linalg.norm(b) / (2.0 * abs(np.sin(angle / 2.0))), 2.0 * np.pi * abs(advance / angle)


@pytest.mark.parametrize(("torsion", "curvature", "twist"), REFERENCES)
def test_a_bonded_helix_has_the_radius_and_pitch_of_least_energy(torsion, curvature, twist):
    stations = 61
    top = layer("top", natural_curvature=curvature, natural_twist=twist)
    strip = rod([layer("bottom"), top], length=0.09, stations=stations, torsion=torsion, clamp_start="wall")
    simulator = Simulator(load_scene(scene([strip], bodies=[fixed()], solver={"dt": 1.0, "tolerance": 1e-10})))
    simulator.run(20.0)
    middle = 0.5 * (simulator.positions[:stations] + simulator.positions[stations:])
    center = stations // 2
    found = 1e3 * np.array(screw(middle[center - 8 : center + 9 : 5]))
    assert found == pytest.approx(REFERENCES[torsion, curvature, twist], rel=5e-3)
