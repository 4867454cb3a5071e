"""Results of a design: the scene with its pattern, each wanted shape and the one that was made."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.scene.config import SceneConfig
from bilayer_core.scene.rod import Rod
from bilayer_core.studies.shaping.target_curve import TargetCurve
from bilayer_core.studies.shaping.varied import Varied

Array = np.ndarray


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
    reached : bool
        Whether the rod comes there from the start of the scene, at once or as stimuli rise.
    """

    target: TargetCurve
    stimulus: dict[str, float]
    made: Array
    distances: Array
    length: float
    stable: bool
    reached: bool

    @property
    def ends_apart(self) -> float:
        """Distance of the end of the rod from that of the target [m]."""
        return float(np.linalg.norm(self.made[-1] - self.target.points[-1]))

    @property
    def state(self) -> str:
        """A word or two on `stable` and `reached`."""
        reached = "" if self.reached else ", but from the start of the scene the rod comes to another shape"
        return ("stable" if self.stable else "UNSTABLE") + reached


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
    def _rod(self) -> Rod:
        return rod_of(self.scene, self.varied)

    @property
    def largest(self) -> float:
        """Largest distance, of the length of the rod."""
        return max(float(shape.distances.max()) for shape in self.shapes) / self.size

    @property
    def rms(self) -> float:
        """Root mean square of the distances, of the length of the rod."""
        return math.sqrt(np.mean([np.mean(shape.distances**2) for shape in self.shapes])) / self.size

    def __str__(self) -> str:
        copies = self._rod.copy_names
        copies = f" of {copies[0]}, the first of {len(copies)} copies," if len(copies) > 1 else ""
        lines = [
            f"{self.scene.name}: {sum(map(len, self.values))} values, {self.equilibria} equilibria; {self.termination}",
            f"  distance{copies} from the target: at most {100 * self.largest:.3g} %, rms {100 * self.rms:.3g} % of "
            "the rod",
        ]
        for shape in self.shapes:
            away = f", at most {100.0 * shape.distances.max() / self.size:.3g} % away" if len(self.shapes) > 1 else ""
            lines.append(
                f"  at {stimuli_text(shape.stimulus)}: {shape.target.source} is {1e3 * shape.target.length:.4g} mm "
                f"long, the rod {1e3 * shape.length:.4g} mm, ends {1e3 * shape.ends_apart:.3g} mm apart{away}; "
                f"{shape.state}"
            )
        if self.at_bounds:
            lines.append(f"  values at their bounds, which limit the shape: {self.at_bounds}")
        for layer, moved in self.sensitivity.items():
            lines.append(f"  an error of 1 % in {layer} moves the rod by up to {100 * moved / self.size:.3g} %")
        return "\n".join(lines)


def stimuli_text(level: Mapping[str, float]) -> str:
    """Return values of stimuli as a text."""
    return ", ".join(f"{name} = {value:g}" for name, value in level.items()) or "no stimulus"


def rod_of(scene: SceneConfig, varied: Sequence[Varied]) -> Rod:
    """Return the rod that is shaped: the only one, or the first that a path names.

    Raises
    ------
    InputError
        If it is not told which.
    """
    named = {f"rods.{key}": rod for k, rod in enumerate(scene.rods) for key in (rod.name, k)}
    found = [named[key] for key in (".".join(v.path.split(".")[:2]) for v in varied) if key in named] or scene.rods
    if len(found) > 1 and found is scene.rods:
        names = ", ".join(rod.name for rod in scene.rods)
        raise InputError(
            f"vary {varied[0].path}: names none of the rods {names}; the first that a path names is shaped"
        )
    return found[0]
