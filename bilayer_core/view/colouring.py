"""Colours of rods by axial strain, curvature, along or across, or the pressure of contact."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bilayer_core.log.messages.colours import PRESSURE_MAP, STRAIN_MAP, map_colours
from bilayer_core.log.run.run_data import RunData
from bilayer_core.observed.frame import Strand
from bilayer_core.view.scales import rounded_up

STRAIN, CURVATURE, SECTION, CONTACT = "strain", "curvature", "section", "contact"
QUANTITIES = (STRAIN, CURVATURE, SECTION, CONTACT)
SMALLEST = {STRAIN: 1e-4, CURVATURE: 1e-6, SECTION: 1e-6, CONTACT: 1e-6}
"""Of the fullest colours [1, 1/m, Pa], for a run in which nothing happens; of curvature, by the size of the robot."""
PRESSURE_SHARE = 99.0
"""Percentile of the pressures above zero that has the fullest colour: an impact would leave no colour to the rest."""
_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "u"))


@dataclass(frozen=True)
class Colouring:
    """How values of rods become colours, the same over a whole run."""

    quantity: str  # One of `QUANTITIES`
    title: str  # Of the colour bar, with the unit
    limit: float  # Value of the fullest colour, in SI units
    shown_limit: str  # The same in the unit of the title
    diverging: bool  # Whether colours go from minus the limit to the limit, and not from zero to it
    exceeded: bool  # Whether values beyond the limit occur; they have its colour

    @property
    def colour_map(self) -> np.ndarray:
        """Colours of the bar from its lower to its upper end: sRGBA from 0 to 1, shape (steps, 4)."""
        return STRAIN_MAP if self.diverging else PRESSURE_MAP

    @property
    def ticks(self) -> tuple[tuple[float, str], ...]:
        """Places along the bar from 0 to 1, and what is written there."""
        most = f">= {self.shown_limit}" if self.exceeded else self.shown_limit
        if not self.diverging:
            return (0.0, "0"), (1.0, most)
        return (0.0, f"-{self.shown_limit}"), (0.5, "0"), (1.0, f"+{self.shown_limit}")

    def values(self, run: RunData, layer: Strand) -> np.ndarray:
        """Return the values of one of the description's `layers`, in SI units, shape (shapes, its nodes)."""
        return _values(run, layer, self.quantity)

    def colours(self, values: np.ndarray) -> np.ndarray:
        """Return SRGBA from 0 to 1 of values, float32, shape + (4,)."""
        return map_colours(values, -self.limit if self.diverging else 0.0, self.limit, self.colour_map)

    def sentence(self) -> str:
        """Return the meaning of the colours, in words."""
        if self.diverging:
            low, high = self.ticks[0][1], self.ticks[-1][1]
            return f"{self.title}: {low} (blue) over 0 (grey) to {high} (red)"
        return f"{self.title}: 0 (grey) to {self.ticks[-1][1]} (dark red)"


def choose_colouring(run: RunData, quantity: str = STRAIN) -> Colouring:
    """Return the colours that suit a run."""
    found = np.concatenate([np.abs(_values(run, layer, quantity)).ravel() for layer in run.description.layers])
    found = found[np.isfinite(found)]
    least = SMALLEST[quantity]
    if quantity in (CURVATURE, SECTION):
        least /= max(float(np.ptp(run.positions[0], axis=0).max()), 1e-9)
    largest = float(found.max(initial=0.0))
    if quantity == CONTACT:
        acting = found[found > 0.0]
        largest = float(np.percentile(acting, PRESSURE_SHARE)) if len(acting) else 0.0
    limit = rounded_up(max(largest, least))
    return colouring_up_to(quantity, limit, bool((found > limit * (1.0 + 1e-6)).any()))


def colouring_up_to(quantity: str, limit: float, exceeded: bool = False) -> Colouring:
    """Return the colours with a given limit, in SI units."""
    if quantity == STRAIN:
        title, shown = "axial strain [%]", f"{100 * limit:.4g}"
    elif quantity in (CURVATURE, SECTION):
        per_mm, across = limit >= 1e3, " across" if quantity == SECTION else ""
        title, shown = f"curvature{across} [1/{'mm' if per_mm else 'm'}]", f"{limit / (1e3 if per_mm else 1.0):.4g}"
    else:
        scale, prefix = next((p for p in _PREFIXES if limit >= p[0]), _PREFIXES[-1])
        title, shown = f"contact pressure [{prefix}Pa]", f"{limit / scale:.4g}"
    return Colouring(quantity, title, limit, shown, quantity != CONTACT, exceeded)


def _values(run: RunData, layer: Strand, quantity: str) -> np.ndarray:
    if quantity == STRAIN:
        return run.strain_of(layer)
    if quantity in (CURVATURE, SECTION):
        return (run.curvature if quantity == CURVATURE else run.section_curvature)[:, layer.nodes]
    return contact_pressure(run, layer)


def contact_pressure(run: RunData, layer: Strand) -> np.ndarray:
    """Return the size of the contact force on each node, friction included, over the face of the ribbon that is the
    node's: its width times half the way to both neighbours [Pa], shape (shapes, nodes).
    """
    positions = run.positions[:, layer.nodes].astype(float)
    edges = np.linalg.norm(np.diff(positions, axis=1), axis=2)
    length = np.zeros(positions.shape[:2])
    length[:, :-1] += 0.5 * edges
    length[:, 1:] += 0.5 * edges
    force = np.linalg.norm(run.contact_forces[:, layer.nodes].astype(float), axis=2)
    area = np.maximum(length * layer.width, math.ulp(0.0))
    return force / area
