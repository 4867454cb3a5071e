"""Scenes with random mutations end with an answer of `check` or with a clear refusal, in time and with little memory.

500 of them by default, the same ones every time. More, and others:

    FUZZ_SCENES=10000 FUZZ_SEED=7 pytest -m "" tests/fuzz

and `FUZZ_STEPS=1` to take a first step with small ones that are accepted. What fails is reduced by hypothesis and
written to `.pytest_cache/fuzz/` (another folder: `FUZZ_FAILURES`): the scene, and beside it the command that tries it
again, with the traceback.
"""

from __future__ import annotations

import os
import shlex
import signal
import time
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings

from fuzz.cases import FAMILIES, Case
from fuzz.worker import ACCEPTED, FAILED, REFUSED, Outcome, Unclear, Workers, limit_memory, require_clear

SCENES = int(os.environ.get("FUZZ_SCENES", "500"))
SEED = int(os.environ.get("FUZZ_SEED", "1"))
STEPS = os.environ.get("FUZZ_STEPS", "0") == "1"
FAILURES = Path(os.environ.get("FUZZ_FAILURES") or Path(__file__).resolve().parents[2] / ".pytest_cache" / "fuzz")
LONGEST_RUN = 7200
"""Of all scenes of a family [s]."""


@pytest.fixture(scope="module")
def workers():
    """A process for the scenes of this module."""
    found = Workers(with_steps=STEPS)
    yield found
    found.close()


def keep(name: str, case: Case, outcome: Outcome) -> Path:
    """Write a scene that fails as a file that fails again, with the command and what happened beside it."""
    FAILURES.mkdir(parents=True, exist_ok=True)
    path = FAILURES / f"{name}.yaml"
    path.write_bytes(case.text.encode("utf-8", "surrogatepass"))
    changes = " ".join(f"--set {shlex.quote(override)}" for override in case.overrides)
    json = " --json" if case.as_json else ""
    told = f"bilayer check {path}{json} {changes}\n\n{outcome.message}"
    path.with_suffix(".txt").write_text(told, errors="surrogateescape")
    return path


@pytest.mark.slow
@pytest.mark.timeout(LONGEST_RUN)
@pytest.mark.parametrize("family", FAMILIES)
def test_mutated_scenes_are_accepted_or_clearly_refused(family, workers):
    strategy, share = FAMILIES[family]
    counts, figures = Counter(), []

    @seed(SEED)
    @settings(
        max_examples=max(1, round(share * SCENES)),
        database=None,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
    )
    @given(strategy())
    def all_end_well(case):
        outcome = workers.outcome(case)
        counts[outcome.kind] += 1
        figures.append((outcome.seconds, outcome.memory))
        if outcome.kind == FAILED:
            path = keep(f"{family}-{SEED}", case, outcome)
            pytest.fail(f"{path}:\n{outcome.message}", pytrace=False)

    all_end_well()
    slowest, largest = (max(column) for column in zip(*figures, strict=True))
    print(f"\n{family}, seed {SEED}: {dict(counts)}, slowest {slowest:.2f} s, largest {largest / 1e6:.0f} MB")
    assert counts[ACCEPTED] and counts[REFUSED]


@pytest.mark.parametrize(
    "message",
    [
        "",
        "scene.yaml: ",
        "must be a list",
        "scene.yaml: KeyError: 'rods'",
        f"scene.yaml: rods: found {'x' * 3000}; is none",
    ],
)
def test_messages_that_tell_nothing_count_as_failures(message):
    with pytest.raises(Unclear):
        require_clear(message)


@pytest.mark.verify
def test_a_process_that_exceeds_its_limits_or_dies_counts_as_a_failure():
    told = []
    for longest, *calls in (
        (0.3, (bytearray, 2 * 10**9), (time.sleep, 60)),
        (1.0, (sum, range(10**12)), (os.abort,), (bytearray, 10)),  # on a busy machine too, CPU time is over first
    ):
        workers = Workers(longest=longest, most_memory=1e9, prepare=limit_memory)
        told += [workers.result(begun) for begun in [workers.start(*call) for call in calls]]
        workers.close()
    assert [outcome.kind for outcome in told[:4]] == [FAILED] * 4 and told[4] == bytearray(10)
    said = "MemoryError", "no answer within", f"exit code {-signal.SIGXCPU}", f"exit code {-signal.SIGABRT}"
    assert all(part in outcome.message for part, outcome in zip(said, told, strict=False))
