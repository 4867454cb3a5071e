"""From a stimulus over time to the strain of the layers that it drives."""

import math

import numpy as np
import pytest
from support.sample_scenes import layer, rod, scene

from bilayer_core import Simulator, load_scene

GROWTH = {"stimulus": "heat", "gain": 0.01}
LAGS = {"time_constant_rising": 0.02, "time_constant_falling": 0.05}


def strip(laws, schedule, **more):
    """A free strip of ten edges, so light that its strain is its eigenstrain to 0.1 %."""
    hold = {"schedule": {"type": "hold", "value": 0.5}}
    return scene(
        [rod([layer(eigenstrain=laws, **more)], length=0.02, stations=11)],
        stimuli={"heat": {"schedule": schedule}, "light": hold},
        materials={"gel": {"youngs_modulus": 1e8, "poisson_ratio": 0.5, "density": 1.0}},
        damping={"mass": 1e3},
    )


def end_of(content, duration, dt=1e-3):
    simulator = Simulator(load_scene(content), dt=dt)
    simulator.run(duration)
    return simulator


def edge_strains(simulator):
    lengths = np.linalg.norm(np.diff(simulator.positions, axis=0), axis=1)
    return lengths / simulator.model.rods.rest_length - 1.0


def test_halving_the_step_does_not_change_what_a_square_wave_makes_of_a_lagging_layer():
    # It switches where steps end: each holds the value from before the jump to its end.
    wave = {"type": "square", "low": 0, "high": 1, "period": 0.06, "start": 2e-3}
    top = 1.0 - math.exp(-0.03 / 0.02)
    for dt in (2e-3, 1e-3, 5e-4):
        simulator = end_of(strip({**GROWTH, **LAGS}, wave), 0.062, dt)
        # The strip follows its eigenstrain as far as its inertia and damping allow.
        assert edge_strains(simulator) == pytest.approx(np.full(10, 0.01 * top * math.exp(-0.03 / 0.05)), rel=1e-3)


def test_a_layer_rises_with_one_time_constant_and_falls_with_the_other_whatever_the_step():
    content = strip({**GROWTH, **LAGS}, {"type": "hold", "value": 0})
    for dt in (2e-3, 1e-3, 5e-4):
        simulator = Simulator(load_scene(content), dt=dt)
        simulator.set_stimulus("heat", 1.0)
        simulator.run(0.03)
        top = 1.0 - math.exp(-0.03 / 0.02)
        assert edge_strains(simulator) == pytest.approx(np.full(10, 0.01 * top), rel=1e-3)
        simulator.set_stimulus("heat", 0.0)
        simulator.run(0.03)
        assert edge_strains(simulator) == pytest.approx(np.full(10, 0.01 * top * math.exp(-0.03 / 0.05)), rel=1e-3)


def test_laws_add_up_where_their_intervals_overlap():
    laws = [
        {**GROWTH, "interval": [0, 0.012]},
        {"stimulus": "light", "gain": 0.02, "interval": [0.008, 0.02]},
    ]
    simulator = end_of(strip(laws, {"type": "hold", "value": 1}), 0.1)
    expected = np.repeat([0.01, 0.02, 0.01], [4, 2, 4])
    assert edge_strains(simulator) == pytest.approx(expected, rel=1e-3)


def test_one_channel_drives_layers_of_several_rods_each_with_its_own_law():
    def free(name, height, gain):
        laws = {"stimulus": "heat", "gain": gain}
        return rod([layer(eigenstrain=laws)], length=0.02, stations=5, start=(0, 0, height), name=name)

    content = strip(GROWTH, {"type": "hold", "value": 1})
    content["rods"] = [free("low", 0, 0.01), free("high", 0.1, -0.02)]
    strain = end_of(content, 0.1).frame().strain
    assert strain == pytest.approx(np.repeat([0.01, -0.02], 5), rel=1e-3)


def test_an_interval_of_a_layer_that_starts_later_counts_along_the_path():
    content = strip([], {"type": "hold", "value": 1})
    active = layer("active", interval=[0.004, 0.018], eigenstrain={**GROWTH, "interval": [0.01, 0.014]})
    content["rods"][0]["layers"] = [layer("passive"), active]
    model = Simulator(load_scene(content)).model
    # The passive layer has edges 0 to 9; edge 10 lies 4 to 6 mm along the path.
    assert model.drives.driven_edge.tolist() == [13, 14]


def test_a_saturated_layer_grows_by_its_hyperbolic_law_from_its_reference():
    laws = {"stimulus": "heat", "gain": 0.05, "reference": 0.2, "saturation": 0.02}
    simulator = end_of(strip(laws, {"type": "hold", "value": 0.8}), 0.1)
    assert edge_strains(simulator) == pytest.approx(np.full(10, 0.02 * math.tanh(1.5)), rel=1e-3)


def test_a_state_in_the_middle_of_a_pulse_continues_bit_for_bit():
    train = {"type": "pulse_train", "low": 0, "high": 1, "period": 0.02, "width": 0.005, "rise_time": 0.002, "count": 2}
    laws = [{**GROWTH, **LAGS, "interval": [0, 0.011]}, {"stimulus": "light", "law": "light_photothermal"}]
    simulator = end_of(strip(laws, train), 0.008)
    saved = simulator.save_state()
    simulator.run(0.03)
    other = Simulator(load_scene(strip(laws, train)))
    other.load_state(saved)
    other.run(0.03)
    assert np.array_equal(other.save_state(), simulator.save_state(), equal_nan=True)
