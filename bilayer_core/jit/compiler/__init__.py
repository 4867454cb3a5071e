"""The compiler of kernels: all that imports numba, which a process with its pieces in library or cache does without."""
