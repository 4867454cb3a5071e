"""The search for the pattern with which a rod takes wanted shapes.

At an equilibrium with the values p, dx/dp of the stations x tells where others would be. Each step minimises, within
the bounds of p,

    Σ |d_i + ∂d_i/∂p δp|²/L² + w² Σ (second differences of the pattern, in parts of its bounds)²

with d_i the way of station i from the nearest point of the wanted curve (Gauss and Newton). Sliding along the curve
costs nothing, as a drawn curve does not say how the strip is stretched. A step that makes the distances larger is made
again with a weight of staying. Far away this is no good: in a plane, the first step takes angles of edges in place of
distances, in which free strips are linear; in space, wanted shapes are approached through shapes that bend less.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import lstsq
from scipy.optimize import lsq_linear

from bilayer_core.errors import InputError, SimulationError
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.loader import load_content, load_scene, scene_content
from bilayer_core.scene.overrides import Overrides
from bilayer_core.simulation.at_rest import equilibrium_of, take_shape
from bilayer_core.simulation.gains import alike_but_gains
from bilayer_core.simulation.gradients.equilibrium_response import Equilibrium
from bilayer_core.simulation.gradients.parameters import Parameter
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.studies.shaping.target_curve import TargetCurve, between, read_curve
from bilayer_core.studies.shaping.varied import Varied, Vary, read_varied

Array = np.ndarray
Target = str | Path | Array
MOST_STEPS, MOST_TRIALS, MOST_MODELS = 60, 8, 3
ENOUGH = 1e-6
"""Root mean square of distances, of the length of the rod, at which to end."""
STALLED = 0.02
"""Part of that by which one of two steps must make it smaller, else the search ends."""
WEAKEST, STRONGER = 1e-4, 4.0
"""First weight of staying, in parts of the bounds, once a step leads away, and its factor (Levenberg, Marquardt)."""
SMOOTH, POINTS = 1e-3, 100
"""w of a pattern of so many points, as the square of their number for others: what is left to choose is smooth."""
TURN = 1.0
"""Of the tip, between two shapes on the way to a wanted one in space [rad]."""
STEEPEST = math.radians(10.0)
"""Between the clamp and the start of a wanted curve."""
LONGEST = 1.1
"""Length of a wanted curve, of what the rod can become."""
AT_BOUND = 1e-6
"""Part of the way between bounds."""


@dataclass(frozen=True)
class Shape:
    """A wanted shape and what became of it.

    Attributes
    ----------
    target : TargetCurve
        Moved to where the rod begins.
    stimulus : dict of str to float
        At which it is wanted.
    made : ndarray
        The rod's curve [m], shape (n, 3).
    distances : ndarray
        From the target [m], shape (n,).
    length : float
        Of the rod there [m].
    stable : bool
    """

    target: TargetCurve
    stimulus: dict[str, float]
    made: Array
    distances: Array
    length: float
    stable: bool


@dataclass(frozen=True)
class DesignResult:
    """Pattern that a search found, and how near it comes.

    Attributes
    ----------
    scene : SceneConfig
        With the pattern.
    varied : list of Varied
    values : list of ndarray
        Of each of them.
    shapes : list of Shape
    at_bounds : int
        How many values are at their bounds.
    sensitivity : dict of str to float
        By layer, the largest displacement by an error of 1 % in its pattern or thickness [m].
    equilibria : int
        That were computed.
    termination : str
    """

    scene: SceneConfig
    varied: list[Varied]
    values: list[Array]
    shapes: list[Shape]
    at_bounds: int
    sensitivity: dict[str, float]
    equilibria: int
    termination: str

    @property
    def size(self) -> float:
        """Length of the rod at the start [m]."""
        return self._rod.path.length

    @property
    def _rod(self) -> Any:
        return next(rod for rod in self.scene.rods if rod.name == rod_of(self.scene, self.varied))

    @property
    def largest(self) -> float:
        """Largest distance, of the length of the rod."""
        return max(float(shape.distances.max()) for shape in self.shapes) / self.size

    @property
    def rms(self) -> float:
        """Root mean square of the distances, of the length of the rod."""
        return math.sqrt(np.mean([np.mean(shape.distances**2) for shape in self.shapes])) / self.size

    def __str__(self) -> str:
        lines = [
            f"{self.scene.name}: {sum(map(len, self.values))} values, {self.equilibria} equilibria; {self.termination}",
            f"  distance from the target: at most {100 * self.largest:.3g} %, rms {100 * self.rms:.3g} % of the rod",
        ]
        for shape in self.shapes:
            at = ", ".join(f"{name} = {value:g}" for name, value in shape.stimulus.items()) or "no stimulus"
            lines.append(
                f"  at {at}: {shape.target.source} is {1e3 * shape.target.length:.4g} mm long, the rod "
                f"{1e3 * shape.length:.4g} mm; {'stable' if shape.stable else 'UNSTABLE'}"
            )
        if self.at_bounds:
            lines.append(f"  {self.at_bounds} values are at their bounds, which limit the shape")
        for layer, moved in self.sensitivity.items():
            lines.append(f"  an error of 1 % in {layer} moves the rod by up to {100 * moved / self.size:.3g} %")
        return "\n".join(lines)


def design(
    scene: SceneConfig | str | Path | Mapping[str, Any],
    target: Target | Sequence[Target],
    vary: Vary,
    *,
    at: Sequence[Mapping[str, float]] | Mapping[str, float] | None = None,
    overrides: Overrides = (),
    smoothness: float = SMOOTH,
    progress: Callable[[str], None] | None = None,
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
    at : mapping or list of mappings, optional
        Values of stimuli, for each target; by default the channels' largest.
    overrides : sequence of str or mapping
        As `load_scene` takes them.
    smoothness : float
        Weight of the roughness of patterns.
    progress : callable, optional
        Called with a line of text for each step.

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
    config, varied = read_varied(config, vary)
    return _Search(config, varied, curves, levels, smoothness, progress).result()


def rod_of(scene: SceneConfig, varied: Sequence[Varied]) -> str:
    """Return the name of the rod that is shaped: the only one, or that of the first path.

    Raises
    ------
    InputError
        If it is not told which.
    """
    names = [name for rod in scene.rods for name in rod.copy_names]
    if len(names) == 1:
        return names[0]
    keys = varied[0].path.split(".")
    if keys[0] == "rods" and keys[1] in names:
        return keys[1]
    raise InputError(f"vary {varied[0].path}: names no single rod, of which there are {', '.join(names)}")


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
    ):
        self._scene, self._varied, self._levels = scene, varied, levels
        self._smoothness, self._progress = smoothness, progress
        self._low = np.concatenate([np.full(len(v.start), v.low) for v in varied])
        self._high = np.concatenate([np.full(len(v.start), v.high) for v in varied])
        self._values = np.concatenate([v.start for v in varied])
        self._names = [name for v in varied for name in v.names]
        self.equilibria = 0
        self._known: list[Array] = []
        self._here = self._built(self._values)
        self._nodes = self._strands()
        self._size = float(np.linalg.norm(np.diff(self._curve(self._here[0]), axis=0), axis=1).sum())
        self._targets = [self._placed(curve, here) for curve, here in zip(curves, self._here, strict=True)]
        self._parameters = [self._sought(here) for here in self._here]
        self._by_laws = self._are_laws()

    def _built(self, values: Array, shapes: Sequence[Equilibrium] = ()) -> list[Equilibrium]:
        """Return the equilibria of the scene with such values, one for each target, near some shapes."""
        scene = load_content(scene_content(self._scene), self._changes(values))
        simulator, found = Simulator(scene), []
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

    def _changes(self, values: Array) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for v, own in zip(self._varied, self._split(values), strict=True):
            found |= v.changes(own)
        return found

    def _split(self, values: Array) -> list[Array]:
        return np.split(values, np.cumsum([len(v.start) for v in self._varied])[:-1])

    def _are_laws(self) -> bool:
        """Return whether all values are gains, for which nothing is built."""
        return all(p.laws.size for of in self._parameters for p in of)

    def _sought(self, here: Equilibrium) -> list[Parameter]:
        return [p for of in here.parameters(self._names).values() for p in of]

    def _strands(self) -> list[slice]:
        """Return the nodes of the strands of the rod; two of them have its curve between them."""
        name, strands = rod_of(self._scene, self._varied), self._here[0].model.strands
        found = [slice(s.first_node, s.first_node + s.shown) for s in strands if s.rod == name]
        return found if len({s.stop - s.start for s in found}) == 1 else found[:1]

    def _curve(self, here: Equilibrium) -> Array:
        """Return the curve of the rod [m], shape (n, 3)."""
        return np.mean([here.positions[nodes] for nodes in self._nodes], axis=0)

    def _derivatives(self, here: Equilibrium, parameters: list[Parameter]) -> Array:
        """Return its derivatives, shape (n, 3, n_parameter)."""
        velocities = here.velocities(parameters)
        return np.mean([velocities[nodes] for nodes in self._nodes], axis=0)

    def _slopes(self) -> list[Array]:
        """Return its derivatives by the values at each level, computed once for each equilibrium."""
        if not self._known:
            self._known = [self._derivatives(*of) for of in zip(self._here, self._parameters, strict=True)]
        return self._known

    def _placed(self, curve: TargetCurve, here: Equilibrium) -> TargetCurve:
        """Return a target, moved to where the rod begins."""
        made, first = self._curve(here), [nodes.start for nodes in self._nodes]
        start = here.model.start_position
        edge = np.mean([start[k + 1] - start[k] for k in first], axis=0)
        way = edge / np.linalg.norm(edge)
        angle = math.acos(np.clip(curve.tangents(np.zeros(1))[0] @ way, -1.0, 1.0))
        if angle > STEEPEST:
            raise InputError(
                f"{curve.source}: begins {math.degrees(angle):.3g}° from the direction in which the rod begins, which "
                f"is {', '.join(f'{x:.3g}' for x in way)}; allowed are {math.degrees(STEEPEST):g}°: turn the curve"
            )
        if curve.length > LONGEST * self._size:
            raise InputError(
                f"{curve.source}: is {1e3 * curve.length:.4g} mm long, the rod {1e3 * self._size:.4g} mm; allowed are "
                f"{LONGEST:g} times its length: it cannot stretch so far"
            )
        return TargetCurve(curve.points + (made[0] - curve.at(np.zeros(1))[0]), curve.source)

    def _go(self, values: Array) -> None:
        """Go to the equilibria with other values."""
        self._known = []
        if not self._by_laws:
            self._here = self._built(values, self._here)
            self._parameters = [self._sought(here) for here in self._here]
        else:
            for here, parameters in zip(self._here, self._parameters, strict=True):
                gains = here.gains
                for parameter, value in zip(parameters, values.tolist(), strict=True):
                    gains[parameter.laws] = value
                here.go_to(gains)
                self.equilibria += 1

    def _departures(self, targets: Sequence[TargetCurve]) -> list[tuple[Array, Array]]:
        """Return ways from targets to the rod [m], and tangents there."""
        found = []
        for here, target in zip(self._here, targets, strict=True):
            made = self._curve(here)
            lengths = np.linalg.norm(np.diff(made, axis=0), axis=1)
            found.append(target.departures(made, np.concatenate([[0.0], np.cumsum(lengths)])))
        return found

    def _rms(self, targets: Sequence[TargetCurve]) -> float:
        ways = [away for away, _ in self._departures(targets)]
        return math.sqrt(np.mean([np.mean((away**2).sum(axis=1)) for away in ways])) / self._size

    def _equations(self, targets: Sequence[TargetCurve]) -> tuple[Array, Array]:
        """Return the Jacobian and the values of distances, over the length of the rod."""
        rows, right = [], []
        for (away, tangents), slopes in zip(self._departures(targets), self._slopes(), strict=True):
            across = slopes - np.einsum("ia,ib,ibk->iak", tangents, tangents, slopes)
            rows.append(across.reshape(-1, len(self._values)) / self._size)
            right.append(away.ravel() / self._size)
        return np.concatenate(rows) / math.sqrt(len(away)), np.concatenate(right) / math.sqrt(len(away))

    def _angles(self) -> tuple[Array, Array]:
        """Return the Jacobian and the values of angles of edges in the plane, over those of the targets [rad]."""
        rows, right = [], []
        for here, target, slopes in zip(self._here, self._targets, self._slopes(), strict=True):
            made = self._curve(here)
            one, other = here.model.rods.axes
            edges, changes = np.diff(made, axis=0), np.diff(slopes, axis=0)
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

    def _step(self, rows: Array, right: Array, damping: float = 0.0) -> Array:
        """Return the values that minimise the squares of linear equations, within their bounds."""
        extent = self._high - self._low
        rough = [np.zeros((0, len(self._values)))]
        begin = 0
        for v in self._varied:
            count = len(v.start)
            part = np.zeros((max(count - 2, 0), len(self._values)))
            part[:, begin : begin + count] = np.diff(np.eye(count), 2, axis=0)
            begin += count
            rough.append(self._smoothness * (count / POINTS) ** 2 * part)
        roughness = np.concatenate(rough)
        now = (self._values - self._low) / extent
        held = damping * np.eye(len(now) if damping else 0, len(now))
        matrix = np.concatenate([rows * extent, roughness, held])
        wanted = np.concatenate([rows @ (extent * now) - right, np.zeros(len(roughness)), held @ now])
        q, r = np.linalg.qr(matrix)
        found = lstsq(r, q.T @ wanted)[0]
        if not ((found >= 0.0) & (found <= 1.0)).all():
            found = lsq_linear(r, q.T @ wanted, bounds=(0.0, 1.0), tol=1e-12).x
        return self._low + extent * np.clip(found, 0.0, 1.0)

    def _improve(self, targets: Sequence[TargetCurve], steps: int) -> str:
        """Make steps towards targets, and return why they ended."""
        now, damping, slow = self._rms(targets), 0.0, 0
        for _ in range(steps):
            if now <= ENOUGH:
                return "the shape is as wanted"
            before, equations = self._values, self._equations(targets)
            for _ in range(MOST_TRIALS):
                try:
                    values = self._step(*equations, damping)
                    self._go(values)
                    new = self._rms(targets)
                except SimulationError:
                    new = math.inf
                if new < now:
                    break
                damping = max(STRONGER * damping, WEAKEST)
            else:
                self._go(before)
                return "no step leads nearer"
            self._values, damping = values, damping / STRONGER if damping > WEAKEST else 0.0
            self._tell(new)
            slow = slow + 1 if new > (1.0 - STALLED) * now else 0
            if slow == 2:
                return "steps lead hardly nearer"
            now = new
        return f"{steps} steps were made"

    def _tell(self, rms: float) -> None:
        if self._progress is not None:
            self._progress(f"{self.equilibria} equilibria: rms distance {100 * rms:.3g} % of the rod")

    def result(self) -> DesignResult:
        """Search, and return what was found."""
        self._refuse_idle()
        if self._here[0].model.plane.exists:
            before, rms = self._values, self._rms(self._targets)
            values = self._step(*self._angles())
            try:
                self._go(values)
                self._values = values
            except SimulationError:
                self._go(before)
            if self._rms(self._targets) > rms:
                self._go(before)
                self._values = before
            self._tell(self._rms(self._targets))
        else:
            starts = [self._curve(here) for here in self._here]
            turns = max(_turning(target) for target in self._targets)
            count = math.ceil(turns / TURN)
            for k in range(1, count):
                near = [between(start, of, k / count) for start, of in zip(starts, self._targets, strict=True)]
                self._improve(near, 2)
        termination = self._improve(self._targets, MOST_STEPS)
        for _ in range(MOST_MODELS):
            scene = load_content(scene_content(self._scene), self._changes(self._values))
            simulator = Simulator(scene)
            if not self._by_laws or alike_but_gains(self._here[0].model, simulator.model):
                break
            self._scene, self._known = scene, []  # what its sections are follows from the pattern
            self._here = self._built(self._values, self._here)
            self._parameters = [self._sought(here) for here in self._here]
            self._by_laws = self._are_laws()
            termination = self._improve(self._targets, MOST_STEPS)
        return self._report(termination, simulator)

    def _refuse_idle(self) -> None:
        moved = np.max([np.abs(slopes).max(axis=(0, 1)) for slopes in self._slopes()], axis=0)
        largest = moved * (self._high - self._low)
        if idle := [name for name, of in zip(self._names, largest, strict=True) if of < 1e-12 * self._size]:
            raise InputError(f"vary {', '.join(idle[:4])}: acts on nothing at these stimuli; leave it out")

    def _report(self, termination: str, simulator: Simulator) -> DesignResult:
        scene, shapes = simulator.scene, []
        for target, level, here, (away, _) in zip(
            self._targets, self._levels, self._here, self._departures(self._targets), strict=True
        ):
            made = self._curve(here)
            take_shape(simulator, here)
            stable = simulator.solve_static().stable
            length = float(np.linalg.norm(np.diff(made, axis=0), axis=1).sum())
            shapes.append(Shape(target, level, made, np.linalg.norm(away, axis=1), length, stable))
        final = equilibrium_of(simulator)
        part = (self._values - self._low) / (self._high - self._low)
        at_bounds = int(np.sum((part <= AT_BOUND) | (part >= 1.0 - AT_BOUND)))
        values = self._split(self._values)
        return DesignResult(
            scene, self._varied, values, shapes, at_bounds, self._sensitivity(final), self.equilibria, termination
        )

    def _sensitivity(self, here: Equilibrium) -> dict[str, float]:
        """Return the displacements by errors of 1 % in each pattern, and in the thickness of each layer [m]."""
        found: dict[str, float] = {}
        slopes, begin = self._slopes()[-1], 0
        for v, own in zip(self._varied, self._split(self._values), strict=True):
            moved = slopes[..., begin : begin + len(own)] @ own
            found[v.path] = 0.01 * float(np.linalg.norm(moved, axis=1).max())
            begin += len(own)
        rod = next(rod for rod in self._scene.rods if rod_of(self._scene, self._varied) in rod.copy_names)
        for layer in rod.layers:
            path = f"rods.{rod.name}.layers.{layer.name}.thickness"
            if isinstance(layer.thickness, float) and rod.radius is None and path not in found:
                moved = self._derivatives(here, here.parameters([path])[path])[..., 0] * layer.thickness
                found[path] = 0.01 * float(np.linalg.norm(moved, axis=1).max())
        return found


def _turning(curve: TargetCurve) -> float:
    """Return by how much a curve turns in all [rad]."""
    ways = curve.tangents(np.linspace(0.0, curve.length, 200))
    return float(np.arccos(np.clip(np.einsum("ij,ij->i", ways[1:], ways[:-1]), -1.0, 1.0)).sum())
