"""`check` forecasts how large a log will be; `tests/benchmarks/log_sizes.py` has the table of all bundled scenes."""

import json

import pytest

from bilayer_core import Simulator, load_scene
from bilayer_core.cli import main
from bilayer_core.log.file.mcap_log import McapRecorder
from bilayer_core.runs.forecast import forecast

LARGEST, SMALLEST = 1.2, 0.35
"""Of a log over what is expected of it: a state is only written where a step has ended since the last frame."""


@pytest.mark.parametrize(
    ("scene", "changes"),
    [
        ("bending", ()),
        ("cantilever", ("solver.dimension=3",)),
        ("jumping", ()),
        ("helix", ("output.rate=200", "output.marker_rate=10")),
        ("gripping", ("duration=3", "solver.model=two_rod")),
        ("swimming", ("duration=1",)),
        ("crawling_dual_leg", ("duration=2",)),
    ],
)
def test_a_forecast_is_near_the_size_of_the_log(scene, changes, tmp_path):
    simulator = Simulator(load_scene(scene, changes))
    expected = forecast(simulator)
    simulator.run(simulator.scene.duration, observers=[recorder(simulator.scene, tmp_path)])
    written = (tmp_path / "run.mcap").stat().st_size
    assert SMALLEST * expected.total < written < LARGEST * expected.total


def recorder(scene, directory):
    return McapRecorder(directory / "run.mcap", scene.output.rate, scene.output.marker_rate)


def test_a_forecast_changes_nothing_and_is_the_same_again():
    simulator = Simulator(load_scene("gripping"))
    before = simulator.save_state().tobytes()
    assert forecast(simulator) == forecast(simulator)
    assert simulator.save_state().tobytes() == before


def test_check_tells_the_size_by_second_and_for_the_scene(capsys):
    assert main(["check", "bending"]) == 0
    assert "a second, " in capsys.readouterr().out.split("  log ")[1].splitlines()[0]
    assert main(["check", "bending", "--json", "--set", "output.rate=1e-9", "--set", "duration=1e4 s"]) == 0
    log = json.loads(capsys.readouterr().out)["log"]
    assert 0 <= log["bytes_per_second"] < log["bytes"] < 100_000
