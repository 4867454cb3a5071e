"""The classes of a scene: they are the schema of scene files. Unknown keys are faults; validated values are SI."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    field_serializer,
    model_validator,
)

from bilayer_core.scene import checks
from bilayer_core.scene.eigenstrain import Eigenstrain
from bilayer_core.scene.faults import refuse, refuse_all
from bilayer_core.scene.schedule import Schedule, faults_of_times
from bilayer_core.scene.units import (
    Acceleration,
    AngularSpeed,
    Curvature,
    Length,
    NonNegativeLength,
    NonNegativeNumber,
    NonNegativeRate,
    NonNegativeTime,
    Number,
    PlainNumber,
    PositiveAngle,
    PositiveDensity,
    PositiveInertia,
    PositiveLength,
    PositiveMass,
    PositiveNumber,
    PositivePressure,
    PositiveRate,
    PositiveSpeed,
    PositiveTime,
    Speed,
    Twist,
    real,
    whole,
)

UNIT_LENGTH_TOLERANCE = 1e-14
"""A direction this near to length 1 is kept as it is, so that a dumped scene is read back bit for bit."""


def _unit_vector(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    length = math.hypot(*vector)
    if length == 0.0:
        raise refuse("must be a direction, with a length above 0")
    if abs(length - 1.0) <= UNIT_LENGTH_TOLERANCE:
        return vector
    return tuple(component / length for component in vector)


Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*$")]
"""Fit for key paths, for ROS topics and for file names."""
Point = tuple[Length, Length, Length]
Direction = Annotated[tuple[Number, Number, Number], AfterValidator(_unit_vector)]
"""Unit vector; a file may give any length."""
Eigenstrains = Annotated[
    list[Eigenstrain],
    BeforeValidator(
        lambda laws: [] if laws is None else [laws] if isinstance(laws, dict) else laws,
        json_schema_input_type=Eigenstrain | list[Eigenstrain] | None,
    ),
]
PoissonRatio = real("Poisson's ratio", "1", "0.5", above=-1.0, at_most=0.5)


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Material(_Part):
    """A linearly elastic, isotropic material."""

    youngs_modulus: PositivePressure
    poisson_ratio: PoissonRatio
    density: PositiveDensity


class Stimulus(_Part):
    """A stimulus channel: its unit, its range, and how the scene itself drives it."""

    unit: str = "1"
    minimum: PlainNumber = 0.0
    maximum: PlainNumber = 1.0
    schedule: Schedule

    @model_validator(mode="after")
    def _check(self) -> Stimulus:
        refuse_all("Stimulus", checks.faults_of_range(self))
        return self


class StraightPath(_Part):
    """A straight line of given length."""

    shape: Literal["straight"]
    start: Point
    direction: Direction
    length: PositiveLength


class ArcPath(_Part):
    """A part of a circle in the plane of its direction and the rod's normal."""

    shape: Literal["arc"]
    start: Point
    direction: Direction
    """Tangent at the start."""
    radius: PositiveLength
    angle: PositiveAngle
    toward: Literal["normal", "opposite"] = "normal"
    """Side on which the centre lies: that of the rod's normal at the start, or the other."""

    @property
    def length(self) -> float:
        """Length of the arc [m]."""
        return self.radius * self.angle

    @property
    def curvature(self) -> float:
        """Towards the normal [1/m]."""
        return (1.0 if self.toward == "normal" else -1.0) / self.radius


class Pattern(_Part):
    """Copies of a rod, turned about an axis at equal angles; the first is the rod itself."""

    axis: Direction = (0.0, 0.0, 1.0)
    center: Point = (0.0, 0.0, 0.0)
    count: whole(1)


class Layer(_Part):
    """One layer of a rod. It covers the whole path, or the stations nearest to `interval`."""

    name: Name
    material: Name
    thickness: PositiveLength
    interval: tuple[NonNegativeLength, PositiveLength] | None = None
    """From and to, as lengths along the path [m]."""
    eigenstrain: Eigenstrains = []
    """One law or several, which add up."""
    natural_curvature: Curvature | None = None
    """Of the layer by itself, through the thickness, positive where it bends to the normal; default: the path's."""
    natural_twist: Twist = 0.0
    """Of the layer by itself, about the path."""

    @field_serializer("eigenstrain")
    def _as_written(self, laws: list[Eigenstrain]) -> Any:
        """A single law without its list, as scenes state it, so that overrides find its keys."""
        return laws if len(laws) > 1 else laws[0] if laws else None


class Rod(_Part):
    """One or two layers along a path, or several equal ones about an axis."""

    name: Name
    width: PositiveLength
    path: Annotated[StraightPath | ArcPath, Field(discriminator="shape")]
    normal: Direction
    """Through the thickness, from the first layer (bottom) to the last (top); at the start of a curved path."""
    stations: whole(3)
    """Cross-sections along the path, both ends included."""
    layers: list[Layer] = Field(min_length=1, max_length=2)
    torsion: Literal["laminate", "layers"] = "laminate"
    """Torsional stiffness: of the bonded section, or the sum of the layers' own."""
    friction_axis: Literal["path", "normal", "across"] = "path"
    """Direction of the rod that counts as forward for friction: along its path, its normal, or path × normal."""
    pattern: Pattern | None = None
    clamp_start: Name | None = None
    clamp_end: Name | None = None

    @property
    def edge_length(self) -> float:
        """Distance of two stations [m]."""
        return self.path.length / (self.stations - 1)

    @property
    def copies(self) -> list[str]:
        """Names of the rods that this one stands for: its own, or numbered ones if it has a pattern."""
        return [f"{self.name}_{index}" for index in range(self.pattern.count)] if self.pattern else [self.name]

    def covered_stations(self, layer: Layer) -> tuple[int, int]:
        """First and last station of `layer`, those nearest to its interval."""
        if layer.interval is None:
            return 0, self.stations - 1
        first, last = (math.floor(length / self.edge_length + 0.5) for length in layer.interval)
        return first, last

    def driven_edges(self, layer: Layer, law: Eigenstrain) -> range:
        """Edges of the path that a law of `layer` drives: those of the layer whose middle lies in its interval, the end
        excluded, so that adjoining intervals share none.
        """
        first, last = self.covered_stations(layer)
        if law.interval is None:
            return range(first, last)
        begin, end = (math.ceil(length / self.edge_length - 0.5) for length in law.interval)
        return range(max(first, begin), min(last, end))

    @model_validator(mode="after")
    def _check(self) -> Rod:
        refuse_all("Rod", checks.faults_of_rod(self))
        return self


class Free(_Part):
    """A body that moves as the forces on it demand."""

    type: Literal["free"]
    mass: PositiveMass
    inertia: tuple[PositiveInertia, PositiveInertia, PositiveInertia] | None = None
    """Principal moments of inertia; without them those of a solid ball, or of a hollow one if `shell` is true."""
    shell: bool = False
    velocity: tuple[Speed, Speed, Speed] = (0.0, 0.0, 0.0)
    angular_velocity: tuple[AngularSpeed, AngularSpeed, AngularSpeed] = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _check(self) -> Free:
        refuse_all("Free", checks.faults_of_inertia(self))
        return self


class Guided(_Part):
    """A body on a rail: it slides along an axis as the forces on it demand, and does not turn."""

    type: Literal["guided"]
    axis: Direction
    mass: PositiveMass
    speed: Speed = 0.0
    """At the start, along the axis."""


class Prescribed(_Part):
    """A body that is guided: at rest, or through points with a rest at each (cubic smoothstep between them)."""

    type: Literal["prescribed"]
    times: list[NonNegativeTime] = []
    displacements: list[Point] = []
    """From the body's position, at each of the times; the first is zero."""

    @model_validator(mode="after")
    def _check(self) -> Prescribed:
        faults = faults_of_times(self.times, ("displacements",), self.displacements)
        if self.displacements and any(self.displacements[0]):
            found = self.displacements[0]
            faults.append((("displacements", 0), found, "must be [0, 0, 0]: `position` is where the body starts"))
        refuse_all("Prescribed", faults)
        return self


class Sphere(_Part):
    """A spherical surface about the body's position."""

    shape: Literal["sphere"]
    radius: PositiveLength


class ContactPoint(_Part):
    """A point of a body that feels surfaces."""

    position: Point
    """In the frame of the body."""
    length: PositiveLength
    """Weight of its barrier: the length of rod that it stands for."""
    offset: NonNegativeLength
    """From the point to the body's face."""


class Body(_Part):
    """A rigid body."""

    name: Name
    position: Point
    motion: Annotated[Free | Guided | Prescribed, Field(discriminator="type")]
    surface: Sphere | None = None
    contact_points: list[ContactPoint] = []


class Plane(_Part):
    """A fixed plane; rods and bodies stay on the side to which the normal points."""

    name: Name
    type: Literal["plane"]
    point: Point
    normal: Direction


class Friction(_Part):
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


class Contact(_Part):
    """Barrier that keeps surfaces apart, and friction."""

    barrier_distance: PositiveLength
    """Distance at which the barrier begins to act."""
    stiffness: PositivePressure
    friction: Friction | None = None


class Fluid(_Part):
    """A fluid around the rods, and its quadratic drag on them."""

    density: PositiveDensity = 1000.0
    velocity: tuple[Speed, Speed, Speed] = (0.0, 0.0, 0.0)
    """Of a uniform flow."""
    drag_along: NonNegativeNumber
    """Coefficient for motion along the tangent, with the width as area per length."""
    drag_across: NonNegativeNumber
    """Coefficient for motion across: with the width through the thickness, with the thickness sideways."""


class Damping(_Part):
    """Damping of the rods."""

    mass: NonNegativeRate = 0.0
    """Force per mass and velocity."""


class Coupling(_Part):
    """Stiffness of the bond between two layers, as multiples of the section's own."""

    translation: PositiveNumber = 10.0
    bending: PositiveNumber = 10.0
    twist: PositiveNumber = 10.0


class Solver(_Part):
    """How the equations are solved."""

    model: Literal["auto", "two_rod"] = "auto"
    dimension: Literal["auto", 3] = "auto"
    integrator: Literal["auto", "implicit_euler"] = "auto"
    dt: PositiveTime = 1e-3
    tolerance: PositiveSpeed = 1e-6
    """Largest velocity correction that Newton may leave."""
    max_newton_iterations: whole(1) = 50
    max_halvings: whole(0) = 10


class Output(_Part):
    """How often a run is recorded, in simulated time."""

    rate: PositiveRate = 50.0
    marker_rate: PositiveRate = 20.0


class SceneConfig(_Part):
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
