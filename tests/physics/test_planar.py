"""Dimension 2: the same mechanics as in space, where all stays in a plane."""

import numpy as np
import pytest
from sample_scenes import GROUND, ball, contact, fixed, layer, rod, scene

from bilayer_core import Simulator
from bilayer_core.errors import InputError, SceneError
from bilayer_core.integrate.integrators import INTEGRATORS
from bilayer_core.integrate.stages import predict, start_point
from bilayer_core.integrate.stepper import Stepper
from bilayer_core.model.build import build_model
from bilayer_core.model.plan import MODELS, best_dimension, make_plan
from bilayer_core.model.state import initial_state
from bilayer_core.scene.bundled import bundled_scenes
from bilayer_core.scene.loader import load_scene
from bilayer_core.solve.configuration import Configuration

GRADIENT_LIMIT = 1e-7  # of the largest entry
HESSIAN_LIMIT = 1e-6
SAME = 1e-8
"""Of the length of a rod: difference of positions in two and in three dimensions before contact."""
AHEAD = {"y = 0": (1.0, 0.0, 0.0), "oblique": (0.8, 0.6, 0.0)}
FREE = {"type": "free", "mass": 1e-3, "inertia": [2e-8, 3e-8, 4e-8]}
HUBS = {"prescribed": {"type": "prescribed"}, "free": FREE}


def in_plane(ahead, along, up):
    """A vector of the vertical plane through the origin that holds `ahead`."""
    return [along * ahead[0], along * ahead[1], up]


def turn_to(ahead):
    """Rotation about z that takes x to `ahead`."""
    return [0, 0, float(np.arctan2(ahead[1], ahead[0]))]


def everything(ahead, hub="prescribed", stations=6):
    """Two bilayer arms of a hub over a ball on the ground in a vertical plane: every force at work."""
    spacing, across = 1.1e-3, np.cross(ahead, [0, 0, 1])
    active = layer(
        "active", interval=[spacing, spacing * (stations - 2)], eigenstrain={"stimulus": "humidity", "gain": 0.06}
    )
    arm = rod(
        [layer("passive"), active],
        length=spacing * (stations - 1),
        stations=stations,
        name="arm",
        clamp_start="hub",
        pattern={"count": 2},
    )
    arm["path"] |= {"start": in_plane(ahead, 0.002, 0.0425), "direction": list(ahead)}
    point = {"position": [0, 0, -0.0005], "length": 0.01, "offset": 0.0005}
    law = contact(coefficient=0.5, speed_threshold=1e-2)
    law["friction"] |= {"forward": 0.3, "backward": 0.6, "sideways": 0.4}
    jet = {"name": "jet", "rod": "arm", "position": spacing, "force": [1e-3, 2e-3, 0], "frame": "material"}
    return scene(
        [arm],
        gravity=in_plane(ahead, 0.3, -10.0),
        stimuli={"humidity": {"schedule": {"type": "hold", "value": 0.5}}},
        bodies=[
            fixed("hub", (0, 0, 0.0425), rotation=turn_to(ahead), contact_points=[point]) | {"motion": HUBS[hub]},
            ball((0, 0, 0.0209), shell=True),
        ],
        obstacles=[GROUND],
        contact=law,
        damping={"mass": 2.0},
        fluid={"drag_along": 0.3, "drag_across": 1.2, "velocity": in_plane(ahead, 0.1, 0.05), "added_mass": True},
        masses=[{"name": "cargo", "rod": "arm", "position": 2.3 * spacing, "mass": 1e-5}],
        loads=[
            {"name": "tug", "rod": "arm_1", "position": 3.5 * spacing, "force": in_plane(ahead, 2e-3, 3e-3)},
            jet,
            {"name": "crank", "body": "ball", "force": [0, 0, 1e-3], "moment": list(3e-5 * across)},
            {"name": "rotor", "body": "ball", "moment": list(-1e-5 * across), "frame": "material"},
        ],
    )


def touching_rods(ahead, hub="prescribed"):
    """Two ribbons of a hub, one of two layers, and a third rod between them, all nearer than the barrier distance."""
    bodies = [{"name": "hub", "position": [0, 0, 0], "rotation": turn_to(ahead), "motion": HUBS[hub]}]
    arm = rod([layer(), layer("top")], 0.02, 7, name="arm", clamp_start="hub")
    between = rod([layer()], 0.02, 8, name="between")
    below = rod([layer()], 0.015, 5, name="below", clamp_start="hub")
    for part, along, up in ((arm, 0.0, 0.5e-3), (between, -4e-3, -1.9e-3), (below, 0.0, -3.7e-3)):
        part["path"] |= {"start": in_plane(ahead, along, up), "direction": list(ahead)}
    law = contact(coefficient=0.4, speed_threshold=0.1) | {"rods": True}
    return scene([arm, between, below], bodies=bodies, contact=law)


class Problem:
    """A potential at a random state of a plane, as a function of the unknowns that are solved for."""

    def __init__(self, content, h, seed, noise=2e-4, model="two_rod"):
        rng = np.random.default_rng(seed)
        model = self.model = build_model(load_scene(content), model, 2)
        stepper = Stepper(model, INTEGRATORS["implicit_euler"], h, 1e-6, 50, 0)
        axes, normal, solved = model.plane.axes, model.plane.normal, model.solved_layout
        state = initial_state(model)
        free = np.setdiff1d(np.arange(model.node_count), model.attached_node)
        state.position[free] += noise * rng.standard_normal((len(free), 2)) @ axes
        rest = Configuration(model)
        rest.take_state(initial_state(model))
        bent = Configuration(model)
        bent.take_state(state)
        bent.carry_frames(rest, np.zeros(model.edge_count))
        state.director1[:] = bent.director1[: model.edge_count]
        state.velocity[free] = 0.05 * rng.standard_normal((len(free), 2)) @ axes
        for body in model.bodies.body_of_free:
            state.body_velocity[body] = 0.02 * rng.standard_normal(2) @ axes
            state.body_angular_velocity[body] = rng.standard_normal() * normal
        start = Configuration(model)
        start.take_state(state)
        drive = stepper.rest_strains_of(np.full(len(model.law_gain), 0.7)), stepper.load_factor(0.03)
        origin = start_point(model, state, start)
        origin.position[:] += 1e-5 * rng.standard_normal((model.node_count, 2)) @ axes
        context = predict(model, origin, start, np.zeros(model.edge_count), h, *drive, momentum_length=1.3 * h)
        self.potential = stepper.potential
        self.potential.start_step(context)
        size, bodies = model.layout.size, 6 * model.free_count
        self.basis = np.zeros((size + bodies, solved.size + model.bodies.freedom.shape[1]))
        for c in range(2):
            for d in range(3):
                self.basis[model.layout.node + d, solved.node + c] = axes[c, d]
        self.basis[size:, solved.size :] = model.bodies.freedom
        held = (solved.attached[:, None] + np.arange(2)).ravel()
        self.free = np.setdiff1d(np.arange(self.basis.shape[1]), held)
        turns = np.abs(self.basis.reshape(len(self.basis), -1)[size:].reshape(-1, 6, self.basis.shape[1])[:, 3:])
        self.scale = np.where(turns.sum(axis=(0, 1)) > 0.0, 50.0, 1.0)  # angles, of a body of 2 cm
        self.at, self.trial = Configuration(model), Configuration(model)
        step = np.zeros(self.basis.shape[1])
        step[self.free] = 3e-5 * rng.standard_normal(len(self.free))
        self._move(start, 0.5 * step, self.at)
        self.potential.follow(self.at)
        self._move(start, step, self.at)

    def _move(self, base, vector, out):
        step, size = self.basis @ (vector * self.scale), self.model.layout.size
        out.set_moved(base, step[:size], step[size:].reshape(-1, 6), 1.0)

    def _gradient(self):
        full = np.concatenate([self.potential.gradient, self.potential.body_gradient.ravel()])
        return self.scale * (full @ self.basis)

    def value(self, vector):
        self._move(self.at, vector, self.trial)
        energy = self.potential.evaluate(self.trial, False)
        return energy, self._gradient()

    def derivatives(self):
        potential, size, freedom = self.potential, self.model.solved_layout.size, self.model.bodies.freedom
        potential.evaluate(self.at, True)
        gradient = self._gradient()
        band, border, corner = potential.matrix.assemble(
            potential.diagonal_factor(), self.at, potential.edge_gradient, potential.attached_gradient
        )
        hessian = np.zeros((len(self.scale), len(self.scale)))
        for j in range(size):
            for r in range(min(band.shape[1] - 1, size - 1 - j) + 1):
                hessian[j + r, j] = hessian[j, j + r] = band[j, r]
        hessian[:size, size:] = border @ freedom
        hessian[size:, :size] = hessian[:size, size:].T
        hessian[size:, size:] = freedom.T @ corner @ freedom
        hessian *= np.outer(self.scale, self.scale)
        return gradient[self.free], hessian[np.ix_(self.free, self.free)]

    def differences(self, h):
        gradient, rows = [], []
        for i in self.free:
            unit = np.zeros(len(self.scale))
            unit[i] = h
            near, far = (
                [a - b for a, b in zip(self.value(k * unit), self.value(-k * unit), strict=True)] for k in (1, 2)
            )
            gradient.append((8 * near[0] - far[0]) / (12 * h))
            rows.append(((8 * near[1] - far[1]) / (12 * h))[self.free])
        return np.array(gradient), np.array(rows)


def check(problem):
    gradient, hessian = problem.derivatives()
    gradient_errors, hessian_errors = [], []
    for h in (3e-8, 1e-7, 3e-7, 1e-6):
        by_energy, by_gradient = problem.differences(h)
        gradient_errors.append(np.abs(gradient - by_energy).max() / np.abs(gradient).max())
        hessian_errors.append(np.abs(hessian - by_gradient).max() / np.abs(hessian).max())
    assert min(gradient_errors) < GRADIENT_LIMIT
    assert min(hessian_errors) < HESSIAN_LIMIT
    assert np.abs(hessian - hessian.T).max() < 1e-14 * np.abs(hessian).max()


def elasticity_alone(content):
    """The scene without what else acts, and without the ball."""
    bodies = [content["bodies"][0] | {"contact_points": []}]
    none = {"gravity": [0, 0, 0], "damping": {}, "fluid": None, "obstacles": [], "contact": None, "loads": []}
    return content | none | {"bodies": bodies}


@pytest.mark.parametrize("hub", HUBS)
@pytest.mark.parametrize("ahead", AHEAD)
@pytest.mark.parametrize("model", MODELS)
def test_derivatives_of_elasticity_agree_with_differences(model, ahead, hub):
    problem = Problem(elasticity_alone(everything(AHEAD[ahead], hub)), 1e4, seed=1, model=model)
    check(problem)
    assert len(problem.model.coupled_joint) == (6 if model == "laminate" else 0)
    terms = ("stretching", "bending", "bond") if model == "two_rod" else ("stretching", "bending")
    assert problem.potential.terms.keys() >= set(terms)
    assert all(problem.potential.terms[term] > 0.0 for term in terms)


@pytest.mark.parametrize("hub", HUBS)
@pytest.mark.parametrize("ahead", AHEAD)
@pytest.mark.parametrize("model", MODELS)
def test_derivatives_of_all_forces_agree_with_differences(model, ahead, hub):
    problem = Problem(everything(AHEAD[ahead], hub), 1e-3, seed=3, model=model)
    check(problem)
    assert all(problem.potential.terms[term] > 0.0 for term in ("barrier", "friction", "drag", "damping"))


@pytest.mark.parametrize("hub", HUBS)
@pytest.mark.parametrize("ahead", AHEAD)
def test_the_newton_matrix_of_rods_that_touch_is_the_derivative_of_the_gradient(ahead, hub):
    problem = Problem(touching_rods(AHEAD[ahead], hub), 1e-5, seed=4, noise=2e-5)
    potential, basis, free, rng = problem.potential, problem.basis, problem.free, np.random.default_rng(5)
    size = problem.model.layout.size
    potential.evaluate(problem.at, True)
    assert potential.factorise(problem.at)
    assert (potential.matrix.shift, potential.matrix.simplified) == (0.0, 0)
    assert all(potential.terms[term] > 0.0 for term in ("rod barrier", "rod friction"))
    touching = potential.matrix.rods.contacts.node[: potential.matrix.rods.contacts.count]
    assert np.isin(touching, problem.model.attached_node).any()
    for _ in range(3):
        load = np.zeros(len(problem.scale))
        load[free] = rng.standard_normal(len(free)) / problem.scale[free]
        full = basis @ load
        step = np.concatenate(
            [p.ravel() for p in potential.matrix.newton_step(full[:size], full[size:].reshape(-1, 6))]
        )
        step = basis.T @ step / problem.scale
        assert np.abs(np.delete(step, free)).max() == 0.0
        errors = []
        for h in (1e-8, 3e-8, 1e-7):
            unit = step * h / np.abs(step).max()
            near, far = (problem.value(k * unit)[1] - problem.value(-k * unit)[1] for k in (1, 2))
            change = (8 * near - far) / 12 * np.abs(step).max() / h
            wanted = -load * problem.scale
            errors.append(np.abs(change - wanted)[free].max() / np.abs(wanted).max())
        assert min(errors) < HESSIAN_LIMIT


def pair(content, integrator="implicit_euler", dt=1e-3, **more):
    """The same scene in three and in two dimensions, solved to rounding."""
    if isinstance(content, dict):
        content = content | {"solver": {"newton_tolerance": 1e-10}}
    config = load_scene(content)
    return [Simulator(config, dimension=d, integrator=integrator, dt=dt, **more) for d in (3, 2)]


def difference(space, plane):
    """Largest difference of positions of nodes and bodies, over the longest rod."""
    apart = np.abs(space.positions - plane.positions).max()
    for name, body in space.bodies.items():
        apart = max(apart, np.abs(body.position - plane.bodies[name].position).max())
        apart = max(apart, 0.02 * np.abs(body.quaternion - plane.bodies[name].quaternion).max())
    return apart / max(rod.path.length for rod in space.scene.rods)


def mechanism(ahead):
    """A bilayer on a mount that moves and turns, a free body at its end, and a rod on that, in a fluid, under loads."""
    across = np.cross(ahead, [0, 0, 1])
    active = layer("active", interval=[0.01, 0.05], eigenstrain={"stimulus": "light", "gain": 0.03})
    arm = rod([layer("passive"), active], 0.06, 13, name="arm", clamp_start="mount", clamp_end="wrist")
    arm["path"] |= {"direction": list(ahead)}
    hand = rod([layer(thickness=0.8e-3)], 0.03, 9, name="hand", clamp_start="wrist")
    hand["path"] |= {"start": in_plane(ahead, 0.06, 0), "direction": [0, 0, -1]}
    hand["normal"] = list(ahead)
    motion = {"type": "prescribed", "times": [0, 0.05], "displacements": [[0, 0, 0], in_plane(ahead, 0.01, 0.02)]}
    motion["rotations"] = [[0, 0, 0], list(0.4 * across)]
    wrist = {"name": "wrist", "position": in_plane(ahead, 0.06, 0), "rotation": turn_to(ahead), "motion": FREE}
    tug = {"name": "tug", "rod": "hand", "position": 0.02, "force": in_plane(ahead, 0.02, 0.01)}
    jet = {"name": "jet", "rod": "arm", "position": 0.033, "force": [0.01, 0.02, 0], "frame": "material"}
    crank = {"name": "crank", "body": "wrist", "moment": list(2e-4 * across)}
    return scene(
        [arm, hand],
        stimuli={"light": {"schedule": {"type": "ramp", "start": 0.01, "end": 0.02, "from": 0, "to": 1}}},
        bodies=[{"name": "mount", "position": [0, 0, 0], "motion": motion}, wrist],
        masses=[{"name": "cargo", "rod": "arm", "position": 0.02, "mass": 1e-4}],
        loads=[tug, jet, crank],
        fluid={"drag_along": 0.3, "drag_across": 1.2, "velocity": in_plane(ahead, 0.1, 0.05), "added_mass": True},
        damping={"mass": 1.0},
        gravity=in_plane(ahead, 0.5, -9.81),
    )


def snap():
    """A free bilayer whose top layer grows within 10 ms."""
    active = layer("active", eigenstrain={"stimulus": "light", "gain": 0.02})
    step = {"type": "table", "times": [0, 0.005, 0.015], "values": [0, 0, 1]}
    return scene([rod([layer(), active])], stimuli={"light": {"schedule": step}})


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("content", [mechanism(AHEAD["y = 0"]), mechanism(AHEAD["oblique"]), snap()])
def test_the_trajectory_before_contact_is_that_in_space(content, model, integrator):
    space, plane = pair(content, integrator, model=model)
    for simulator in (space, plane):
        simulator.run(0.04)
    moved = np.abs(space.positions - space.model.start_position).max()
    assert moved > 1e-3
    assert difference(space, plane) < SAME
    assert plane.model.unknowns < 0.55 * space.model.unknowns


@pytest.mark.parametrize("model", MODELS)
def test_a_cycle_of_the_inchworm_is_that_in_space(model):
    space, plane = pair("crawling_inchworm", model=model)
    for simulator in (space, plane):
        simulator.run(2.4)
    stride = plane.com[0] - plane.start_com[0]
    assert stride > 1e-3
    assert difference(space, plane) < SAME


@pytest.mark.parametrize("ahead", AHEAD)
def test_with_contact_and_friction_of_bodies_all_moves_as_in_space(ahead):
    space, plane = pair(everything(AHEAD[ahead], "free"))
    for simulator in (space, plane):
        simulator.run(0.03)
    assert plane.energy()["barrier"] > 0.0
    assert np.abs(plane.bodies["ball"].quaternion[:2]).max() > 1e-4  # it turns
    assert difference(space, plane) < SAME


def test_an_equilibrium_is_that_in_space():
    content = mechanism(AHEAD["oblique"]) | {"fluid": None}
    space, plane = pair(content)
    for simulator in (space, plane):
        simulator.set_stimulus("light", 0.8)
        assert simulator.solve_static().stable
    assert np.abs(plane.positions - plane.model.start_position).max() > 1e-3
    assert difference(space, plane) < SAME


def strut(width, thickness):
    """A strip that stands on its clamped end, under a load on top."""
    column = rod([layer(thickness=thickness)], 0.1, 21, width=width, clamp_start="wall")
    column["path"] |= {"direction": [0, 0, 1]}
    column["normal"] = [1, 0, 0]
    load = {"name": "weight", "rod": "rod", "position": 0.1, "force": [0, 0, -0.02]}
    return scene([column], bodies=[fixed()], loads=[load])


def test_stability_in_two_dimensions_is_that_against_disturbances_in_the_plane():
    # critical load π² E I/(4 L²): 8 mN about the weak axis of 4 mm × 1 mm, 130 mN about the other
    for width, thickness, unstable in ((4e-3, 1e-3, (1, 1)), (1e-3, 4e-3, (1, 0))):
        found = tuple(s.solve_static().unstable_directions for s in pair(strut(width, thickness)))
        assert found == unstable


def test_a_saved_state_continues_bit_for_bit():
    content = everything(AHEAD["oblique"], "free")
    first, second = (Simulator(load_scene(content), dimension=2, integrator="tr_bdf2") for _ in range(2))
    first.run(0.01)
    snapshot = first.save_state()
    first.run(0.01)
    second.load_state(snapshot)
    second.run(0.01)
    assert np.array_equal(first.save_state(), second.save_state(), equal_nan=True)


def test_a_state_out_of_the_plane_is_refused():
    space, plane = pair(snap())
    state = space.save_state()
    plane.load_state(state)
    snapshot = plane.save_state()
    space._state.velocity[3, 1] = 1e-3
    with pytest.raises(InputError, match="velocity leaves the plane"):
        plane.load_state(space.save_state())
    assert np.array_equal(plane.save_state(), snapshot, equal_nan=True)


BUNDLED = {
    "bending": (2, "all stays in the plane y = 0"),
    "cantilever": (2, "all stays in the plane y = 0"),
    "crawling_dual_leg": (3, "rods.hind_foot leaves the plane y = 0"),
    "crawling_inchworm": (2, "all stays in the plane y = 0"),
    "gripping": (3, "rods.arm_1 leaves the plane y = 0"),
    "gripping_friction": (3, "rods.arm_1 leaves the plane y = 0"),
    "helix": (3, "rods.strip.layers.helical.natural_twist turns the rod out of the plane y = 0"),
    "jumping": (2, "all stays in the plane y = 0"),
    "swimming": (3, "rods.arm_1 leaves the plane y = 0"),
}


def test_of_every_bundled_scene_is_said_whether_it_stays_in_a_plane():
    assert {name: best_dimension(load_scene(name)) for name in bundled_scenes()} == BUNDLED


def with_body(**body):
    return {"bodies": [{"name": "thing", "position": [0, 0, -0.05], "motion": {"type": "prescribed"}, **body}]}


def with_load(**load):
    return {"loads": [{"name": "tug", "rod": "rod", "position": 0.05, **load}]}


CUBE = {"shape": "box", "size": [0.01, 0.01, 0.01]}
LEAVES = {
    "gravity leaves": {"gravity": [0, 1, -10]},
    "fluid.velocity leaves": {"fluid": {"drag_along": 1, "drag_across": 1, "velocity": [0, 1, 0]}},
    "loads.tug.force leaves": with_load(force=[1, 1e-3, 0]),
    "loads.tug.force leaves the": with_load(force=[1, 0, 1e-3], frame="material"),
    "bodies.thing.motion.displacements leaves": with_body(
        motion={"type": "prescribed", "times": [0, 1], "displacements": [[0, 0, 0], [0, 1, 0]]}
    ),
    "bodies.thing.motion.rotations leaves": with_body(
        motion={"type": "prescribed", "times": [0, 1], "rotations": [[0, 0, 0], [1, 0, 0]]}
    ),
    "bodies.thing.motion.axis leaves": with_body(motion={"type": "guided", "axis": [0, 1, 1], "mass": 1}),
    "bodies.thing.position leaves": with_body(motion=FREE, position=[0, 0.01, -0.05]),
    "bodies.thing.motion.velocity leaves": with_body(motion=FREE | {"velocity": [0, 1, 0]}),
    "bodies.thing.motion.angular_velocity leaves": with_body(motion=FREE | {"angular_velocity": [0, 1, 1]}),
    "bodies.thing.motion.inertia, of which no": with_body(motion=FREE, rotation=[0.3, 0, 0]),
    "points by which bodies.thing touches are not": with_body(
        motion=FREE, contact_points=[{"position": [0, 1e-3, 0], "length": 0.01, "offset": 1e-3}]
    ),
    "bodies.thing.surface is not": with_body(surface=CUBE, rotation=[0.3, 0, 0]),
    "obstacles.hill is not": {
        "obstacles": [{"name": "hill", "type": "plane", "point": [0, 0, -1], "normal": [0, 1, 3]}]
    },
    "obstacles.rock is not": {
        "obstacles": [{"name": "rock", "type": "sphere", "position": [0, 1e-3, -0.1], "radius": 0.05}]
    },
    "obstacles.log is not": {
        "obstacles": [{"name": "log", "type": "cylinder", "position": [0, 0.04, -1], "axis": [0, 1, 0]} | {
            "radius": 0.05, "length": 0.05}]
    },
}  # fmt: skip


@pytest.mark.parametrize("message", LEAVES)
def test_what_leaves_the_plane_is_named(message):
    content = scene([rod([layer()])], contact=contact(coefficient=0.3)) | LEAVES[message]
    with pytest.raises(SceneError, match=f"sample: solver.dimension: found 2, but .*{message}.* plane y = 0; for this scene"):
        make_plan(load_scene(content), dimension=2)
    assert make_plan(load_scene(content)).dimension == 3


STAYS = {
    "a rail": with_body(motion={"type": "guided", "axis": [1, 0, 1], "mass": 1}),
    "a turned cube": with_body(motion=FREE, surface=CUBE, rotation=[0, 0.3, 0]),
    "a point beside the plane on a body that does not turn": with_body(
        contact_points=[{"position": [0, 1e-3, 0], "length": 0.01, "offset": 1e-3}]
    ),
    "two feet, left and right": with_body(
        motion=FREE,
        contact_points=[{"position": [0, y, 0], "length": 0.01, "offset": 1e-3} for y in (-1e-3, 1e-3)],
    ),
    "a slope": {"obstacles": [{"name": "hill", "type": "plane", "point": [0, 5, -1], "normal": [1, 0, 3]}]},
    "a log that runs on": {
        "obstacles": [{"name": "log", "type": "cylinder", "position": [0, 0.04, -1], "axis": [0, 1, 0]} | {
            "radius": 0.05, "length": 0.1}]
    },
    "a pole": {
        "obstacles": [
            {"name": "pole", "type": "cylinder", "position": [0, 0, -1], "axis": [1, 0, 1], "radius": 0.05, "length": 1}
        ]
    },
}  # fmt: skip


@pytest.mark.parametrize("what", STAYS)
def test_what_stays_in_the_plane_is_allowed(what):
    content = scene([rod([layer()])], contact=contact(coefficient=0.3)) | STAYS[what]
    plan = make_plan(load_scene(content), dimension=2)
    assert plan.dimension == 2
    assert plan.reasons["dimension"] == "asked for: all stays in the plane y = 0"
    assert plan.terms["twisting"] == "skipped: nothing twists in a plane"


def test_a_node_has_two_unknowns_and_couples_with_few_others():
    for layers, half_bandwidth in (([layer()], 5), ([layer(), layer("top")], 9)):
        model = Simulator(load_scene(scene([rod(layers)])), dimension=2).model
        assert model.unknowns == 2 * model.node_count
        assert model.solved_layout.half_bandwidth == half_bandwidth
