"""What type checkers know of the public interface; `make lint` checks it, nothing runs it."""

# mypy: disallow-any-expr

from typing import assert_type

from bilayer_core import Simulator, load_scene
from bilayer_core.scene.body import Body
from bilayer_core.scene.config import Contact, SceneConfig


def scenes_have_numbers() -> None:
    """Not Any, which would let every mistake pass."""
    scene = load_scene("gripping")
    assert_type(scene, SceneConfig)
    assert_type(scene.duration, float)
    assert_type(scene.gravity, tuple[float, float, float])
    assert_type(scene.solver.tolerance, float | None)
    assert_type(scene.solver.max_newton_iterations, int)
    assert_type(scene.solver.max_halvings, int | None)
    assert_type(scene.output.rate, float)
    assert_type(scene.contact, Contact | None)
    assert_type(scene.rods[0].stations, int)
    assert_type(scene.rods[0].normal, tuple[float, float, float])
    assert_type(scene.bodies, list[Body])
    assert_type({name: material.youngs_modulus for name, material in scene.materials.items()}, dict[str, float])


def simulators_have_numbers_and_scenes() -> None:
    """By name and over time."""
    simulator = Simulator(load_scene("gripping"))
    assert_type(simulator.time, float)
    assert_type(simulator.scene.duration, float)
    assert_type(simulator.energy(), dict[str, float])
    assert_type(simulator.run(0.1).simulated, float)
