"""Fields whose diffusivity depends on their own value."""

from __future__ import annotations

from bilayer_core.jit.record import Indices, Matrix, Vector, record


@record
class VariedFields:
    """Fields whose diffusivity depends on their value, and modes of theirs at points of integration through the
    thickness; see `engine.varied_diffusion`. Absent where no diffusivity varies.
    """

    number: Indices  # of each field among these, −1 of all others, shape (n_field,)
    point: Indices  # first point of each, last the number of all, shape (n_varied + 1,)
    entry: Indices  # first value of v and v′ of each, shape (n_varied,)
    square: Indices  # first value of its `exchange`, likewise
    tolerance: Vector  # of a step [unit of the stimulus], likewise
    amplitude: Vector  # γ of modes, shape (n_mode,)
    value: Vector  # v of modes at points, point after point
    slope: Vector  # ∂v/∂z [1/m], likewise
    weight: Vector  # S dz of points [m], shape (n_point,)
    exchange: Vector  # Σ h S v vᵀ of faces, shape (n_own, n_own) of each field
    curve: Indices  # diffusivity of each point, shape (n_point,)
    curve_first: Indices  # first place of each curve, last the number of all, shape (n_curve + 1,)
    curve_at: Vector  # value of the field, increasing along a curve
    curve_value: Vector  # diffusivity there [m²/s]
    matrix: Matrix = ("varied mode", "varied mode")
    present: Vector = ("varied mode",)  # q at the start of a step of the field
    moved: Vector = ("varied mode",)
    level: Matrix = ("level", "varied mode")
