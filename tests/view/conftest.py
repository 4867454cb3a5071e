"""A log of a run that nobody computed, for all tests of pictures."""

import numpy as np
import pytest
from support import synthetic_run

from bilayer_core.log.file.mcap_log import McapRecorder

TIMES = np.arange(0, 101) * 0.04


@pytest.fixture(scope="session")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("pictured") / "run.mcap"
    synthetic_run.run(McapRecorder(path, rate=25.0, marker_rate=25.0), TIMES)
    return path
