"""The terms of the incremental potential: each binds kernels of `bilayer_core.forces` to a model's arrays.

A new force is a kernel in `forces`, a `Term` here, and a line in the register of `solve/potential.py`.
"""
