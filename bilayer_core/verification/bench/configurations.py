"""Parameters that a benchmark varies: model, dimension, integrator, step or tolerance, and mesh.

Models, dimensions and integrators are those that the simulator has; what a scene refuses is left out with its reason.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from itertools import product

from bilayer_core.errors import SceneError
from bilayer_core.integrators.integrator_register import INTEGRATORS
from bilayer_core.model.plan import DIMENSIONS, MODELS, make_plan
from bilayer_core.scene.config import SceneConfig

FREE_MOTION = "implicit_midpoint"
"""The integrator for motion without contact or fluid: it does not damp what these excite."""


@dataclass(frozen=True, order=True)
class Family:
    """Choices that a user makes once: all runs of a family differ in step and mesh alone."""

    model: str
    dimension: int
    integrator: str
    adaptive: bool = False

    @property
    def label(self) -> str:
        """For tables and legends."""
        return f"{self.model} {self.dimension}-D, {self.integrator}{', adaptive' if self.adaptive else ''}"

    @classmethod
    def of(cls, record: dict) -> Family:
        """Return the family of a recorded run."""
        return cls(*(record[field.name] for field in fields(cls)))


@dataclass(frozen=True)
class Configuration:
    """One run of a family."""

    family: Family
    stations: int  # Of the rod whose mesh is varied
    step: float  # Length of fixed steps [s]; of adaptive ones their tolerance, in lengths of the longest rod

    @property
    def dt(self) -> float | None:
        """Length of fixed steps [s]."""
        return None if self.family.adaptive else self.step

    @property
    def tolerance(self) -> float | None:
        """Tolerance of adaptive steps, in lengths of the longest rod; None if steps are fixed."""
        return self.step if self.family.adaptive else None

    def identity(self) -> dict[str, object]:
        """Return the values that identify the configuration in records."""
        return {**vars(self.family), "stations": self.stations, "dt": self.dt, "tolerance": self.tolerance}


def shapes(scene: SceneConfig) -> Iterator[tuple[str, int]]:
    """Yield the models and dimensions in which a scene can be simulated."""
    for model, dimension in product(MODELS, DIMENSIONS):
        if refusal(scene, Family(model, dimension, next(iter(INTEGRATORS)))) is None:
            yield model, dimension


def families(scene: SceneConfig, integrators: Iterable[str] = tuple(INTEGRATORS)) -> list[Family]:
    """Return all families that a scene accepts; with contact or a fluid without the integrator that is not made
    for it.
    """
    free = scene.contact is None and scene.fluid is None
    fit = [name for name in integrators if free or name != FREE_MOTION]
    return [
        Family(*shape, name, adaptive)
        for shape in shapes(scene)
        for name in fit
        for adaptive in ((False,) if INTEGRATORS[name].estimate is None else (False, True))
    ]


def refusal(scene: SceneConfig, family: Family) -> str | None:
    """Return why a scene cannot be simulated by this family; None if it can."""
    try:
        make_plan(scene, model=family.model, dimension=family.dimension, integrator=family.integrator)
    except SceneError as error:
        return str(error)
    return None
