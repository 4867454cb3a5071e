"""Equilibria of simulators, for studies that go from one to the next."""

from __future__ import annotations

from bilayer_core.simulation.gradients.equilibrium_response import Equilibrium
from bilayer_core.simulation.simulator import Simulator


def equilibrium_of(simulator: Simulator) -> Equilibrium:
    """Return the equilibrium at which a robot is, with the factor of its Hessian; it leaves the simulator as it is."""
    return simulator._equilibrium()


def take_shape(simulator: Simulator, found: Equilibrium) -> None:
    """Let a robot have the shape of an equilibrium of its scene, or of one with other numbers, under its stimuli."""
    simulator.compile()
    found.write_shape(simulator._state)
    simulator._loop.take_state()
