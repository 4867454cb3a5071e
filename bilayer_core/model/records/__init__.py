"""Arrays that kernels read and write, under names: see `jit.record`."""
