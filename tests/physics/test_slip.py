"""Where on a Newton step friction holds it up."""

import numpy as np
import pytest
from support.slips import dissipation

from bilayer_core import Simulator, load_scene
from bilayer_core.forces.friction_limit import PASSED, PATH_SIZE, friction_limit

THRESHOLD, STEP = 1e-4, 1e-3  # ε_v [m/s], h [s]
ZONE = THRESHOLD * STEP  # slip within which a contact sticks [m]


def way_of(slip, rate, load=1.0, coefficient=0.5, forward=None):
    """One contact with equal coefficients all round, but for that forward if it is given, which is smaller."""
    square = coefficient**2
    ahead = square if forward is None else forward**2
    return np.array(
        [[*(slip[0], rate[0], slip[1], rate[1]), ahead, square, square, load, coefficient * STEP, THRESHOLD]]
    )


def derivatives(function, at, h):
    plus, minus = function(at + h), function(at - h)
    return (plus - minus) / (2.0 * h), (plus - 2.0 * function(at) + minus) / h**2


def potential_along(way, slope):
    """The potential along a Newton step: quadratic but for friction."""

    def friction(a):
        return dissipation(way, a, THRESHOLD)

    first, second = derivatives(friction, 0.0, 1e-6)
    linear, quadratic = slope - first, -slope - second
    assert quadratic > 0.0
    return lambda a: linear * a + 0.5 * quadratic * a**2 + friction(a)


@pytest.mark.parametrize("side", [0.0, 0.3 * ZONE])
@pytest.mark.parametrize("turning_point", [0.02, 0.37, 0.8])
def test_a_step_that_would_turn_a_contact_round_ends_where_that_rests(turning_point, side):
    rate = -400.0 * ZONE
    way = way_of((-turning_point * rate, side), (rate, 0.0))
    slope = -0.3 * abs(rate)  # of which friction, 2 μ λ |δu|, is a multiple
    along = potential_along(way, slope)
    fraction = friction_limit(1, way, slope, 1.0)
    assert abs(derivatives(along, fraction, 1e-7)[0]) <= 1.01 * PASSED * abs(slope)
    assert abs(fraction - turning_point) * abs(rate) < ZONE  # it sticks
    fractions = np.linspace(0.0, 1.0, 4001)
    lowest = min(along(a) for a in fractions)
    assert along(fraction) - lowest < 1e-3 * (along(0.0) - lowest)


def test_a_step_is_not_held_up_by_contacts_that_slip_on_or_yield_to_it():
    rate = 400.0 * ZONE
    on = way_of((100.0 * ZONE, 0.0), (rate, 0.0))
    weak = way_of((0.4 * rate, 0.0), (-rate, 0.0), load=1e-3)
    for way in (on, weak):
        assert friction_limit(1, way, -0.3 * rate, 1.0) == 1.0
        assert friction_limit(1, way, -0.3 * rate, 0.25) == 0.25
    assert friction_limit(0, np.empty((0, PATH_SIZE)), -1.0, 0.5) == 0.5


@pytest.mark.parametrize("rate, is_held", [(400.0 * ZONE, False), (-400.0 * ZONE, True)])
def test_a_contact_at_rest_holds_a_step_up_by_the_friction_of_the_way_it_goes(rate, is_held):
    way = way_of((0.0, 0.0), (rate, 0.0), forward=0.2)  # 0.5 backward
    fraction = friction_limit(1, way, -0.3 * abs(rate), 1.0)
    assert (fraction * abs(rate) < ZONE) if is_held else fraction == 1.0


def test_sticking_and_slipping_on_the_ground_takes_few_iterations():
    simulator = Simulator(
        load_scene("jumping", ["contact.rods=false"]), model="laminate", integrator="implicit_euler", dt=STEP
    )
    simulator.run(1.0)
    iterations = []
    for _ in range(20):  # the loop lets go
        before = simulator.summary()["newton_iterations"]
        simulator.run(STEP)
        iterations.append(simulator.summary()["newton_iterations"] - before)
    assert sum(iterations) < 260  # 297 where friction does not limit steps
