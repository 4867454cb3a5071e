"""The state of a run: everything that the next step depends on, and its flat form for logs and restarts."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, fields

import numpy as np

from bilayer_core.errors import InputError
from bilayer_core.kinematics.frame_strains import cross
from bilayer_core.model.fingerprint import FREE, difference
from bilayer_core.model.lit_elements import light_of, part_seen
from bilayer_core.model.model import Model
from bilayer_core.model.override import no_overrides
from bilayer_core.model.records.parts import Drives
from bilayer_core.model.set_friction import none_given
from bilayer_core.model.sizes import sizes_of
from bilayer_core.model.start_motion import set_in_motion

Array = np.ndarray
POSE_GOAL = 26
"""Values that say how a body goes to a pose."""
NOT_KNOWN = -1.0
"""Of a contact point, whether it is touched."""
LAST_STEP = 1e-3
"""Length of a step that ends at time 0, for the value of a schedule before a jump there [s]."""


@dataclass
class State:
    """Quantities that are carried from step to step.

    `flat` and `set_flat` copy it bit for bit.

    Attributes
    ----------
    values : Array
        All parts in order, of which each is a view.
    places : dict
        Where each part begins and ends in `values`, and its shape.
    """

    time: Array  # simulated time [s], shape (1,); with fixed steps their number times dt, so that it does not drift
    step: Array  # steps done, without parts of fixed ones, shape (1,)
    next_step: Array  # length of the next step [s], or of the next part of a fixed one; 0 at the start, shape (1,)
    last_error: Array  # error of the last adaptive step as a part of the tolerance, 0 if there is none, shape (1,)
    position: Array  # of nodes [m], shape (n_node, 3)
    position_low: Array  # what rounding cut off `position` [m], shape (n_node, 3); see `kinematics.compensated`
    velocity: Array  # [m/s], shape (n_node, 3)
    director1: Array  # material director m1 of edges, unit, shape (n_edge, 3)
    spin: Array  # rate of edges about their tangent [rad/s], shape (n_edge,)
    fluid_excess: Array  # fluid momentum less that of `velocity`, of held nodes and as in `Fluid.momentum` [N s]
    twist: Array  # of joints when forces were last evaluated [rad]: tells whole turns apart, shape (n_joint,)
    body_position: Array  # [m], shape (n_body, 3)
    body_position_low: Array  # what rounding cut off `body_position` [m], shape (n_body, 3)
    body_rotation: Array  # shape (n_body, 3, 3)
    body_velocity: Array  # [m/s], shape (n_body, 3)
    body_angular_velocity: Array  # [rad/s], shape (n_body, 3)
    memory: Array  # what forces carry from step to step (`forces.force_register`), shape (n_memory,)
    has_history: (
        Array  # 1 if the accelerations and forces below are those of the last step, shape (1,), or (0,) without a use
    )
    touched: Array  # 1 for nodes and points of bodies that something pushed at the end of the last step, or `NOT_KNOWN`
    acceleration: Array  # of nodes [m/s²], shape (n_node, 3); like the others empty if the integrator has no history
    spin_acceleration: Array  # of edges [rad/s²], shape (n_edge,)
    body_acceleration: Array  # of free bodies [m/s²], shape (n_free, 3)
    body_moment: Array  # on free bodies [N m], shape (n_free, 3)
    fluid_force: Array  # rate of the momentum of the fluid, as in `Fluid.momentum` [N], with added mass
    strain_rate: Array  # of viscous elements [1/s], gaps of impacts, mechanisms [m/s, rad/s], kept directors [1/s]
    strain_acceleration: Array  # likewise [1/s²]; empty if the integrator has no history
    account: Array  # of energy; see `engine.energy_account`, shape (14,)
    law_force: Array  # −∂V/∂η of each eigenstrain law when the account was last written [J], shape (n_law,)
    light_rate: Array  # of m1·l and V of each lit element over the last step [1/s], shape (n_lit, 2)
    transduction: Array  # stimulus that each mode of a material has reached, shape (n_mode,)
    conditions: Array  # number of all that a state may be taken into another scene for, shape (1,)
    seal: Array  # checksum of a flat state, 0 before it is one, shape (1,)
    override: Array  # what is set from outside of channels, then of loads (`model.override`), shape (n, 5)
    friction: Array  # what is set from outside of its coefficients (`model.set_friction`), shape (4,)
    pose_goal: Array  # of controlled bodies; see `simulation.poses`, shape (n_controlled, 26), zeros where none acts
    fingerprint: Array  # of the scene it belongs to, shape (n_part,), or (0,) for a state that is never saved

    def __post_init__(self):
        """Copy the parts into one piece."""
        parts = {name: getattr(self, name) for name in PARTS}
        self.values = np.concatenate([part.ravel() for part in parts.values()])
        ends = np.cumsum([part.size for part in parts.values()]).tolist()
        self.places = {
            name: (end - part.size, end, part.shape) for (name, part), end in zip(parts.items(), ends, strict=True)
        }
        for name, (begin, end, shape) in self.places.items():
            setattr(self, name, self.values[begin:end].reshape(shape))

    def copy(self) -> State:
        """Return an independent state with the same values."""
        copied = object.__new__(State)
        copied.values, copied.places = self.values.copy(), self.places
        for name, (begin, end, shape) in self.places.items():
            setattr(copied, name, copied.values[begin:end].reshape(shape))
        return copied

    def become(self, other: State) -> None:
        """Take all of another state, which may be of another model, with arrays of other sizes."""
        vars(self).update(vars(other.copy()))

    def take(self, other: State) -> None:
        """Take all values of another state of the same model."""
        self.values[:] = other.values

    def flat(self) -> Array:
        """Return all parts in order, as one array of float64, with a seal: what has one is as a run left it."""
        return sealed(self.values, self.places["seal"][0])

    def layout(self) -> tuple[tuple[str, tuple[int, ...]], ...]:
        """Return the name and shape of each part of `flat`."""
        return tuple((name, shape) for name, (_, _, shape) in self.places.items())

    def set_flat(self, flat: Array) -> bool:
        """Take all parts from a flat array; whether it is as `flat` made it, under the same conditions.

        Raises
        ------
        InputError
            If it belongs to another scene, or its length or a value does not fit this model; nothing is changed then.
        """
        flat = np.array(flat, dtype=float)
        size, marks = self.values.size, self.fingerprint.size
        differs = ""
        if marks and flat.ndim == 1 and flat.size >= marks:
            differs = difference(flat[-marks:], self.fingerprint)
        if flat.shape != (size,):
            why = f"; it is of another scene, with other {differs}" if differs else ""
            raise InputError(f"saved state: has {flat.size} values, this scene's state has {size}{why}")
        if differs:
            raise InputError(f"saved state: is of another scene, with other {differs}; allowed to differ are {FREE}")
        finite = np.isfinite(flat)
        finite[slice(*self.places["override"][:2])] = True  # NaN is the scene's own stimulus
        bad = np.flatnonzero(~finite)
        if bad.size:
            raise InputError(f"saved state: value {bad[0]} is {flat[bad[0]]}, must be finite")
        place, conditions = self.places["seal"][0], self.conditions.copy()
        seal, flat[place] = flat[place], 0.0
        self.values[:] = flat
        untouched = seal == zlib.crc32(flat) and np.array_equal(self.conditions, conditions)
        self.conditions[:] = conditions
        return untouched


def sealed(values: Array, place: int) -> Array:
    """Return a copy of a flat state with a seal, its checksum, at `place`."""
    flat = values.copy()
    flat[place] = zlib.crc32(values)
    return flat


def director_rates(model: Model, state: State) -> Array:
    """Return ṁ1 of raised edges [1/s], shape (n_raised, 3)."""
    return _kept_rates(model, state)[model.raised.slot]


def turn_directors(model: Model, state: State) -> None:
    """Let directors of raised edges turn as the velocities of nodes and the spins of a state say.

    They have velocities of their own (`forces.raised`), which a state whose velocities someone sets has to be given.
    """
    _kept_rates(model, state)[model.raised.slot] = turning(model, state)[model.raised.edge]


def turning(model: Model, state: State) -> Array:
    """Return ṁ1 of edges that turn as the velocities of nodes and their spins say [1/s], shape (n_edge, 3)."""
    first = model.rods.edge_node
    vector, director = state.position[first + 1] - state.position[first], state.director1
    length = np.linalg.norm(vector, axis=1, keepdims=True)
    lengthened = state.velocity[first + 1] - state.velocity[first]
    tangent, leaning = vector / length, np.einsum("ki,ki->k", director, lengthened)[:, None] / length
    return state.spin[:, None] * cross(tangent, director) - leaning * tangent


def _kept_rates(model: Model, state: State) -> Array:
    """Return the rates of kept directors [1/s], a view of shape (n_kept, 3)."""
    return state.strain_rate[state.strain_rate.size - 3 * model.kept_directors :].reshape(-1, 3)


PARTS = tuple(part.name for part in fields(State))
"""Names of the parts of a state, in order."""
OUT_OF_PLANE = 1e-9
"""Component along the normal of a plane, of the largest there is, that is rounding."""


def refuse_out_of_plane(model: Model, state: State) -> None:
    """Raise InputError if a state is none of a model of dimension 2."""
    plane = model.plane
    if not plane.exists:
        return
    free, turned = model.free_bodies.body_of_free, state.body_rotation @ model.bodies.start_rotation.transpose(0, 2, 1)
    spins = state.body_angular_velocity
    out_of_plane = {
        "position": (state.position - model.start_position) @ plane.normal,
        "velocity": state.velocity @ plane.normal,
        "director1": state.director1 @ plane.normal,
        "spin": state.spin,
        "body_position": (state.body_position - model.bodies.start_position) @ plane.normal,
        "body_velocity": state.body_velocity @ plane.normal,
        "body_rotation": turned[free] @ plane.normal - plane.normal,
        "body_angular_velocity": spins - np.outer(spins @ plane.normal, plane.normal),
    }
    for name, component in out_of_plane.items():
        largest = np.abs(component).max(initial=0.0)
        if largest > OUT_OF_PLANE * max(1.0, np.abs(getattr(state, name)).max(initial=0.0)):
            raise InputError(
                f"saved state: {name} leaves the plane of the scene by {largest:.3g}; allowed with dimension 3"
            )


def _settled(model: Model, stimulus: Array) -> Array:
    """Return the value that each mode has at the start if channels have had theirs for long, shape (n_mode,)."""
    light, place = light_of(model), (model.start_position, model.start_director1)
    seen = part_seen(light, *place, model.bodies.start_position, model.bodies.start_rotation) if light.exists else 1.0
    return reached_at_rest(model.drives, stimulus, seen)


def reached_at_rest(drives: Drives, stimulus: Array, seen: Array | float) -> Array:
    """Return what each mode reaches of the stimuli of channels, of which fields see a part, shape (n_mode,)."""
    return np.repeat(stimulus[drives.field_channel] * seen, np.diff(drives.field_first))


def initial_state(
    model: Model,
    with_history: bool = False,
    fingerprint: Array | None = None,
    memory: int = 0,
    conditions: float = 0.0,
) -> State:
    """Return the state at time 0: the scene's shape, with the velocities of `model.start_motion`.

    Materials have reached the stimulus from before time 0: a schedule that jumps there acts from the first step on.
    `with_history` makes arrays for what some integrators keep from step to step, `memory` for so many values of forces;
    `fingerprint` says what the state belongs to, `conditions` is a number of all else (`model.fingerprint`).
    """
    bodies, sizes = model.bodies, sizes_of(model)
    in_fluid = sizes["wet"] if model.fluid.exists else 0
    strain_rate = np.zeros(sizes["strain"])
    channels = list(model.scene.stimuli.values())
    before = np.array([channel.schedule.value_before(0.0, LAST_STEP) for channel in channels])
    state = State(
        time=np.zeros(1),
        step=np.zeros(1),
        next_step=np.zeros(1),
        last_error=np.zeros(1),
        position=model.start_position.copy(),
        position_low=np.zeros((model.node_count, 3)),
        velocity=np.zeros((model.node_count, 3)),
        director1=model.start_director1.copy(),
        spin=np.zeros(sizes["edge"]),
        fluid_excess=np.zeros((in_fluid, 3)),
        twist=np.zeros(sizes["joint"]),
        body_position=bodies.start_position.copy(),
        body_position_low=np.zeros_like(bodies.start_position),
        body_rotation=bodies.start_rotation.copy(),
        body_velocity=np.zeros_like(bodies.start_position),
        body_angular_velocity=np.zeros_like(bodies.start_position),
        memory=np.zeros(memory),
        has_history=np.zeros(int(with_history)),
        touched=np.full(with_history * (sizes["node"] + sizes["point"]), NOT_KNOWN),
        acceleration=np.zeros((with_history * model.node_count, 3)),
        spin_acceleration=np.zeros(with_history * sizes["edge"]),
        body_acceleration=np.zeros((with_history * model.free_count, 3)),
        body_moment=np.zeros((with_history * model.free_count, 3)),
        fluid_force=np.zeros((with_history * in_fluid, 3)),
        strain_rate=strain_rate,
        strain_acceleration=np.zeros(with_history * len(strain_rate)),
        account=np.zeros(14),
        law_force=np.zeros(sizes["law"]),
        light_rate=np.zeros((sizes["lit"], 2)),
        transduction=_settled(model, before) if len(channels) else np.zeros(0),
        conditions=np.array([conditions]),
        seal=np.zeros(1),
        override=no_overrides(len(channels) + len(model.scene.loads)),
        friction=none_given(),
        pose_goal=np.zeros((len(bodies.controlled), POSE_GOAL)),
        fingerprint=np.zeros(0) if fingerprint is None else fingerprint.copy(),
    )
    set_in_motion(model, state)
    turn_directors(model, state)
    return state
