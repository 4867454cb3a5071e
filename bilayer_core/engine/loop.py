"""What kernels take in one piece: a call from the interpreter costs 3 µs for every group that it is given."""

from __future__ import annotations

from ..jit.record import Vector, record
from ..model.records.parts import Strands, Surfaces
from ..model.records.problem import Problem, Sums
from ..model.records.step import Course, Method, StateArrays, Tally, Work


@record
class Loop:
    """All that steps read and write."""

    problem: Problem
    state: StateArrays
    method: Method
    course: Course
    work: Work
    before: Vector  # room for the values of the state
    tally: Tally
    ranges: Vector  # of channels, in their units, shape (n_channel,)


@record
class Counted:
    """All that is looked at, and written, when the end of a step is counted."""

    surfaces: Surfaces
    strands: Strands
    sums: Sums
    state: StateArrays
    tally: Tally
