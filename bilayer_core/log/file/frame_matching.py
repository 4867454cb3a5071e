"""Which frame a message without a stamp belongs to: messages and frames keep their order, and were sent at about the
same time.
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray
BAND = 24
"""Frames before and after the nearest one that are tried: more than a middleware keeps of one topic."""
LONG = 95.0
"""Percentile of the times between frames that counts as the usual one: frames may come in bursts, and a node pauses."""
GAP = 0.3
"""Price of a frame without a message, or of a message without a frame, in that time: less than half, so that no pair
moves to the next frame for the sake of two that have lost their partners. Pairs farther apart than twice the price
are none.
"""
LEAST = 1e5
"""Least price [ns]: what sending the messages of one frame takes."""
_PAIR, _NO_FRAME, _NO_MESSAGE = range(3)


def match_frames(messages: Array, first: Array, last: Array) -> tuple[Array, bool]:
    """Find the frame that each message belongs to.

    Without losses, messages and frames are paired one by one. Otherwise the pairing keeps the order and has the least
    sum of distances in time, with a price for what stays without a partner.

    Parameters
    ----------
    messages : ndarray
        When they were sent, in that order [ns], shape (messages,), integers.
    first, last : ndarray
        When the first and the last of the other messages of each frame were sent [ns], shape (frames,), integers that
        do not decrease.

    Returns
    -------
    frames : ndarray
        Number of the frame of each message, -1 for none; shape (messages,), integers that increase but for these.
    certain : bool
        Whether there were no losses, or each message is nearer to its frame than to the neighbours of that.
    """
    found = np.full(len(messages), -1)
    if not len(messages) or not len(first):
        return found, True
    start, count = first[0], len(first)
    messages, first, last = ((of - start).astype(float) for of in (messages, first, last))
    gap = max(GAP * float(np.percentile(np.diff(first), LONG)) if count > 1 else 0.0, LEAST)
    if len(messages) == count and (_distances(messages, first, last) <= 2.0 * gap).all():
        return np.arange(count), True
    nearest = np.maximum.accumulate(np.searchsorted(first, messages))
    low, high = np.clip(nearest - BAND, 0, count), np.clip(nearest + BAND, 0, count)
    choices = _choices(messages, first, last, gap, low, high)
    message, used = len(messages) - 1, count  # of the frames, as many are used up
    while message >= 0:
        used = min(used, int(high[message]))
        choice = choices[message, used - low[message]]
        if choice == _PAIR:
            found[message] = used - 1
        message -= choice != _NO_MESSAGE
        used -= choice != _NO_FRAME
    frames, messages = found[found >= 0], messages[found >= 0]
    own, before, behind = (
        _distances(messages, first[of], last[of]) for of in (frames, np.maximum(frames - 1, 0), (frames + 1) % count)
    )
    nearest_is_own = ((own < before) | (frames == 0)) & ((own < behind) | (frames == count - 1))
    return found, bool(nearest_is_own.all())


def _distances(messages: Array, first: Array, last: Array) -> Array:
    """Return the distances in time of messages from frames; zero between the first and the last of a frame."""
    return np.maximum(np.maximum(first - messages, messages - last), 0.0)


def _choices(messages: Array, first: Array, last: Array, gap: float, low: Array, high: Array) -> Array:
    """Return the cheapest last choice for each message and each number of frames that are used up by then.

    Row i has the numbers `low[i]` to `high[i]`; shape (messages, 2 `BAND` + 1).
    """
    choices = np.zeros((len(messages), 2 * BAND + 1), np.int8)
    costs, begin = np.zeros(1), 0

    def cost_of(used: Array) -> Array:
        """Return the costs before this message; behind the band, frames without a message are added."""
        index, end = used - begin, len(costs) - 1
        return np.where(index < 0, np.inf, costs[np.clip(index, 0, end)] + gap * np.maximum(index - end, 0))

    for number, message in enumerate(messages):
        used = np.arange(low[number], high[number] + 1)
        pair = np.where(used > 0, cost_of(used - 1) + _distances(message, first[used - 1], last[used - 1]), np.inf)
        alone = cost_of(used) + gap
        best = np.minimum(pair, alone) - gap * used
        cheapest = np.minimum.accumulate(best)
        choices[number, : len(used)] = np.where(cheapest < best, _NO_MESSAGE, np.where(pair <= alone, _PAIR, _NO_FRAME))
        costs, begin = cheapest + gap * used, used[0]
    return choices
