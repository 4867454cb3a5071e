"""Values without a stamp are paired with the frames that they were sent with, whatever a recorder loses."""

import numpy as np
import pytest

from bilayer_core.log.file.frame_matching import match_frames

PERIOD = 20_000_000
"""Of frames [ns]."""


def lossy(generator, count, share):
    """Which of so many a recorder keeps: it begins late, and loses some."""
    kept = generator.random(count) > share
    kept[: generator.integers(0, 5)] = False
    return kept


@pytest.mark.parametrize("seed", range(20))
def test_no_value_goes_to_another_frame_whatever_is_lost(seed):
    generator = np.random.default_rng(seed)
    sent = np.arange(300) * PERIOD + generator.integers(0, PERIOD // 8, 300)
    messages, frames = (np.flatnonzero(lossy(generator, 300, 0.02)) for _ in range(2))
    found, certain = match_frames(sent[messages] + PERIOD // 50, sent[frames], sent[frames])
    paired = found >= 0
    np.testing.assert_array_equal(frames[found[paired]], messages[paired])
    assert paired.sum() == len(np.intersect1d(messages, frames)) and certain


@pytest.mark.parametrize("first_read", ["messages", "frames"])
def test_bursts_that_are_read_topic_by_topic_are_paired_in_order(first_read):
    # Ten frames at once, every 200 ms, first all of one topic and then all of the other.
    burst, place = np.divmod(np.arange(200), 10)
    early, late = (burst * 10 * PERIOD + place * 100_000 + wait for wait in (0, 2_000_000))
    messages, frames = (early, late) if first_read == "messages" else (late, early)
    found, certain = match_frames(messages[10:], frames, frames)
    np.testing.assert_array_equal(found, np.arange(10, 200))
    assert not certain


def test_a_recorder_that_halts_between_two_topics_of_a_frame_shifts_nothing():
    sent = np.arange(40) * PERIOD
    late = np.where(np.arange(40) >= 37, sent + 2 * 10**9, sent)
    last = np.where(np.arange(40) == 37, late, sent)  # frame 37 was received before and after
    found, _ = match_frames(late[5:38], sent, last)
    np.testing.assert_array_equal(found, np.arange(5, 38))


def test_long_gaps_on_either_side_leave_the_rest_paired():
    sent = np.arange(1000) * PERIOD
    messages, frames = np.r_[0:300, 420:1000], np.r_[0:500, 800:1000]
    found, certain = match_frames(sent[messages] + 1000, sent[frames], sent[frames])
    both = np.isin(messages, frames)
    np.testing.assert_array_equal(frames[found[both]], messages[both])
    assert (found[~both] == -1).all()


def test_nothing_is_paired_with_nothing():
    none = np.empty(0, np.int64)
    assert len(match_frames(none, np.arange(3), np.arange(3))[0]) == 0
    assert list(match_frames(np.arange(3), none, none)[0]) == [-1, -1, -1]
    assert list(match_frames(np.array([5]), np.array([9]), np.array([9]))[0]) == [0]
