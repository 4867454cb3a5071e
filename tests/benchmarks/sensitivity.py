"""How far stress cases move that start a millionth of their length higher: what no step length can compute.

    bilayer stress --out runs/stress
    python tests/benchmarks/sensitivity.py runs/stress/results.jsonl 7

takes every seventh case inside the region of validity whose error is above 1 %, and prints the error beside the largest
distance, in lengths, between the run and the one that starts higher.
"""

import sys
from pathlib import Path

from bilayer_core.errors import SimulationError
from bilayer_core.testing.trial import Trial, distance_of
from bilayer_core.verification.stress.all_cases import all_cases
from bilayer_core.verification.stress.execute_case import ACCURATE
from bilayer_core.verification.stress.robots import LOOKS
from bilayer_core.verification.stress.stress_case import Outcome, Record

SHIFT = 1e-6
"""Of the longest rod."""


def frames_of(case, shift):
    """A trial of a case that starts higher by `shift` lengths, and its frames."""
    trial = Trial(case.scene(), case.most_steps, case.cpu_limit, judged=False)
    simulator, model = trial.simulator, trial.simulator.model
    state = simulator._state
    held = set(model.constrained.node.tolist())
    loose = [node for node in range(model.node_count) if node not in held]
    state.position[loose, 2] += shift * trial.length
    state.body_position[model.free_bodies.body_of_free, 2] += shift * trial.length
    return trial, trial.looks(trial.ends(LOOKS))


def moved_by(case):
    """Largest distance of a node or body from where it is without the shift, over the size of the motion."""
    trial, first = frames_of(case, 0.0)
    _, second = frames_of(case, SHIFT)
    size = max([trial.length, *(distance_of(trial.start, frame) for frame in first)])
    return max(map(distance_of, first, second)) / size


def main(path, every):
    records = [Record.from_line(line) for line in Path(path).read_text(encoding="utf-8").splitlines()[1:]]
    wrong = [r for r in records if r.inside and r.outcome is Outcome.STABLE and r.error is not None][::every]
    cases, far = all_cases(), 0
    for record in wrong:
        try:
            moved = moved_by(cases[record.name])
        except SimulationError as failure:
            print(f"{record.name:52}{record.error:10.2g}   {failure}")
            continue
        far += moved > ACCURATE
        print(f"{record.name:52}{record.error:10.2g}{moved:10.2g}")
    print(f"{far} of {len(wrong)} move by more than {100 * ACCURATE:g} % if they start {SHIFT:g} lengths higher")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 1)
