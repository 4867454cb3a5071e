"""The search for the pattern with which a rod takes wanted shapes.

At an equilibrium with the values p, dx/dp of the stations x tells where others would be. Each step minimises, within
the bounds of p,

    Σ |d_i + ∂d_i/∂p δp|²/L² + w² Σ (second differences of the pattern, in parts of its bounds)²

with d_i the way of station i from the nearest point of the wanted curve (Gauss and Newton). A drawn curve does not say
how the strip is stretched: sliding along it costs nothing, but a little at its end. A step that makes this sum larger
is made again with a weight of staying. Far away this is no good: in a plane, the first step takes angles of edges in
place of distances, in which free strips are linear; in space, wanted shapes are approached through shapes that bend
less. Strips that sag or curl across may come to rest elsewhere: a pattern may be right, and yet the way to its shape
not. So where the first step leads astray, shapes that bend less are followed in a plane as well, without weight; then
weight comes back while the shape is held, in which gains are linear, too.
Values of palettes come last, from the linear problem about the best pattern without them, then about that with them.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bilayer_core.errors import InputError, SceneError, SimulationError
from bilayer_core.model.plan import best_dimension
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.loader import load_content, load_scene, scene_content
from bilayer_core.scene.overrides import Overrides
from bilayer_core.simulation.gains import alike_but_gains
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.studies.shaping.design_result import DesignResult
from bilayer_core.studies.shaping.shape_report import CLOSE, out_of_reach, report_of
from bilayer_core.studies.shaping.shaped_rod import ENDS, ShapedRod, Stopped, sections_of
from bilayer_core.studies.shaping.target_curve import TargetCurve, between, read_curve
from bilayer_core.studies.shaping.varied import Varied, Vary, read_varied

Array = np.ndarray
Target = str | Path | Array
MOST_STEPS, FEW_STEPS, MOST_TRIALS, MOST_MODELS, MOST_PALETTES = 60, 3, 8, 3, 8
ENOUGH = 1e-6
"""Root mean square of distances, of the length of the rod, at which to end."""
STALLED = 0.02
"""Part by which one of two steps must make the root of the sum smaller, else the search ends."""
WEAKEST, STRONGER = 1e-4, 4.0
"""First weight of staying, in parts of the bounds, once a step leads away, and its factor (Levenberg, Marquardt)."""
SMOOTH = 1e-3
"""w of a pattern of `pattern.POINTS` points: what is left to choose is smooth."""
TURN = 1.0
"""Of the tip, between two shapes on the way to a wanted one in space [rad]."""
ASTRAY, SHORTEST = 0.2, 1.0 / 64.0
"""Largest error of linear equations about a step, of what it was to mend, and the shortest step, of the whole way."""
AMONG = 0.381966
"""Part of the way between bounds at which no value is likely to be special."""


def design(
    scene: SceneConfig | str | Path | Mapping[str, Any],
    target: Target | Sequence[Target],
    vary: Vary,
    *,
    at: Sequence[Mapping[str, float]] | Mapping[str, float] | None = None,
    overrides: Overrides = (),
    smoothness: float = SMOOTH,
    progress: Callable[[str], None] | None = None,
    interrupted: Callable[[], bool] = lambda: False,
) -> DesignResult:
    """Find values of a scene with which a rod takes one wanted shape or several.

    Parameters
    ----------
    scene : SceneConfig, str, Path or mapping
        As `load_scene` takes it.
    target : str, Path or ndarray, or a list of these
        Csv files with columns x, y and z [m], or arrays of shape (n, 3): the curve of the rod from its start.
    vary : sequence of str or mapping
        ``PATH=LO:HI``, or ``PATH=LO:HI:POINTS`` for a profile along the rod; or (lo, hi) or (lo, hi, points) by paths.
        ``PATH=V,V,…`` and ``PATH=V,V,…:PIECES``, or ([v, …],) and ([v, …], pieces), allow these values alone.
    at : mapping or list of mappings, optional
        Values of stimuli, for each target; by default the channels' largest.
    overrides : sequence of str or mapping
        As `load_scene` takes them.
    smoothness : float
        Weight of the roughness of patterns.
    progress : callable, optional
        Called with a line of text for each step.
    interrupted : callable, optional
        Called before each equilibrium. The search ends where it returns True; the result is the best pattern so far.

    Returns
    -------
    DesignResult

    Raises
    ------
    SceneError, InputError
        If anything that is given is not acceptable, a target is longer than the rod can become or begins in another
        direction, or a parameter acts on nothing.
    SimulationError
        If the scene has no equilibrium at the start.
    """
    config = scene if isinstance(scene, SceneConfig) else load_scene(scene, overrides)
    if isinstance(scene, SceneConfig) and overrides:
        config = load_scene(scene_content(scene), overrides)
    targets = target if isinstance(target, list | tuple) else [target]
    curves = [TargetCurve(given) if isinstance(given, np.ndarray) else read_curve(given) for given in targets]
    levels = [dict(at)] if isinstance(at, Mapping) else [dict(of) for of in at or ()]
    if not levels and len(curves) == 1:
        levels = [{name: channel.maximum for name, channel in config.stimuli.items()}]
    if len(levels) != len(curves):
        raise InputError(f"target: {len(curves)} curves need values of stimuli each, {len(levels)} are given")
    for level in levels:
        if levels.count(level) > 1:
            raise InputError(f"target: two curves are wanted at the same stimuli, {level}")
    if not 0.0 <= smoothness < math.inf:
        raise InputError(f"smoothness: {smoothness} is not allowed; it must be a finite number from 0 up")
    config, varied = read_varied(config, vary)
    config = _in_space(config, varied)
    return _Search(progress, config, varied, curves, levels, smoothness, interrupted).result()


def _in_space(scene: SceneConfig, varied: list[Varied]) -> SceneConfig:
    """Return the scene in space, if only its present values keep it in a plane."""
    changes = {
        path: of for v in varied for path, of in v.changes(v.low + AMONG * (v.high - v.low) + 0.0 * v.start).items()
    }
    with contextlib.suppress(SceneError):
        other = load_content(scene_content(scene), changes)
        if scene.solver.dimension == "auto" and best_dimension(scene)[0] < best_dimension(other)[0]:
            return load_content(scene_content(scene), {"solver.dimension": 3})
    return scene


class _Search(ShapedRod):
    """Steps from equilibrium to equilibrium."""

    def __init__(self, progress: Callable[[str], None] | None, *of_rod: Any):
        super().__init__(*of_rod)
        self._progress, self._failure = progress, ""
        self._moving = np.ones(len(self.values), dtype=bool)

    def _left(self, targets: Sequence[TargetCurve]) -> float:
        """Return the root of the sum that steps make smaller."""
        ends = ENDS * math.sqrt(np.mean(self.beyond(targets) ** 2)) / self.size
        return math.hypot(self.rms(targets), ends, math.sqrt(self.pattern.roughness(self.values)))

    def _improve(self, targets: Sequence[TargetCurve], steps: int) -> str:
        """Make steps towards targets, and return why they ended."""
        damping, slow = 0.0, 0
        for _ in range(steps):
            if self.rms(targets) <= ENOUGH:
                return "the shape is as wanted"
            before, now, equations = self.kept(), self._left(targets), self.equations(targets, self.slopes())
            for _ in range(MOST_TRIALS):
                new = self._left_with(self.pattern.solved(*equations, self.values, self._moving, damping), targets)
                if new < now:
                    break
                self.return_to(before)
                damping = max(STRONGER * damping, WEAKEST)
            else:
                return f"no step leads nearer{self._failure}"
            damping = damping / STRONGER if damping > WEAKEST else 0.0
            self._tell()
            slow = slow + 1 if new > (1.0 - STALLED) * now else 0
            if slow == 2:
                return "steps lead hardly nearer"
        return f"{steps} steps were made"

    def _left_with(self, values: Array, targets: Sequence[TargetCurve]) -> float:
        """Go to other values, and return what is left there, infinity if there is no equilibrium."""
        self.values, self._failure = values, ""
        try:
            self.go(values)
        except SimulationError as error:
            self._failure = f": {error}"
            return math.inf
        return self._left(targets)

    def _take_palettes(self, most: int) -> str:
        """Take values of palettes, from the linear problem about each pattern that was tried; others follow."""
        free, best, least, tried = 100.0 * self.rms(self.targets), self.kept(), math.inf, set()
        moving, palette = self._moving, self.pattern.in_palette
        for _ in range(most):
            equations = self.equations(self.targets, self.slopes())
            values = self.pattern.printable(*equations, self.values, moving)
            if values[palette].tobytes() in tried:
                break
            tried.add(values[palette].tobytes())
            if not math.isfinite(self._left_with(values, self.targets)):
                break
            self._improve_some(moving & ~palette, FEW_STEPS)
            self._tell()
            left = self._left(self.targets)
            best, least = (self.kept(), left) if left < least else (best, least)
        self.return_to(best)
        if not math.isfinite(least):
            return f"no pattern of the palette has an equilibrium near{self._failure}"
        return f"values of the palette; without it: rms distance {free:.3g} %"

    def _improve_some(self, moving: Array, steps: int) -> None:
        """Make steps towards targets in which some values alone change."""
        if moving.any():
            before, self._moving = self._moving, moving
            self._improve(self.targets, steps)
            self._moving = before

    def _tell(self) -> None:
        """Tell how near the rod is, and note the best pattern so far: of palettes, if there are any."""
        is_free = self.weight < 1.0 or not self.pattern.is_printable(self.values)
        rank = is_free, self._left(self.targets)
        if rank < self._best_rank:
            self._best_rank, self._best = rank, (self.kept(), self.sections)
        if self._progress is not None:
            rms = self.rms(self.targets)
            self._progress(f"{self.equilibria} equilibria: rms distance {100 * rms:.3g} % of the rod")

    def result(self) -> DesignResult:
        """Search, and return what was found.

        Which sections rods have may follow from the pattern. Beams come first: they have one shape at rest, from which
        wide strips find their own that is near. Where strips have none, the scene keeps the sections of the search.
        """
        self._best_rank, self._best = (True, math.inf), (self.kept(), self.sections)
        try:
            return report_of(self, *self._searched_with_own_sections())
        except Stopped:
            kept, self.sections = self._best
            self.return_to(kept)
            self._interrupted, self._moving = bool, np.ones_like(self._moving)
            self.by_laws = self.are_laws()
            if not self.pattern.is_printable(self.values):
                self._take_palettes(1)
            return report_of(self, "stopped; this is the best pattern so far", self._in_sections_of_search())

    def _searched_with_own_sections(self) -> tuple[str, Simulator]:
        """Search, and return why that ended, and a simulator of the scene that was found."""
        termination = self._search()
        for _ in range(MOST_MODELS):
            simulator = Simulator(self.scene_with(self.values, {}))
            if alike_but_gains(self.here[0].model, simulator.model):
                break
            before, sections = self.kept(), self.sections
            self.sections, self.known = sections_of(simulator.scene, simulator.plan.model), []
            try:
                self.here = self.built(self.values, self.here)
                self.parameters = [self.sought(here) for here in self.here]
                self.by_laws, self._best_rank = self.are_laws(), (True, math.inf)
                termination = self._search()
            except SimulationError as error:
                own = ", ".join(f"{path}: {self.sections[path]}" for path in self.sections)
                termination += f"; no equilibrium is near with its own sections ({own}): {error}"
                self.sections = sections
                self.return_to(before)
                simulator = self._in_sections_of_search()
                break
        else:
            termination += "; sections change with the pattern"
            simulator = self._in_sections_of_search()
        return termination + out_of_reach(self), simulator

    def _in_sections_of_search(self) -> Simulator:
        """Return a simulator of the scene with the sections of the search."""
        return Simulator(self.scene_with(self.values, self.sections))

    def _search(self) -> str:
        """Go to the best pattern, and return why the search ended there.

        Values of palettes are chosen from a linear problem, in which they may come out worse beside others that vary
        than alone. So they are sought alone as well, beside the others as they are and as the scene
        gives them, before these follow.
        """
        start, palette, every = self.kept(), self.pattern.in_palette, self._moving
        ended = self._searched()
        if palette.all() or not palette.any():
            return ended
        best, least = self.kept(), self._left(self.targets)
        given = np.where(palette, start[0], np.concatenate([v.start for v in self.varied]))
        for values in [start[0], given][: 1 if np.array_equal(given, start[0]) else 2]:
            self.return_to(start)
            self._moving = palette
            with contextlib.suppress(SimulationError):
                if values is given:
                    self.values = given
                    self.go(given)
                self._searched()
                self._improve_some(~palette, FEW_STEPS)
                if (left := self._left(self.targets)) < least:
                    best, least = self.kept(), left
        self._moving = every
        self.return_to(best)
        self._improve_some(~palette, MOST_STEPS)
        return ended

    def _searched(self) -> str:
        """Go to the best pattern by the values that may change, and return why the search ended there.

        If the direct way leads astray, another goes through shapes between without weight, which then comes back.
        """
        start, left = self.kept(), self._left(self.targets)
        heavy = any(self.scene.gravity) and not any(v.path.startswith("gravity") for v in self.varied)
        if self.in_plane:
            known = self._step(self.targets, 1.0)
            if not self._left(self.targets) < left:
                self.return_to(start)
            self._tell()
        else:
            known = not heavy
            self._approach()
        ended = self._found()
        if known or self.rms(self.targets) <= CLOSE:
            return ended
        best, least, other = self.kept(), self._left(self.targets), ""
        self.return_to(start)
        with contextlib.suppress(SimulationError):
            self._detour(heavy)
            other = self._found()
        if other and self._left(self.targets) < least:
            return other
        self.return_to(best)
        return ended

    def _detour(self, heavy: bool) -> None:
        """Go near the targets without weight, and let it come back."""
        if heavy:
            self.weight = 0.0
            self.go(self.values)
        self._approach()
        if heavy:
            self._in_parts(lambda part: self._step(self.targets, part))
            self.weight = 1.0
            self.go(self.values)

    def _approach(self) -> None:
        """Go near the targets through shapes between."""
        starts = [self.curve(here) for here in self.here]

        def near(part: float) -> list[TargetCurve]:
            return [between(start, of, part) for start, of in zip(starts, self.targets, strict=True)]

        if self.in_plane:
            self._in_parts(lambda part: self._step(near(part), self.weight))
        else:
            count = math.ceil(max(_turning(target) for target in self.targets) / TURN)
            for k in range(1, count + 1):
                self._improve(near(k / count), 2)

    def _in_parts(self, go: Callable[[float], bool]) -> None:
        """Go part of the way from 0 to 1, and on from there; half as far where that leads astray."""
        done, step = 0.0, 1.0
        while done < 1.0 and step >= SHORTEST:
            before = self.kept()
            if go(done + step):
                done += step
                step = min(2.0 * step, 1.0 - done)
                self._tell()
            else:
                self.return_to(before)
                step *= 0.5

    def _step(self, targets: Sequence[TargetCurve], weight: float) -> bool:
        """Make a step towards targets under a part of the weight, and return whether it led where equations say."""
        equations, pull = self.angles if self.in_plane else self.equations, np.zeros(1)
        if weight != self.weight:
            sizes = {f"gravity.{k}": size for k, size in enumerate(self.scene.gravity) if size}
            slopes = [self.derivatives(here, self.sought(here, list(sizes))) for here in self.here]
            pull = equations(targets, slopes)[0] @ list(sizes.values()) * (weight - self.weight)
            self.weight, self.known = weight, []
        rows, right = equations(targets, self.slopes())
        values = self.pattern.solved(rows, right + pull, self.values, self._moving, 0.0)
        wanted = right + pull + rows @ (values - self.values)
        if not math.isfinite(self._left_with(values, targets)):
            return False
        error = np.linalg.norm(equations(targets, self.slopes())[1] - wanted)
        return bool(error <= ASTRAY * np.linalg.norm(right + pull))

    def _found(self) -> str:
        """Go to the best pattern that is near, and return why the search ended there."""
        ended = self._improve(self.targets, MOST_STEPS)
        return self._take_palettes(MOST_PALETTES) if self.pattern.in_palette.any() else ended


def _turning(curve: TargetCurve) -> float:
    """Return by how much a curve turns in all [rad]."""
    ways = curve.tangents(np.linspace(0.0, curve.length, 200))
    return float(np.arccos(np.clip(np.einsum("ij,ij->i", ways[1:], ways[:-1]), -1.0, 1.0)).sum())
