"""A rod that is to take wanted shapes: its equilibria with some values, and how far they are from what is wanted.

Curves are those that the body sees that holds the rod where it begins; targets begin there, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.model.plan import simplest_model
from bilayer_core.model.strip_choice import section_of
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.loader import load_content, scene_content
from bilayer_core.simulation.at_rest import equilibrium_of, take_shape
from bilayer_core.simulation.gradients.equilibrium_response import Equilibrium
from bilayer_core.simulation.gradients.parameters import Parameter
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.studies.shaping.design_result import rod_of
from bilayer_core.studies.shaping.pattern import Pattern
from bilayer_core.studies.shaping.target_curve import TargetCurve
from bilayer_core.studies.shaping.varied import Varied

Array = np.ndarray
ENDS = 1e-3
"""Weight of where the rod ends along a curve: what the shape leaves to choose, as layers that swell alike, sets it."""
STEEPEST = math.radians(10.0)
"""Between the clamp and the start of a wanted curve."""
LONGEST = 1.1
"""Length of a wanted curve, of the longest rod within the bounds; that of the shortest, of a wanted curve."""
ASIDE = 0.05
"""Of its length: by how much a curve may leave its plane where the rod stays in one."""
IDLE = 1e-8
"""Motion of the rod from one bound to the other, of its length, that is rounding of differences, which is 1e-10."""


class Stopped(Exception):  # noqa: N818 it is no error
    """The search is to end."""


class ShapedRod:
    """The rod of a scene in equilibrium at each of some stimuli.

    Attributes
    ----------
    scene : SceneConfig
    varied : list of Varied
    levels : list of dict of str to float
        Stimuli, one for each target.
    pattern : Pattern
    values : ndarray
        Of all that varies, shape (n_value,).
    here : list of Equilibrium
    targets : list of TargetCurve
    size : float
        Length of the rod at the start [m].
    equilibria : int
        That were computed.
    weight : float
        Part of the scene's gravity that acts.
    sections : dict of str to str
        What gives rods of the scene the sections of these equilibria.
    """

    def __init__(
        self,
        scene: SceneConfig,
        varied: list[Varied],
        curves: list[TargetCurve],
        levels: list[dict[str, float]],
        smoothness: float,
        interrupted: Callable[[], bool],
    ):
        self.scene, self.varied, self.levels = scene, varied, levels
        self.pattern, self._interrupted = Pattern(varied, smoothness), interrupted
        self.values = np.concatenate([v.start for v in varied])
        self._names = [name for v in varied for name in v.names]
        owners = self.pattern.split(np.arange(len(self.values)))
        self._owner = np.concatenate([v.in_scene(own) for v, own in zip(varied, owners, strict=True)])
        self.equilibria, self.weight = 0, 1.0
        self.sections = _beams_of(scene)
        self.known: list[Array] = []
        self.here = self.built(self.values)
        self._nodes = self._strands()
        self.size = float(np.linalg.norm(np.diff(self.curve(self.here[0]), axis=0), axis=1).sum())
        self.parameters = [self.sought(here) for here in self.here]
        self.by_laws = self.are_laws()
        self._refuse_idle()
        self.targets = [self._placed(*of) for of in zip(curves, self.here, self.slopes(), strict=True)]

    def built(self, values: Array, shapes: Sequence[Equilibrium] = ()) -> list[Equilibrium]:
        """Return the equilibria of the scene with such values, one for each target, near some shapes."""
        simulator, found = Simulator(self.scene_with(values, self.sections)), []
        for k, level in enumerate(self.levels):
            simulator.reset()
            for channel, value in level.items():
                simulator.set_stimulus(channel, value)
            if k < len(shapes) and shapes[k].fits(simulator.model):
                take_shape(simulator, shapes[k])
            simulator.solve_static()
            self.equilibria += 1
            found.append(equilibrium_of(simulator))
        return found

    def scene_with(self, values: Array, sections: dict[str, str]) -> SceneConfig:
        """Return the scene with other values and sections, under the weight that acts."""
        changes = sections | ({} if self.weight == 1.0 else {"gravity": list(self._gravity)})
        for v, own in zip(self.varied, self.pattern.split(values), strict=True):
            changes |= v.changes(own)
        return load_content(scene_content(self.scene), changes)

    @property
    def _gravity(self) -> tuple[float, ...]:
        return tuple(self.weight * of for of in self.scene.gravity)

    @property
    def in_plane(self) -> bool:
        return bool(self.here[0].model.plane.exists)

    def are_laws(self) -> bool:
        """Return whether all values are gains, for which nothing is built."""
        return all(p.share.size for of in self.parameters for p in of)

    def sought(self, here: Equilibrium, names: Sequence[str] = ()) -> list[Parameter]:
        """Return the numbers with some names, or all that vary, as parameters of an equilibrium."""
        return [p for of in here.parameters(names or self._names).values() for p in of]

    def _strands(self) -> list[slice]:
        """Return the nodes of the strands of the rod; two of them have its curve between them."""
        rod, strands = rod_of(self.scene, self.varied), self.here[0].model.strands
        name, rod = rod.copies[0].name, rod.copies[0].rod
        if not rod.clamp_start:
            raise InputError(
                f"rods.{rod.name}: wanted curves begin where the rod does, which nothing holds: clamp_start"
            )
        self._holder = [body.name for body in self.scene.bodies].index(rod.clamp_start)
        found = [slice(s.first_node, s.first_node + s.shown) for s in strands if s.rod == name]
        return found if len({s.stop - s.start for s in found}) == 1 else found[:1]

    def of_rod(self, of_nodes: Array) -> Array:
        """Return what the curve of the rod has, of what nodes have."""
        return np.mean([of_nodes[nodes] for nodes in self._nodes], axis=0)

    def turned(self, here: Equilibrium) -> Array:
        """Return the rotation since the start of the body that holds the rod, shape (3, 3)."""
        return here.rotations[self._holder] @ here.model.bodies.start_rotation[self._holder].T

    def curve(self, here: Equilibrium) -> Array:
        """Return the curve of the rod from its start, as the body sees it that holds it there [m], shape (n, 3)."""
        return self.from_start(here) @ self.turned(here)

    def from_start(self, here: Equilibrium | Simulator) -> Array:
        """Return the curve of the rod from its start, as the world sees it [m], shape (n, 3)."""
        points = self.of_rod(here.positions)
        return points - points[0]

    def derivatives(self, here: Equilibrium, parameters: list[Parameter]) -> Array:
        """Return its derivatives, shape (n, 3, n_parameter)."""
        of_nodes, of_bodies = here.velocities(parameters)
        velocities = self.of_rod(of_nodes)
        turning = np.cross(of_bodies[self._holder][None], self.from_start(here)[..., None], axis=1)
        return np.einsum("iak,ab->ibk", velocities - velocities[0] - turning, self.turned(here))

    def slopes(self) -> list[Array]:
        """Return its derivatives by the values at each level, computed once for each equilibrium."""
        if not self.known:
            acts = np.eye(len(self.values))[self._owner]  # what a value changes in the scene
            self.known = [self.derivatives(*of) @ acts for of in zip(self.here, self.parameters, strict=True)]
        return self.known

    def _placed(self, curve: TargetCurve, here: Equilibrium, slopes: Array) -> TargetCurve:
        """Return a target, moved to begin at the origin."""
        made, first = self.curve(here), [nodes.start for nodes in self._nodes]
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
        ends = np.array([self.pattern.low, self.pattern.high]) - self.values
        least, most = lengths.sum() + (np.sort(growth * ends, axis=0) @ np.ones(len(growth)))
        if not least / LONGEST <= curve.length <= LONGEST * most:
            raise InputError(
                f"{curve.source}: is {1e3 * curve.length:.4g} mm long; within these bounds the rod becomes "
                f"{1e3 * least:.4g} to {1e3 * most:.4g} mm long, and allowed are {LONGEST:g} times more "
                "and less; x, y and z are in m"
            )
        if self.in_plane:
            aside = np.ptp(curve.points @ np.cross(*here.model.rods.axes))
            if aside > ASIDE * curve.length:
                raise InputError(
                    f"{curve.source}: leaves its plane by {1e3 * aside:.4g} mm, in which the rod stays; allowed are "
                    f"{100.0 * ASIDE:g} % of its length: let the rod twist, as fibres at an angle do"
                )
        return TargetCurve(curve.points - curve.at(np.zeros(1))[0], curve.source)

    def go(self, values: Array) -> None:
        """Go to the equilibria with other values."""
        if self._interrupted():
            raise Stopped
        self.known = []
        if not self.by_laws or self.here[0].model.scene.gravity != self._gravity:
            self.here = self.built(values, self.here)
            self.parameters = [self.sought(here) for here in self.here]
        else:
            for here, parameters in zip(self.here, self.parameters, strict=True):
                here.go_to(parameters, values[self._owner].tolist())
                self.equilibria += 1

    def departures(self, targets: Sequence[TargetCurve]) -> list[tuple[Array, Array]]:
        """Return ways from targets to the rod [m], and tangents there; those of shapes on the way from point to point,
        since sliding along them the rod would go astray.
        """
        found = []
        for here, target in zip(self.here, targets, strict=True):
            made = self.curve(here)
            lengths = np.linalg.norm(np.diff(made, axis=0), axis=1)
            along = np.concatenate([[0.0], np.cumsum(lengths)])
            if targets is self.targets:
                found.append(target.departures(made, along))
            else:
                away = made - target.at(along * (target.length / along[-1]))
                found.append((away, np.zeros_like(away)))
        return found

    def rms(self, targets: Sequence[TargetCurve]) -> float:
        """Return the root mean square of distances from targets, over the length of the rod."""
        ways = [away for away, _ in self.departures(targets)]
        return math.sqrt(np.mean([np.mean((away**2).sum(axis=1)) for away in ways])) / self.size

    def beyond(self, targets: Sequence[TargetCurve]) -> Array:
        """Return how far beyond the ends of targets the rod ends, along their last tangents [m]."""
        tips = [self.curve(here)[-1] for here in self.here]
        ends = [(target.at(end := np.array([target.length]))[0], target.tangents(end)[0]) for target in targets]
        return np.array([tangent @ (tip - end) for tip, (end, tangent) in zip(tips, ends, strict=True)])

    def equations(self, targets: Sequence[TargetCurve], slopes: list[Array]) -> tuple[Array, Array]:
        """Return the Jacobian and the values of distances, over the length of the rod, and last those of its ends."""
        rows, right = [], []
        for (away, tangents), slope in zip(self.departures(targets), slopes, strict=True):
            across = slope - np.einsum("ia,ib,ibk->iak", tangents, tangents, slope)
            rows.append(across.reshape(away.size, -1) / math.sqrt(len(away)))
            right.append(away.ravel() / math.sqrt(len(away)))
        last = [target.tangents(np.array([target.length]))[0] for target in targets]
        rows.append(ENDS * np.array([tangent @ slope[-1] for tangent, slope in zip(last, slopes, strict=True)]))
        right.append(ENDS * self.beyond(targets))
        over = self.size * math.sqrt(len(targets))
        return np.concatenate(rows) / over, np.concatenate(right) / over

    def angles(self, targets: Sequence[TargetCurve], slopes: list[Array]) -> tuple[Array, Array]:
        """Return the Jacobian and the values of angles of edges in the plane, over those of the targets [rad]."""
        rows, right = [], []
        for here, target, slope in zip(self.here, targets, slopes, strict=True):
            made = self.curve(here)
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

    def kept(self) -> tuple[Any, ...]:
        """Return values and their equilibria for `return_to`."""
        return self.values, self.weight, self.here, self.parameters, self.known, [of.kept() for of in self.here]

    def return_to(self, kept: tuple[Any, ...]) -> None:
        """Go back to values and the equilibria that were found with them."""
        self.values, self.weight, self.here, self.parameters, self.known, shapes = kept
        for here, shape in zip(self.here, shapes, strict=True):
            here.return_to(shape)

    def _refuse_idle(self) -> None:
        moved = np.max([np.abs(slopes).max(axis=(0, 1)) for slopes in self.slopes()], axis=0)
        acts = self.pattern.split(moved * (self.pattern.high - self.pattern.low) >= IDLE * self.size)
        if idle := [v.path for v, own in zip(self.varied, acts, strict=True) if not own.any()]:
            of = rod_of(self.scene, self.varied).name
            raise InputError(f"vary {', '.join(idle)}: acts on nothing of rods.{of} at these stimuli; leave it out")


def sections_of(scene: SceneConfig, model: str) -> dict[str, str]:
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
    found = sections_of(scene, model) if model == "laminate" else {}
    return {path: "beam" if path.endswith(".section") else value for path, value in found.items()}
