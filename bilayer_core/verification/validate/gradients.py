"""Derivatives of equilibria and runs, against differences of those made anew, and against closed forms."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from bilayer_core.scene.loader import load_scene, scene_content
from bilayer_core.scene.overrides import read_overrides
from bilayer_core.simulation.at_rest import stepper_and_state
from bilayer_core.simulation.gradients.nearby import values_of
from bilayer_core.simulation.simulator import Simulator
from bilayer_core.verification.validate.impacts import thrown
from bilayer_core.verification.validate.validation_case import Case

TOLERANCE = 1e-14
"""Displacement that counts as rest [m]."""
TIGHT = {"solver.newton_tolerance": 1e-12}
"""For runs."""
Steps = Sequence[tuple[float, bool]]
STEP = 2e-4
"""Of the parameter: differences are of fourth order."""
HANGING: dict[str, Any] = {"gravity": [0, 0, -9.81]}
POST = {"name": "post", "type": "sphere", "radius": 0.005, "position": [0.03, 0, -0.0068]}
ON_A_POST = HANGING | {"obstacles": [POST], "contact": {"barrier_distance": 2e-4, "stiffness": 1e6}}
ACTIVE = "rods.strip.layers.active"


def at_rest(name: str, overrides: dict[str, Any], stimuli: dict[str, float]) -> Simulator:
    """Return a simulator of a bundled scene in equilibrium."""
    simulator = Simulator(load_scene(name, overrides))
    for channel, value in stimuli.items():
        simulator.set_stimulus(channel, value)
    simulator.solve_static(TOLERANCE)
    return simulator


def height(name: str, overrides: dict[str, Any], stimuli: dict[str, float], to: str) -> Callable:
    """Measure how the height of the mass centre depends on a parameter."""

    def measured() -> tuple[float, float]:
        here = at_rest(name, overrides, stimuli)
        if to in stimuli:
            value = stimuli[to]
        else:
            holder, place = read_overrides({to: 0.0})[0].find(scene_content(here.scene))
            value = holder[place]
        h = STEP * abs(value)

        def at(k: float) -> float:
            other = {to: value + k * h}
            own = (overrides, stimuli | other) if to in stimuli else (overrides | other, stimuli)
            return float(at_rest(name, *own).com[2])

        a, b, c, d = map(at, (-1.0, -0.5, 0.5, 1.0))
        return float(here.gradient("com", to)["com", to][2]), (8.0 * (c - b) - (d - a)) / (6.0 * h)

    return measured


def end_of_run(
    name: str | dict, overrides: dict[str, Any], duration: float, to: str, of: str = "com", step: float = 1e-4
) -> Callable:
    """Measure how a quantity at the end of a run depends on a parameter: its largest component."""

    def measured() -> tuple[float, float]:
        run = Simulator(load_scene(name, TIGHT | overrides)).run(duration, gradients=True)
        found = run.gradient(of, to)[of, to].ravel()
        (other,) = differences_of_runs(name, overrides, run.differentiable.made, to, step, [of])
        place = int(np.abs(other).argmax())
        return float(found[place]), float(other.ravel()[place])

    return measured


def differences_of_runs(
    name: str | dict, overrides: dict[str, Any], steps: Steps, to: str, step: float, of: Sequence[str]
) -> list[np.ndarray]:
    """Return differences of quantities at the end of two runs with the steps of another, over the parameter, which
    is `step` of its value away on either side.
    """
    holder, place = read_overrides({to: 0.0})[0].find(scene_content(load_scene(name, overrides)))
    h, sides = step * (abs(holder[place]) or 1.0), []
    for way in (-1.0, 1.0):
        simulator = Simulator(load_scene(name, TIGHT | overrides | {to: holder[place] + way * h}))
        sides.append(with_steps(simulator, steps, of))
    return [(high - low) / (2.0 * h) for low, high in zip(*sides, strict=True)]


def with_steps(simulator: Simulator, steps: Steps, of: Sequence[str]) -> list[np.ndarray]:
    """Return quantities at the end of a run with the steps of another run, whatever their errors are."""
    stepper, state = stepper_and_state(simulator)
    stepper.evaluate(state)
    for end, stood_in in steps:
        stepper.make_again(state, end, stood_in)
    return values_of(stepper, state, of, simulator.description)


def adjoint(name: str, overrides: dict[str, Any], duration: float, to: str) -> Callable:
    """Measure the derivative of the sum of all coordinates of nodes, back from the end of a run and forward to it."""

    def measured() -> tuple[float, float]:
        simulator = Simulator(load_scene(name, TIGHT | overrides))
        run = simulator.run(duration, gradients=True)
        seeds = {"positions": np.ones((simulator.model.node_count, 3))}
        response = run.differentiable.response()
        along = response.forward(response.numbers([to])[to])
        return float(run.pull_back(seeds, to)[to]), float(along.place[response.nodes, 0].sum())

    return measured


def curvature_per_swelling() -> tuple[float, float]:
    """Measure how the curvature of a free bilayer depends on the stimulus, in the middle, in 1/m."""
    simulator = at_rest("bending", {}, {"swelling": 0.6})
    found = simulator.gradient("rod/strip/curvature", "swelling")
    return abs(float(found["rod/strip/curvature", "swelling"][20])), 1.5 * 0.01 / 2e-3


def weight_by_density() -> tuple[float, float]:
    """Measure how the force on a clamp depends on the density of what hangs from it."""
    simulator = at_rest("cantilever", {}, {})
    found = simulator.gradient("body/wall/clamp_wrench", "materials.gel.density")
    rod = simulator.scene.rods[0]
    volume = rod.path.length * rod.width * rod.layers[0].thickness
    return float(found["body/wall/clamp_wrench", "materials.gel.density"][2]), -9.81 * volume


def error_of_a_list() -> tuple[float, float]:
    """Measure the sum of the derivatives by both ends of a profile of gains, over that by a gain which is a number."""
    profile = {f"{ACTIVE}.eigenstrain.gain": {"at": [0, 0.1], "value": [0.01, 0.01]}}
    names = f"{ACTIVE}.eigenstrain.gain.value", f"{ACTIVE}.eigenstrain.gain"
    of_points = at_rest("bending", HANGING | profile, {"swelling": 0.6}).gradient("com", names[0])
    whole = at_rest("bending", HANGING, {"swelling": 0.6}).gradient("com", names[1])
    return float(np.sum(of_points["com", names[0]][2])), float(whole["com", names[1]][2])


IN_SPACE, TWO_RODS, STRIP = {"solver.dimension": 3}, {"solver.model": "two_rod"}, {"rods.strip.section": "strip"}
SWOLLEN, DIFFERENCES = {"swelling": 0.6}, "differences of equilibria"
ANEW = {
    "stimulus": ("bending", HANGING, SWOLLEN, "swelling"),
    "gain": ("bending", HANGING, SWOLLEN, f"{ACTIVE}.eigenstrain.gain"),
    "modulus": ("bending", HANGING, SWOLLEN, "materials.active.youngs_modulus"),
    "length": ("bending", HANGING, SWOLLEN, "rods.strip.path.length"),
    "thickness": ("bending", HANGING, SWOLLEN, f"{ACTIVE}.thickness"),
    "in space/stimulus": ("bending", HANGING | IN_SPACE, SWOLLEN, "swelling"),
    "in space/thickness": ("bending", HANGING | IN_SPACE, SWOLLEN, f"{ACTIVE}.thickness"),
    "two rods/stimulus": ("bending", HANGING | TWO_RODS, SWOLLEN, "swelling"),
    "two rods/length": ("bending", HANGING | TWO_RODS, SWOLLEN, "rods.strip.path.length"),
    "strip/stimulus": ("bending", HANGING | STRIP, {"swelling": 0.1}, "swelling"),
    "two rods in space/gravity": ("helix", {"gravity": [0, 0, -0.2]}, {}, "gravity.2"),
    "gripper/density": ("gripping", {}, {"humidity": 0.8}, "materials.film.density"),
}
TOUCHING = {
    "contact/stimulus": ("bending", ON_A_POST, {"swelling": 0.03}, "swelling"),
    "contact/thickness": ("bending", ON_A_POST, {"swelling": 0.03}, f"{ACTIVE}.thickness"),
    "contact/radius": ("bending", ON_A_POST, {"swelling": 0.03}, "obstacles.post.radius"),
}
LEVEL, GAIN = "stimuli.swelling.schedule.to", f"{ACTIVE}.eigenstrain.gain"
SWELLING = HANGING | {LEVEL: 0.8}
VISCOUS = {"materials.active.retardation_time": 0.05}
EULER = {"solver.integrator": "implicit_euler", "solver.dt": 0.004, "solver.tolerance": None}
WATER = {"density": 1000.0, "velocity": [0, 0.05, 0], "drag_along": 0.01, "drag_across": 1.0, "added_mass": True}
UNLIKE_IN_WATER = SWELLING | {"materials.active.youngs_modulus": 3e7, "fluid": WATER}
STRIDE = {"stimuli.humidity.schedule.period": 0.4}
GRIP = EULER | {"solver.dt": 0.001, "stimuli.humidity.schedule.start": 0, "stimuli.humidity.schedule.end": 0.05}
FIELD = {"stimulus": "swelling", "top": {}, "diffusivity": {"active": {"at": [0, 1], "value": [1e-5, 5e-5]}}}
VARIED = {"rods.strip.diffusion": FIELD}
LIT = {"stimuli.swelling.light": {"from": [0.3, 0, 1]}, f"{ACTIVE}.eigenstrain.time_constant": 0.03}
THROWN, BALL = thrown(1e9, 3, restitution=0.5), "body/ball/position"
RUNS: dict[str, tuple[Any, ...]] = {
    "stimulus": ("bending", SWELLING, 0.2, LEVEL),
    "gain in space": ("bending", SWELLING | IN_SPACE, 0.2, GAIN),
    "modulus, two rods": ("bending", SWELLING | TWO_RODS, 0.1, "materials.active.youngs_modulus"),
    "thickness": ("bending", SWELLING, 0.2, f"{ACTIVE}.thickness"),
    "length, implicit euler": ("bending", SWELLING | EULER, 0.1, "rods.strip.path.length", "com", 1e-5),
    "gain, implicit midpoint": ("bending", SWELLING | {"solver.integrator": "implicit_midpoint"}, 0.1, GAIN),
    "viscosity": ("bending", SWELLING | VISCOUS, 0.2, "materials.active.retardation_time"),
    "hinges/density": ("arch", {}, 0.005, "materials.passive.density"),
    "starts at rest/gain": ("bending", SWELLING | {"start": "settle"}, 0.05, GAIN),
    "impact/restitution": (THROWN, {}, 5e-4, "contact.restitution", BALL),
    "light/gravity": ("bending", SWELLING | LIT, 0.05, "gravity.2"),
    "diffusion that varies/stimulus": ("bending", SWELLING | VARIED, 0.05, LEVEL),
    "fibres/gravity": ("chiral_pod", {}, 0.02, "gravity.2"),
    "swimmer/density of the fluid": ("swimming", {}, 0.01, "fluid.density"),
    "added mass/density of the fluid": ("flagellum", {}, 0.05, "fluid.density"),
    "added mass of unlike layers/density of the fluid": ("bending", UNLIKE_IN_WATER, 0.05, "fluid.density"),
    "drag/density of the fluid": ("flagellum", {"fluid.added_mass": False}, 0.05, "fluid.density"),
}
RUBBING: dict[str, tuple[Any, ...]] = {
    "inchworm/gain": ("crawling_inchworm", {}, 0.05, "rods.body.layers.active.eigenstrain.gain"),
    "inchworm/friction": ("crawling_inchworm", {}, 0.05, "contact.friction.forward"),
    "knot/density": ("knot", {}, 0.005, "materials.rubber.density"),
    "jumper/gravity": ("jumping", {}, 0.03, "gravity.2"),
    "walker/friction": ("crawling_dual_leg", STRIDE, 0.002, "contact.friction.backward"),
    "grip/gain": ("gripping", GRIP, 0.055, "rods.arm.layers.active.eigenstrain.gain"),
}
CASES = (
    *(Case(f"gradients/runs/{name}", "differences of runs", 1e-6, end_of_run(*of)) for name, of in RUNS.items()),
    *(
        Case(f"gradients/runs/friction/{name}", "differences of runs", 1e-4, end_of_run(*of, "com", 1e-5))
        for name, of in RUBBING.items()
    ),
    Case(
        "gradients/runs/contact/stimulus",
        "differences of runs",
        1e-4,
        end_of_run("bending", ON_A_POST | {LEVEL: 0.1}, 0.2, LEVEL),
    ),
    Case(
        "gradients/runs/rods that touch/density",
        "differences of runs",
        1e-4,
        end_of_run("knot", {"contact.friction": None}, 0.01, "materials.rubber.density"),
    ),
    Case(
        "gradients/runs/back", "the same forward", 1e-10, adjoint("bending", SWELLING | VISCOUS | IN_SPACE, 0.1, GAIN)
    ),
    *(Case(f"gradients/{name}", DIFFERENCES, 1e-6, height(*of)) for name, of in ANEW.items()),
    *(Case(f"gradients/{name}", DIFFERENCES, 1e-4, height(*of)) for name, of in TOUCHING.items()),
    Case("gradients/curvature by the stimulus", "Timoshenko's formula", 1e-3, curvature_per_swelling, "1/m"),
    Case("gradients/reaction by density", "g V", 1e-6, weight_by_density, "N m³/kg"),
    Case("gradients/points of a profile", "the gradient by a number", 1e-8, error_of_a_list, "m"),
)
