"""The classes of a scene: they are the schema of scene files. Unknown keys are faults; validated values are SI."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from bilayer_core.printable import shortened
from bilayer_core.scene import checks
from bilayer_core.scene.body import Body
from bilayer_core.scene.channel_range import value_in_range
from bilayer_core.scene.faults import Fault, refuse
from bilayer_core.scene.friction import Friction
from bilayer_core.scene.joint import Joint
from bilayer_core.scene.load import Load, PointMass
from bilayer_core.scene.part import AngularVelocity, Direction, Name, Part, Velocity
from bilayer_core.scene.rod import Rod
from bilayer_core.scene.schedule import Schedule
from bilayer_core.scene.shape import Obstacle
from bilayer_core.scene.units import (
    Acceleration,
    NonNegativeNumber,
    NonNegativeRate,
    NonNegativeTime,
    PlainNumber,
    PositiveDensity,
    PositiveLength,
    PositiveNumber,
    PositivePressure,
    PositiveRate,
    PositiveSpeed,
    PositiveTime,
    real,
    whole,
)

LARGEST_TOLERANCE = 0.1
DEFAULT_TOLERANCE, DEFAULT_DT = 1e-4, 1e-3
"""Of `Solver`: where neither is given, steps are adaptive with this tolerance and begin with this length [s]."""
ErrorTolerance = Annotated[
    float,
    *real(
        "a part of the longest rod (the speed at which Newton ends is `newton_tolerance`)",
        "1",
        "1e-4",
        above=0.0,
        at_most=LARGEST_TOLERANCE,
    ),
]
Restitution = Annotated[float, *real("a coefficient of restitution", "1", "0.5", at_least=0.0, at_most=1.0)]
PoissonRatio = Annotated[float, *real("Poisson's ratio", "1", "0.5", above=-1.0, at_most=0.5)]


class Material(Part):
    """A linearly elastic, isotropic material."""

    youngs_modulus: PositivePressure
    """Stiffness E in tension and bending."""
    poisson_ratio: PoissonRatio
    """ν, from which the shear modulus E/(2(1 + ν)) of torsion follows."""
    density: PositiveDensity
    """Mass per volume."""
    retardation_time: NonNegativeTime = 0.0
    """Viscosity over stiffness (Kelvin–Voigt); a vibration ω loses energy at the damping ratio ω × this / 2."""


class Light(Part):
    """Parallel light: a layer sees of its channel what its outer face catches, which changes with the shape."""

    from_direction: Direction = Field(alias="from")
    """Where it comes from: a direction in the world, from the robot to the light."""
    shadow: bool = False
    """Whether rods, bodies and obstacles hide it from layers behind them. Faces turned away are dark in any case."""


class Stimulus(Part):
    """A stimulus channel: its unit, its range, and how the scene itself drives it."""

    unit: str = "1"
    """For people to read; values are never converted."""
    minimum: PlainNumber = 0.0
    """Smallest value that a schedule, a topic or `set_stimulus` may give."""
    maximum: PlainNumber = 1.0
    """Largest value."""
    schedule: Schedule
    """Value over time, as long as no topic and no `set_stimulus` overrides it."""
    light: Light | None = None
    """Makes the channel the brightness of a light with a direction. Layers then follow it with a lag, element by
    element."""

    def _faults(self) -> list[Fault]:
        """Return the faults of a channel's range and of the values that its schedule takes."""
        low, high = self.minimum, self.maximum
        if self.light is not None and low != 0.0:
            return [(("minimum",), low, "must be 0 for a light: that is what layers in the dark see")]
        if high <= low:
            return [(("maximum",), high, f"must be above `minimum` ({low:g})")]
        return [
            (("schedule", *key), value, f"must lie in the range of the channel, {low:g} to {high:g} [{self.unit}]")
            for key, value in self.schedule.points().items()
            if value_in_range(value, low, high) is None
        ]


class Contact(Part):
    """Barrier that keeps surfaces apart, and friction."""

    barrier_distance: PositiveLength
    """Distance at which the barrier begins to act."""
    stiffness: PositivePressure
    """Of the barrier, per length of rod; a larger one leaves the gap nearer to `barrier_distance`."""
    impact_speed: PositiveSpeed | None = None
    """Speed of the impacts that the barrier has to hold: where the heaviest part needs a larger stiffness than
    `stiffness` for that, it is used, and stated."""
    friction: Friction | None = None
    """Of all that touches; without it nothing rubs."""
    restitution: Restitution | None = None
    """Speed after an impact over that before, of bodies with each other and with obstacles; without it a barrier gives
    back all. Rods rebound by their waves, which the retardation time of a material damps."""
    rods: Literal["auto", True, False] = "auto"
    """Whether rods touch each other and themselves; `auto`: where their lengths and free curvatures let them meet."""


class AddedMass(Part):
    """Fluid that moves with a ribbon, as multiples of what an ellipse of its width and thickness takes along."""

    through: NonNegativeNumber = 1.0
    """Mass through the thickness, of π/4 × density × width² per length."""
    sideways: NonNegativeNumber = 1.0
    """Mass across the width, of π/4 × density × thickness² per length."""
    turning: NonNegativeNumber = 1.0
    """Moment of inertia about the path, of π/128 × density × (width² − thickness²)² per length."""


def _with_or_without(value: Any) -> Any:
    """Return the default multiples for `true`, and no added mass for `false`."""
    if isinstance(value, bool):
        return {} if value else None
    if value is None or isinstance(value, dict | AddedMass):
        return value
    raise refuse("must be true, false, or a mapping of `through`, `sideways`, `turning`")


class Fluid(Part):
    """A fluid around the rods: its quadratic drag on them and, on request, its inertia."""

    density: PositiveDensity = 1000.0
    """Mass per volume of the fluid. There is no buoyancy: take it off `gravity`."""
    velocity: Velocity = (0.0, 0.0, 0.0)
    """Of a uniform flow."""
    drag_along: NonNegativeNumber
    """Coefficient for motion along the tangent, with the width as area per length."""
    drag_across: NonNegativeNumber
    """Coefficient for motion across: with the width through the thickness, with the thickness sideways."""
    drag_turning: NonNegativeNumber = 0.0
    """Coefficient for ribbons that turn about their axis, a plate whose points move across it: per length the moment
    density × this × width⁴/64 × spin². None by default; 2 is that of a plate."""
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
    """Against one layer's sliding on the other and lifting off."""
    bending: PositiveNumber = 10.0
    """Against a zigzag of one layer against the other."""
    twist: PositiveNumber = 10.0
    """Against one layer's twisting on the other."""


class Solver(Part):
    """How the equations are solved."""

    model: Literal["auto", "two_rod", "laminate"] = "auto"
    """`two_rod`: each layer a rod of its own, bonded to the other; `laminate`: one curve for both, bonded exactly;
    `auto`: the laminate, unless the scene needs a feature of the two-rod model."""
    dimension: Literal["auto", 2, 3] = "auto"
    """Of space; `auto`: 2 where all stays in a plane, which is faster, otherwise 3."""
    integrator: Literal["auto", "implicit_euler", "sdirk2", "tr_bdf2", "generalised_alpha", "implicit_midpoint"] = (
        "auto"
    )
    """How a step is taken in time; `auto` is the recommended one, `sdirk2`."""
    dt: PositiveTime | None = None
    """Alone: the time step, always the same. With `tolerance`, or by default (1 ms): the first adaptive step, and the
    first after a jump of a stimulus or a load."""
    tolerance: ErrorTolerance | None = None
    """Largest error per adaptive step: displacement over the length of the longest rod; 1e-4 unless `dt` is given. It
    bounds no error of a whole run, in which those of steps add up; `bilayer run --error-estimate` tells that."""
    max_step: PositiveTime | None = None
    """Longest adaptive step; by default the longer of 1/250 of `duration`, and of 1/100 of it up to
    20 ms."""
    newton_tolerance: PositiveSpeed | None = None
    """Newton's last correction of velocities is at most this, and in proportion less in steps of more than 20 ms; by
    default the speed that makes 1/100 of `tolerance` (1e-4 with fixed steps) in a step of 20 ms, or as long as
    `duration` if that is shorter, and at most a tenth of `contact.friction.speed_threshold` (or 1/100 of that speed, if
    this is more)."""
    max_newton_iterations: Annotated[int, *whole(1, 10_000)] = 50
    """After which a step counts as failed and is shortened."""
    max_halvings: Annotated[int, *whole(0, 1000)] | None = None
    """Of `dt`, for steps that fail; when the smallest one fails as well, the run stops and says why. By default 10, and
    adaptive steps may be as short as a thousandth of the time in which sound passes an edge, or in which the fastest
    point covers what `tolerance` allows."""


class Output(Part):
    """How often a run is recorded, in simulated time."""

    rate: PositiveRate = 50.0
    """Of poses, forces, energies and the state. Steps do not end at these times: what is recorded within one is
    interpolated, and the state is that of the step before."""
    marker_rate: PositiveRate = 20.0
    """Of the large messages, nodes, points and markers; not above `rate`."""


class SceneConfig(Part):
    """A scene: a robot, its surroundings, what drives it, and how it is solved."""

    schema_version: Literal[1] = Field(alias="schema")
    """Version of this format."""
    name: Name
    """For logs and summaries."""
    title: str
    """One line that says what happens."""
    description: str = ""
    """Anything more that a reader should know."""
    duration: PositiveTime
    """Simulated time of a run."""
    gravity: tuple[Acceleration, Acceleration, Acceleration] = (0.0, 0.0, -9.81)
    """Along x, y and z; z is up."""
    materials: dict[Name, Material]
    """By the names that layers call them by."""
    stimuli: dict[Name, Stimulus] = {}
    """Channels that drive the active layers, by the names of their topics."""
    rods: list[Rod] = Field(min_length=1)
    """The ribbons of the robot."""
    bodies: list[Body] = []
    """Rigid parts: hubs, walls, junctions, things to grasp."""
    joints: list[Joint] = []
    """Between bodies."""
    masses: list[PointMass] = []
    """Masses fixed to rods."""
    loads: list[Load] = []
    """Forces and moments from outside."""
    obstacles: list[Obstacle] = []
    """Surfaces fixed in the world."""
    contact: Contact | None = None
    """Must be given where there is something to touch."""
    fluid: Fluid | None = None
    """Around the rods; none by default."""
    start: Literal["placed", "settle"] = "placed"
    """Shape at the start: `placed` as the paths say, `settle` at the static equilibrium under gravity and what stimuli
    and loads are before time 0, where the robot rests on what is below it."""
    velocity: Velocity | None = None
    """Of the robot at the start: of all rods, and of the bodies that they hang on and that have no motion of their
    own."""
    angular_velocity: AngularVelocity | None = None
    """Likewise, about the mass centre of these and the axes of the world."""
    damping: Damping = Damping()
    """None by default."""
    coupling: Coupling = Coupling()
    """Of the two layers of a rod; rarely needs to be changed."""
    solver: Solver = Solver()
    """Model, time step and accuracy."""
    output: Output = Output()
    """What logs and topics hold how often."""

    @property
    def friction(self) -> Friction | None:
        """Law of friction of all that touches; None without contact, or where nothing rubs."""
        return self.contact.friction if self.contact is not None else None

    def __repr__(self) -> str:
        counts = f"{len(self.rods)} rods, {len(self.bodies)} bodies, {len(self.obstacles)} obstacles"
        channels = ", ".join(self.stimuli) or "none"
        return f"Scene({self.name}: {counts}, {self.duration:g} s; channels: {shortened(channels)})"

    __str__ = __repr__

    def _faults(self) -> list[Fault]:
        return checks.faults_of_scene(self)
