"""When output is due."""

import pytest

from bilayer_core.simulation.observers import completed, next_end


@pytest.mark.parametrize("rate", [7.0, 50.0, 93.0, 1000.0 / 3.0])
@pytest.mark.parametrize("count", [0, 1, 3, 10**6 + 1, 10**8 + 3, 10**10 + 1])
def test_periods_are_counted_without_a_slip_however_many_there_are(rate, count):
    assert completed(count / rate, rate) == count
    assert next_end(count / rate, rate) == (count + 1) / rate
    assert completed((count + 0.999) / rate, rate) == count
