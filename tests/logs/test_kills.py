"""Logs of programs that are killed at random moments: one of each by default; more, and others:

KILLS=200 KILLS_SEED=7 pytest -m "" -s tests/logs/test_kills.py
"""

import os

import pytest
from support.kills import kills
from support.processes import claimed_domain

KILLS = int(os.environ.get("KILLS", "2"))
SEED = int(os.environ.get("KILLS_SEED", "1"))
MOST_MISSING = 1.0
"""Wall time of which frames may be missing [s]."""


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_a_log_of_a_killed_run_or_node_lacks_at_most_a_second(tmp_path):
    found = []
    with claimed_domain() as domain:
        for name, loss in kills(KILLS, tmp_path, SEED, domain):
            found.append(loss)
            print(f"{name}: {loss}", flush=True)
            assert loss.missing - loss.stalled <= MOST_MISSING, f"{name}, kill {len(found)}: {loss}"
    losses = sorted(loss.missing for loss in found)
    print(f"\n{len(found)} kills: missing {losses[len(losses) // 2]:.2f} s in the middle, {losses[-1]:.2f} s at most")
    assert any(loss.frames for loss in found)
