"""Equilibria and steps of simulators, for studies that go from one to the next."""

from __future__ import annotations

from bilayer_core.model.state import State
from bilayer_core.simulation.gradients.equilibrium_response import Equilibrium
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.simulation.stepper import Stepper


def stepper_and_state(simulator: Simulator) -> tuple[Stepper, State]:
    """Return another maker of steps of a robot, and a copy of its state."""
    return simulator._builders.stepper_of(simulator.model), simulator._now.copy()


def equilibrium_of(simulator: Simulator) -> Equilibrium:
    """Return the equilibrium at which a robot is, with the factor of its Hessian; it leaves the simulator as it is."""
    return simulator._equilibrium()


def take_shape(simulator: Simulator, found: Equilibrium) -> None:
    """Let a robot have the shape of an equilibrium of its scene, or of one with other numbers, under its stimuli."""
    simulator.compile()
    found.write_shape(simulator._state)
    simulator._loop.take_state()


def look_no_more(simulator: Simulator) -> None:
    """Let a robot look no more out of its plane, which costs more than a short run and which no study tells of."""
    simulator.plane_watch = simulator._loop._plane_watch = None
