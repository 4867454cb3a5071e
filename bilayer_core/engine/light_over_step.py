"""Light over a step: what each element of a layer sees of it at any time in the step.

How an element faces a light, m1·l, and what part V of it nothing hides are looked at where a step begins, and go on as
they went over the step before, linearly in time. So a law's stimulus at the time c in the step is

    s(c) V(c) max(0, ± m1·l(c))

That is wrong by O(h²), and the lag T of the law, which a light must have, makes O(h³/T) of it in a step: integrators of
second order keep it, whatever their stages. (The edge between light and dark passes an element in one step, of which
the part O(h) is wrong by O(h): second order as well. In the first step of a run light stays as it is, and once is not
often.) Within a step the shape does not act on the light, so Newton's method has the potential that it has without.
Velocities at the start would foretell the light as well, but in a vibration too fast for the step they lead far beyond
what comes, and the light then drives it; what was seen at two instants does not.
Where a layer follows by diffusion, all this holds for each mode of its field.

Adaptive steps compare the light at the end of a step with what was foreseen. What the difference δb would have made of
a law's filtered stimulus, had it grown linearly, is (1 − φ) s δb (`scene.transduction`); times the gain it is a free
strain δη, which bends a rod of length L and thickness H by about δη L/H of its length. The root mean square over all
elements is an error of the step beside that of positions.
"""

from __future__ import annotations

import math

from bilayer_core.contact.light import brightness
from bilayer_core.engine.laws import lagged
from bilayer_core.jit import kernel, piece
from bilayer_core.kinematics.copying import copy
from bilayer_core.model import lit_elements  # noqa: F401 (declares `shine`)
from bilayer_core.model.lit_elements import shine
from bilayer_core.model.records.problem import Problem
from bilayer_core.model.records.status import READY
from bilayer_core.model.records.step import StageInputs, StateArrays


@kernel
def _take_state(light, state):
    """Look at light where a state is."""
    copy(state.position, light.node_position)
    copy(state.director1, light.director1)
    for b in range(state.body_position.shape[0]):
        for c in range(3):
            light.body_position[b, c] = state.body_position[b, c]
            for d in range(3):
                light.body_rotation[b, c, d] = state.body_rotation[b, c, d]


@kernel
def _see(light, rate, elapsed, column):
    """Write what fields see a time after the start of the step [s]."""
    for k in range(light.law.shape[0]):
        facing = light.facing[k, 0] + elapsed * rate[k, 0]
        visible = min(max(light.visible[k, 0] + elapsed * rate[k, 1], 0.0), 1.0)
        light.seen[light.field[k], column] = brightness(light.side[k], facing, visible)


@piece(int, Problem, StateArrays)
def begin_light(p, state):
    """Look at light at the start of a step."""
    _take_state(p.light, state)
    shine(p.light, 0)
    _see(p.light, state.light_rate, 0.0, 0)
    return READY


@kernel
def see_light(light, state, elapsed):
    """Write into `seen` what fields see at the start of the step and at a time in it [s]."""
    _see(light, state.light_rate, elapsed, 1)


@piece(float, Problem, StateArrays, StageInputs, int, float)
def end_light(p, state, inputs, n, h):
    """Look at light at the end of a step of length h [s], its point n, and take how it went into the state.

    Returns
    -------
    error : float
        Of the step, by light that was not as foreseen, as a part of the longest rod.
    """
    light, drives, rate = p.light, p.drives, state.light_rate
    _see(light, rate, h, 1)
    _take_state(light, state)
    shine(light, 1)
    square = 0.0
    for k in range(light.law.shape[0]):
        i, f, strained = light.law[k], light.field[k], 0.0
        missed = brightness(light.side[k], light.facing[k, 1], light.visible[k, 1]) - light.seen[f, 1]
        missed *= inputs.stimulus[n, drives.field_channel[f]]
        for m in range(drives.field_first[f], drives.field_first[f + 1]):
            lag = min(drives.mode_rising[m], drives.mode_falling[m])
            weight = drives.law_weight[drives.law_first[i] + m - drives.field_first[f]]
            strained += weight * lagged(0.0, 0.0, missed, lag, lag, h)
        square += (light.slenderness[k] * drives.law_gain[i] * strained) ** 2
        rate[k, 0] = (light.facing[k, 1] - light.facing[k, 0]) / h
        rate[k, 1] = (light.visible[k, 1] - light.visible[k, 0]) / h
    return math.sqrt(square / light.law.shape[0])
