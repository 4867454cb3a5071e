"""Departures of a rod's shape at rest from its path."""

from __future__ import annotations

from typing import Annotated, Literal

from bilayer_core.scene.part import Part
from bilayer_core.scene.units import PositiveLength, whole


class Imperfection(Part):
    """A small departure of a rod from its path, free of stress. It decides when and which way a symmetric rod buckles,
    which is otherwise left to rounding.
    """

    shape: Literal["bow", "random"]
    """`bow`: that of the first buckling, by what holds the ends; `random`: six such shapes, the n-th with a random
    part of 1/n². Both keep position and direction of clamped ends."""
    size: PositiveLength
    """Largest distance from the path; a hundredth of the thickness is small."""
    direction: Literal["normal", "across", "both"] = "normal"
    """Along the normal of the rod, across path and normal, or both by the same law; the last two need dimension 3."""
    seed: Annotated[int, *whole(0)] = 0
    """Of the random numbers. Rods of a pattern have the same shape."""
