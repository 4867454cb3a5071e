"""Fields whose diffusivity depends on their own value."""

from __future__ import annotations

from bilayer_core.jit.record import Flags, IndexTable, Indices, Matrix, Vector, record

DECISIONS = 64
"""Of steps of a field that are kept: order, whether a step was the last and whether it was taken. With them, values
nearby go the same way, and what they reach has a derivative."""


@record
class VariedFields:
    """Fields whose diffusivity depends on their value, and modes of theirs at points of integration through the
    thickness; see `engine.varied_diffusion`. Absent where no diffusivity varies.
    """

    number: Indices  # of each field among these, −1 of all others, shape (n_field,)
    point: Indices  # first point of each, last the number of all, shape (n_varied + 1,)
    tolerance: Vector  # largest norm of a step's error in q, shape (n_varied,)
    amplitude: Matrix  # γ of modes, shape (n_varied, n_mode), zero beyond those of a field
    rate: Matrix  # λ [1/s], likewise
    value: Matrix  # v of modes at points, shape (n_point, n_mode)
    slope: Matrix  # ∂v/∂z [1/m], likewise
    weight: Vector  # S dz of points [m], shape (n_point,)
    curve: Indices  # diffusivity of each point, shape (n_point,)
    curve_first: Indices  # first place of each curve, last the number of all, shape (n_curve + 1,)
    curve_at: Vector  # value of the field, increasing along a curve
    curve_lack: Vector  # what the diffusivity there lacks to the largest of its layer, D₀ − D [m²/s]
    present: Vector = ("varied mode",)  # q at the start of a step of the field
    moved: Vector = ("varied mode",)
    change: Vector = ("varied mode",)  # q′ [1/s times q]
    span: Vector = ("varied mode",)  # (1 − exp(−λ h))/λ [s]
    decided: IndexTable = ("varied field", DECISIONS)  # of the last steps of each; see `diffuse`
    follows: Flags = (1,)  # whether these decide once more
    level: Matrix = ("level", "varied mode")
