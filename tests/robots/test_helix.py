"""The bundled helix: it winds up to the shape of least energy."""

import pytest

from bilayer_core import Simulator, load_scene
from bilayer_core.verification.validate.closed_forms import bonded_helix
from bilayer_core.verification.validate.helix import screw


@pytest.mark.slow
def test_the_helix_comes_to_rest_with_the_radius_and_pitch_of_least_energy():
    simulator = Simulator(load_scene("helix"))
    simulator.run()
    assert simulator.energy()["kinetic"] < 1e-9
    bottom, top = simulator.positions.reshape(2, -1, 3)
    middle = len(bottom) // 2
    found = screw(0.5 * (bottom + top)[middle - 8 : middle + 9 : 5])
    assert found == pytest.approx(bonded_helix(100.0, 50.0, "layers"), rel=5e-3)
