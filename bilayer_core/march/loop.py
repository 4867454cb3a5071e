"""What kernels take in one piece: a call from the interpreter costs 3 µs for every group that it is given."""

from __future__ import annotations

import numpy as np

from .group import group
from .model_groups import Strands, Surfaces
from .problem import Problem, Sums
from .step_groups import Course, Method, StateArrays, Tally, Work

Array = np.ndarray


@group
class Loop:
    """All that steps read and write."""

    problem: Problem
    state: StateArrays
    method: Method
    course: Course
    work: Work
    before: Array  # room for the values of the state
    tally: Tally
    ranges: Array  # of channels, in their units, shape (n_channel,)


@group
class Counted:
    """All that is looked at, and written, when the end of a step is counted."""

    surfaces: Surfaces | None
    strands: Strands
    sums: Sums
    state: StateArrays
    tally: Tally
