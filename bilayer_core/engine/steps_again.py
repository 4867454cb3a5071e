"""Beginnings of steps and stages that are made once more, for derivatives of runs; see `engine.step`."""

from __future__ import annotations

from bilayer_core.engine.actuation import Actuation, drive_step, take_first_stimuli
from bilayer_core.engine.configuration import take_state
from bilayer_core.engine.newton import first_guess_of
from bilayer_core.engine.potential import start_stage, update_lagged
from bilayer_core.engine.stages import add_history_to_origin, predict_stage, set_origin, start_step_point
from bilayer_core.engine.step import drive_stage
from bilayer_core.jit import piece
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import Configuration, Method, StageInputs, StateArrays, Work


@piece(int, Problem, StateArrays, Method, Actuation, StageInputs, Work, float, float, float, Configuration)
def begin_step(p, state, method, actuation, inputs, work, begin, h, same, start):
    """Take the start of a step of length h [s] from `begin` [s], with what acts during it."""
    take_first_stimuli(actuation, begin, same, inputs)
    drive_step(actuation, method.nodes, begin, h, same, inputs)
    take_state(p, state, start)
    start_step_point(p, state, start, work.first)
    work.stage.length, work.stage.momentum_length = method.diagonal * h, method.momentum_diagonal * h
    work.start_angle[:] = 0.0
    return READY


@piece(int, Problem, StateArrays, Method, StageInputs, Work, int, float, Configuration, Configuration)
def begin_stage(p, state, method, inputs, work, n, h, start, guess):
    """Start stage n of it from the configuration where the last one ended, up to the first guess; return a status."""
    stage = work.stage
    set_origin(work, method, n)
    drive_stage(p, state, inputs, n, work)
    if method.history:
        add_history_to_origin(p, state, work, method, n, h)
    predict_stage(p, state, work, inputs, n, work.first if n == 0 else work.end, start)
    status = start_stage(p, start, stage)
    if status != READY:
        return status
    update_lagged(p, start, stage)
    return first_guess_of(p, start, inputs.position[n], inputs.rotation[n], stage, guess, False)
