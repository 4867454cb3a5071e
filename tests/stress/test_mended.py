"""Cases of the matrix that failed once, each with what was wrong: they do not."""

from dataclasses import replace

import pytest

from bilayer_core.verification.stress.all_cases import all_cases
from bilayer_core.verification.stress.execute_case import execute
from bilayer_core.verification.stress.stress_case import Outcome

MENDED = {
    "all/0010": "a step of a strip that a moving body meets made more energy than the run had",
    "all/0098": "a slow ramp excused steps that made energy",
    "all/0103": "the midpoint rule in a heavy fluid made energy at the ends of steps",
    "all/0213": "a jump within a fixed step supplied what depended on the step",
    "all/0222": "likewise",
    "all/0488": "the remedy of a refusal ended in a step whose edge had no length left",
    "all/0578": "a refusal's remedy passed through",
    "all/0336": "the shortest step that a body drove made ten thousand times the energy of the run",
    "all/0700": "many of the shortest steps, each of which was allowed some, made energy together",
    "all/1316": "there was capacity for as many contacts as rods have points, 2.7 million, none of which touched",
    "all/1530": "likewise",
    "all/0769": "noise on a stimulus excused steps that made energy",
}
QUICK = ("all/0098", "all/0222")
CPU_LIMIT = 5.0
"""Of each run of a case [s]: all of them failed sooner."""


@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.verify) for n in MENDED])
def test_what_failed_once_does_not(name):
    record = execute(replace(all_cases()[name], cpu_limit=CPU_LIMIT))
    assert record.outcome is not Outcome.FAILED, record.reason
    assert record.remedy_works is not False, record.remedy
