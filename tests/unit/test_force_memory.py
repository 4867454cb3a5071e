"""What a force carries from step to step is part of the state."""

from dataclasses import replace

import numpy as np
import pytest
from support.budgets import driven

from bilayer_core import Simulator, load_scene
from bilayer_core.forces import force_register
from bilayer_core.jit import piece, record
from bilayer_core.model.force_slots import slot_of
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Stage

BENDING = slot_of("bending")
TINY = 1e-15
"""What a step that is counted adds to the energy of bending [J]: none that matters."""


@record
class Diary:
    """Where a force that only takes notes has them: of steps, and of the heights of each node."""

    first: int


@piece(float, Diary, Problem, Configuration, Stage, bool)
def add_diary(diary, p, at, stage, with_hessian):
    """Push nobody."""
    return np.inf


@piece(int, Diary, Problem, Configuration, Stage)
def end_diary(diary, p, at, stage):
    """Count the step, keep each node's greatest height, and say so as an energy."""
    p.memory[diary.first] += 1.0
    for i in range(at.position.shape[0]):
        k = diary.first + 1 + i
        p.memory[k] = max(p.memory[k], at.position[i, 2])
    p.sums.energy[BENDING] = TINY * p.memory[diary.first]
    return READY


@pytest.fixture(autouse=True)
def with_diary(monkeypatch):
    """A force more than there are, beside that of bending."""
    diary = force_register.Term(
        ("bending",),
        lambda model, of: Diary(first=of["memory"]),
        add_diary,
        end=end_diary,
        memory=lambda model: 1 + model.node_count,
    )
    place, inertia = next(pair for pair in enumerate(force_register.TERMS) if "inertia" in pair[1].names)
    other = replace(inertia, memory=lambda model: 3)
    monkeypatch.setattr(
        force_register, "TERMS", (*force_register.TERMS[:place], other, *force_register.TERMS[place + 1 :], diary)
    )


@pytest.mark.parametrize("steps", [{"dt": 1e-3}, {"dt": 1e-3, "integrator": "implicit_midpoint"}, {"tolerance": 1e-4}])
def test_memory_is_written_once_for_each_accepted_step_and_restored_with_the_state(steps):
    kicked = driven(gain=0.1, solver={"max_newton_iterations": 4, "max_halvings": 6})
    simulator = Simulator(load_scene(kicked), **steps)
    memory = simulator._state.memory
    assert memory.shape == (3 + 1 + simulator.model.node_count,) and not memory.any()
    simulator.run(0.02)
    assert memory[3] == simulator.statistics.substeps > 0
    assert simulator.energy()["bending"] == TINY * memory[3]
    assert not memory[:3].any()
    assert np.all(memory[4:] >= np.maximum(simulator.positions[:, 2], 0.0) - 1e-9)
    saved, counted, run_on = simulator.save_state(), memory[3], []
    for _ in range(2):
        simulator.load_state(saved)
        simulator.run(0.01)
        run_on.append(simulator.save_state())
    np.testing.assert_array_equal(*run_on)
    assert memory[3] == simulator.statistics.substeps + counted
    simulator.reset()
    assert not simulator._state.memory.any()


def test_refused_attempts_leave_no_trace_in_memory():
    hasty = driven(gain=0.1, solver={"max_newton_iterations": 4, "max_halvings": 6})
    simulator = Simulator(load_scene(hasty), dt=1e-2)
    simulator.run(0.1)
    assert simulator.statistics.rejected > 0
    assert simulator._state.memory[3] == simulator.statistics.substeps


def test_statics_and_evaluations_write_no_memory():
    simulator = Simulator(load_scene(driven()), dt=1e-3)
    simulator.run(5e-3)
    before = simulator._state.memory.copy()
    simulator.solve_static()
    np.testing.assert_array_equal(simulator._state.memory, before)
