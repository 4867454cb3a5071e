"""Report on a pattern that was found: how near it comes, whether it is stable and reached, and what limits it."""

from __future__ import annotations

import contextlib

import numpy as np

from bilayer_core.errors import SimulationError
from bilayer_core.simulation.at_rest import take_shape
from bilayer_core.simulation.gradients.equilibrium_response import Equilibrium
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.studies.shaping.design_result import DesignResult, Shape, rod_of, stimuli_text
from bilayer_core.studies.shaping.shaped_rod import ShapedRod
from bilayer_core.studies.shaping.target_curve import TargetCurve

Array = np.ndarray
CLOSE = 1e-3
"""Root mean square of distances, of the length of the rod, that is none: no other way is tried from there on."""
FIXED = 1e-9
"""Motion of the rod along one direction, of that along another, that is none."""
RISES = 10
"""Parts in which stimuli rise."""
AT_BOUND = 1e-6
"""Part of the way between bounds."""


def report_of(rod: ShapedRod, termination: str, simulator: Simulator) -> DesignResult:
    """Return the pattern of a rod, and what its shapes at rest are like in a simulator of the scene."""
    scene, shapes = simulator.scene, []
    for target, level, here, (away, _) in zip(
        rod.targets, rod.levels, rod.here, rod.departures(rod.targets), strict=True
    ):
        made = rod.of_rod(here.positions)
        target = TargetCurve(target.points @ rod.turned(here).T + made[0], target.source)
        length = float(np.linalg.norm(np.diff(made, axis=0), axis=1).sum())
        stable, reached = _is_stable(rod, simulator, here), _is_reached(rod, simulator, here, level)
        shapes.append(Shape(target, level, made, np.linalg.norm(away, axis=1), length, stable, reached))
    part = rod.pattern.parts(rod.values)[[not v.palette for v in rod.varied for _ in v.start]]
    at_bounds = int(np.sum((part <= AT_BOUND) | (part >= 1.0 - AT_BOUND)))
    values = rod.pattern.split(rod.values)
    return DesignResult(scene, rod.varied, values, shapes, at_bounds, _sensitivity(rod), rod.equilibria, termination)


def out_of_reach(rod: ShapedRod) -> str:
    """Return along which direction nothing moves the rod though it is away from a target, as a text."""
    for (away, _), slopes, level in zip(rod.departures(rod.targets), rod.slopes(), rod.levels, strict=True):
        moved = slopes.swapaxes(1, 2).reshape(-1, 3)
        _, sizes, ways = np.linalg.svd(moved, full_matrices=False)
        alone = away @ ways[2] if sizes[0] > 0.0 else np.linalg.norm(away, axis=1)
        missed = float(np.abs(alone).max())
        if sizes[2] <= FIXED * sizes[0] and missed > CLOSE * rod.size:
            way = f"along ({', '.join(f'{abs(x):.3g}' for x in ways[2].round(3))})"
            where = way if sizes[0] > 0.0 else f"at {stimuli_text(level)}"
            return f"; unreachable: {1e3 * missed:.3g} mm {where}, where nothing that varies moves the rod"
    return ""


def _is_stable(rod: ShapedRod, simulator: Simulator, here: Equilibrium) -> bool:
    """Return whether a simulator of the scene stays at an equilibrium, and all small disturbances decay."""
    take_shape(simulator, here)
    with contextlib.suppress(SimulationError):
        return simulator.solve_static().stable and _is_at(rod, simulator, here)
    return False


def _is_reached(rod: ShapedRod, simulator: Simulator, here: Equilibrium, level: dict[str, float]) -> bool:
    """Return whether the rod comes to an equilibrium from the start of the scene, at once or as stimuli rise."""
    for count in (1, RISES):
        simulator.reset()
        begin = simulator.stimulus
        with contextlib.suppress(SimulationError):
            for k in range(1, count + 1):
                for channel, value in level.items():
                    simulator.set_stimulus(channel, begin[channel] + k / count * (value - begin[channel]))
                simulator.solve_static()
            if _is_at(rod, simulator, here):
                return True
    return False


def _is_at(rod: ShapedRod, simulator: Simulator, here: Equilibrium) -> bool:
    return bool(np.abs(rod.from_start(simulator) - rod.from_start(here)).max() <= CLOSE * rod.size)


def _sensitivity(rod: ShapedRod) -> dict[str, float]:
    """Return the largest displacements by errors of 1 % in each pattern, and in the thickness of each layer [m]."""
    found: dict[str, float] = {}

    def note(path: str, moved: list[Array]) -> None:
        found[path] = 0.01 * max(float(np.linalg.norm(of, axis=1).max()) for of in moved)

    begin = 0
    for v, own in zip(rod.varied, rod.pattern.split(rod.values), strict=True):
        note(v.path, [slopes[..., begin : begin + len(own)] @ own for slopes in rod.slopes()])
        begin += len(own)
    shaped = rod_of(rod.scene, rod.varied)
    for layer in shaped.layers:
        path = f"rods.{shaped.name}.layers.{layer.name}.thickness"
        if isinstance(layer.thickness, float) and shaped.radius is None and path not in found:
            slopes = [rod.derivatives(here, rod.sought(here, [path]))[..., 0] for here in rod.here]
            note(path, [slope * layer.thickness for slope in slopes])
    return found
