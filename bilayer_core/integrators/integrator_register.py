"""The table of integrators. A new one is a file with its `Method`, a line here, and its name in `scene.config`."""

from __future__ import annotations

from bilayer_core.integrators import generalised_alpha, implicit_euler, implicit_midpoint, sdirk2, tr_bdf2
from bilayer_core.integrators.method import Method

INTEGRATORS: dict[str, Method] = {
    module.METHOD.name: module.METHOD
    for module in (implicit_euler, sdirk2, tr_bdf2, generalised_alpha, implicit_midpoint)
}
