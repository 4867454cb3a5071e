"""The example sweeps of config/sweeps can be made."""

from pathlib import Path

import pytest

from bilayer_core import Simulator
from bilayer_core.sweeps.execute import scene_of
from bilayer_core.sweeps.run import read_sweep

FILES = sorted((Path(__file__).resolve().parents[2] / "config/sweeps").glob("*.yaml"))


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_the_first_and_the_last_run_of_an_example_can_be_built(file):
    read = read_sweep(file)
    points = list(read.points())
    for point in (points[0], points[-1]):
        assert Simulator(scene_of(read.job, point.parameters)).model.node_count > 1
    assert len(FILES) == 4 and read.spec.title and read.job.metrics
