"""Requirements that a run must meet to be drawn."""

from __future__ import annotations

from bilayer_core.errors import InputError
from bilayer_core.log.run.run_data import RunData
from bilayer_core.observed.frame import Strand

DRAWN = ("body_pose", "nodes", "points")
"""Topics without which there is nothing to draw."""
PLACED = ("positions", "contact_forces", "strain", "curvature", "section_curvature", "material_frames")
PLACED += ("body_positions", "body_quaternions")
"""Attributes of a run that decide where things are drawn, and how large."""
LARGEST = 1e12
"""Of their values, in SI units."""


def refuse_undrawable(run: RunData, name: str) -> None:
    """Raise InputError, which begins with a name, if a run lacks a topic that is drawn, holds no frame, or has values
    that no picture can show.
    """
    if missing := [topic for topic in run.lacks if any(f"/{drawn}/" in f"{topic}/" for drawn in DRAWN)]:
        raise InputError(f"{name}: the log does not hold {', '.join(missing)}, which is drawn")
    if not len(run.times) or not len(run.shape_times):
        raise InputError(f"{name}: the run holds no frame, there is nothing to show")
    for attribute in PLACED:
        values = getattr(run, attribute)
        if values.size and not (values.min() >= -LARGEST and values.max() <= LARGEST):  # NaN is neither
            what = attribute.replace("_", " ")
            raise InputError(
                f"{name}: its {what} have values that are not finite or above {LARGEST:g}; they cannot be drawn"
            )


def has_sections(layer: Strand) -> bool:
    """Return whether the cross-section of a layer is known, which it is not in a bag without the node's description."""
    return bool(layer.width.any())
