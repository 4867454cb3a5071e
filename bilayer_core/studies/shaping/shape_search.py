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
from bilayer_core.model.plan import best_dimension, simplest_model
from bilayer_core.model.strip_choice import section_of
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.loader import load_content, load_scene, scene_content
from bilayer_core.scene.overrides import Overrides
from bilayer_core.simulation.at_rest import equilibrium_of, take_shape
from bilayer_core.simulation.gains import alike_but_gains
from bilayer_core.simulation.gradients.equilibrium_response import Equilibrium
from bilayer_core.simulation.gradients.parameters import Parameter
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.studies.shaping.design_result import DesignResult, Shape, rod_of, stimuli_text
from bilayer_core.studies.shaping.pattern import Pattern
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
ENDS = 1e-3
"""Weight of where the rod ends along a curve: what the shape leaves to choose, as layers that swell alike, sets it."""
TURN = 1.0
"""Of the tip, between two shapes on the way to a wanted one in space [rad]."""
STEEPEST = math.radians(10.0)
"""Between the clamp and the start of a wanted curve."""
LONGEST = 1.1
"""Length of a wanted curve, of the longest rod within the bounds; that of the shortest, of a wanted curve."""
ASIDE = 0.05
"""Of its length: by how much a curve may leave its plane where the rod stays in one."""
CLOSE = 1e-3
"""Root mean square of distances, of the length of the rod, from which on no other way is tried."""
ASTRAY, SHORTEST = 0.2, 1.0 / 64.0
"""Largest error of linear equations about a step, of what it was to mend, and the shortest step, of the whole way."""
FIXED = 1e-9
"""Motion of the rod along one direction, of that along another, that is none."""
AMONG = 0.381966
"""Part of the way between bounds at which no value is likely to be special."""
RISES = 10
"""Parts in which stimuli rise."""
AT_BOUND = 1e-6
"""Part of the way between bounds."""


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
    return _Search(config, varied, curves, levels, smoothness, progress, interrupted).result()


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


class _Stopped(Exception):  # noqa: N818 it is no error
    """The search is to end."""


class _Search:
    """Steps from equilibrium to equilibrium."""

    def __init__(
        self,
        scene: SceneConfig,
        varied: list[Varied],
        curves: list[TargetCurve],
        levels: list[dict[str, float]],
        smoothness: float,
        progress: Callable[[str], None] | None,
        interrupted: Callable[[], bool],
    ):
        self._scene, self._varied, self._levels = scene, varied, levels
        self._pattern, self._progress, self._interrupted = Pattern(varied, smoothness), progress, interrupted
        self._values = np.concatenate([v.start for v in varied])
        self._moving = np.ones(len(self._values), dtype=bool)
        self._names = [name for v in varied for name in v.names]
        owners = self._pattern.split(np.arange(len(self._values)))
        self._owner = np.concatenate([v.in_scene(own) for v, own in zip(varied, owners, strict=True)])
        self.equilibria, self._weight, self._failure = 0, 1.0, ""
        self._sections = _beams_of(scene)
        self._known: list[Array] = []
        self._here = self._built(self._values)
        self._nodes = self._strands()
        self._size = float(np.linalg.norm(np.diff(self._curve(self._here[0]), axis=0), axis=1).sum())
        self._parameters = [self._sought(here) for here in self._here]
        self._by_laws = self._are_laws()
        self._refuse_idle()
        self._targets = [self._placed(*of) for of in zip(curves, self._here, self._slopes(), strict=True)]

    def _built(self, values: Array, shapes: Sequence[Equilibrium] = ()) -> list[Equilibrium]:
        """Return the equilibria of the scene with such values, one for each target, near some shapes."""
        simulator, found = Simulator(self._scene_with(values, self._sections)), []
        for k, level in enumerate(self._levels):
            simulator.reset()
            for channel, value in level.items():
                simulator.set_stimulus(channel, value)
            if k < len(shapes) and shapes[k].fits(simulator.model):
                take_shape(simulator, shapes[k])
            simulator.solve_static()
            self.equilibria += 1
            found.append(equilibrium_of(simulator))
        return found

    def _scene_with(self, values: Array, sections: dict[str, str]) -> SceneConfig:
        changes = sections | ({} if self._weight == 1.0 else {"gravity": list(self._gravity)})
        for v, own in zip(self._varied, self._pattern.split(values), strict=True):
            changes |= v.changes(own)
        return load_content(scene_content(self._scene), changes)

    @property
    def _gravity(self) -> tuple[float, ...]:
        return tuple(self._weight * of for of in self._scene.gravity)

    @property
    def _in_plane(self) -> bool:
        return bool(self._here[0].model.plane.exists)

    def _are_laws(self) -> bool:
        """Return whether all values are gains, for which nothing is built."""
        return all(p.laws.size for of in self._parameters for p in of)

    def _sought(self, here: Equilibrium, names: Sequence[str] = ()) -> list[Parameter]:
        return [p for of in here.parameters(names or self._names).values() for p in of]

    def _strands(self) -> list[slice]:
        """Return the nodes of the strands of the rod; two of them have its curve between them."""
        rod, strands = rod_of(self._scene, self._varied), self._here[0].model.strands
        name, rod = rod.copies[0].name, rod.copies[0].rod
        if not rod.clamp_start:
            raise InputError(
                f"rods.{rod.name}: wanted curves begin where the rod does, which nothing holds: clamp_start"
            )
        self._holder = [body.name for body in self._scene.bodies].index(rod.clamp_start)
        found = [slice(s.first_node, s.first_node + s.shown) for s in strands if s.rod == name]
        return found if len({s.stop - s.start for s in found}) == 1 else found[:1]

    def _of_rod(self, of_nodes: Array) -> Array:
        """Return what the curve of the rod has, of what nodes have."""
        return np.mean([of_nodes[nodes] for nodes in self._nodes], axis=0)

    def _turned(self, here: Equilibrium) -> Array:
        """Return the rotation since the start of the body that holds the rod, shape (3, 3)."""
        return here.rotations[self._holder] @ here.model.bodies.start_rotation[self._holder].T

    def _curve(self, here: Equilibrium) -> Array:
        """Return the curve of the rod from its start, as the body sees it that holds it there [m], shape (n, 3)."""
        return self._from_start(here) @ self._turned(here)

    def _from_start(self, here: Equilibrium | Simulator) -> Array:
        points = self._of_rod(here.positions)
        return points - points[0]

    def _derivatives(self, here: Equilibrium, parameters: list[Parameter]) -> Array:
        """Return its derivatives, shape (n, 3, n_parameter)."""
        of_nodes, of_bodies = here.velocities(parameters)
        velocities = self._of_rod(of_nodes)
        turning = np.cross(of_bodies[self._holder][None], self._from_start(here)[..., None], axis=1)
        return np.einsum("iak,ab->ibk", velocities - velocities[0] - turning, self._turned(here))

    def _slopes(self) -> list[Array]:
        """Return its derivatives by the values at each level, computed once for each equilibrium."""
        if not self._known:
            acts = np.eye(len(self._values))[self._owner]  # what a value changes in the scene
            self._known = [self._derivatives(*of) @ acts for of in zip(self._here, self._parameters, strict=True)]
        return self._known

    def _placed(self, curve: TargetCurve, here: Equilibrium, slopes: Array) -> TargetCurve:
        """Return a target, moved to begin at the origin."""
        made, first = self._curve(here), [nodes.start for nodes in self._nodes]
        start = here.model.start_position
        edge = np.mean([start[k + 1] - start[k] for k in first], axis=0)
        way = edge / np.linalg.norm(edge)
        angle = math.acos(np.clip(curve.tangents(np.zeros(1))[0] @ way, -1.0, 1.0))
        if angle > STEEPEST:
            raise InputError(
                f"{curve.source}: begins {math.degrees(angle):.3g}° from the direction in which the rod begins, which "
                f"is {', '.join(f'{x:.3g}' for x in way)}; allowed are {math.degrees(STEEPEST):g}°: turn the curve "
                "or reverse it"
            )
        edges = np.diff(made, axis=0)
        lengths = np.linalg.norm(edges, axis=1)
        growth = np.einsum(
            "ia,iak->k", edges / lengths[:, None], np.diff(slopes, axis=0)
        )  # of the length by each value
        ends = np.array([self._pattern.low, self._pattern.high]) - self._values
        least, most = lengths.sum() + (np.sort(growth * ends, axis=0) @ np.ones(len(growth)))
        if not least / LONGEST <= curve.length <= LONGEST * most:
            raise InputError(
                f"{curve.source}: is {1e3 * curve.length:.4g} mm long; within these bounds the rod becomes "
                f"{1e3 * least:.4g} to {1e3 * most:.4g} mm long, and allowed are {LONGEST:g} times more "
                "and less; x, y and z are in m"
            )
        if self._in_plane:
            aside = np.ptp(curve.points @ np.cross(*here.model.rods.axes))
            if aside > ASIDE * curve.length:
                raise InputError(
                    f"{curve.source}: leaves its plane by {1e3 * aside:.4g} mm, in which the rod stays; allowed are "
                    f"{100.0 * ASIDE:g} % of its length: let the rod twist, as fibres at an angle do"
                )
        return TargetCurve(curve.points - curve.at(np.zeros(1))[0], curve.source)

    def _go(self, values: Array) -> None:
        """Go to the equilibria with other values."""
        if self._interrupted():
            raise _Stopped
        self._known = []
        if not self._by_laws or self._here[0].model.scene.gravity != self._gravity:
            self._here = self._built(values, self._here)
            self._parameters = [self._sought(here) for here in self._here]
        else:
            for here, parameters in zip(self._here, self._parameters, strict=True):
                here.go_to(parameters, values[self._owner].tolist())
                self.equilibria += 1

    def _departures(self, targets: Sequence[TargetCurve]) -> list[tuple[Array, Array]]:
        """Return ways from targets to the rod [m], and tangents there; those of shapes on the way from point to point,
        since sliding along them the rod would go astray.
        """
        found = []
        for here, target in zip(self._here, targets, strict=True):
            made = self._curve(here)
            lengths = np.linalg.norm(np.diff(made, axis=0), axis=1)
            along = np.concatenate([[0.0], np.cumsum(lengths)])
            if targets is self._targets:
                found.append(target.departures(made, along))
            else:
                away = made - target.at(along * (target.length / along[-1]))
                found.append((away, np.zeros_like(away)))
        return found

    def _rms(self, targets: Sequence[TargetCurve]) -> float:
        ways = [away for away, _ in self._departures(targets)]
        return math.sqrt(np.mean([np.mean((away**2).sum(axis=1)) for away in ways])) / self._size

    def _beyond(self, targets: Sequence[TargetCurve]) -> Array:
        """Return how far beyond the ends of targets the rod ends, along their last tangents [m]."""
        tips = [self._curve(here)[-1] for here in self._here]
        ends = [(target.at(end := np.array([target.length]))[0], target.tangents(end)[0]) for target in targets]
        return np.array([tangent @ (tip - end) for tip, (end, tangent) in zip(tips, ends, strict=True)])

    def _equations(self, targets: Sequence[TargetCurve], slopes: list[Array]) -> tuple[Array, Array]:
        """Return the Jacobian and the values of distances, over the length of the rod, and last those of its ends."""
        rows, right = [], []
        for (away, tangents), slope in zip(self._departures(targets), slopes, strict=True):
            across = slope - np.einsum("ia,ib,ibk->iak", tangents, tangents, slope)
            rows.append(across.reshape(away.size, -1) / math.sqrt(len(away)))
            right.append(away.ravel() / math.sqrt(len(away)))
        last = [target.tangents(np.array([target.length]))[0] for target in targets]
        rows.append(ENDS * np.array([tangent @ slope[-1] for tangent, slope in zip(last, slopes, strict=True)]))
        right.append(ENDS * self._beyond(targets))
        over = self._size * math.sqrt(len(targets))
        return np.concatenate(rows) / over, np.concatenate(right) / over

    def _angles(self, targets: Sequence[TargetCurve], slopes: list[Array]) -> tuple[Array, Array]:
        """Return the Jacobian and the values of angles of edges in the plane, over those of the targets [rad]."""
        rows, right = [], []
        for here, target, slope in zip(self._here, targets, slopes, strict=True):
            made = self._curve(here)
            one, other = here.model.rods.axes
            edges, changes = np.diff(made, axis=0), np.diff(slope, axis=0)
            lengths = np.linalg.norm(edges, axis=1)
            along = np.concatenate([[0.0], np.cumsum(lengths)]) * target.length / lengths.sum()
            ways = target.tangents(0.5 * (along[1:] + along[:-1]))
            own, wanted = (np.unwrap(np.arctan2(of @ other, of @ one)) for of in (edges, ways))
            turned = own - wanted
            right.append(turned - 2.0 * math.pi * round(turned[0] / (2.0 * math.pi)))
            normal = np.outer(edges @ one, other) - np.outer(edges @ other, one)
            rows.append(np.einsum("ia,iak->ik", normal, changes) / (lengths**2)[:, None])
        count = math.sqrt(len(right[0]))
        return np.concatenate(rows) / count, np.concatenate(right) / count

    def _left(self, targets: Sequence[TargetCurve]) -> float:
        """Return the root of the sum that steps make smaller."""
        ends = ENDS * math.sqrt(np.mean(self._beyond(targets) ** 2)) / self._size
        return math.hypot(self._rms(targets), ends, math.sqrt(self._pattern.roughness(self._values)))

    def _improve(self, targets: Sequence[TargetCurve], steps: int) -> str:
        """Make steps towards targets, and return why they ended."""
        damping, slow = 0.0, 0
        for _ in range(steps):
            if self._rms(targets) <= ENOUGH:
                return "the shape is as wanted"
            before, now, equations = self._kept(), self._left(targets), self._equations(targets, self._slopes())
            for _ in range(MOST_TRIALS):
                new = self._left_with(self._pattern.solved(*equations, self._values, self._moving, damping), targets)
                if new < now:
                    break
                self._return_to(before)
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
        self._values, self._failure = values, ""
        try:
            self._go(values)
        except SimulationError as error:
            self._failure = f": {error}"
            return math.inf
        return self._left(targets)

    def _kept(self) -> tuple[Any, ...]:
        """Return values and their equilibria for `_return_to`."""
        return self._values, self._weight, self._here, self._parameters, self._known, [of.kept() for of in self._here]

    def _return_to(self, kept: tuple[Any, ...]) -> None:
        self._values, self._weight, self._here, self._parameters, self._known, shapes = kept
        for here, shape in zip(self._here, shapes, strict=True):
            here.return_to(shape)

    def _take_palettes(self, most: int) -> str:
        """Take values of palettes, from the linear problem about each pattern that was tried; others follow."""
        free, best, least, tried = 100.0 * self._rms(self._targets), self._kept(), math.inf, set()
        moving, palette = self._moving, self._pattern.in_palette
        for _ in range(most):
            equations = self._equations(self._targets, self._slopes())
            values = self._pattern.printable(*equations, self._values, moving)
            if values[palette].tobytes() in tried:
                break
            tried.add(values[palette].tobytes())
            if not math.isfinite(self._left_with(values, self._targets)):
                break
            self._improve_some(moving & ~palette, FEW_STEPS)
            self._tell()
            left = self._left(self._targets)
            best, least = (self._kept(), left) if left < least else (best, least)
        self._return_to(best)
        if not math.isfinite(least):
            return f"no pattern of the palette has an equilibrium near{self._failure}"
        return f"values of the palette; without it: rms distance {free:.3g} %"

    def _improve_some(self, moving: Array, steps: int) -> None:
        """Make steps towards targets in which some values alone change."""
        if moving.any():
            before, self._moving = self._moving, moving
            self._improve(self._targets, steps)
            self._moving = before

    def _tell(self) -> None:
        """Tell how near the rod is, and note the best pattern so far: of palettes, if there are any."""
        is_free = self._weight < 1.0 or not self._pattern.is_printable(self._values)
        rank = is_free, self._left(self._targets)
        if rank < self._best_rank:
            self._best_rank, self._best = rank, (self._kept(), self._sections)
        if self._progress is not None:
            rms = self._rms(self._targets)
            self._progress(f"{self.equilibria} equilibria: rms distance {100 * rms:.3g} % of the rod")

    def result(self) -> DesignResult:
        """Search, and return what was found.

        Which sections rods have may follow from the pattern. Beams come first: they have one shape at rest, from which
        wide strips find their own that is near. Where strips have none, the scene keeps the sections of the search.
        """
        self._best_rank, self._best = (True, math.inf), (self._kept(), self._sections)
        try:
            return self._report(*self._searched_with_own_sections())
        except _Stopped:
            kept, self._sections = self._best
            self._return_to(kept)
            self._interrupted = bool
            if not self._pattern.is_printable(self._values):
                self._take_palettes(1)
            return self._report("stopped; this is the best pattern so far", self._in_sections_of_search())

    def _searched_with_own_sections(self) -> tuple[str, Simulator]:
        """Search, and return why that ended, and a simulator of the scene that was found."""
        termination = self._search()
        for _ in range(MOST_MODELS):
            simulator = Simulator(self._scene_with(self._values, {}))
            if alike_but_gains(self._here[0].model, simulator.model):
                break
            before, sections = self._kept(), self._sections
            self._sections, self._known = _sections_of(simulator.scene, simulator.plan.model), []
            try:
                self._here = self._built(self._values, self._here)
                self._parameters = [self._sought(here) for here in self._here]
                self._by_laws = self._are_laws()
                termination = self._search()
            except SimulationError as error:
                own = ", ".join(f"{path}: {self._sections[path]}" for path in self._sections)
                termination += f"; no equilibrium is near with its own sections ({own}): {error}"
                self._sections = sections
                self._return_to(before)
                simulator = self._in_sections_of_search()
                break
        else:
            termination += "; sections change with the pattern"
            simulator = self._in_sections_of_search()
        return termination + self._out_of_reach(), simulator

    def _in_sections_of_search(self) -> Simulator:
        """Return a simulator of the scene with the sections of the search."""
        return Simulator(self._scene_with(self._values, self._sections))

    def _search(self) -> str:
        """Go to the best pattern, and return why the search ended there.

        Values of palettes are chosen from a linear problem, in which they may come out worse beside others that vary
        than alone. So they are sought alone as well, before the others follow.
        """
        start, palette, every = self._kept(), self._pattern.in_palette, self._moving
        ended = self._searched()
        if palette.all() or not palette.any():
            return ended
        best, least = self._kept(), self._left(self._targets)
        self._return_to(start)
        with contextlib.suppress(SimulationError):
            self._moving = palette
            self._searched()
            self._improve_some(~palette, FEW_STEPS)
        self._moving = every
        if not self._left(self._targets) < least:
            self._return_to(best)
        self._improve_some(~palette, MOST_STEPS)
        return ended

    def _searched(self) -> str:
        """Go to the best pattern by the values that may change, and return why the search ended there.

        If the direct way leads astray, another goes through shapes between without weight, which then comes back.
        """
        start, left = self._kept(), self._left(self._targets)
        heavy = any(self._scene.gravity) and not any(v.path.startswith("gravity") for v in self._varied)
        if self._in_plane:
            known = self._step(self._targets, 1.0)
            if not self._left(self._targets) < left:
                self._return_to(start)
            self._tell()
        else:
            known = not heavy
            self._approach()
        ended = self._found()
        if known or self._rms(self._targets) <= CLOSE:
            return ended
        best, least, other = self._kept(), self._left(self._targets), ""
        self._return_to(start)
        with contextlib.suppress(SimulationError):
            self._detour(heavy)
            other = self._found()
        if other and self._left(self._targets) < least:
            return other
        self._return_to(best)
        return ended

    def _detour(self, heavy: bool) -> None:
        """Go near the targets without weight, and let it come back."""
        if heavy:
            self._weight = 0.0
            self._go(self._values)
        self._approach()
        if heavy:
            self._in_parts(lambda part: self._step(self._targets, part))
            self._weight = 1.0
            self._go(self._values)

    def _approach(self) -> None:
        """Go near the targets through shapes between."""
        starts = [self._curve(here) for here in self._here]

        def near(part: float) -> list[TargetCurve]:
            return [between(start, of, part) for start, of in zip(starts, self._targets, strict=True)]

        if self._in_plane:
            self._in_parts(lambda part: self._step(near(part), self._weight))
        else:
            count = math.ceil(max(_turning(target) for target in self._targets) / TURN)
            for k in range(1, count + 1):
                self._improve(near(k / count), 2)

    def _in_parts(self, go: Callable[[float], bool]) -> None:
        """Go part of the way from 0 to 1, and on from there; half as far where that leads astray."""
        done, step = 0.0, 1.0
        while done < 1.0 and step >= SHORTEST:
            before = self._kept()
            if go(done + step):
                done += step
                step = min(2.0 * step, 1.0 - done)
                self._tell()
            else:
                self._return_to(before)
                step *= 0.5

    def _step(self, targets: Sequence[TargetCurve], weight: float) -> bool:
        """Make a step towards targets under a part of the weight, and return whether it led where equations say."""
        equations, pull = self._angles if self._in_plane else self._equations, np.zeros(1)
        if weight != self._weight:
            sizes = {f"gravity.{k}": size for k, size in enumerate(self._scene.gravity) if size}
            slopes = [self._derivatives(here, self._sought(here, list(sizes))) for here in self._here]
            pull = equations(targets, slopes)[0] @ list(sizes.values()) * (weight - self._weight)
            self._weight, self._known = weight, []
        rows, right = equations(targets, self._slopes())
        values = self._pattern.solved(rows, right + pull, self._values, self._moving, 0.0)
        wanted = right + pull + rows @ (values - self._values)
        if not math.isfinite(self._left_with(values, targets)):
            return False
        error = np.linalg.norm(equations(targets, self._slopes())[1] - wanted)
        return bool(error <= ASTRAY * np.linalg.norm(right + pull))

    def _found(self) -> str:
        """Go to the best pattern that is near, and return why the search ended there."""
        ended = self._improve(self._targets, MOST_STEPS)
        return self._take_palettes(MOST_PALETTES) if self._pattern.in_palette.any() else ended

    def _refuse_idle(self) -> None:
        moved = np.max([np.abs(slopes).max(axis=(0, 1)) for slopes in self._slopes()], axis=0)
        acts = self._pattern.split(moved * (self._pattern.high - self._pattern.low) >= 1e-12 * self._size)
        if idle := [v.path for v, own in zip(self._varied, acts, strict=True) if not own.any()]:
            of = rod_of(self._scene, self._varied).name
            raise InputError(f"vary {', '.join(idle)}: acts on nothing of rods.{of} at these stimuli; leave it out")

    def _out_of_reach(self) -> str:
        """Return along which direction nothing moves the rod though it is away from a target, as a text."""
        for (away, _), slopes, level in zip(self._departures(self._targets), self._slopes(), self._levels, strict=True):
            moved = slopes.swapaxes(1, 2).reshape(-1, 3)
            _, sizes, ways = np.linalg.svd(moved, full_matrices=False)
            alone = away @ ways[2] if sizes[0] > 0.0 else np.linalg.norm(away, axis=1)
            missed = float(np.abs(alone).max())
            if sizes[2] <= FIXED * sizes[0] and missed > CLOSE * self._size:
                way = f"along ({', '.join(f'{abs(x):.3g}' for x in ways[2].round(3))})"
                where = way if sizes[0] > 0.0 else f"at {stimuli_text(level)}"
                return f"; unreachable: {1e3 * missed:.3g} mm {where}, where nothing that varies moves the rod"
        return ""

    def _report(self, termination: str, simulator: Simulator) -> DesignResult:
        scene, shapes = simulator.scene, []
        for target, level, here, (away, _) in zip(
            self._targets, self._levels, self._here, self._departures(self._targets), strict=True
        ):
            made = self._of_rod(here.positions)
            target = TargetCurve(target.points @ self._turned(here).T + made[0], target.source)
            length = float(np.linalg.norm(np.diff(made, axis=0), axis=1).sum())
            stable, reached = self._is_stable(simulator, here), self._is_reached(simulator, here, level)
            shapes.append(Shape(target, level, made, np.linalg.norm(away, axis=1), length, stable, reached))
        part = self._pattern.parts(self._values)[[not v.palette for v in self._varied for _ in v.start]]
        at_bounds = int(np.sum((part <= AT_BOUND) | (part >= 1.0 - AT_BOUND)))
        values = self._pattern.split(self._values)
        return DesignResult(
            scene, self._varied, values, shapes, at_bounds, self._sensitivity(), self.equilibria, termination
        )

    def _is_stable(self, simulator: Simulator, here: Equilibrium) -> bool:
        """Return whether a simulator of the scene stays at an equilibrium, and all small disturbances decay."""
        take_shape(simulator, here)
        with contextlib.suppress(SimulationError):
            return simulator.solve_static().stable and self._is_at(simulator, here)
        return False

    def _is_reached(self, simulator: Simulator, here: Equilibrium, level: dict[str, float]) -> bool:
        """Return whether the rod comes to an equilibrium from the start of the scene, at once or as stimuli rise."""
        for count in (1, RISES):
            simulator.reset()
            begin = simulator.stimulus
            with contextlib.suppress(SimulationError):
                for k in range(1, count + 1):
                    for channel, value in level.items():
                        simulator.set_stimulus(channel, begin[channel] + k / count * (value - begin[channel]))
                    simulator.solve_static()
                if self._is_at(simulator, here):
                    return True
        return False

    def _is_at(self, simulator: Simulator, here: Equilibrium) -> bool:
        return bool(np.abs(self._from_start(simulator) - self._from_start(here)).max() <= CLOSE * self._size)

    def _sensitivity(self) -> dict[str, float]:
        """Return the largest displacements by errors of 1 % in each pattern, and in the thickness of each layer [m]."""
        found: dict[str, float] = {}

        def note(path: str, moved: list[Array]) -> None:
            found[path] = 0.01 * max(float(np.linalg.norm(of, axis=1).max()) for of in moved)

        begin = 0
        for v, own in zip(self._varied, self._pattern.split(self._values), strict=True):
            note(v.path, [slopes[..., begin : begin + len(own)] @ own for slopes in self._slopes()])
            begin += len(own)
        rod = rod_of(self._scene, self._varied)
        for layer in rod.layers:
            path = f"rods.{rod.name}.layers.{layer.name}.thickness"
            if isinstance(layer.thickness, float) and rod.radius is None and path not in found:
                slopes = [self._derivatives(here, self._sought(here, [path]))[..., 0] for here in self._here]
                note(path, [slope * layer.thickness for slope in slopes])
        return found


def _sections_of(scene: SceneConfig, model: str) -> dict[str, str]:
    """Return the sections of rods that may be beams or strips, as changes of a scene that give it these alone."""
    found = {
        f"rods.{rod.name}.section": section_of(scene, rod, model)
        for rod in scene.rods
        if rod.section != "beam" and not rod.feels_across and rod.radius is None
    }
    return found | {"solver.model": model} if found else {}


def _beams_of(scene: SceneConfig) -> dict[str, str]:
    """Return changes of a scene that make beams of its strips, where that does not change the model."""
    model = simplest_model(scene)[0] if scene.solver.model == "auto" else scene.solver.model
    found = _sections_of(scene, model) if model == "laminate" else {}
    return {path: "beam" if path.endswith(".section") else value for path, value in found.items()}


def _turning(curve: TargetCurve) -> float:
    """Return by how much a curve turns in all [rad]."""
    ways = curve.tangents(np.linspace(0.0, curve.length, 200))
    return float(np.arccos(np.clip(np.einsum("ij,ij->i", ways[1:], ways[:-1]), -1.0, 1.0)).sum())
