"""Steps of a run that are kept for its gradient, and made once more where there was no room for all of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from bilayer_core.model.records.step import Method
from bilayer_core.model.state import State
from bilayer_core.simulation.gradients.step_again import KeptStep
from bilayer_core.simulation.stepper import Stepper

Array = np.ndarray
ROOM = 2**28
"""For states that are kept, without more being asked for [bytes]."""
FROM_OUTSIDE = ("override", "friction", "pose_goal")


@dataclass
class _Span:
    """Steps between two kept states: when each ends, whether another method stood in, and `Engine.spread` of each."""

    start: Array
    outside: Array
    ends: list[float]
    stood_in: list[bool]
    spread: list[Array]


class Course:
    """Keeps the steps of a run.

    Parameters
    ----------
    stepper : Stepper
        That makes them.
    state : State
        In which each step leaves its end.
    room : int
        For states [bytes]: beyond it, every second one is given up, and its step made again when it is asked for.
    """

    def __init__(self, stepper: Stepper, state: State, room: int = ROOM):
        self._stepper, self._state = stepper, state
        self._most, self._stride = max(room // state.values.nbytes, 2), 1
        self._spans: list[_Span] = []
        self._last = state.values.copy()
        self._shared: list[tuple[Array, State]] = []  # by their values

    def __len__(self) -> int:
        return sum(len(span.ends) for span in self._spans)

    @property
    def made(self) -> list[tuple[float, bool]]:
        """Times at which steps ended [s], and whether another method stood in."""
        return [step for span in self._spans for step in zip(span.ends, span.stood_in, strict=True)]

    @property
    def end(self) -> State:
        """The last state."""
        return self._of(self._last)

    @property
    def start(self) -> State:
        """The state before the first step."""
        return self._of(self._spans[0].start) if self._spans else self.end

    def take(self) -> None:
        """Take a step that was just made."""
        end, outside = self._state.values.copy(), self._outside
        if not self._spans or len(self._spans[-1].ends) == self._stride or self._differs(outside):
            self._spans.append(_Span(self._last, outside, [], [], []))
        span = self._spans[-1]
        span.ends.append(float(self._state.time[0]))
        span.stood_in.append(self._stepper.engine.stood_in)
        span.spread.append(self._stepper.engine.spread)
        self._last = end
        if len(self._spans) > self._most:
            self._thin()

    @property
    def _outside(self) -> Array:
        return np.concatenate([getattr(self._state, name).ravel() for name in FROM_OUTSIDE])

    def _differs(self, outside: Array) -> bool:
        return outside.tobytes() != self._spans[-1].outside.tobytes()

    def _thin(self) -> None:
        """Put spans together, two and two, between which nothing was set from outside."""
        self._stride *= 2
        joined: list[_Span] = []
        for span in self._spans:
            last = joined[-1] if joined else span
            if last is not span and len(last.ends) + len(span.ends) <= self._stride:
                if last.outside.tobytes() == span.outside.tobytes():
                    last.ends += span.ends
                    last.stood_in += span.stood_in
                    last.spread += span.spread
                    continue
            joined.append(span)
        self._spans = joined

    def _of(self, values: Array) -> State:
        state = self._state.copy()
        state.values[:] = values
        return state

    def _shared_of(self, values: Array) -> State:
        """Return the state with some values, which is the end of one step and the start of the next."""
        for kept, state in self._shared:
            if kept is values:
                return state
        state = self._of(values)
        self._shared = [*self._shared[-1:], (values, state)]
        return state

    def steps(self, maker: Stepper, backward: bool = False) -> Iterator[KeptStep]:
        """Yield all steps, the last one first if `backward`; `maker` makes those again of which no state is kept."""
        ends = [span.start for span in self._spans[1:]] + [self._last]
        spans = list(zip(self._spans, ends, strict=True))
        for span, end in reversed(spans) if backward else spans:
            steps = list(self._made(span, end, maker))
            yield from reversed(steps) if backward else steps

    def alike(self) -> Iterator[tuple[list[float], Method, State]]:
        """Yield the ends of steps [s] that follow each other with the same method and from outside, the method, and a
        state with what was set from outside.
        """
        outside = [span.outside.tobytes() for span in self._spans for _ in span.ends]
        steps = zip(self.made, outside, strict=True)
        state = self.start
        for (stood_in, set_then), group in groupby(steps, key=lambda step: (step[0][1], step[1])):
            _set_outside(state, np.frombuffer(set_then))
            yield [end for (end, _), _ in group], self._method(stood_in), state

    def _made(self, span: _Span, end: Array, maker: Stepper) -> Iterator[KeptStep]:
        state = self._shared_of(span.start)
        _set_outside(state, span.outside)
        for k, (time, stood_in) in enumerate(zip(span.ends, span.stood_in, strict=True)):
            start = state
            if k + 1 == len(span.ends):
                state = self._shared_of(end)
            else:
                state = state.copy()
                maker.make_again(state, time, stood_in)
            yield KeptStep(start, state, self._method(stood_in), span.spread[k])

    def repeat(self, maker: Stepper, state: State) -> None:
        """Make all steps from another state, with what was set from outside."""
        for span in self._spans:
            _set_outside(state, span.outside)
            for time, stood_in in zip(span.ends, span.stood_in, strict=True):
                maker.make_again(state, time, stood_in)

    def _method(self, stood_in: bool) -> Method:
        return self._stepper.engine.methods[-1 if stood_in else 0]


def _set_outside(state: State, outside: Array) -> None:
    """Set what is set from outside."""
    place = 0
    for name in FROM_OUTSIDE:
        part = getattr(state, name)
        part[...] = outside[place : place + part.size].reshape(part.shape)
        place += part.size
