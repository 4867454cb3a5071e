"""Actuation from outside over time: stimuli, loads and prescribed paths, evaluated at the stages of steps.

Each schedule is given as its next spans (`scene.spans.Span`), as far as a horizon. Two times that differ by less than
`same` [s] count as one. Where a schedule jumps, a step that ends there has its value from before, to its end.
"""

from __future__ import annotations

import math

from bilayer_core.engine.laws import value_of_span
from bilayer_core.jit import kernel, piece
from bilayer_core.jit.called import stack_vector
from bilayer_core.jit.record import Indices, Matrix, Stack, Vector, record
from bilayer_core.kinematics.rotating import rotate_by, spin_of
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import StageInputs
from bilayer_core.scene.spans import ROUNDING, Span


@record
class Paths:
    """Keyframes of prescribed bodies that move; a cubic leads from one to rest at the next: a smoothstep, but where a
    body leaves a keyframe with a velocity (`simulation.poses`).
    """

    body: Indices  # shape (n_moving,)
    first: Indices  # of the keyframes of each, last the number of all, shape (n_moving + 1,)
    time: Vector  # of keyframes [s], shape (n_keyframe,)
    displacement: Matrix  # [m], shape (n_keyframe, 3)
    rotation_vector: Matrix  # [rad], shape (n_keyframe, 3)
    velocity: Matrix  # with which a keyframe is left [m/s], shape (n_keyframe, 3)
    rotation_rate: Matrix  # likewise of the rotation vector [rad/s], shape (n_keyframe, 3)
    position: Matrix  # of all bodies where displacements are counted from [m], shape (n_body, 3)
    rotation: Stack  # likewise, shape (n_body, 3, 3)


@record
class Actuation:
    """Schedules as far as `horizon`, one row of `PARTS` for each span."""

    stimulus: Stack  # shape (n_channel, n_span, len(PARTS))
    load: Stack  # shape (n_load, n_span, len(PARTS))
    ranges: Vector  # of channels, in their units, shape (n_channel,)
    horizon: Vector  # the first end of all last spans [s], shape (1,)
    paths: Paths


PARTS = Span._fields
UNTIL, LEVEL, BEGIN, RATE, AMPLITUDE, FREQUENCY, PHASE = range(len(PARTS))
AT_ONCE = 1e-2
"""Part of a step below which the lag of a layer makes no difference to a jump of its stimulus."""
NO_JUMP = 1e-9
"""Part of a channel's range below which a change at once is rounding."""


@kernel
def _value(spans, row, k, time):
    """Return `Span.value`"""
    level, begin, rate = spans[row, k, LEVEL], spans[row, k, BEGIN], spans[row, k, RATE]
    wave = spans[row, k, AMPLITUDE], spans[row, k, FREQUENCY], spans[row, k, PHASE]
    return value_of_span(time, level, begin, rate, wave[0], wave[1], wave[2])


@kernel
def _span_until(spans, row, time):
    """Return the first span that ends at `time` or later."""
    k = 0
    while k + 1 < spans.shape[1] and spans[row, k, UNTIL] < time:
        k += 1
    return k


@kernel
def _any_jumps(spans, time, same):
    """Return whether any schedule jumps at a time [s]; see `Span.jump_to`."""
    for row in range(spans.shape[0]):
        k = _span_until(spans, row, time - same)
        end = spans[row, k, UNTIL]
        if end > time + same or k + 1 == spans.shape[1]:
            continue
        before, after = _value(spans, row, k, end), _value(spans, row, k + 1, end)
        largest = max(abs(spans[row, k, LEVEL]), abs(spans[row, k, AMPLITUDE]), abs(before), abs(after))
        if abs(after - before) > ROUNDING * largest:
            return True
    return False


@piece(int, Actuation, float, float)
def jumps_at(actuation, time, same):
    """Return 1 if a stimulus jumps at a time [s], plus 2 if a load does."""
    return int(_any_jumps(actuation.stimulus, time, same)) + 2 * int(_any_jumps(actuation.load, time, same))


@piece(float, Actuation, float, float)
def corner_after(actuation, time, same):
    """Return the first time after `time` at which a schedule or a path has a corner or jumps [s]; infinity if none."""
    first, paths = math.inf, actuation.paths
    for row in range(actuation.stimulus.shape[0]):
        k = _span_until(actuation.stimulus, row, time + same)
        first = min(first, actuation.stimulus[row, k, UNTIL])
    for row in range(actuation.load.shape[0]):
        k = _span_until(actuation.load, row, time + same)
        first = min(first, actuation.load[row, k, UNTIL])
    if paths.exists:
        for k in range(paths.time.shape[0]):
            if paths.time[k] > time + same:
                first = min(first, paths.time[k])
    return first


@kernel
def take_first_stimuli(actuation, begin, same, inputs):
    """Write the stimuli at the start of a step, after any jump there."""
    for c in range(actuation.stimulus.shape[0]):
        inputs.first[c] = _value(actuation.stimulus, c, _span_until(actuation.stimulus, c, begin + same), begin)


@piece(int, Actuation, Vector, float, float, float, StageInputs)
def drive_step(actuation, nodes, begin, h, same, inputs):
    """Write to `inputs` the stimuli, load factors and prescribed motions at the stages of a step of length `h` [s] that
    begins at `begin` [s].
    """
    for n in range(nodes.shape[0]):
        inputs.elapsed[n] = nodes[n] * h
        time = begin + nodes[n] * h
        for c in range(actuation.stimulus.shape[0]):
            k = _span_until(actuation.stimulus, c, time - same)
            inputs.stimulus[n, c] = _value(actuation.stimulus, c, k, time)
        for i in range(actuation.load.shape[0]):
            k = _span_until(actuation.load, i, time - same)
            inputs.load_factor[n, i] = _value(actuation.load, i, k, time)
        _follow_paths(actuation.paths, time, inputs.position[n], inputs.rotation[n], inputs.rates[n])
    return READY


@kernel
def _keyframe_before(paths, first, last, time):
    """Return the last of the keyframes from `first` to `last` − 1 that is not later than a time; first − 1 if none."""
    low, high = first, last
    while low < high:
        middle = (low + high) // 2
        if paths.time[middle] <= time:
            low = middle + 1
        else:
            high = middle
    return low - 1


@kernel
def _follow_paths(paths, time, position, rotation, rates):
    """Put bodies where their paths lead."""
    if not paths.exists:
        return
    for k in range(paths.body.shape[0]):
        b, first, last = paths.body[k], paths.first[k], paths.first[k + 1]
        before = _keyframe_before(paths, first, last, time)
        a, z = max(before, first), min(before + 1, last - 1)
        part = rate = carried = carried_rate = 0.0
        if z > a:
            duration = paths.time[z] - paths.time[a]
            s = (time - paths.time[a]) / duration
            part, rate = s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s) / duration
            carried, carried_rate = duration * s * (1.0 - s) ** 2, (1.0 - s) * (1.0 - 3.0 * s)
        shift, velocity, spin = paths.displacement, paths.velocity, paths.rotation_rate
        for c in range(3):
            change = shift[z, c] - shift[a, c]
            position[b, c] = paths.position[b, c] + shift[a, c] + part * change + carried * velocity[a, c]
            rates[b, c] = rate * change + carried_rate * velocity[a, c]
        v, u = stack_vector(3), stack_vector(3)
        for c in range(3):
            begun, change = paths.rotation_vector[a, c], paths.rotation_vector[z, c] - paths.rotation_vector[a, c]
            v[c] = begun + part * change + carried * spin[a, c]
            u[c] = rate * change + carried_rate * spin[a, c]
        rotate_by(v[0], v[1], v[2], paths.rotation, b, rotation, b)
        rates[b, 3], rates[b, 4], rates[b, 5] = spin_of(v[0], v[1], v[2], u[0], u[1], u[2])


@kernel
def stimulus_has_jumped(drives, state, first, ranges, h):
    """Return whether a stimulus has jumped that some layer follows at once in a step of length `h` [s]. Of a layer with
    diffusion the slowest mode decides: what its face takes up at once is little of the layer.
    """
    for k in range(drives.field_channel.shape[0]):
        channel, m = drives.field_channel[k], drives.field_slowest[k]
        change = first[channel] - state.transduction[m]
        lag = drives.mode_rising[m] if change > 0.0 else drives.mode_falling[m]
        if abs(change) > NO_JUMP * ranges[channel] and lag < AT_ONCE * h:
            return True
    return False
