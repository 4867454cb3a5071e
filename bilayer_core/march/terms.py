"""Terms of the potential, by their place in `Sums.energy`; the order is that of the sum."""

from __future__ import annotations

NAMES = (
    "stretching",
    "bending",
    "twisting",
    "bond",
    "inertia",
    "damping",
    "gravity",
    "loads",
    "followers",
    "moments",
    "drag",
    "added mass",
    "barrier",
    "friction",
    "rod barrier",
    "rod friction",
)
STRETCHING, BENDING, TWISTING, BOND, INERTIA, DAMPING, GRAVITY = range(7)
LOADS, FOLLOWERS, MOMENTS, DRAG, ADDED_MASS, BARRIER, FRICTION, ROD_BARRIER, ROD_FRICTION = range(7, 16)
