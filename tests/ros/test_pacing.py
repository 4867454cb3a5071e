import pytest

from bilayer_sim_ros.control.pacing import LARGEST_LAG, LOG, OTHERS, PHYSICS, Pacer, cause_of_delay


class SetClock:
    """A clock that shows what it is set to."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock():
    return SetClock()


@pytest.mark.parametrize(("factor", "delay"), [(1.0, 0.02), (2.0, 0.01), (0.1, 0.2)])
def test_a_simulation_ahead_of_the_clock_waits_according_to_the_factor(clock, factor, delay):
    assert Pacer(factor, clock).delay(0.02) == pytest.approx(delay)


def test_factor_zero_never_waits(clock):
    assert Pacer(0.0, clock).delay(1e6) == 0.0


def test_a_short_lag_is_made_up_for(clock):
    pacer = Pacer(1.0, clock)
    clock.now += 0.5 * LARGEST_LAG
    assert pacer.delay(0.0) == 0.0
    assert pacer.delay(LARGEST_LAG) == pytest.approx(0.5 * LARGEST_LAG)


def test_a_long_lag_is_forgotten_instead_of_raced_after(clock):
    pacer = Pacer(1.0, clock)
    clock.now += 10.0
    assert pacer.delay(0.0) == 0.0
    assert pacer.delay(0.02) == pytest.approx(0.02)
    assert pacer.lost == pytest.approx(10.0)
    for _ in range(100):
        clock.now += 1.0
        assert pacer.delay(0.02) == 0.0
        assert pacer.delay(0.04) <= 0.02 + 1e-9  # however long it lasts, the lag does not grow


def test_after_a_restart_only_time_since_then_counts(clock):
    pacer = Pacer(1.0, clock)
    clock.now += 10.0
    pacer.restart(5.0)
    assert pacer.delay(5.02) == pytest.approx(0.02)


def test_the_cause_of_a_delay_is_what_most_time_went_to_and_the_rest_is_told():
    spent = {LOG: 0.3, PHYSICS: 0.5, OTHERS: 0.001}
    assert cause_of_delay(spent, 1.0) == "physics, 50% of the time (log 30%)"
    assert cause_of_delay({PHYSICS: 0.9}, 1.0) == "physics, 90% of the time"
    assert cause_of_delay({}, 1.0) == "not known"
