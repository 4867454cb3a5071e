"""How far a crawler goes in each cycle."""

import numpy as np

from bilayer_core import Simulator, load_scene

PERIOD = 2.4  # of both crawlers
DAMPED = "solver.integrator=implicit_euler"
"""Brings a crawler to rest: integrators of second order keep vibrations, which shake its feet along."""


def strides(scene, cycles, *changes):
    """Displacement of the mass centre along x in each cycle [m], and the simulator."""
    simulator = Simulator(load_scene(scene, changes))
    found = [simulator.com[0]]
    for _ in range(cycles):
        simulator.run(PERIOD)
        found.append(simulator.com[0])
    return np.diff(found), simulator
