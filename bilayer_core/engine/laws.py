"""Formulas of scenes that kernels evaluate as well, compiled."""

from __future__ import annotations

from bilayer_core.jit import kernel
from bilayer_core.scene import spans, transduction

value_of_span = kernel(spans.value_of_span)
lagged = kernel(transduction.lagged)
eigenstrain_of = kernel(transduction.eigenstrain_of)
