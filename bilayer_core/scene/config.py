"""The classes of a scene: they are the schema of scene files. Unknown keys are faults; validated values are SI."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from bilayer_core.scene import checks
from bilayer_core.scene.body import Body
from bilayer_core.scene.faults import refuse, refuse_all
from bilayer_core.scene.load import Load, PointMass
from bilayer_core.scene.part import Direction, Name, Part, Point
from bilayer_core.scene.rod import Rod
from bilayer_core.scene.schedule import Schedule
from bilayer_core.scene.units import (
    Acceleration,
    NonNegativeNumber,
    NonNegativeRate,
    PlainNumber,
    PositiveDensity,
    PositiveLength,
    PositiveNumber,
    PositivePressure,
    PositiveRate,
    PositiveSpeed,
    PositiveTime,
    Speed,
    real,
    whole,
)

PoissonRatio = real("Poisson's ratio", "1", "0.5", above=-1.0, at_most=0.5)


class Material(Part):
    """A linearly elastic, isotropic material."""

    youngs_modulus: PositivePressure
    poisson_ratio: PoissonRatio
    density: PositiveDensity


class Stimulus(Part):
    """A stimulus channel: its unit, its range, and how the scene itself drives it."""

    unit: str = "1"
    minimum: PlainNumber = 0.0
    maximum: PlainNumber = 1.0
    schedule: Schedule

    @model_validator(mode="after")
    def _check(self) -> Stimulus:
        refuse_all("Stimulus", checks.faults_of_range(self))
        return self


class Plane(Part):
    """A fixed plane; rods and bodies stay on the side to which the normal points."""

    name: Name
    type: Literal["plane"]
    point: Point
    normal: Direction


class Friction(Part):
    """Coulomb friction, smoothed below a speed.

    Rods may slide more easily one way than the other along their axis (`Rod.friction_axis`), and sideways; bodies feel
    `coefficient`.
    """

    coefficient: NonNegativeNumber
    speed_threshold: PositiveSpeed
    forward: NonNegativeNumber | None = None
    """Of rods sliding along + of their axis; like the next two, `coefficient` by default."""
    backward: NonNegativeNumber | None = None
    sideways: NonNegativeNumber | None = None

    @property
    def of_rods(self) -> tuple[float, float, float]:
        """Coefficients of rods: forward, backward, sideways."""
        given = (self.forward, self.backward, self.sideways)
        return tuple(self.coefficient if value is None else value for value in given)

    @property
    def acts(self) -> bool:
        """Whether there is any friction."""
        return self.coefficient > 0.0 or max(self.of_rods) > 0.0


class Contact(Part):
    """Barrier that keeps surfaces apart, and friction."""

    barrier_distance: PositiveLength
    """Distance at which the barrier begins to act."""
    stiffness: PositivePressure
    friction: Friction | None = None


class AddedMass(Part):
    """Fluid that moves with a ribbon, as multiples of what an ellipse of its width and thickness takes along."""

    through: NonNegativeNumber = 1.0
    """Mass through the thickness, of π/4 × density × width² per length."""
    sideways: NonNegativeNumber = 1.0
    """Mass across the width, of π/4 × density × thickness² per length."""
    turning: NonNegativeNumber = 1.0
    """Moment of inertia about the path, of π/128 × density × (width² − thickness²)² per length."""


def _with_or_without(value: Any) -> Any:
    """`true` stands for the multiples by default, `false` for no added mass."""
    if isinstance(value, bool):
        return {} if value else None
    if value is None or isinstance(value, dict | AddedMass):
        return value
    raise refuse("must be true, false, or a mapping of `through`, `sideways`, `turning`")


class Fluid(Part):
    """A fluid around the rods: its quadratic drag on them and, on request, its inertia."""

    density: PositiveDensity = 1000.0
    velocity: tuple[Speed, Speed, Speed] = (0.0, 0.0, 0.0)
    """Of a uniform flow."""
    drag_along: NonNegativeNumber
    """Coefficient for motion along the tangent, with the width as area per length."""
    drag_across: NonNegativeNumber
    """Coefficient for motion across: with the width through the thickness, with the thickness sideways."""
    added_mass: Annotated[
        AddedMass | None, BeforeValidator(_with_or_without, json_schema_input_type=AddedMass | bool | None)
    ] = None
    """Inertia of the fluid that the rods push aside; none by default, `true` for all multiples 1."""


class Damping(Part):
    """Damping of the rods."""

    mass: NonNegativeRate = 0.0
    """Force per mass and velocity."""


class Coupling(Part):
    """Stiffness of the bond between two layers, as multiples of the section's own."""

    translation: PositiveNumber = 10.0
    bending: PositiveNumber = 10.0
    twist: PositiveNumber = 10.0


class Solver(Part):
    """How the equations are solved."""

    model: Literal["auto", "two_rod"] = "auto"
    dimension: Literal["auto", 3] = "auto"
    integrator: Literal["auto", "implicit_euler"] = "auto"
    dt: PositiveTime = 1e-3
    tolerance: PositiveSpeed = 1e-6
    """Largest velocity correction that Newton may leave."""
    max_newton_iterations: whole(1) = 50
    max_halvings: whole(0) = 10


class Output(Part):
    """How often a run is recorded, in simulated time."""

    rate: PositiveRate = 50.0
    marker_rate: PositiveRate = 20.0


class SceneConfig(Part):
    """A scene: a robot, its surroundings, what drives it, and how it is solved."""

    schema_version: Literal[1] = Field(alias="schema")
    name: Name
    title: str
    description: str = ""
    duration: PositiveTime
    gravity: tuple[Acceleration, Acceleration, Acceleration] = (0.0, 0.0, -9.81)
    materials: dict[Name, Material]
    stimuli: dict[Name, Stimulus] = {}
    rods: list[Rod] = Field(min_length=1)
    bodies: list[Body] = []
    masses: list[PointMass] = []
    loads: list[Load] = []
    obstacles: list[Plane] = []
    contact: Contact | None = None
    fluid: Fluid | None = None
    damping: Damping = Damping()
    coupling: Coupling = Coupling()
    solver: Solver = Solver()
    output: Output = Output()

    @model_validator(mode="after")
    def _check(self) -> SceneConfig:
        refuse_all("SceneConfig", checks.faults_of_scene(self))
        return self
