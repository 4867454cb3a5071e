"""What a benchmark varies: model, dimension, integrator, and the step or the tolerance, and the mesh.

Models, dimensions and integrators are those that the simulator has; what a scene refuses is left out with its reason.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from ..errors import SceneError
from ..model.plan import DIMENSIONS, INTEGRATORS, MODELS, make_plan
from ..scene.config import SceneConfig

FREE_MOTION = "implicit_midpoint"
"""The integrator for motion without contact or fluid: it does not damp what these excite."""


@dataclass(frozen=True, order=True)
class Family:
    """What a user chooses once: all runs of a family differ in step and mesh alone."""

    model: str
    dimension: int
    integrator: str

    @property
    def label(self) -> str:
        """For tables and legends."""
        return f"{self.model} {self.dimension}-D, {self.integrator}"

    @classmethod
    def of(cls, record: dict) -> Family:
        """That of a recorded run."""
        return cls(record["model"], record["dimension"], record["integrator"])


@dataclass(frozen=True)
class Configuration:
    """One run of a family.

    Attributes
    ----------
    family : Family
    stations : int
        Of the rod whose mesh is varied.
    dt : float
        Step [s].
    """

    family: Family
    stations: int
    dt: float

    def identity(self) -> dict[str, object]:
        """As it stands in records."""
        return {**vars(self.family), "stations": self.stations, "dt": self.dt}


def shapes(scene: SceneConfig) -> Iterator[tuple[str, int]]:
    """Models and dimensions in which a scene can be simulated."""
    for model, dimension in product(MODELS, DIMENSIONS):
        if refusal(scene, Family(model, dimension, INTEGRATORS[0])) is None:
            yield model, dimension


def families(scene: SceneConfig, integrators: tuple[str, ...] = INTEGRATORS) -> list[Family]:
    """All families that a scene accepts; with contact or a fluid without the integrator that is not made for it."""
    free = scene.contact is None and scene.fluid is None
    fit = [name for name in integrators if free or name != FREE_MOTION]
    return [Family(*shape, name) for shape in shapes(scene) for name in fit]


def refusal(scene: SceneConfig, family: Family) -> str | None:
    """Why a scene cannot be simulated by this family; None if it can."""
    try:
        make_plan(scene, model=family.model, dimension=family.dimension, integrator=family.integrator)
    except SceneError as error:
        return str(error)
    return None
