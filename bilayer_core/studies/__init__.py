"""Many runs: convergence, fits, sweeps and searches."""
