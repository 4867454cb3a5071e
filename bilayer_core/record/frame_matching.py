"""Which frame a message without a stamp belongs to: messages and frames keep their order, and were sent at about the
same time.
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray
BAND = 24
"""Frames before and after the nearest one that are tried: more than a middleware keeps of one topic."""
GAP = 5.0
"""Price of a frame without a message, or a message without a frame, in mean distances between frames: two are paired
up to twice that distance.
"""
_PAIR, _NO_FRAME, _NO_MESSAGE = range(3)


def match_frames(messages: Array, frames: Array) -> Array:
    """Return the number of the frame that each message belongs to, -1 for none.

    Without losses, messages and frames are paired one by one. Otherwise the pairing keeps the order and has the least
    sum of distances in time, with a price for what stays without a partner.

    Parameters
    ----------
    messages, frames : ndarray
        When they were sent, in the order in which they were [ns], shapes (messages,) and (frames,), integers.

    Returns
    -------
    ndarray
        Shape (messages,), integers; those that are not -1 increase.
    """
    found = np.full(len(messages), -1)
    if not len(messages) or not len(frames):
        return found
    start, count = frames[0], len(frames)
    messages, frames = (messages - start).astype(float), (frames - start).astype(float)
    gap = GAP * max(float(frames[-1]), 1.0) / max(count - 1, 1)
    if len(messages) == count and (np.abs(messages - frames) <= 2.0 * gap).all():
        return np.arange(count)
    nearest = np.maximum.accumulate(np.searchsorted(frames, messages))
    low, high = np.clip(nearest - BAND, 0, count), np.clip(nearest + BAND, 0, count)
    choices = _choices(messages, frames, gap, low, high)
    message, used = len(messages) - 1, count  # of the frames, as many are used up
    while message >= 0:
        used = min(used, int(high[message]))
        choice = choices[message, used - low[message]]
        if choice == _PAIR:
            found[message] = used - 1
        message -= choice != _NO_MESSAGE
        used -= choice != _NO_FRAME
    return found


def _choices(messages: Array, frames: Array, gap: float, low: Array, high: Array) -> Array:
    """Return the cheapest last choice for each message and each number of frames that are used up by then.

    Row i has the numbers `low[i]` to `high[i]`; shape (messages, 2 `BAND` + 1).
    """
    choices = np.zeros((len(messages), 2 * BAND + 1), np.int8)
    costs, first = np.zeros(1), 0

    def cost_of(used: Array) -> Array:
        """Return the costs before this message; behind the band, frames without a message are added."""
        index, last = used - first, len(costs) - 1
        return np.where(index < 0, np.inf, costs[np.clip(index, 0, last)] + gap * np.maximum(index - last, 0))

    for number, message in enumerate(messages):
        used = np.arange(low[number], high[number] + 1)
        pair = np.where(used > 0, cost_of(used - 1) + np.abs(message - frames[used - 1]), np.inf)
        alone = cost_of(used) + gap
        best = np.minimum(pair, alone) - gap * used
        cheapest = np.minimum.accumulate(best)
        choices[number, : len(used)] = np.where(cheapest < best, _NO_MESSAGE, np.where(pair <= alone, _PAIR, _NO_FRAME))
        costs, first = cheapest + gap * used, used[0]
    return choices
