"""Runs: the simulator, its observers, the energy budget, equilibria."""
