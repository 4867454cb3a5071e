"""Time stepping: integrators, control of the step, and the `Simulator`."""
