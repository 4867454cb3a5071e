"""Time integrators: tables of coefficients, one file each."""
