"""Which bodies feel a fluid, and with what area."""

from __future__ import annotations

import math
from collections.abc import Iterator

from bilayer_core.model.findings import Finding
from bilayer_core.scene.body import Body, Prescribed
from bilayer_core.scene.config import SceneConfig


def drag_area(body: Body) -> float:
    """Return the area that a fluid presses on [m²]: its own, or the mean shadow of its surface."""
    if body.drag.area is not None:
        return body.drag.area
    shape = body.surface
    if shape.shape == "sphere":
        return math.pi * shape.radius**2
    if shape.shape == "box":
        a, b, c = shape.size
        return 0.5 * (a * b + b * c + c * a)
    return 0.5 * math.pi * shape.radius * (shape.radius + shape.length)


def dry_bodies(scene: SceneConfig) -> Iterator[Finding]:
    """Yield the bodies in a fluid that move and do not feel it."""
    for body in scene.bodies if scene.fluid is not None else ():
        if not isinstance(body.motion, Prescribed) and body.motion.mass > 0.0 and body.drag is None:
            after = " does not feel the fluid: `drag` gives it a resistance"
            yield Finding("dry body", f"bodies.{body.name}", after)
