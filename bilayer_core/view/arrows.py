"""Arrows over time: contact forces on nodes, forces and moments on the bodies that hold rods."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bilayer_core.log.run.run_data import RunData
from bilayer_core.view.scales import ARROW_SHARE, SHOWN_SHARE, Scales, reference_of, rounded_up

REACTIONS = {"clamp_forces": slice(0, 3), "clamp_moments": slice(3, 6)}
"""What is drawn of the force and moment of rods on a body."""
NOISE = 1e-6
"""Part of the other, over the size of the robot, below which a force or a moment is what rounding leaves."""


@dataclass(frozen=True)
class Arrows:
    """Forces or moments, each with its place."""

    times: np.ndarray  # [s], shape (n,)
    origins: np.ndarray  # [m], shape (n, m, 3)
    forces: np.ndarray  # [N] or [N m], shape (n, m, 3)
    metres_per_unit: float  # Length of an arrow by its size [m/N] or [1/N]
    shown: float  # Size from which there is an arrow


def contact_arrows(run: RunData, scales: Scales) -> Arrows:
    """Return the arrows of contact forces on nodes and contact points."""
    return Arrows(run.shape_times, run.positions, run.contact_forces, scales.metres_per_newton, scales.shown_force)


def reaction_arrows(run: RunData, scales: Scales) -> dict[str, Arrows]:
    """Return arrows of the reactions of rods on bodies that hold them, by `REACTIONS`; only of those that ever act."""
    return scaled_reactions(run, scales, reaction_references(run, scales.size))


def reaction_references(run: RunData, size: float) -> dict[str, float]:
    """Return the sizes by which to scale the reactions that act [N, N m]; `size` is that of the robot [m]."""
    arms = {"clamp_forces": 1.0, "clamp_moments": size}
    acting = {name: run.clamp_wrenches[:, :, part] for name, part in REACTIONS.items()}
    references = {name: reference_of(of) for name, of in acting.items() if of.any()}
    largest = max((reference / arms[name] for name, reference in references.items()), default=0.0)
    return {name: reference for name, reference in references.items() if reference / arms[name] > NOISE * largest}


def scaled_reactions(run: RunData, scales: Scales, references: Mapping[str, float]) -> dict[str, Arrows]:
    """Return the arrows of these sizes."""
    found = {}
    for name, reference in references.items():
        scale = metres_per(reference, scales.size)
        wrenches = run.clamp_wrenches[:, :, REACTIONS[name]]
        found[name] = Arrows(run.times, run.body_positions, wrenches, scale, SHOWN_SHARE * reference)
    return found


def metres_per(reference: float, size: float) -> float:
    """Return the length of arrows by the size that they are scaled by, for a robot of a size [m]: [m/N] or [1/N]."""
    return 1.0 / rounded_up(reference / (ARROW_SHARE * size))
