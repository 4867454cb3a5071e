import pytest

from bilayer_sim_ros.replay.log_clock import LogClock

SECOND = 1_000_000_000


class SetClock:
    """A clock that shows what it is set to."""

    now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def real():
    return SetClock()


def test_time_stands_still_until_it_is_started_and_after_it_is_stopped(real):
    clock = LogClock(2.0, real)
    real.now += 1
    assert clock.now == 0
    clock.start()
    real.now += 1
    assert clock.now == 2 * SECOND
    clock.stop()
    real.now += 1
    assert clock.now == 2 * SECOND
    clock.start()
    real.now += 1
    assert clock.now == 4 * SECOND


@pytest.mark.parametrize(("rate", "wait"), [(1.0, 3.0), (0.5, 6.0), (10.0, 0.3)])
def test_the_wait_for_a_time_follows_the_rate(real, rate, wait):
    clock = LogClock(rate, real)
    clock.jump(5 * SECOND)
    clock.start()
    assert clock.until(8 * SECOND) == pytest.approx(wait)
    real.now += 2 * wait
    assert clock.until(8 * SECOND) == pytest.approx(-wait)


def test_another_rate_does_not_move_the_time(real):
    clock = LogClock(1.0, real)
    clock.start()
    real.now += 3
    clock.rate = 4.0
    assert clock.now == 3 * SECOND
    real.now += 1
    assert clock.now == 7 * SECOND


def test_times_of_this_century_are_kept_to_the_nanosecond(real):
    clock = LogClock(1.0, real)
    clock.jump(1_795_441_161_309_531_199)
    clock.start()
    assert clock.now == 1_795_441_161_309_531_199
    real.now += 0.5
    assert clock.now == 1_795_441_161_809_531_199


@pytest.mark.parametrize("rate", [1e-300, 1e300])
def test_no_rate_is_too_large_or_too_small(real, rate):
    clock = LogClock(rate, real)
    clock.start()
    real.now += 1e6
    assert 0 <= clock.now <= 2**62
