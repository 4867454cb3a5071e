"""Derivatives of runs against differences of runs with the same steps."""

import warnings

import numpy as np
import pytest

from bilayer_core import Simulator, load_scene
from bilayer_core.errors import InputError
from bilayer_core.simulation.gradients.course import Course
from bilayer_core.verification.validate.gradients import TIGHT, differences_of_runs

HANGING = {"gravity": [0, 0, -9.81], "stimuli.swelling.schedule.to": 0.8}
ACTIVE = "rods.strip.layers.active"
GAIN, THICKNESS, LENGTH = f"{ACTIVE}.eigenstrain.gain", f"{ACTIVE}.thickness", "rods.strip.path.length"
MODULUS, DENSITY, LAG = (
    "materials.active.youngs_modulus",
    "materials.active.density",
    f"{ACTIVE}.eigenstrain.time_constant",
)
LEVEL, TIME, VISCOSITY = (
    "stimuli.swelling.schedule.to",
    "stimuli.swelling.schedule.end",
    "materials.active.retardation_time",
)
POST = {"name": "post", "type": "sphere", "radius": 0.005, "position": [0.03, 0, -0.0068]}
ON_A_POST = {
    "gravity": [0, 0, -9.81],
    LEVEL: 0.1,
    "obstacles": [POST],
    "contact": {"barrier_distance": 2e-4, "stiffness": "1 MPa"},
}
WATER = {
    "density": 1000.0,
    "velocity": [0, 0.05, 0],
    "drag_along": 0.01,
    "drag_across": 1.0,
    "drag_turning": 1.0,
    "added_mass": False,
}
STILL_WATER, BODY = {"fluid.added_mass": False}, "rods.body.layers.active"
JET = {"name": "jet", "rod": "strip", "position": 0.1, "force": [0, 0.01, 0.02], "frame": "material"}
MOVES = {"bodies.wall.motion": {"type": "prescribed", "times": [0, 0.1], "displacements": [[0, 0, 0], [0, 0, 0.01]]}}
EULER = {"solver.integrator": "implicit_euler", "solver.dt": 0.004, "solver.tolerance": None}
ALPHA, MIDPOINT = {"solver.integrator": "generalised_alpha"}, {"solver.integrator": "implicit_midpoint"}
UNLIKE = {"solver.integrator": "tr_bdf2", THICKNESS: 1.5e-4}
VISCOUS, SPACE = {VISCOSITY: 0.05}, {"solver.dimension": 3}
HEAVY = {"fluid.added_mass": True}
FREE = {"type": "free", "mass": "2 g", "inertia": ["0.3 g cm^2", "0.5 g cm^2", "0.7 g cm^2"]}
TURNING = SPACE | {"bodies.wall.motion": FREE | {"angular_velocity": [3.0, 5.0, -4.0]}}
IN_WATER = SPACE | {"fluid": WATER}
WALL = {"name": "wall", "position": [0, 0, 0], "motion": {"type": "prescribed"}}


def bob(joint):
    """Return what hangs a body by a joint from the end of the strip, which another body holds."""
    tip = {"name": "tip", "position": [0.1, 0, 0], "motion": dict(FREE)}
    hanging = {"name": "bob", "position": [0.11, 0, -0.02], "motion": dict(FREE)}
    pivot = {"name": "pivot", "bodies": ["tip", "bob"], "point": [0.1, 0, 0]} | joint
    of_scene = {"bodies": [WALL, tip, hanging], "joints": [pivot], "rods.strip.clamp_end": "tip"}
    return HANGING | SPACE | of_scene | {"solver.integrator": "sdirk2"}


HINGE = {"type": "hinge", "axis": [0, 1, 0], "turning": {"spring": 0.002, "damping": 1e-5, "friction": 1e-4}}
SLIDING = {"spring": 10.0, "damping": 0.1}
CYLINDER = {"type": "cylinder", "axis": [0.6, 0, 0.8], "turning": {"friction": 1e-4}}
GUIDE = {"type": "guided", "axis": [0, 0, 1], "mass": 1e-3, "sliding": SLIDING}
TURNED = "joints.pivot.turning"
SPINNING = dict(FREE, inertia=[3e-8, 5e-8, 7e-8], angular_velocity=[3.0, 5.0, -4.0])
AT_TIP = bob({"type": "pin"}) | {"joints": []}
"""A body at the end of the strip."""
FLOOR = {"name": "floor", "type": "plane", "point": [0, 0, -0.0056], "normal": [0, 0, 1]}
DAMPED = {"barrier_distance": 2e-4, "stiffness": "10 MPa", "restitution": 0.5}
LANDS = AT_TIP | {
    "bodies": [WALL, AT_TIP["bodies"][1] | {"surface": {"shape": "sphere", "radius": 0.005}}],
    "gravity": [0, 0, -50.0],
    "obstacles": [FLOOR],
    "contact": DAMPED,
}
TWIST = {"name": "twist", "body": "tip", "moment": [0.0005, 0.002, 0.001], "frame": "material"}
LIT = {"stimuli.sun.light": None, "stimuli.sun.schedule.start": 0, "stimuli.sun.schedule.end": 0.05}
SWELLS = LIT | {"rods.ring.layers.outer.eigenstrain": {"stimulus": "sun", "gain": 0.01}}
RING = SWELLS | SPACE | {"gravity": [1.0, 0.5, -9.81]}
WET_RING = RING | MIDPOINT | {"materials.silicone.retardation_time": 0, "fluid": WATER | {"added_mass": True}}
DRIES = {"materials.tissue.retardation_time": 0.01, "rods.valve.layers.outer.interval": [0, 0.06]}
OF_TIP = {"drag": {"coefficient": 0.5, "area": 1e-3}}
DRAGGED = {"bodies": [WALL, AT_TIP["bodies"][1] | OF_TIP], "fluid": WATER | {"added_mass": True}}
SPUN = HANGING | SPACE | MIDPOINT | {"bodies.wall.motion": SPINNING, LAG: 0.05}
ON_A_BODY = {"bodies.wall.motion": SPINNING, "gravity": [0.3, 0, -9.81], "solver.model": "laminate"}
COILED = SPACE | {"bodies.wall.motion": SPINNING, "solver.dt": 0.004, "solver.tolerance": None}
COILED |= {"solver.integrator": "sdirk2"}
SPUN_FAST = HANGING | SPACE | {"bodies.wall.motion": SPINNING | {"angular_velocity": [50.0, 5.0, -4.0]}}
OFF_CURVE = HANGING | {THICKNESS: 1.5e-4, DENSITY: 2000.0}
PUSHED_OFF = OFF_CURVE | SPACE | {"loads": [JET], "solver.integrator": "sdirk2"}
WADES = PUSHED_OFF | {MODULUS: 3e7, "fluid": WATER | {"added_mass": True}}
SHINES = HANGING | {TIME: 0.02, LAG: 0.03, "stimuli.swelling.light": {"from": [0.3, 0, 1], "shadow": False}}
ROOF = {"name": "roof", "position": [0.06, 0, 0.05], "motion": {"type": "prescribed"}}
ROOFED = {"bodies": [WALL, ROOF | {"surface": {"shape": "sphere", "radius": 0.01}}], "contact": ON_A_POST["contact"]}
SHADED = SHINES | SPACE | ROOFED | {"stimuli.swelling.light": {"from": [0.3, 0.1, 1], "shadow": True}}
FIELD = {"stimulus": "swelling", "partition": 0.5, "top": {}}
VARIED = {"passive": 2e-5, "active": {"at": [0, 0.4, 1], "value": [1e-5, 2e-5, 5e-5]}}
SOAKS = HANGING | {"rods.strip.diffusion": FIELD | {"diffusivity": {"passive": 2e-5, "active": 3e-5}}}
VARIES = HANGING | {"rods.strip.diffusion": FIELD | {"diffusivity": VARIED}}
DIFFUSIVITY = "rods.strip.diffusion.diffusivity"
RESTS = {"start": "settle", "stimuli.swelling.schedule.from": 0.3}
THROWN = FREE | {"velocity": [0.05, 0.1, 0.2], "angular_velocity": [3.0, 5.0, -4.0]}
MOVES_OFF = AT_TIP | RESTS | {"bodies": [WALL, AT_TIP["bodies"][1] | {"motion": THROWN}]}
ON_RAIL = {"bodies.wall.motion": GUIDE | {"speed": 0.2}}
PROFILE = {GAIN: {"at": np.linspace(0, 0.1, 8).tolist(), "value": np.linspace(0.02, -0.01, 8).tolist()}}
POINTS = [f"{GAIN}.value.{k}" for k in (0, 3, 5)]
COPIES = {"rods.strip.pattern": {"type": "translation", "step": [0, 0.05, 0], "count": 3, "gains": [1, 0.5, -2]}}
STRIP = {"rods.strip.section": "strip", LEVEL: 0.3}
CASES = {
    "in a plane": ("bending", HANGING, 0.2, [GAIN, LEVEL, TIME, MODULUS, THICKNESS, "gravity.2", LENGTH]),
    "in space": ("bending", HANGING | SPACE, 0.2, [GAIN, MODULUS, LENGTH]),
    "two rods": ("bending", HANGING | {"solver.model": "two_rod"}, 0.1, [GAIN, MODULUS, LENGTH]),
    "implicit euler with fixed steps": ("bending", HANGING | EULER, 0.1, [GAIN, MODULUS, LENGTH]),
    "viscosity": ("bending", HANGING | VISCOUS, 0.2, [GAIN, DENSITY, LENGTH, VISCOSITY]),
    "viscosity in space": ("bending", HANGING | VISCOUS | SPACE, 0.1, [GAIN, VISCOSITY]),
    "generalised alpha": ("bending", HANGING | ALPHA | VISCOUS | SPACE, 0.1, [GAIN, MODULUS, THICKNESS]),
    "layers that become unlike": ("bending", HANGING | UNLIKE, 0.1, [MODULUS, DENSITY]),
    "a lag": ("bending", HANGING | {LAG: 0.05}, 0.2, [GAIN, LEVEL, LAG]),
    "diffusion": (
        "bending",
        SOAKS,
        0.05,
        [LEVEL, THICKNESS, f"{DIFFUSIVITY}.active", "rods.strip.diffusion.partition"],
    ),
    "diffusion that varies": ("bending", VARIES, 0.05, [GAIN, LEVEL, f"{DIFFUSIVITY}.active.value.1"]),
    "light": ("bending", SHINES, 0.05, [LEVEL, LAG, "gravity.2", LENGTH]),
    "a shadow": ("bending", SHADED, 0.04, [GAIN, "gravity.2"]),
    "masses off the curve": ("bending", OFF_CURVE, 0.1, [THICKNESS, LENGTH]),
    "masses off the curve that turn": ("bending", PUSHED_OFF, 0.05, [GAIN, THICKNESS, "loads.0.force.2"]),
    "added mass of unlike layers": ("bending", WADES, 0.05, [GAIN, THICKNESS, "loads.0.force.2"]),
    "added mass of layers that become unlike": ("bending", HANGING | ALPHA | IN_WATER | HEAVY, 0.05, [THICKNESS]),
    "a clamp that moves": ("bending", HANGING | MOVES, 0.1, [GAIN, "bodies.wall.motion.displacements.1.2"]),
    "a strip that curls": ("bending", HANGING | STRIP, 0.2, [GAIN, MODULUS]),
    "points of gains of a strip that curls": ("bending", HANGING | STRIP | PROFILE, 0.1, POINTS),
    "points of gains of two rods": ("bending", HANGING | VISCOUS | {"solver.model": "two_rod"} | PROFILE, 0.05, POINTS),
    "copies with factors": ("bending", HANGING | COPIES, 0.05, [GAIN]),
    "points of gains on a body in space": ("bending", TURNING | PROFILE, 0.03, POINTS),
    "fibres in space": ("chiral_pod", {}, 0.02, ["gravity.2"]),
    "drag in a plane": ("flagellum", STILL_WATER, 0.05, ["fluid.density", "materials.film.youngs_modulus"]),
    "drag in space": ("bending", HANGING | IN_WATER, 0.1, [GAIN, "fluid.density"]),
    "a pin between bodies": ("bending", bob({"type": "pin"}), 0.03, [LENGTH, "bodies.tip.position.2"]),
    "a hinge that resists": ("bending", bob(HINGE), 0.05, [GAIN, f"{TURNED}.spring", "joints.pivot.point.0"]),
    "a hinge that rubs": ("bending", bob(HINGE), 0.05, [f"{TURNED}.friction", "bodies.bob.motion.mass"]),
    "a cylinder in space": (
        "bending",
        bob(CYLINDER | {"sliding": SLIDING | {"friction": 0.02}}),
        0.03,
        [GAIN, "gravity.2"],
    ),
    "a rail": ("bending", HANGING | {"bodies.wall.motion": GUIDE}, 0.05, [GAIN, "bodies.wall.motion.sliding.spring"]),
    "an arch between hinges": ("arch", {}, 0.005, ["gravity.2", "materials.passive.density"]),
    "a body that spins": (
        "bending",
        HANGING | SPACE | ALPHA | {"bodies.wall.motion": SPINNING},
        0.03,
        [GAIN, LENGTH, "bodies.wall.motion.inertia.1"],
    ),
    "a rod that a body holds elsewhere": ("helical_ribbon", ON_A_BODY, 0.003, ["rods.ribbon.path.start.2"]),
    "a coil that turns a body": ("awn", COILED, 0.004, ["rods.awn.path.start.0"]),
    "layers that become unlike on a body that spins": ("bending", SPUN_FAST, 0.01, [MODULUS, DENSITY]),
    "the implicit midpoint rule": ("bending", SPUN, 0.03, [GAIN, LAG, LENGTH, "bodies.wall.motion.inertia.1"]),
    "a moment": ("bending", AT_TIP | {"loads": [TWIST]}, 0.03, [GAIN, "loads.0.moment.1"]),
    "a body that rebounds": ("bending", LANDS, 0.012, ["contact.restitution", "gravity.2"]),
    "a body in water": ("bending", AT_TIP | DRAGGED, 0.02, [GAIN, "fluid.density"]),
    "added mass by the implicit midpoint rule": (
        "bending",
        HANGING | IN_WATER | HEAVY | MIDPOINT,
        0.03,
        [GAIN, "fluid.density", LENGTH],
    ),
    "a body in water by that rule": ("bending", AT_TIP | DRAGGED | MIDPOINT, 0.02, [GAIN, "fluid.density"]),
    "added mass of unlike layers by that rule": ("bending", WADES | MIDPOINT, 0.03, [GAIN, "loads.0.force.2"]),
    "a ring in water by that rule": ("ring", WET_RING, 0.003, ["fluid.density"]),
    "a viscous strip on a body": ("bending", AT_TIP | VISCOUS, 0.03, [GAIN, LENGTH, VISCOSITY]),
    "a viscous strip of fibres": ("chiral_pod", DRIES, 0.02, ["gravity.2", "materials.tissue.retardation_time"]),
    "a ring": ("ring", RING, 0.005, ["gravity.0", "materials.silicone.youngs_modulus"]),
    "a start at rest": ("bending", HANGING | RESTS, 0.05, [GAIN, LEVEL, MODULUS, LENGTH]),
    "a start at rest that then moves": (
        "bending",
        MOVES_OFF,
        0.02,
        [GAIN, LEVEL, MODULUS, LENGTH, "bodies.tip.motion.angular_velocity.1"],
    ),
    "a start at rest on a rail": ("bending", HANGING | RESTS | ON_RAIL, 0.03, [GAIN, "bodies.wall.motion.speed"]),
    "drag of turns": (
        "bending",
        SPACE | {"fluid": WATER, "loads": [JET]},
        0.1,
        ["loads.0.force.2", "fluid.velocity.1"],
    ),
}
STEPS_OF_1_MS = EULER | {"solver.dt": 0.001}
STRIDE, CLOSE = {"stimuli.humidity.schedule.period": 0.4}, {"stimuli.humidity.schedule.end": 0.05}
PUSHED = {"bodies.ball.motion.velocity": [0.05, 0.02, 0]}
ALIKE = STRIDE | STEPS_OF_1_MS | {"contact.friction": {"coefficient": 0.6, "speed_threshold": 1e-4}}
GRIP = CLOSE | STEPS_OF_1_MS | {"stimuli.humidity.schedule.start": 0}
BALL, FOOT, COEFFICIENT = "body/ball/position", "rod/hind_foot/position", "contact.friction.coefficient"
GAIN_OF_ARMS, GAIN_OF_TRUNK = (f"rods.{rod}.layers.active.eigenstrain.gain" for rod in ("arm", "trunk"))
SLIPS = LANDS | {"contact": DAMPED | {"friction": {"coefficient": 0.3, "speed_threshold": 0.01}}}
RUBBING = {
    "a body that rebounds": ("bending", SLIPS, 0.012, ["contact.restitution", GAIN], "body/tip/position"),
    "a crawler": ("crawling_inchworm", {}, 0.05, [f"{BODY}.eigenstrain.gain", "contact.friction.forward"], "com"),
    "rods in space": ("knot", {}, 0.005, ["materials.rubber.density"], "com"),
    "a jumper": ("jumping", {}, 0.03, ["gravity.2"], "com"),
    "a ball that rolls": ("gripping", PUSHED, 0.03, [COEFFICIENT, "bodies.ball.motion.velocity.0"], BALL),
    "a ball that is gripped": ("gripping", GRIP, 0.055, ["gravity.2", GAIN_OF_ARMS], BALL),
    "a walker": ("crawling_dual_leg", STRIDE, 0.002, ["gravity.2", "contact.friction.backward"], FOOT),
    "a walker on a place that slides": ("crawling_dual_leg", ALIKE, 0.005, [COEFFICIENT, GAIN_OF_TRUNK], "com"),
}
STEPS = {LENGTH: 1e-5} | dict.fromkeys(POINTS, 1e-2)
"""Differences of second order have their least errors with these, else with 1e-4."""


def kept_run(name, overrides, duration):
    simulator = Simulator(load_scene(name, TIGHT | overrides))
    return simulator, simulator.run(duration, gradients=True)


def error(found, other):
    return np.abs(found - other).max() / np.abs(other).max()


@pytest.mark.parametrize("case", CASES)
def test_gradients_of_runs_agree_with_differences_of_runs_to_1e_6(case):
    name, overrides, duration, to = CASES[case]
    simulator, result = kept_run(name, overrides, duration)
    steps = result.differentiable.made
    found = result.gradient("com", to)
    for path in to:
        (other,) = differences_of_runs(name, overrides, steps, path, STEPS.get(path, 1e-4), ["com"])
        assert error(found["com", path], other) < 1e-6, path


@pytest.mark.parametrize("to", [GAIN, LEVEL, MODULUS, "obstacles.post.radius"])
def test_gradients_of_runs_through_contact_agree_to_1e_4(to):
    simulator, result = kept_run("bending", ON_A_POST, 0.2)
    assert np.abs(simulator.contact_forces).max() > 1e-3
    of = ["com", "rod/strip/position"]
    found = result.gradient(of, to)
    for name, other in zip(
        of, differences_of_runs("bending", ON_A_POST, result.differentiable.made, to, 1e-5, of), strict=True
    ):
        assert error(found[name, to], other) < 1e-4, name


@pytest.mark.parametrize("case", RUBBING)
def test_gradients_of_runs_through_settled_friction_agree_to_1e_4(case):
    name, overrides, duration, to, of = RUBBING[case]
    simulator, result = kept_run(name, overrides, duration)
    found = result.gradient(of, to)
    for path in to:
        (other,) = differences_of_runs(name, overrides, result.differentiable.made, path, 1e-5, [of])
        assert error(found[of, path], other) < 1e-4, path


def test_differences_of_runs_over_a_ladder_of_steps_reach_a_plateau_at_the_gradient():
    simulator, result = kept_run("bending", HANGING, 0.1)
    found, steps = result.gradient("com", THICKNESS)["com", THICKNESS], result.differentiable.made
    ladder = [
        error(differences_of_runs("bending", HANGING, steps, THICKNESS, step, ["com"])[0], found)
        for step in (1e-2, 1e-3, 1e-4, 1e-9)
    ]
    assert ladder[0] > 50.0 * ladder[1] > 1e-6  # second order: 100 times
    assert ladder[2] < 1e-7
    assert ladder[3] > 10.0 * ladder[2]  # rounding


BACK = {
    "in a plane": ("bending", HANGING, 0.1, [GAIN, LEVEL, THICKNESS, LENGTH]),
    "in space": ("bending", HANGING | SPACE | VISCOUS, 0.1, [GAIN, LEVEL, MODULUS, VISCOSITY]),
    "fibres in space": ("chiral_pod", {}, 0.02, ["gravity.2"]),
    "a shadow": ("bending", SHADED, 0.03, [LEVEL]),
    "diffusion that varies": ("bending", VARIES, 0.05, [LEVEL, f"{DIFFUSIVITY}.passive"]),
    "generalised alpha": ("bending", HANGING | ALPHA | VISCOUS, 0.1, [GAIN, MODULUS]),
    "contact": ("bending", ON_A_POST, 0.2, [LEVEL, "obstacles.post.radius"]),
    "friction": ("jumping", {}, 0.03, ["gravity.2"]),
    "friction on bodies": ("crawling_dual_leg", ALIKE, 0.002, ["gravity.2", COEFFICIENT]),
    "a grip": ("gripping", GRIP, 0.052, [COEFFICIENT, GAIN_OF_ARMS]),
    "a hinge that rubs": ("bending", bob(HINGE), 0.05, [GAIN, f"{TURNED}.friction"]),
    "a start at rest on a rail": ("bending", HANGING | RESTS | ON_RAIL, 0.02, [GAIN, "bodies.wall.motion.speed"]),
    "a body that rebounds": ("bending", SLIPS, 0.012, [GAIN, "contact.restitution"]),
    "a body that turns": ("bending", HANGING | TURNING, 0.05, [GAIN, "gravity.2"]),
    "a body with a history": ("bending", HANGING | TURNING | {"solver.integrator": "tr_bdf2"}, 0.01, [GAIN]),
    "the implicit midpoint rule": ("bending", SPUN, 0.02, [GAIN, LEVEL, LENGTH]),
    "layers that become unlike": ("bending", SPUN_FAST, 0.01, [MODULUS]),
    "a body in water": ("bending", AT_TIP | DRAGGED, 0.01, ["fluid.density"]),
    "a body in water by the implicit midpoint rule": ("bending", AT_TIP | DRAGGED | MIDPOINT, 0.01, [GAIN]),
    "unlike layers in water by that rule": ("bending", WADES | MIDPOINT, 0.01, [GAIN, "fluid.density"]),
    "a ring in water by that rule": ("ring", WET_RING, 0.003, ["gravity.0"]),
    "a viscous strip of fibres": ("chiral_pod", DRIES, 0.01, ["gravity.2"]),
    "added mass": ("flagellum", {}, 0.05, ["fluid.density"]),
    "added mass of unlike layers": ("bending", WADES | ALPHA, 0.05, [GAIN, "fluid.density"]),
    "drag of turns": ("bending", IN_WATER | {"loads": [JET]}, 0.1, ["fluid.density"]),
}


@pytest.mark.parametrize("case", BACK)
def test_what_comes_back_from_the_end_is_what_goes_forward_to_1e_10(case):
    name, overrides, duration, to = BACK[case]
    simulator, result = kept_run(name, overrides, duration)
    sizes = {"": simulator.model.node_count, "body_": len(simulator.model.bodies.names)}
    seeds = {
        of + kind: np.random.default_rng(k).normal(size=(size, 3))
        for of, size in sizes.items()
        for k, kind in enumerate(("positions", "velocities"))
    }
    free = simulator.model.free_bodies.body_of_free
    for of, seed in seeds.items():
        if of.startswith("body_"):
            seed[np.setdiff1d(np.arange(len(seed)), free)] = 0.0
    back = result.pull_back(seeds, to)
    response = result.differentiable.response()
    numbers = [number for of in response.numbers(to).values() for number in of]
    along = response.forward(numbers)
    for k, path in enumerate(to):
        forward = np.vdot(seeds["positions"], along.place[response.nodes, k]) + np.vdot(
            seeds["velocities"], along.speed[response.nodes, k]
        )
        forward += np.vdot(seeds["body_positions"][free], along.place[response.bodies, k]) + np.vdot(
            seeds["body_velocities"][free], along.speed[response.bodies, k]
        )
        assert back[path] == pytest.approx(forward, rel=1e-10), path


def test_keeping_steps_changes_no_bit_of_a_run():
    runs = [Simulator(load_scene("bending", HANGING)) for _ in range(2)]
    for simulator, gradients in zip(runs, (False, True), strict=True):
        simulator.run(0.1, gradients=gradients)
    assert runs[0].save_state().tobytes() == runs[1].save_state().tobytes()


def test_steps_of_which_no_state_is_kept_are_made_again_bit_for_bit():
    simulator = Simulator(load_scene("bending", HANGING | VISCOUS))
    simulator.compile()
    rooms = 2**28, 5 * simulator._state.values.nbytes
    kept = [Course(simulator._stepper, simulator._state, room) for room in rooms]

    def each_step(_):
        for course in kept:
            course.take()
        if 0.02 < simulator.time < 0.04:
            simulator.set_stimulus("swelling", 10.0 * simulator.time)

    simulator.run(0.1, each_step=each_step)
    assert len(kept[1]._spans) < 0.7 * len(kept[0]._spans) == 0.7 * len(kept[0])
    maker = simulator._builders.stepper_of(simulator.model)
    for backward in (False, True):
        pairs = list(zip(*(course.steps(maker, backward) for course in kept), strict=True))
        assert len(pairs) == len(kept[0])
        for one, other in pairs:
            assert one.end.position.tobytes() == other.end.position.tobytes()
            assert one.start.velocity.tobytes() == other.start.velocity.tobytes()
            assert one.method is other.method


def test_gradients_do_not_depend_on_the_room_for_states():
    found = [kept_run("bending", HANGING, 0.1)[1].gradient("com", GAIN)["com", GAIN]]
    simulator = Simulator(load_scene("bending", TIGHT | HANGING))
    result = simulator.run(0.1, gradients=5 * simulator._state.values.nbytes)
    assert len(result.differentiable._course._spans) <= 5
    assert np.array_equal(result.gradient("com", GAIN)["com", GAIN], found[0])


@pytest.mark.parametrize("room", [0, -1, 1e6, "much"])
def test_no_room_for_states_is_refused(room):
    with pytest.raises(InputError, match="gradients: found .*; allowed are True, False and a number of bytes above 0"):
        Simulator("bending").run(1e-2, gradients=room)


def test_a_run_with_other_numbers_goes_where_derivatives_say():
    simulator = Simulator(load_scene("bending"))
    simulator.run(0.05)
    simulator.set_stimulus("swelling", 0.3)
    found = simulator.run(0.1, gradients=True).gradient(["com", "rod/strip/position"], GAIN)
    assert set(found.off) == {"com", "rod/strip/position"} and max(found.off.values()) < 0.1
    rests = Simulator(load_scene("bending", HANGING | RESTS)).run(0.02, gradients=True)
    assert rests.gradient("com", [GAIN, MODULUS]).off["com"] < 0.1


def test_derivatives_of_a_run_by_leaps_are_told_to_be_useless():
    result = Simulator(load_scene("jumping")).run(0.05, gradients=True)
    with pytest.warns(RuntimeWarning, match=r"gravity.2 at -9.9 in place of -10, .* % apart\): it goes by leaps"):
        assert result.gradient("com", "gravity.2").off["com"] > 0.5


def test_layers_with_equal_gains_have_derivatives_of_their_own():
    simulator = Simulator(load_scene("chiral_pod"))
    result = simulator.run(0.05, gradients=True)
    layers = [f"rods.valve.layers.{name}.eigenstrain.gain" for name in ("inner", "outer")]
    one, other = (result.gradient("com", of)["com", of] for of in layers)
    assert np.abs(one - other).max() > 0.1 * np.abs(one).max()


def test_a_motion_that_forgets_its_start_is_told():
    simulator, result = kept_run("bending", HANGING, 0.05)
    seeds = {"positions": np.ones((simulator.model.node_count, 3))}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result.pull_back(seeds, GAIN)
        result.gradient("com", GAIN)
    response = result.differentiable.response()
    numbers = response.numbers([GAIN])[GAIN]
    response._size = 1e-20
    with pytest.warns(RuntimeWarning, match="forgets its start: at .* s derivatives have grown"):
        response.forward(numbers)
    with pytest.warns(RuntimeWarning, match="forgets its start: at .* s derivatives have grown"):
        response.backward(seeds, numbers)


def test_a_run_that_begins_elsewhere_begins_there_whatever_the_numbers_are():
    simulator = Simulator(load_scene("bending", HANGING))
    simulator.run(0.05)
    first = simulator.run(0.01, gradients=True)
    whole = Simulator(load_scene("bending", HANGING)).run(0.06, gradients=True)
    to = "gravity.2"
    assert abs(first.gradient("com", to)["com", to][2]) < 0.5 * abs(whole.gradient("com", to)["com", to][2])


@pytest.mark.parametrize(
    ("name", "overrides", "to", "told"),
    [
        ("bending", IN_WATER | HEAVY | MIDPOINT, THICKNESS, "makes layers unlike"),
        ("bending", RESTS | {"bodies.wall.motion": FREE}, GAIN, "a robot that floats at its start"),
        ("crawling_inchworm", SPACE, "rods.body.layers.active.interval.1", "changes how many unknowns"),
        ("bending", {}, "swelling", "a number of its schedule"),
        ("bending", {}, "contact.stiffness", "contact"),
        ("bending", {}, "rods.strip.path.start.1", "turns or moves the plane"),
        ("swimming", {}, "bodies.hub.position.0", "where its guide or joint does not let it go"),
    ],
)
def test_what_runs_are_not_differentiated_through_or_by_is_refused_by_name(name, overrides, to, told):
    result = Simulator(load_scene(name, overrides)).run(1e-3, gradients=True)
    with pytest.raises(InputError if told != "contact" else Exception, match=told):
        result.gradient("com", to)


def test_numbers_that_act_on_nothing_in_a_run_are_refused():
    result = Simulator(load_scene("bending", {"solver.integrator": "sdirk2"})).run(1e-2, gradients=True)
    with pytest.raises(InputError, match="acts on nothing in this run"):
        result.gradient("com", "output.rate")


def test_a_run_without_kept_steps_has_no_gradient():
    result = Simulator("bending").run(1e-2)
    with pytest.raises(InputError, match="run\\(gradients=True\\)"):
        result.gradient("com", GAIN)


def test_what_comes_back_from_the_mass_centre_is_its_gradient_with_masses_off_the_curve():
    unlike = {DENSITY: 5000.0, f"{ACTIVE}.natural_twist": 20.0, "solver.model": "laminate", "solver.dimension": 3}
    simulator, result = kept_run("bending", HANGING | unlike | {"solver.newton_tolerance": 1e-10}, 0.05)
    assert simulator.model.raised.first_moment.any()
    for axis, way in enumerate(np.eye(3)):
        back = result.pull_back({"com": way}, GAIN)[GAIN]
        assert back == pytest.approx(result.gradient("com", GAIN)["com", GAIN][axis], rel=1e-5, abs=1e-9), axis


def test_seeds_that_do_not_fit_are_refused():
    result = Simulator("bending").run(1e-2, gradients=True)
    with pytest.raises(InputError, match="allowed are com, shape .3,., positions and velocities"):
        result.pull_back({"positions": np.zeros(3)}, GAIN)
